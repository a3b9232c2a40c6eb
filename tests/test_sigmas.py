"""What rows state of their noise along axes, and of orientations, counts in fits and in updates."""

import numpy as np
import pytest

import truearm as ta
from truearm.doubts.uneven_axes import UNEVEN_AXES
from truearm.doubts.uneven_setups import UNEVEN_TURNS
from truearm.reporting.report import report
from truearm.rotations import matrix_from_quaternion, matrix_from_rotation_vector, quaternion_from_matrix
from truearm.rows.visits import one_row_a_pose
from truearm.simulation import Imperfections, VirtualArm

DEPTH_MM = np.array([0.03, 0.03, 0.5])
QUATERNION = ["qw", "qx", "qy", "qz"]


@pytest.fixture(scope="module")
def arm():
    plain = Imperfections(share=0.0, noise_mm=0.0, noise_mrad=0.0)
    return VirtualArm(ta.Robot.load("ur10"), seed=4, imperfections=plain)


def camera(arm, count, seed=0):
    """Poses of a device that is coarse along its z, without a word of it."""
    table = arm.measure_table(arm.poses(count, seed=seed))
    noise = 1e-3 * DEPTH_MM * np.random.default_rng(seed).normal(size=(count, 3))
    table[["x", "y", "z"]] += noise
    return table


def stating(table, sigmas_mm):
    return table.assign(**{f"sigma_{axis}_mm": sigma for axis, sigma in zip("xyz", sigmas_mm, strict=True)})


def found(arm, table, **options):
    data = ta.Measurements.from_dataframe(table)
    return ta.calibrate(arm.robot, data, drift="none", refit=False, holdout=0.1, **options)


def error_mm(arm, calibration):
    """Mean error of the measured target where nothing was measured."""
    there = arm.poses(300, seed=9)
    truth = arm.measure(there).targets[:, 0]
    at = calibration.position(there, group=calibration.groups[0], target=1)
    return 1e3 * float(np.linalg.norm(at - truth, axis=1).mean())


def kinds(calibration):
    return {notice.kind for notice in calibration.notices}


@pytest.mark.parametrize("model", ["constant", "variable"])
def test_the_noise_of_each_axis_counts_where_it_is_stated(arm, model):
    table = camera(arm, 60)
    alike = found(arm, table.assign(sigma_mm=np.sqrt(np.square(DEPTH_MM).mean())), model=model)
    stated = found(arm, stating(table, DEPTH_MM), model=model)
    assert error_mm(arm, stated) < 0.6 * error_mm(arm, alike)
    assert UNEVEN_AXES not in kinds(stated)


def test_standard_deviations_hold_the_errors_of_axes(arm):
    there = arm.poses(200, seed=9)
    truth = arm.measure(there).targets[:, 0]
    shares = []
    for seed in range(5):
        calibration = found(arm, stating(camera(arm, 60, seed), DEPTH_MM), model="constant")
        at = calibration.position(there, group=calibration.groups[0], target=1)
        std = calibration.position_std(there, group=calibration.groups[0], target=1)
        shares.append(np.square((at - truth) / std).mean(axis=0))
    assert np.all((np.mean(shares, axis=0) > 0.3) & (np.mean(shares, axis=0) < 2.5))


@pytest.mark.parametrize("model", ["constant", "variable"])
def test_a_coarse_axis_is_told_with_the_sigma_to_state(arm, model):
    calibration = found(arm, camera(arm, 80), model=model)
    said = next(str(notice) for notice in calibration.notices if notice.kind == UNEVEN_AXES)
    assert "times as much as x and y" in said
    to_state = float(said.split("as x and y, about ")[1].split(" mm")[0])
    assert to_state == pytest.approx(DEPTH_MM[2], rel=0.35)
    assert ("--model variable" in said) == (model == "constant")
    assert said in {advice.words for advice in report(calibration).advice}


def test_axes_that_scatter_alike_are_not_told(arm):
    table = arm.measure_table(arm.poses(60))
    table[["x", "y", "z"]] += 1e-4 * np.random.default_rng(0).normal(size=(60, 3))
    assert UNEVEN_AXES not in kinds(found(arm, table, model="constant"))


def two_probes(arm, fine_mrad, coarse_mrad, seed=0, poses=60):
    """Poses of two devices in turn, whose orientations are off by so much."""
    table = arm.measure_table(arm.poses(2 * poses, seed=seed), orientation=True)
    draw = np.random.default_rng(seed)
    mrad = np.where(np.arange(2 * poses) < poses, fine_mrad, coarse_mrad)
    off = matrix_from_rotation_vector(1e-3 * mrad[:, None] * draw.normal(size=(2 * poses, 3)))
    table[QUATERNION] = quaternion_from_matrix(off @ matrix_from_quaternion(table[QUATERNION].to_numpy()))
    table[["x", "y", "z"]] += 1e-3 * 0.05 * draw.normal(size=(2 * poses, 3))
    return table.assign(group=np.where(np.arange(2 * poses) < poses, "fine", "coarse")), mrad


