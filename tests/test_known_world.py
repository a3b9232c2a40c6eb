"""Calibrations with the world as frame, of devices that do and do not measure in the base's frame."""

import numpy as np
import pytest

import truearm as ta
from truearm.doubts.of_results import ANOTHER_FRAME, NO_HELP
from truearm.lengths import length_mm
from truearm.simulation import Imperfections, VirtualArm


def calibrated(shift_m, frame="world"):
    """A virtual arm's calibration by a device whose frame is shifted, and the arm."""
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3, imperfections=Imperfections(share=0.0, noise_mm=0.02))
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
