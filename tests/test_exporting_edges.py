"""Exports of arms with limits on one side, and of joints that stood still."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from truearm import Robot
from truearm.exporting.field_grid import POINTS, grid_axes
from truearm.exporting.new_urdf import default_names, unstated_limits
from truearm.exporting.urdf_file import urdf_text
from truearm.simulation import VirtualArm


@pytest.mark.parametrize("name", ["ur10", "adept-cobra-600"])
def test_limits_on_one_side_are_kept_and_what_stands_for_the_other_is_said(name):
    robot = Robot.load(name)
    limits = np.array(robot.limits)
    limits[:3] = [-np.inf, 0.2], [-0.1, np.inf], [-np.inf, np.inf]
    arm = replace(robot, limits=limits)
    text, _, names = urdf_text(arm, arm, None, [])
    assert names == default_names(arm)
    again = Robot.from_urdf_text(text, names.base_link, names.tip_link)
    np.testing.assert_array_equal(again.limits, limits)
    said = " ".join(unstated_limits(arm))
    assert "effort and velocity" in said
    assert "Joints 1 and 2 may go on without end" in said
    assert ("Joint 3 may" in said) == (arm.joints[2] == "prismatic")
    assert "without end" not in " ".join(unstated_limits(Robot.load("ur10")))


def test_a_joint_that_stood_still_has_one_reading_on_the_grid():
    robot = Robot.load("ur10")
    arm = VirtualArm(robot, seed=3)
    q = arm.poses(40)
    q[:, 3] = 0.3
    axes = grid_axes(ta.calibrate(robot, arm.measure(q), model="constant", refit=False))
    assert [axis.count for axis in axes] == [POINTS, POINTS, POINTS, 1, POINTS, POINTS]