def test_a_coarse_set_up_does_not_spoil_the_orientations_of_a_fine_one(arm):
    errors: dict[str, list[float]] = {"silent": [], "stated": [], "alone": []}
    for seed in range(3):
        table, mrad = two_probes(arm, 0.1, 5.0, seed)
        tables = {"silent": table, "stated": table.assign(sigma_mrad=mrad), "alone": table[:60]}
        for name, each in tables.items():
            errors[name].append(error_of_fine(arm, found(arm, each, model="constant")))
    silent, stated, alone = (np.mean(errors[name]) for name in ("silent", "stated", "alone"))
    assert stated < 1.1 * alone
    assert stated < 0.6 * silent


def error_of_fine(arm, calibration):
    """Mean error of the orientation in the set-up of the finer device, mrad."""
    there = arm.poses(200, seed=9)
    truth = matrix_from_quaternion(arm.measure(there, orientation=True).orientations)
    at = calibration.pose(there, group="fine", target=1)[:, :3, :3]
    cosine = (np.einsum("nij,nij->n", at, truth) - 1.0) / 2.0
    return 1e3 * float(np.arccos(np.clip(cosine, -1.0, 1.0)).mean())


@pytest.mark.parametrize("model", ["constant", "variable"])
def test_orientations_of_set_ups_that_scatter_differently_are_told(arm, model):
    table, mrad = two_probes(arm, 0.1, 5.0)
    calibration = found(arm, table, model=model)
    said = next(str(notice) for notice in calibration.notices if notice.kind == UNEVEN_TURNS)
    to_state = float(said.split("sigma_mrad: about ")[1].split(" mrad")[0])
    assert to_state == pytest.approx(5.0, rel=0.3)
    assert said in {advice.words for advice in report(calibration).advice}
    assert UNEVEN_TURNS not in kinds(found(arm, table.assign(sigma_mrad=mrad), model=model))


def test_orientations_that_scatter_alike_are_not_told(arm):
    table, _ = two_probes(arm, 1.0, 1.0)
    assert UNEVEN_TURNS not in kinds(found(arm, table, model="constant"))


def test_an_update_knows_the_axes_that_rows_state(arm):
    calibration = found(arm, stating(camera(arm, 60), DEPTH_MM))
    later = stating(camera(arm, 40, seed=5), DEPTH_MM)
    told = ta.update(calibration, ta.Measurements.from_dataframe(later))
    assert 0.5 < told.rest.squares / told.rest.freedom < 1.6
    small = ta.update(calibration, ta.Measurements.from_dataframe(stating(later, [0.03, 0.03, 0.03])))
    assert small.rest.squares > 3.0 * told.rest.squares


def test_an_update_takes_silent_orientations_to_be_as_those_of_the_calibration(arm):
    table, _ = two_probes(arm, 2.0, 2.0)
    calibration = found(arm, table.assign(sigma_mrad=2.0))
    later, _ = two_probes(arm, 2.0, 2.0, seed=5, poses=15)
    silent, stated = (
        ta.update(calibration, ta.Measurements.from_dataframe(each))
        for each in (later, later.assign(sigma_mrad=2.0))
    )
    assert silent.rest.squares == pytest.approx(stated.rest.squares, rel=1e-9)
    said = next(str(notice) for notice in silent.notices if notice.kind == "sigma")
    assert "30 rows without a sigma of the orientation" in said
    assert "by 2 mrad" in said
    assert "sigma" not in kinds(stated)


def test_the_file_of_a_calibration_keeps_what_rows_state(arm, tmp_path):
    table, mrad = two_probes(arm, 0.1, 5.0)
    calibration = found(arm, stating(table, DEPTH_MM).assign(sigma_mrad=mrad), model="constant")
    calibration.save(tmp_path / "a.calib")
    loaded = ta.Calibration.load(tmp_path / "a.calib")
    assert loaded.rows is not None
    rows, before = loaded.rows.data, calibration.rows.data
    np.testing.assert_array_equal(rows.sigma_axes_m, before.sigma_axes_m)
    np.testing.assert_array_equal(rows.sigma_rad, before.sigma_rad)
    assert rows.hash() == before.hash()


def test_means_of_shots_are_as_sure_as_their_axes(arm):
    table = stating(camera(arm, 3).loc[[0, 0, 0, 0, 1, 2]].reset_index(drop=True), DEPTH_MM)

    means = one_row_a_pose(ta.Measurements.from_dataframe(table))
    assert means.sigma_axes_m is not None
    np.testing.assert_allclose(means.sigma_axes_m[0], 0.5e-3 * DEPTH_MM, rtol=1e-12)
    np.testing.assert_allclose(means.sigma_axes_m[1], 1e-3 * DEPTH_MM, rtol=1e-12)
