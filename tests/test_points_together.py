"""Rows that hold different targets of one pose are taken together."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.nests import a_target_a_row
from truearm.doubts.points_together import KIND, points_together
from truearm.simulation import VirtualArm

POSES = 40


def wide(sigma=False):
    """Three targets at each pose, one a row of them."""
    arm = VirtualArm.paper(seed=3)
    q = arm.poses(POSES)
    parts = [arm.measure(q, seed=k) for k in range(3)]
    targets = np.concatenate([part.targets for part in parts], axis=1)
    return arm, replace(parts[0], targets=targets, sigma_m=np.full(POSES, 1e-5) if sigma else None)


@pytest.mark.parametrize("sigma", [False, True])
def test_rows_of_one_target_each_are_the_poses_that_they_are_of(sigma):
    _, data = wide(sigma)
    joined, notices = points_together(a_target_a_row(data))
    assert np.array_equal(joined.targets, data.targets)
    assert np.allclose(joined.readings, data.readings, rtol=0.0, atol=1e-15)
    assert joined.rows.tolist() == list(range(1, 3 * POSES, 3))
    assert [notice.kind for notice in notices] == [KIND]
    assert str(notices[0]).startswith(f"{3 * POSES} rows are {POSES} poses")


def test_a_target_that_is_measured_again_begins_another_row():
    _, data = wide()
    rows = a_target_a_row(data).select([0, 1, 2, 0, 1, 2, 3])
    joined, _ = points_together(rows)
    assert np.array_equal(joined.targets[:2], data.targets[[0, 0]])
    assert np.isfinite(joined.targets).all(axis=2).sum(axis=1).tolist() == [3, 3, 1]


def test_rows_of_other_poses_setups_or_sigmas_stay_rows_of_their_own():
    _, data = wide(sigma=True)
    rows = a_target_a_row(data).select([0, 1, 2])
    apart = [
        replace(rows, readings=rows.readings + np.array([[0.0], [1e-2], [2e-2]])),
        replace(rows, group=np.array(["a", "b", "c"])),
        replace(rows, sigma_m=np.array([1e-5, 2e-5, 3e-5])),
    ]
    for given in apart:
        joined, notices = points_together(given)
        assert joined is given
        assert not notices
    assert points_together(data) == (data, [])


def test_an_orientation_joins_the_points_of_its_pose():
    _, data = wide()
    rows = a_target_a_row(data).select([0, 1, 2])
    turned = np.full((3, 4), np.nan)
    turned[1] = [1.0, 0.0, 0.0, 0.0]
    joined, _ = points_together(replace(rows, orientations=turned))
    assert joined.orientations is not None
    assert joined.orientations.tolist() == [[1.0, 0.0, 0.0, 0.0]]
    both = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1))
    assert len(points_together(replace(rows, orientations=both))[0]) == 3


def test_a_calibration_from_a_row_for_each_target_is_that_of_whole_poses():
    arm, data = wide()
    whole, rows = (ta.calibrate(arm.robot, each, model="constant") for each in (data, a_target_a_row(data)))
    found, wanted = (one.validation.holdout["constant"].position.mean for one in (rows, whole))
    assert found == pytest.approx(wanted, rel=1e-9)
    assert KIND in [notice.kind for notice in rows.notices]
