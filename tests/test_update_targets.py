"""Updates of constants that were fitted to several targets, which are off together where the arm is."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from truearm.fits.known_scale import common_share
from truearm.simulation import Imperfections, VirtualArm

TARGETS_MM = ((30.0, 20.0, 50.0), (-60.0, 10.0, 80.0), (20.0, -70.0, 20.0))


def with_targets(arm, poses, seed):
    """What is measured of all targets: each of its own, at poses that are off as one."""
    q = arm.poses(poses, seed=seed)
    tables = []
    for target in TARGETS_MM:
        arm.target_in_flange = 1e-3 * np.array(target)
        tables.append(arm.measure_table(q, seed=seed))
    first, *others = tables
    named = [table[["x", "y", "z"]].add_suffix(str(number)) for number, table in enumerate(others, start=2)]
    return ta.Measurements.from_dataframe(pd.concat([first, *named], axis=1))


@pytest.fixture(scope="module")
def known():
    arm = VirtualArm(ta.Robot.load("rv-m2"), seed=3)
    return arm, ta.calibrate(arm.robot, with_targets(arm, 50, 1), model="constant")


def test_targets_share_what_constants_leave(known):
    _, calibration = known
    common = calibration.constant.scale.common
    assert common > 0.8
    noise = calibration.spread.noise(np.zeros((1, 9, 1)), np.zeros(9, dtype=np.bool_))[0]
    np.testing.assert_allclose(np.diag(noise), calibration.constant.noise_m**2)
    np.testing.assert_allclose(noise[:3, 3:6], common * calibration.constant.noise_m**2 * np.eye(3))
    stripped = ta.Calibration.from_bytes(calibration.to_bytes(with_rows=False), where="stripped")
    assert stripped.spread.noise(np.zeros((1, 9, 1)), np.zeros(9, dtype=np.bool_))[0] == pytest.approx(noise)


def test_more_targets_of_a_pose_tell_hardly_more_of_the_joints_that_carry_it(known):
    arm, calibration = known
    all_of_them = with_targets(arm, 12, 10)
    first = ta.Measurements.from_dataframe(arm.measure_table(arm.poses(12, seed=10), seed=10))
    several, one = (ta.update(calibration, data).offsets[1:3] for data in (all_of_them, first))
    stds = np.array([[offset.std for offset in offsets] for offsets in (several, one)], dtype=np.float64)
    ratios = stds[0] / stds[1]
    assert all(0.75 < ratio < 1.05 for ratio in ratios)


def test_rows_tell_how_far_the_farthest_target_is(known):
    arm, calibration = known
    rows = ta.update(calibration, with_targets(arm, 12, 10)).calibration.rows
    assert rows is not None
    each = np.linalg.norm(rows.residual.reshape(12, 3, 3), axis=2)
    assert (each[:, 0] < each.max(axis=1)).any()
    np.testing.assert_allclose(rows.distance_m, each.max(axis=1))


def test_the_common_share_is_that_of_drawn_displacements():
    random = np.random.default_rng(0)
    own, shared = random.normal(size=(4000, 2, 3)), random.normal(size=(4000, 1, 3))
    residual = (own + 2.0 * shared).reshape(4000, 6)
    residual[::3, 3:] = 0.0
    weight, nothing = np.ones(4000), np.zeros(4000)
    assert common_share(residual, weight, 2, np.sqrt(5.0), nothing) == pytest.approx(0.8, abs=0.03)
    assert common_share(own.reshape(4000, 6), weight, 2, 1.0, nothing) < 0.05
    assert common_share(residual[:, :3], weight, 1, 1.0, nothing) == 0.0
    assert common_share(residual, weight, 2, 2.0, nothing + 1.0) == pytest.approx(1.0, abs=0.03)
    for scale in (0.5, 2.0):
        share = common_share(scale * residual, weight, 2, np.sqrt(5.0), nothing)
        assert share == pytest.approx(0.8, abs=0.03)


@pytest.mark.parametrize("robust", ["none", "cauchy"])
def test_targets_with_constants_that_leave_much_are_calibrated(robust):
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1, imperfections=Imperfections(noise_mm=0.01))
    found = ta.calibrate(arm.robot, with_targets(arm, 40, 1), model="constant", robust=robust)
    assert found.constant.scale is not None
    assert 0.8 < found.constant.scale.common < 0.99


def test_targets_that_differ_by_nothing_have_noise_of_their_own(known):
    scale = replace(known[1].constant.scale, common=1.0)
    spread = replace(known[1], constant=replace(known[1].constant, scale=scale)).spread
    noise = spread.noise(np.zeros((1, 9, 1)), np.zeros(9, dtype=np.bool_))[0]
    assert np.linalg.eigvalsh(noise).min() > 0.0
    assert np.isfinite(np.linalg.cholesky(np.linalg.inv(noise))).all()


def test_a_target_that_the_calibration_does_not_know_is_left_out(known):
    arm, _ = known
    one = ta.calibrate(arm.robot, with_targets(arm, 50, 1), model="constant", use="position")
    data = with_targets(arm, 14, 10)
    found = ta.update(one, data)
    assert found.tested == ("offsets", "tool")
    assert str(found.notices[0]) == "Not used: target 2, target 3, which took no part in the calibration."
    assert ta.update(one, data, keep_tool=True).kept == ("tool",)
