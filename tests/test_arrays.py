"""Rigid transforms at the door: what is wrong with them is named, and nearly exact last rows are exact."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import truearm as ta
from truearm.arrays import as_transforms, rotation_fault
from truearm.simulation import VirtualArm
from truearm.tables.rotation_columns import RotationColumns

TURN = Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix()


def transform(turn=TURN, last=(0.0, 0.0, 0.0, 1.0)):
    """A transform (4, 4)."""
    found = np.eye(4)
    found[:3, :3], found[:3, 3], found[3] = turn, [0.3, -0.2, 0.5], last
    return found


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (transform(2.0 * TURN), r"R\^T R differs from the identity by up to 3\.0e\+00"),
        (transform(np.round(TURN, 4)), r"R\^T R differs .* in double precision"),
        (transform(TURN @ np.diag([1.0, 1.0, -1.0])), "R mirrors.*A rotation is right-handed"),
        (transform().T, "the last row is 0.3 -0.2 0.5 1. It must be 0 0 0 1.*the transposed matrix"),
        (transform(last=(0.0, 0.0, 0.0, 1.0 + 1e-7)), "the last row is 0 0 0 1"),
    ],
)
def test_what_is_wrong_with_a_transform_is_named(bad, words):
    given = np.stack([transform(), bad])
    with pytest.raises(ta.InputError, match=rf"poses are not rigid in row 1 \(counted from 0\): {words}"):
        as_transforms(given, what="poses")


def test_a_last_row_that_is_nearly_exact_is_made_so_and_the_given_one_left():
    given = transform(last=(1e-17, 0.0, -1e-12, 1.0 + 1e-12))
    before = given.copy()
    found, single = as_transforms(given, what="poses")
    assert single
    np.testing.assert_array_equal(found[0], transform())
    np.testing.assert_array_equal(given, before)


def test_tools_and_targets_with_a_nearly_exact_last_row_are_taken():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=2)
    found = ta.calibrate(arm.robot, arm.measure(arm.poses(40)), model="constant")
    q = np.radians([10.0, -80.0, 90.0, -90.0, -80.0, 5.0])
    target = found.pose(q)
    tool = transform(last=(1e-17, 0.0, 0.0, 1.0))
    np.testing.assert_array_equal(found.position(q, tool=tool), found.position(q, tool=transform()))
    target[3, 0] = 1e-17
    np.testing.assert_allclose(found.solve(target, q + 0.01), q, atol=1e-9)


def test_a_coarse_rule_takes_rotations_with_few_decimals_and_still_no_mirror():
    assert rotation_fault(np.round(TURN, 3)[None]) is not None
    assert rotation_fault(np.round(TURN, 3)[None], 0.02) is None
    columns = RotationColumns.parse("matrix=a,b,c,d,e,f,g,h,i")
    with pytest.raises(ta.InputError, match="the nine numbers of row 1 are no rotation matrix: R mirrors"):
        columns.quaternions(np.diag([1.0, 1.0, -1.0]).reshape(1, 9))
