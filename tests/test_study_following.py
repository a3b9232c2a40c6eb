"""Paths of the experiment as an arm follows them that a scheme has compensated."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from truearm.fits.identified import IdentifiedArm
from truearm.fits.parameters import THETA, A, D
from truearm.planning.spaces import CartesianSpace
from truearm.robot import Robot
from truearm.studies.metrics import scheme_chain
from truearm.studies.process.following import STEPS, followed
from truearm.studies.process.setting import COMMAND_MM, path, space
from truearm.studies.schemes import Scheme
from truearm.studies.setting import ROBOT


@pytest.fixture(scope="module")
def known():
    """An arm of which a scheme knows all that is wrong."""
    robot = Robot.load(ROBOT)
    wrong = IdentifiedArm(robot, "world").table.copy()
    wrong[1, [THETA, D]] += [3e-3, 8e-4]
    wrong[2, [THETA, A]] += [-2e-3, 1e-3]
    scheme = Scheme(lambda readings: np.tile(wrong, (len(readings), 1, 1)), robot.tool[:3, 3])
    made: Any = SimpleNamespace(arm=SimpleNamespace(robot=robot), identified=IdentifiedArm(robot, "world"))
    chain = scheme_chain(made, scheme)
    made.arm.true_position = lambda readings: chain.position(
        np.ascontiguousarray(robot.joints_from_readings(readings)), scheme.parameters(readings)
    )
    return made, scheme


def test_what_a_scheme_knows_is_left_only_as_far_as_the_controller_rounds(known):
    errors_mm = followed(known[0], space(), known[1], path()).errors_mm
    assert 0.45 * COMMAND_MM < np.abs(errors_mm).max() < 0.51 * COMMAND_MM


def test_points_out_of_reach_are_none_and_leave_the_others_as_they_are(known):
    far = path()[:3]
    far[1, 1] += 2.0
    found = followed(known[0], space(), known[1], far)
    assert np.isnan(found.size_mm).tolist() == [False, True, False]
    whole = followed(known[0], space(), known[1], path())
    np.testing.assert_array_equal(found.errors_mm[[0, 2]], whole.errors_mm[[0, 2]])


def test_commands_that_settled_are_not_moved_again(known, monkeypatch):
    asked, readings = [], CartesianSpace.readings

    def counted(box, coordinates):
        asked.append(len(coordinates))
        return readings(box, coordinates)

    monkeypatch.setattr(CartesianSpace, "readings", counted)
    followed(known[0], space(), known[1], path())
    assert sum(asked) < 0.5 * (STEPS + 1) * len(path())
