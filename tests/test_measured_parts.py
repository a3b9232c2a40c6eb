"""What no row, or no row of a set-up, measured: no part of the fit, no answer, no share in what is known."""

import numpy as np
import pytest

import truearm as ta
from truearm.simulation import Imperfections, VirtualArm

UR10 = ta.Robot.load("ur10")
QUATERNION = ["qw", "qx", "qy", "qz"]
SECOND = ["x2", "y2", "z2"]
ROWS = 60


@pytest.fixture(scope="module")
def arm():
    return VirtualArm(UR10, seed=1, imperfections=Imperfections(share=0.0, noise_mm=0.02))


@pytest.fixture(scope="module")
def table(arm):
    """Poses of a target and, with them, of a second one."""
    return with_second(arm, arm.poses(ROWS))


def second_in_world(arm, q):
    """Where the second target is (n, 3), m."""
    beside = np.eye(4)
    beside[:3, 3] = [0.1, -0.05, 0.02]
    return (arm.world_from_base @ arm.true_pose(q, tool=beside))[:, :3, 3]


def with_second(arm, q):
    table = arm.measure_table(q, orientation=True)
    table[SECOND] = second_in_world(arm, q)
    return table


def measured(table, **columns):
    return ta.Measurements.from_dataframe(table.assign(**columns))


def constants(table, **options):
    return ta.calibrate(UR10, measured(table), model="constant", **options)


def test_columns_without_a_value_change_nothing(arm, table):
    plain = constants(table.drop(columns=[*QUATERNION, *SECOND]))
    q = arm.poses(5, seed=4)
    for more in ({"x2": np.nan, "y2": np.nan, "z2": np.nan}, dict.fromkeys(QUATERNION, np.nan)):
        found = constants(table.drop(columns=[*QUATERNION, *SECOND]).assign(**more))
        assert found.selection == plain.selection
        assert found.position_std(q).tolist() == plain.position_std(q).tolist()
        with pytest.raises(ta.WorkError, match="orientation of the target on the tool is not known"):
            found.pose(q, group="data", target=1)


def test_orientations_are_used_beside_columns_of_targets_that_nobody_measured(table):
    found = constants(table.assign(**dict.fromkeys(SECOND, np.nan)))
    assert found.selection.orientation
    assert [notice.kind for notice in found.notices if notice.kind == "orientations_left_out"] == []


def test_the_first_target_is_the_first_that_was_measured(table):
    lone = table.drop(columns=QUATERNION).assign(x=np.nan, y=np.nan, z=np.nan)
    found = constants(lone)
    assert found.selection.targets == (1,)
    assert found.validation.holdout["constant"].position.mean < 0.1


def test_what_was_measured_in_no_row_cannot_be_asked_for(table):
    empty = table.assign(**dict.fromkeys([*SECOND, *QUATERNION], np.nan))
    for use, words in (("targets", "one point was measured"), ("pose", "no orientation was measured")):
        with pytest.raises(ta.UsageError, match=words):
            constants(empty, use=use)
