"""What no row of the fit has found on the tool is not judged, and what is judged was not measured before."""

import numpy as np
import pytest

import truearm as ta
from truearm.errors import list_outliers, short_names
from truearm.reporting.report import report
from truearm.simulation import VirtualArm

UR10 = ta.Robot.load("ur10")
NESTS = np.array([[0.0, 0.0, 0.0], [0.08, 0.0, 0.02], [0.0, 0.09, -0.02], [-0.07, -0.05, 0.03]])


@pytest.fixture(scope="module")
def arm():
    return VirtualArm(UR10, seed=3)


def in_nests(arm, count, nest, *, seed=0):
    """Rows (count,) of which each holds the target in one of four nests of the tool, `nest` (count,)."""
    poses = arm.poses(count, seed=seed)
    table = arm.measure_table(poses, seed=seed)
    true = (arm.world_from_base @ arm.true_pose(poses))[:, :3, :3]
    table = table[[*(f"q{j + 1}" for j in range(6)), "x", "y", "z"]]
    seen = table[["x", "y", "z"]].to_numpy() + np.einsum("nij,nj->ni", true, NESTS[nest])
    for k in range(len(NESTS)):
        names = [f"{axis}{k + 1}" if k else axis for axis in "xyz"]
        table[names] = np.where((nest == k)[:, None], seen, np.nan)
    return table


def notices(found, kind):
    return [notice.message for notice in found.notices if notice.kind == kind]


@pytest.mark.parametrize("purposes", [("train", "validate"), ("Train", "VALIDATE ")])
def test_a_target_that_no_training_row_holds_is_not_judged(arm, purposes):
    nest = np.repeat([0, 1], [48, 12])
    table = in_nests(arm, 60, nest).assign(purpose=np.repeat(purposes, [40, 20]))
    found = ta.calibrate(UR10, ta.Measurements.from_dataframe(table), model="constant")
    assert (found.validation.n_planned, found.validation.n_holdout) == (8, 8)
    assert found.held is not None
    assert np.isfinite(found.held.errors["constant"].distance_m).sum() == 8
    assert found.validation.holdout["constant"].position.max < 1.0
    assert notices(found, "not_judged") == [
        'Target 2 of "data" was measured in none of the rows that find where it is on the tool, and is not '
        "judged: 12 rows with no other target have no error."
    ]
    only = ta.Measurements.from_dataframe(table.assign(purpose=np.where(nest == 1, "validate", "train")))
    with pytest.raises(ta.InputError, match='target 2 of "data" was measured in none of the rows'):
        ta.calibrate(UR10, only, model="constant")


def test_purposes_that_nobody_knows_are_told(arm):
    table = in_nests(arm, 40, np.zeros(40, dtype=int)).assign(purpose=np.repeat(["train", "validation"], 20))
    data = ta.Measurements.from_dataframe(table)
    told = [notice.message for notice in data.notices if notice.kind == "purpose"]
    assert told == [
        'data: column "purpose" holds "validation", which plans nothing: "train", "validate" and "repeat" '
        "are known."
    ]


def test_nests_in_turn_make_no_changed_arm(arm):
    table = in_nests(arm, 60, np.zeros(60, dtype=int))
    known = ta.calibrate(UR10, ta.Measurements.from_dataframe(table), model="constant")
    for seed in range(1, 21):
        nest = np.arange(30) % 3
        other = ta.Measurements.from_dataframe(in_nests(arm, 30, nest, seed=seed))
        found = ta.evaluate(known, other, frame_rows=6, seed=seed)
        assert not notices(found, "not_as_calibrated")
        assert not notices(found, "outliers")


def test_one_gross_row_moves_no_judged_target(arm):
    poses = arm.poses(60)
    table = arm.measure_table(poses)
    for axis, column in zip("xyz", (arm.world_from_base @ arm.true_pose(poses))[:, :3, 0].T, strict=True):
        table[f"{axis}2"] = table[axis] + 0.05 * column
    spoilt = table.copy()
    spoilt.loc[1, "x2"] += 0.3
    means = [
        ta.calibrate(
            UR10, ta.Measurements.from_dataframe(each), model="constant", judge_target=2, use="position"
        )
        .validation.holdout["constant"]
        .position.mean
        for each in (table, spoilt)
    ]
    assert means[1] < 1.1 * means[0]


