"""Figures of arms whose joints are coupled: they go along what the parameters vary with."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.report_support import words_of
from truearm._core import Field
from truearm.reporting.axes import curve_axis, ends, input_axis, readings_at
from truearm.reporting.facts import Facts
from truearm.reporting.parts import Figure
from truearm.reporting.report import report
from truearm.reporting.slices import slices
from truearm.reporting.sweeps import corrections, sweep, swept_names
from truearm.robot import Robot
from truearm.simulation import VirtualArm

COUPLED = 2


@pytest.fixture(scope="module")
def fitted():
    """Of a UR10 whose third reading is against the horizontal: it turns with joint 2."""
    content = Robot.load("ur10").to_dict()
    coupling = np.eye(6)
    coupling[COUPLED, 1] = -1.0
    arm = VirtualArm(Robot.from_dict(content | {"coupling": coupling.tolist()}), seed=2)
    return ta.calibrate(arm.robot, arm.measure(arm.poses(90)), model="variable", refit=False)


def going_with(calibration, over_readings):
    """The same where curves of some joints, from 0, go with readings, and those of the others with values."""
    model = calibration.model
    blocks = model.field.blocks()
    for block in blocks:
        block.pop("reading", None)
        if block["name"] == "own" and block["inputs"][0] in over_readings:
            block["reading"] = np.linalg.inv(calibration.robot.coupling)[block["inputs"][0]].tolist()
    chain = calibration.arm.flange_chain
    field = Field(model.field.input_count, model.field.parameter_count, blocks, chain)
    return replace(calibration, models=calibration.models | {"variable": replace(model, field=field)})


@pytest.fixture(scope="module")
def calibration(fitted):
    return going_with(fitted, [])


@pytest.fixture(scope="module")
def facts(calibration):
    return Facts(calibration)


@pytest.fixture(scope="module")
def by_readings(fitted):
    return going_with(fitted, [COUPLED])


def test_one_value_differs_while_those_of_the_other_joints_stay(facts):
    robot, wanted = facts.calibration.robot, np.linspace(-1.0, 1.0, 5)
    along = input_axis(facts, 1)
    values = robot.joints_from_readings(readings_at(facts, facts.typical, {along: wanted}))
    held = robot.joints_from_readings(facts.typical)
    np.testing.assert_allclose(values[:, 1], wanted)
    np.testing.assert_allclose(np.delete(values, 1, axis=1), np.tile(np.delete(held, 1), (5, 1)), atol=1e-12)


def test_curves_of_coupled_joints_are_of_their_values_within_those_of_the_rows(facts):
    values = facts.calibration.robot.joints_from_readings(facts.readings)[:, COUPLED]
    found = sweep(facts, COUPLED)
    assert ends(facts, curve_axis(facts, COUPLED)) == (found.q[0], found.q[-1])
    assert values.min() <= found.q[0] < found.q[-1] <= values.max()
    held = facts.calibration.robot.joints_from_readings(facts.typical)
    asked = np.tile(held, (len(found.q), 1))
    asked[:, COUPLED] = found.q
    readings = facts.calibration.robot.readings_from_joints(asked)
    np.testing.assert_allclose(found.values, corrections(facts, readings), atol=1e-15)


def test_ranges_of_values_follow_from_limits_where_the_rows_were_left_out(calibration):
    bare = Facts(calibration.without_rows())
    low, high = ends(bare, curve_axis(bare, COUPLED))
    assert low == pytest.approx(bare.span[COUPLED, 0] - bare.span[1, 1])
    assert high == pytest.approx(bare.span[COUPLED, 1] - bare.span[1, 0])


def test_names_say_what_differs_on_coupled_joints_alone(facts, by_readings):
    names = swept_names(facts)
    assert names[:4] == ["joint 1", "D-H value of joint 2", "D-H value of joint 3", "joint 4"]
    assert swept_names(Facts(by_readings))[:4] == ["joint 1", "D-H value of joint 2", "reading 3", "joint 4"]


def test_a_curve_that_goes_with_a_reading_has_that_reading_differ(by_readings):
    facts = Facts(by_readings)
    found = sweep(facts, COUPLED)
    readings = np.tile(facts.typical, (len(found.q), 1))
    readings[:, COUPLED] = found.q
    assert (found.q[0], found.q[-1]) == tuple(facts.span[COUPLED])
    np.testing.assert_allclose(found.values, corrections(facts, readings), atol=1e-15)


def test_slices_are_over_values(facts):
    shown = [part for part in slices(facts) if isinstance(part, Figure)]
    assert shown[0].title.startswith("Variation over D-H values of joints ")
    titles = {shown[0].layout[name]["title"]["text"] for name in ("xaxis", "yaxis")}
    assert titles & {"D-H value of joint 2, deg", "D-H value of joint 3, deg"}


def test_the_report_says_what_its_curves_go_along(calibration, by_readings):
    text = words_of(report(calibration).html)
    assert (
        "The readings of joints 2 and 3 are coupled, and parameters vary with their Denavit-Hartenberg"
        in text
    )
    assert "the curves of" not in text
    text = words_of(report(by_readings).html)
    assert "What the drives leave goes with readings, so the curves of joint 3 are along one reading" in text


def test_an_arm_without_coupled_joints_has_no_word_of_that():
    arm = VirtualArm.paper(seed=2)
    found = ta.calibrate(arm.robot, arm.measure(arm.poses(90)), model="variable", refit=False)
    text = words_of(report(found).html)
    assert "D-H value" not in text
    assert "coupled" not in text
