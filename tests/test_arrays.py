"""Arrays at the door: what is wrong is named, nearly exact last rows become exact, any bytes are taken."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import truearm as ta
from truearm.arrays import as_transforms, rotation_fault
from truearm.planning import AboveFloor, accessible
from truearm.simulation import VirtualArm
from truearm.streaming import CorrectionStream
from truearm.tables.rotation_columns import RotationColumns

TURN = Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix()
READING = np.radians([10.0, -80.0, 90.0, -90.0, -80.0, 5.0])


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


@pytest.fixture(scope="module")
def found():
    """A calibration by constants."""
    arm = VirtualArm(ta.Robot.load("ur10"), seed=2)
    return ta.calibrate(arm.robot, arm.measure(arm.poses(40)), model="constant")


def test_tools_and_targets_with_a_nearly_exact_last_row_are_taken(found):
    q, target = READING, found.pose(READING)
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


def packet(values):
    """The same numbers behind one byte, as they stand in a telegram: not aligned."""
    array = np.asarray(values, dtype=np.float64)
    found = np.frombuffer(b"!" + array.tobytes(), np.float64, array.size, offset=1).reshape(array.shape)
    assert not found.flags.aligned
    return found


DOORS = {
    "robot.position": lambda c, q, as_given: c.robot.position(as_given(q)),
    "robot.pose": lambda c, q, as_given: c.robot.pose(as_given(q)),
    "robot.parameter_jacobian": lambda c, q, as_given: c.robot.parameter_jacobian(as_given(q), pose=True),
    "robot.joint_jacobian": lambda c, q, as_given: c.robot.joint_jacobian(as_given(q)),
    "robot.from_table": lambda c, q, as_given: ta.Robot.from_table("x", as_given(c.robot.table)).position(q),
    "position": lambda c, q, as_given: c.position(as_given(q)),
    "position of a tool": lambda c, q, as_given: c.position(q, tool=as_given(transform())),
    "position of a point": lambda c, q, as_given: c.position(q, tool=as_given([0.0, 0.0, 0.1])),
    "parameters": lambda c, q, as_given: c.parameters(as_given(q)),
    "position_std": lambda c, q, as_given: c.position_std(as_given(q)),
    "conservative_std": lambda c, q, as_given: c.conservative_std(as_given(q)),
    "solve": lambda c, q, as_given: c.solve(as_given(c.pose(q)), as_given(q)),
    "correct": lambda c, q, as_given: ta.Compensator(c).correct(as_given(q)),
    "joints": lambda c, q, as_given: ta.Compensator(c).joints(as_given(q)).q,
    "poses": lambda c, q, as_given: ta.Compensator(c).poses(as_given(c.robot.pose(q)), as_given(q)).q,
    "stream": lambda c, q, as_given: CorrectionStream(ta.Compensator(c)).step(as_given(q), 0.0).q,
    "inverse": lambda c, q, as_given: ta.Controller.nominal(c.robot).inverse.near(
        c.robot.pose(q), as_given(q)
    ),
    "accessible": lambda c, q, as_given: accessible(c.robot, as_given(q), [AboveFloor(0.0)]),
}


@pytest.mark.parametrize("door", DOORS)
def test_numbers_that_are_not_aligned_are_taken(door, found):
    call = DOORS[door]
    np.testing.assert_array_equal(call(found, READING, packet), call(found, READING, np.array))
