"""Updates of calibrations with the world as frame: the base is part of the arm, and compared like it."""

import numpy as np
import pytest

import truearm as ta
from tests.remastered import remastered
from truearm.simulation import Imperfections, VirtualArm
from truearm.update_words import of_known_world, untested_words
from truearm.updating.moved import Motion, Offset

SHIFT = np.array([0.0, 0.6, 0.0, 0.9, 0.0, 0.0])
FIRST = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])


def virtual_arm():
    """A virtual arm whose device is in its base frame."""
    imperfections = Imperfections(share=0.0, noise_mm=0.02)
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3, imperfections=imperfections)
    arm.world_from_base = np.eye(4)
    return arm


def probability(part: Offset | Motion) -> float:
    """That a part which did not move looks as if it had moved so far."""
    assert part.p is not None
    return part.p


@pytest.fixture(scope="module")
def known():
    """A virtual arm whose device is in its base frame, and its calibration."""
    arm = virtual_arm()
    return arm, ta.calibrate(arm.robot, arm.measure(arm.poses(60)), frame="world", model="constant")


def test_an_arm_that_did_not_change_holds(known):
    arm, calibration = known
    found = ta.update(calibration, arm.measure(arm.poses(15, seed=8), seed=8))
    assert (found.verdict, found.tested) == ("holds", ("offsets", "base", "tool"))
    assert probability(found.frames[0]) > found.threshold


def test_joint_1_shows_as_a_turn_of_the_base_which_is_tested(known):
    arm, calibration = known
    found = ta.update(calibration, remastered(arm, arm.poses(15, seed=9), FIRST, seed=9))
    base = found.frames[0]
    assert found.verdict == "moved"
    assert (base.part, base.moved, found.offsets[0].told) == ("base", True, False)
    assert base.angle_deg == pytest.approx(0.1, abs=0.01)
    assert base.largest_mm < 0.2
    assert found.before.position.mean > 5.0 * found.after.position.mean
    words = untested_words(found.to_dict(), found.calibration.groups)
    assert "confounded with the base: if device and base stand where they stood, --keep-frame tells" in words


def test_joint_1_is_told_where_the_base_is_kept(known):
    arm, calibration = known
    data = remastered(arm, arm.poses(15, seed=9), FIRST, seed=9)
    found = ta.update(calibration, data, keep_frame=True)
    assert (found.kept, found.tested) == (("base",), ("offsets", "tool"))
    assert [offset.joint for offset in found.offsets if offset.moved] == [1]
    assert found.offsets[0].change == pytest.approx(0.1, abs=0.01)
    assert found.frames[0].kept


def test_a_base_that_moved_is_found_with_the_offsets(known):
    _, calibration = known
    moved = virtual_arm()
    moved.world_from_base[:3, 3] = 0.002, 0.0, -0.001
    found = ta.update(calibration, remastered(moved, moved.poses(15, seed=9), SHIFT, seed=9))
    assert found.verdict == "moved"
    assert found.frames[0].largest_mm == pytest.approx(np.sqrt(5.0), abs=0.1)
    assert found.after.position.mean < 0.1


def test_nothing_is_said_to_have_moved_where_the_calibration_holds(known):
    arm, calibration = known
    found = ta.update(calibration, arm.measure(arm.poses(15, seed=229), seed=229))
    assert found.verdict == "holds"
    assert probability(found.tools[0]) < found.level
    assert not any(offset.moved for offset in found.offsets)
    assert not any(motion.moved for motion in (*found.frames, *found.tools))


def test_parts_share_the_level_of_the_test_of_them_all(known):
    arm, calibration = known
    found = ta.update(calibration, remastered(arm, arm.poses(15, seed=9), SHIFT, seed=9))
    parts: list[Offset | Motion] = [*found.offsets, *found.frames, *found.tools]
    compared = [part for part in parts if part.p is not None]
    limit = found.threshold / len(compared)
    assert found.changed.p < found.threshold
    assert [part.moved for part in compared] == [probability(part) < limit for part in compared]


def test_a_shift_that_the_base_does_not_have_is_no_offset_of_joint_1(known):
    _, calibration = known
    moved = virtual_arm()
    moved.world_from_base[:3, 3] = 0.0, 0.001, 0.0
    found = ta.update(calibration, moved.measure(moved.poses(15, seed=9), seed=9))
    assert (found.verdict, found.offsets[0].told) == ("field", False)
    assert "along the sixth" in of_known_world(found.to_dict())
