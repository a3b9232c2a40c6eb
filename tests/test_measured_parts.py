"""What no row, or no row of a set-up, measured: no part of the fit, no answer, no share in what is known."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.calibration_file_support import read_calibration_file, write_calibration_file
from truearm.evaluation import EvaluationOptions
from truearm.simulation import Imperfections, VirtualArm
from truearm.storage.calibration_file import NO_DIGEST

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


@pytest.fixture(scope="module")
def by_set_up(arm, table):
    """Of set-up A, the smaller one, everything was measured, of B the first target alone; no orientations."""
    parts = table.drop(columns=QUATERNION).assign(group=np.where(np.arange(ROWS) < 24, "A", "B"))
    parts.loc[24:, SECOND] = np.nan
    return constants(parts)


@pytest.fixture(scope="module")
def turned_in_a(table):
    """Orientations were measured in set-up A, the smaller one, alone."""
    parts = table.drop(columns=SECOND).assign(group=np.where(np.arange(ROWS) < 24, "A", "B"))
    parts.loc[24:, QUATERNION] = np.nan
    return constants(parts)


def test_a_target_of_another_set_up_makes_no_standard_deviation_large(arm, table, by_set_up):
    q = arm.poses(20, seed=4)
    assert by_set_up.position_std(q).max() < 1e-4
    assert by_set_up.position_std(q, group="A", target=2).max() < 1e-4
    assert by_set_up.conservative_std(q)[:, 0].max() < 2e-4
    nearly = table.drop(columns=QUATERNION)
    nearly.loc[24:, SECOND] = np.nan
    variable = ta.calibrate(UR10, measured(nearly.assign(group=np.where(np.arange(ROWS) < 24, "A", "B"))))
    for known in (variable, replace(variable, fitted_spread=None)):
        assert known.position_std(q).max() < 1e-4


@pytest.mark.parametrize(("sigma_mm", "rows"), [(5.0, 1), (5.0, 40), (0.02, 1)])
def test_a_target_of_few_or_coarse_rows_harms_no_standard_deviation(arm, table, sigma_mm, rows):
    """What the device saw of the tool is the place of the targets that it saw best."""
    q, few = arm.poses(20, seed=4), np.arange(ROWS) < rows
    coarse = table.drop(columns=QUATERNION).assign(sigma_mm=np.where(few, sigma_mm, 0.02))
    coarse.loc[~few, SECOND] = np.nan
    found, plain = constants(coarse), constants(coarse.drop(columns=SECOND))
    for std in ("position_std", "conservative_std"):
        ratio = np.median(getattr(found, std)(q)) / np.median(getattr(plain, std)(q))
        assert ratio < 1.01
    again = ta.Calibration.from_bytes(found.to_bytes(with_rows=False), where="without rows")
    assert again.position_std(q).tolist() == found.position_std(q).tolist()


def test_targets_of_as_many_rows_count_the_same(table):
    found = constants(table.drop(columns=QUATERNION))
    assert found.measured.shares(0).tolist() == [0.5, 0.5]


def test_a_file_without_its_rows_tells_the_same(arm, by_set_up, turned_in_a):
    q = arm.poses(5, seed=4)
    for whole in (by_set_up, turned_in_a):
        stripped = ta.Calibration.from_bytes(whole.to_bytes(with_rows=False), where="without rows")
        assert stripped.position_std(q).tolist() == whole.position_std(q).tolist()
        assert stripped.measured.pack() == whole.measured.pack()


def test_files_that_do_not_say_what_was_measured_are_read(by_set_up, tmp_path):
    for with_rows in (True, False):
        by_set_up.save(tmp_path / "arm.calib", with_rows=with_rows)
        arrays, content = read_calibration_file(tmp_path / "arm.calib")
        del content["measured"]
        write_calibration_file(tmp_path / "old.calib", arrays, {**content, "sha256": NO_DIGEST})
        old = ta.Calibration.load(tmp_path / "old.calib").measured
        assert old.targets.tolist() == ([[24, 24], [36, 0]] if with_rows else [[1, 1], [1, 1]])
    content["measured"] = {"rows": [1], "targets": [[1, 1], [1, 0]], "orientations": [0, 0]}
    write_calibration_file(tmp_path / "odd.calib", arrays, {**content, "sha256": NO_DIGEST})
    with pytest.raises(ta.InputError, match=r"'measured.rows' has shape \(1,\)"):
        ta.Calibration.load(tmp_path / "odd.calib")


def test_standard_deviations_in_a_world_are_of_its_set_up():
    """Twelve rows of a camera beside forty of a tracker: their world is as far off as it says."""
    off, std = [], []
    for seed in range(4):
        arm = VirtualArm(UR10, seed=seed, imperfections=Imperfections(share=0.0, noise_mm=0.0))
        table = arm.measure_table(arm.poses(52)).assign(sigma_mm=0.3, group="camera")
        table.loc[12:, ["sigma_mm", "group"]] = 0.03, "tracker"
        noise_m = 1e-3 * table["sigma_mm"].to_numpy()[:, None]
        table[["x", "y", "z"]] += noise_m * np.random.default_rng(seed).normal(size=(52, 3))
        found, q, mounted = constants(table), arm.poses(30, seed=9), np.eye(4)
        mounted[:3, 3] = arm.target_in_flange
        true = (arm.world_from_base @ arm.true_pose(q, tool=mounted))[:, :3, 3]
        off.append(found.position(q, group="camera", target=1) - true)
        std.append(found.position_std(q, group="camera", target=1))
        assert (found.position_std(q, group="tracker", target=1) < 0.5 * std[-1]).all()
        of_point = found.position_std(q, group="camera", tool=found.model.setup.targets[0, 0])
        assert of_point == pytest.approx(std[-1])
    assert 0.6 < np.sqrt(np.square(np.divide(off, std)).mean()) < 1.5


def test_standard_deviations_of_a_target_are_its_own(arm, table):
    """A target of few rows beside one of many is known less well."""
    few = table.drop(columns=QUATERNION)
    few.loc[3:, SECOND] = np.nan
    found, q = constants(few), arm.poses(20, seed=4)
    first, second = (found.position_std(q, group="data", target=number) for number in (1, 2))
    assert (second > 1.05 * first).all()


def test_targets_that_a_set_up_did_not_measure_are_no_answer(arm, by_set_up):
    q = arm.poses(5, seed=4)
    off = by_set_up.position(q, group="A", target=2) - second_in_world(arm, q)
    assert np.abs(off).max() < 2e-4
    for ask in (by_set_up.position, by_set_up.position_std):
        with pytest.raises(ta.WorkError, match='target 2 was not measured in the set-up "B"'):
            ask(q, group="B", target=2)
    assert np.isfinite(by_set_up.position(q, group="B")).all()


def test_orientations_are_known_where_they_were_measured(arm, turned_in_a):
    q = arm.poses(5, seed=4)
    assert turned_in_a.pose_std(q, group="A")[:, 3:].max() < 1e-3
    with pytest.raises(ta.WorkError, match="orientation of the target on the tool is not known"):
        turned_in_a.pose(q, group="B")
    assert np.isfinite(turned_in_a.position(q, group="B")).all()


@pytest.mark.parametrize("kept", [EvaluationOptions(keep_tool=True), EvaluationOptions(keep_frames=True)])
def test_what_a_kept_set_up_did_not_measure_is_not_judged(arm, by_set_up, kept):
    table = with_second(arm, arm.poses(30, seed=8)).drop(columns=QUATERNION).assign(group="B")
    found = ta.evaluate(by_set_up, measured(table), kept)
    assert found.errors["constant"].position.max < 0.2
    told = [notice.message for notice in found.notices if notice.kind == "not_judged"]
    assert [words.split(" was measured in none of the rows")[0] for words in told] == ['Target 2 of "B"']
    lone = measured(table.assign(x=np.nan, y=np.nan, z=np.nan))
    with pytest.raises(ta.InputError, match='target 2 of "B" was measured in none of the rows'):
        ta.evaluate(by_set_up, lone, kept)


def test_orientations_that_a_kept_set_up_did_not_measure_are_not_judged(arm, turned_in_a):
    table = with_second(arm, arm.poses(30, seed=8)).drop(columns=SECOND).assign(group="B")
    found = ta.evaluate(turned_in_a, measured(table), keep_tool=True)
    assert found.errors["constant"].position.max < 0.2
    assert found.errors["constant"].orientation is None
    assert [notice.kind for notice in found.notices] == ["not_judged"]


def test_held_out_orientations_of_a_set_up_that_trained_without_are_not_judged(table):
    purpose = np.where(np.arange(ROWS) % 3 == 0, "validate", "train")
    group = np.where(np.arange(ROWS) < 24, "A", "B")
    parts = table.drop(columns=SECOND).assign(group=group, purpose=purpose)
    parts.loc[(group == "B") & (purpose == "train"), QUATERNION] = np.nan
    found = constants(parts)
    turned = found.validation.holdout["constant"].orientation
    assert turned is not None
    assert turned.max < 1.0


def test_an_update_compares_with_nothing_that_was_not_measured(arm, by_set_up):
    later = measured(with_second(arm, arm.poses(20, seed=8)).drop(columns=QUATERNION).assign(group="B"))
    assert ta.update(by_set_up, later).verdict == "holds"
    with pytest.raises(ta.UsageError, match='no frame and tool of set-up "B" that could be kept'):
        ta.update(by_set_up, later, keep_tool=True)
