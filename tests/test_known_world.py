"""Calibrations with the world as frame, of devices that do and do not measure in the base's frame."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import truearm as ta
from truearm.doubts.of_results import ANOTHER_FRAME, NO_HELP
from truearm.exporting import ExportOptions, export
from truearm.lengths import length_mm
from truearm.simulation import Imperfections, VirtualArm

UR10 = ta.Robot.load("ur10")


def calibrated(shift_m, frame="world"):
    """A virtual arm's calibration by a device whose frame is shifted, and the arm."""
    arm = VirtualArm(UR10, seed=3, imperfections=Imperfections(share=0.0, noise_mm=0.02))
    arm.world_from_base = np.eye(4)
    arm.world_from_base[:3, 3] = shift_m
    return arm, ta.calibrate(arm.robot, arm.measure(arm.poses(40)), frame=frame, model="constant")


def framed(calibration):
    return [str(notice) for notice in calibration.notices if notice.kind == ANOTHER_FRAME]


@pytest.mark.parametrize(("shift_m", "frame"), [((0.001, 0.0, 0.001), "world"), ((0.0, 0.001, 0.0), "free")])
def test_what_the_base_or_a_frame_takes_up_is_no_word(shift_m, frame):
    _, calibration = calibrated(shift_m, frame)
    assert calibration.constant.noise_m < 3e-5
    assert framed(calibration) == []


def test_a_shift_that_the_base_does_not_have_is_told_with_the_way_out():
    _, calibration = calibrated((0.0, 0.001, 0.0))
    (told,) = framed(calibration)
    assert f"leaves {length_mm(1e3 * calibration.constant.noise_m, 3)}" in told
    assert "Leave --frame world out" in told
    assert "five of the six freedoms" in told


def test_a_device_far_from_the_base_is_named_and_its_calibration_not_updated():
    arm, calibration = calibrated((1.5, -0.9, 0.0))
    assert NO_HELP in {notice.kind for notice in calibration.notices}
    assert len(framed(calibration)) == 1
    with pytest.raises(ta.WorkError, match=r"misses held-out rows of its own by \d+ mm") as refused:
        ta.update(calibration, arm.measure(arm.poses(15, seed=8), seed=8))
    assert "Calibrate anew" in str(refused.value)


def errors_of_links_alone(found, q):
    """How far the arms with the links that a calibration has at readings, and the file's base, are off, m."""
    arms = [replace(found.robot, table=table) for table in found.parameters(q)]
    return [np.abs(arm.pose(row) - found.pose(row)).max() for arm, row in zip(arms, q, strict=True)]


@pytest.mark.parametrize("model", ["constant", "variable", "regions"])
def test_parameters_and_base_are_the_arm_that_predicts(model):
    """The base is found like a link, of a robot file with a row for it (RV-M2) or without."""
    wavy = Imperfections(share=0.3, noise_mm=0.01)
    for arm in (VirtualArm.paper(seed=2, imperfections=wavy), VirtualArm(UR10, seed=2, imperfections=wavy)):
        arm.world_from_base = np.eye(4)
        data = arm.measure(arm.poses(120))
        more: dict[str, Any] = {"most_regions": 4} if model == "regions" else {}
        found = ta.calibrate(arm.robot, data, frame="world", model=model, **more)
        q = arm.poses(10, seed=9)
        assert min(errors_of_links_alone(found, q)) > 2e-4
        for row, table, base in zip(q, found.parameters(q), found.base(q), strict=True):
            same = replace(arm.robot, table=table, base=base)
            np.testing.assert_allclose(same.pose(row), found.pose(row), rtol=0.0, atol=1e-12)
        np.testing.assert_array_equal(found.base(q[0]), found.base(q)[0])
        if model == "variable":
            text = " ".join(export(found, "field-csv", options=ExportOptions(grid="q1=3")).text.split())
            words = re.search(
                r"the base is (.*) mm from .* of world, turned by the rotation vector (.*?) mrad", text
            )
            assert words is not None
            moved, turned = (np.array(part.split(", "), dtype=float) for part in words.groups())
            base = found.base(q[0])
            np.testing.assert_allclose(moved, 1e3 * (base - arm.robot.base)[:3, 3], atol=1e-3)
            turn = Rotation.from_matrix(base[:3, :3] @ arm.robot.base[:3, :3].T)
            np.testing.assert_allclose(turned, 1e3 * turn.as_rotvec(), atol=1e-3)


def test_the_base_is_that_of_the_file_where_frames_are_found():
    _, calibration = calibrated((0.0, 0.0, 0.0), "free")
    q = np.zeros((2, 6))
    np.testing.assert_array_equal(calibration.base(q), [calibration.robot.base] * 2)
    assert max(errors_of_links_alone(calibration, q)) < 1e-12