def test_held_out_rows_of_poses_that_trained_are_told(arm):
    poses = np.tile(arm.poses(20), (4, 1)) + np.random.default_rng(0).normal(0.0, 1e-5, (80, 6))
    again = ta.Measurements.from_dataframe(arm.measure_table(poses).assign(station=np.tile(np.arange(20), 4)))
    told = notices(ta.calibrate(UR10, again, model="constant"), "known_poses")
    assert "held-out rows are of poses that also trained" in told[0]
    kept = ta.calibrate(UR10, again, model="constant", split_by=("station",))
    assert notices(kept, "known_poses") == []


def test_files_of_one_name_are_told_apart():
    assert short_names(["a/mon/m.csv", "a/tue/m.csv", "a/n.csv"]) == {
        "a/mon/m.csv": "mon/m.csv",
        "a/tue/m.csv": "tue/m.csv",
        "a/n.csv": "n.csv",
    }
    assert short_names(["m.csv", "old/m.csv"]) == {"m.csv": "m.csv", "old/m.csv": "old/m.csv"}
    alone = [{"file": "a/tue/m.csv", "row": 10, "distance_mm": 19.984}]
    assert list_outliers(alone, ["a/mon/m.csv", "a/tue/m.csv"]) == "row 10 of tue/m.csv (19.98 mm)"
    assert list_outliers(alone, ["a/tue/m.csv"]) == "row 10 (19.98 mm)"


def test_a_file_knows_from_which_side_its_poses_were_approached(arm, tmp_path):
    again = np.repeat(np.arange(40), np.where(np.arange(40) % 3 == 0, 2, 1))
    second = np.r_[False, again[1:] == again[:-1]]
    table = arm.measure_table(arm.poses(40)[again])
    table = table.assign(approach=np.where(second, -1, 1), purpose=np.where(second, "repeat", "train"))
    made = ta.calibrate(UR10, ta.Measurements.from_dataframe(table), model="constant")
    made.save(tmp_path / "arm.calib")
    kept = ta.Calibration.load(tmp_path / "arm.calib")
    for calibration in (made, kept):
        assert "Poses approached from both sides" in report(calibration).html
    assert made.rows is not None
    assert kept.rows is not None
    assert kept.rows.data.purpose is not None
    assert kept.rows.data.purpose.tolist() == table["purpose"].to_numpy()[made.rows.data.rows - 1].tolist()


def test_held_out_rows_of_the_judged_target_alone_have_no_intervals(arm):
    table = in_nests(arm, 60, np.zeros(60, dtype=int))
    table[["x2", "y2", "z2"]] = table[["x", "y", "z"]]
    table = table.assign(purpose=np.repeat(["train", "validate"], [40, 20]))
    table.loc[40:, ["x", "y", "z"]] = np.nan
    table = table[[name for name in table.columns if name[1:] not in ("3", "4") or name[0] == "q"]]
    found = ta.calibrate(UR10, ta.Measurements.from_dataframe(table), judge_target=2, refit=False)
    assert found.validation.coverage_95 is None
    again = ta.Calibration.from_bytes(found.to_bytes(), where="the same")
    assert again.validation == found.validation


def test_rows_that_hold_nothing_judged_do_not_count_as_judged(arm):
    table = in_nests(arm, 80, np.zeros(80, dtype=int)).assign(group=np.repeat(["a", "b"], 40))
    table[["x2", "y2", "z2"]] = table[["x", "y", "z"]].to_numpy()
    table.loc[40:, ["x2", "y2", "z2"]] = np.nan
    table.loc[:3, ["x2", "y2", "z2"]] = np.nan
    data = ta.Measurements.from_dataframe(table)
    known = ta.calibrate(UR10, data, model="constant", judge_target=2, refit=False)
    assert known.held is not None
    finite = int(np.isfinite(known.held.errors["constant"].distance_m).sum())
    judged = known.validation
    assert 0 < finite == judged.n_holdout == judged.n_holdout_poses < len(known.held)
    assert "another split would give others" in judged.few
    for options, empty in (({"keep_frames": True}, 4), ({"frame_rows": 10, "seed": 1}, None)):
        found = ta.evaluate(known, data, judge_target=2, **options)
        assert found.rows is not None
        assert found.n_judged == np.isfinite(found.rows.errors["constant"].distance_m).sum()
        assert found.n_judged == found.n_judged_poses < len(found.rows)
        words = "rows of 80 to judge hold nothing that is judged" if empty else "hold nothing that is judged"
        assert [text for text in notices(found, "not_judged") if words in text]
