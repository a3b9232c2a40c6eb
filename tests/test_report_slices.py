"""Slices of the `major` block: over joints that moved, and none that stood still."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from truearm._core import Field
from truearm.reporting.facts import Facts
from truearm.reporting.parts import Figure, Text
from truearm.reporting.slices import slices
from truearm.simulation import VirtualArm

STILL_RAD = 0.7


@pytest.fixture(scope="module")
def third_still():
    """A calibration from poses in which joint 3 stood still, and its `major` block over two other joints."""
    arm = VirtualArm(ta.Robot.load("ur10"), seed=2)
    q = arm.poses(90)
    q[:, 2] = STILL_RAD
    return ta.calibrate(arm.robot, arm.measure(q), model="variable", refit=False)


def over(calibration, joints):
    """Facts of the same where the `major` block is over other joints, from 0, with the axes that it has."""
    model = calibration.model
    blocks = model.field.blocks()
    major = next(block for block in blocks if block["name"] == "major")
    major["axes"] = [major["axes"][0]] * len(joints)
    cells = np.prod([axis[4] for axis in major["axes"]])
    weights = np.random.default_rng(0).normal(scale=1e-4, size=(cells, len(major["outputs"])))
    major |= {"inputs": joints, "weights": weights}
    chain = calibration.arm.flange_chain
    field = Field(model.field.input_count, model.field.parameter_count, blocks, chain)
    return Facts(replace(calibration, models=calibration.models | {"variable": replace(model, field=field)}))


def figures_over(calibration, joints):
    found = [part for part in slices(over(calibration, joints)) if isinstance(part, Figure)]
    assert len(found) == 3
    return found


def test_a_joint_that_stood_still_is_no_axis(third_still):
    parts = figures_over(third_still, [1, 2, 3])
    assert parts[0].title == "Variation over joints 2 and 4 together, all parameters"
    assert parts[0].says.endswith("In the `major` block, joint 3 at 40.11 deg stood still.")
    for part in parts:
        assert part.layout["xaxis"]["title"]["text"] == "joint 2, deg"
        assert part.layout["yaxis"]["title"]["text"] == "joint 4, deg"
        assert np.ptp(part.traces[0]["y"]) > 90.0


def test_without_two_joints_that_moved_there_is_a_sentence(third_still):
    words = "In the `major` block, joint 3 at 40.11 deg stood still: there are no two joints to show it over."
    assert slices(over(third_still, [1, 2])) == [Text(words, is_note=True)]


def test_joints_that_moved_are_shown_without_a_word_on_standing_still(third_still):
    assert not any("stood still" in part.says for part in figures_over(third_still, [0, 1]))
