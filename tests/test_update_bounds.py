"""What may have moved by less than usual, and how small and large that may be."""

import numpy as np
import pytest

import truearm as ta
from tests.remastered import remastered, remastered_table
from truearm.doubts.at_once import STEP_KINDS
from truearm.simulation import VirtualArm

DEG = 0.1
"""By how much joint 2 is off."""


@pytest.fixture(scope="module")
def arm():
    return VirtualArm(ta.Robot.load("ur10"), seed=1)


@pytest.fixture(scope="module")
def known(arm):
    return ta.calibrate(arm.robot, arm.measure(arm.poses(60), seed=0), model="constant")


@pytest.mark.parametrize("offset_deg", [0.0001, 0.001, 0.01])
def test_an_offset_that_contradicts_what_was_said_is_no_joint_that_moved_meanwhile(arm, known, offset_deg):
    data = remastered(arm, arm.poses(20, seed=9), np.array([0.0, DEG, 0.0, 0.0, 0.0, 0.0]), seed=9)
    with pytest.raises(ta.WorkError, match=r"joint 2 would be off by \d+ times what is allowed for"):
        ta.update(known, data, offset_deg=offset_deg)


def test_offsets_of_an_unchanged_arm_are_told_however_closely_they_are_known(arm, known):
    data = arm.measure(arm.poses(20, seed=9), seed=9)
    usual, narrow = ta.update(known, data), ta.update(known, data, offset_deg=0.001)
    assert (usual.verdict, narrow.verdict) == ("holds", "holds")
    assert [o.told for o in narrow.offsets] == [o.told for o in usual.offsets]
    assert [o.confounded for o in narrow.offsets] == [o.confounded for o in usual.offsets]
    assert all(o.std <= 0.001 for o in narrow.offsets if o.std is not None)


def test_a_target_that_is_elsewhere_than_was_said_slipped_at_no_row(arm, known):
    table = remastered_table(arm, arm.poses(20, seed=9), np.zeros(6), seed=9, tool_mm=(2.0, 0.0, 0.0))
    data = ta.Measurements.from_dataframe(table, joints=arm.robot.joints)
    found = ta.update(known, data, tool_mm=0.001)
    assert found.verdict != "holds"
    assert not {notice.kind for notice in found.notices} & set(STEP_KINDS)


@pytest.mark.parametrize("name", ["offset_deg", "offset_mm", "tool_mm", "tool_deg"])
@pytest.mark.parametrize("size", [5e-324, 1e-300, 1e-7, 1e7, 1e300, 1.7e308])
def test_sizes_that_nothing_has_are_refused(arm, known, name, size):
    unit = name.rpartition("_")[2]
    words = f"{name}: .*At least 1e-06 and at most 1,000,000, in {unit}"
    with pytest.raises(ta.UsageError, match=words):
        ta.update(known, arm.measure(arm.poses(20, seed=9), seed=9), **{name: size})
