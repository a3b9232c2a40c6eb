"""Set-ups that move while they are measured."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import truearm as ta
from tests.report_support import words_of
from truearm import drifting
from truearm.cli import main
from truearm.drifting import Drift
from truearm.fits.fitting import fit_rows
from truearm.reporting.report import report
from truearm.simulation import VirtualArm
from truearm.storage.calibration_content import pack, unpack

FAR = np.array([0.12, -0.05, 0.16]) / 1e3
ROWS = 120


def warming(count):
    """How far a set-up that warms up has moved at each of so many rows (n, 3), m."""
    return (1.0 - np.exp(-np.linspace(0.0, 5.0, count)))[:, None] * FAR


def moved(data, by):
    """Measurements of a set-up that moved."""
    return replace(data, targets=data.targets + by[:, None])


@pytest.fixture(scope="module")
def measured():
    """An arm whose measuring instrument warmed up, and what would have been measured without."""
    arm = VirtualArm.paper(seed=4)
    steady = arm.measure(arm.poses(ROWS))
    return arm, steady, moved(steady, warming(ROWS))


@pytest.fixture(scope="module")
def settled(measured):
    arm, _, data = measured
    return ta.calibrate(arm.robot, data)


def rows_of(calibration):
    """The rows of a calibration that has them."""
    assert calibration.rows is not None
    return calibration.rows


def drift_of(calibration):
    """What a calibration says that was taken out, where something was."""
    assert calibration.validation.drift is not None
    return calibration.validation.drift


def held_mean(calibration):
    return calibration.validation.holdout["variable"].position.mean


def test_what_a_set_up_moved_is_found_and_taken_out(measured, settled):
    arm, steady, data = measured
    rows = rows_of(settled)
    order = np.argsort(rows.data.rows)
    truth = warming(ROWS)
    left = rows.moved[order] - (truth - truth.mean(axis=0))
    left -= left.mean(axis=0)
    assert np.sqrt(np.square(left).mean()) < 0.5 * np.sqrt(np.square(truth - truth.mean(axis=0)).mean())
    left_in = ta.calibrate(arm.robot, data, drift="none", refit=False)
    alone = ta.calibrate(arm.robot, steady, refit=False)
    assert held_mean(settled) < 0.5 * (held_mean(left_in) + held_mean(alone))
    assert left_in.validation.drift is None
    # Where a drift was looked for, the hyper-parameters were found by the rough fits before the last one.
    assert all(one.variable is not None and one.variable.evaluations > 0 for one in (left_in, alone))
    assert rows_of(left_in).moved is None


def test_it_is_told_with_what_it_would_do_if_left_in(settled):
    drift = drift_of(settled)
    (span,) = drift.moved_mm.values()
    assert 0.5 < span / (1e3 * np.linalg.norm(FAR)) < 1.2
    (notice,) = [notice for notice in settled.notices if notice.kind == "drift"]
    assert "--drift none" in str(notice)
    assert settled.summary["drift"] == drift.to_dict()


def test_the_rows_stay_as_they_were_measured(measured, settled, tmp_path):
    _, _, data = measured
    rows = rows_of(settled)
    assert np.array_equal(rows.data.targets, data.targets[rows.data.rows - 1])
    assert ta.evaluate(settled, data, keep_frames=True).notices[0].kind == "known_rows"
    settled.save(tmp_path / "a.calib")
    again = ta.Calibration.load(tmp_path / "a.calib")
    assert np.array_equal(rows_of(again).moved, rows.moved)
    assert again.validation.drift == settled.validation.drift


def test_a_file_tells_the_standard_deviations_that_the_fit_told():
    """Poses measured there and back: how much shots of a pose differ tells the noise."""
    arm = VirtualArm(ta.Robot.load("abb-irb-120"), seed=5)
    there = arm.poses(50)
    data = arm.measure(np.vstack([there, there[::-1]]))
    found = ta.calibrate(arm.robot, moved(data, np.linspace(0.0, 4.0, 100)[:, None] * FAR), refit=False)
    drift_of(found)
    again = ta.Calibration.from_bytes(found.to_bytes(), where="the same")
    q = arm.poses(20, seed=4)
    assert again.position_std(q) == pytest.approx(found.position_std(q), rel=1e-6)


def test_rows_in_any_order_give_the_same_drift(measured, settled):
    """Their numbers say when they were measured."""
    arm, _, data = measured
    order = np.random.default_rng(5).permutation(ROWS)
    other = ta.calibrate(arm.robot, data.select(order))
    by_row = [rows_of(found).moved[np.argsort(rows_of(found).data.rows)] for found in (other, settled)]
    assert by_row[0] == pytest.approx(by_row[1], abs=4e-5)


def test_nothing_moves_where_nothing_moved():
    for seed in range(6):
        arm = VirtualArm.paper(seed=seed)
        calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(60 + 20 * seed)), refit=False)
        assert calibration.validation.drift is None
        assert not [notice for notice in calibration.notices if notice.kind == "drift"]


def test_a_set_up_that_moved_leaves_the_others_where_they_are():
    arm = VirtualArm.paper(seed=6)
    both = arm.measure(arm.poses(200))
    first, second = both.select(np.arange(100)), both.select(np.arange(100, 200))
    still = replace(first, group=np.full(100, "still"), sources=np.full(100, "still.csv"))
    warm = replace(moved(second, warming(100)), group=np.full(100, "warm"), sources=np.full(100, "warm.csv"))
    calibration = ta.calibrate(arm.robot, [still, warm], refit=False)
    assert list(drift_of(calibration).moved_mm) == ["warm"]
    rows = rows_of(calibration)
    assert not rows.moved[rows.data.group == "still"].any()


@pytest.mark.parametrize("model", ["variable", "constant", "regions"])
@pytest.mark.parametrize("joint", [0, 2])
def test_poses_in_an_order_are_not_taken_for_a_drift(model, joint):
    """Of an arm that stood still, measured by one joint after the other."""
    arm = VirtualArm.paper(seed=joint)
    data = arm.measure(arm.poses(ROWS))
    ordered = data.select(np.argsort(data.readings[:, joint]))
    ordered = replace(ordered, rows=np.arange(1, ROWS + 1))
    assert ta.calibrate(arm.robot, ordered, model=model, refit=False).validation.drift is None


def named(data, name, first=1):
    """The rows as those of a file, numbered from `first` on, of one set-up."""
    count = len(data)
    rows, sources = np.arange(first, first + count), np.full(count, name)
    return replace(data, rows=rows, sources=sources, group=np.full(count, "cell"))


@pytest.mark.parametrize(
    ("second", "seed"), [("b.csv", 0), ("a.csv", 2)], ids=["two_files", "two_parts_of_one_name"]
)
def test_a_session_in_two_parts_is_one(measured, second, seed):
    """Also in the report, whatever the seed; the same numbers in parts of one name tell nothing."""
    arm, _, data = measured
    half = ROWS // 2
    parts = named(data.select(np.arange(half)), "a.csv"), named(data.select(np.arange(half, ROWS)), second)
    calibration = ta.calibrate(arm.robot, list(parts), seed=seed)
    rows = rows_of(calibration)
    order = np.argsort(rows.progress)
    placed = half * (rows.data.sources[order] != "a.csv") + rows.data.rows[order] - 1
    if second == "b.csv":
        assert np.array_equal(placed, np.arange(ROWS))
    assert rows.data.readings[order] == pytest.approx(data.readings)
    assert np.corrcoef(rows.moved[order][:, 2], warming(ROWS)[:, 2])[0, 1] > 0.9
    (says,) = [says for title, says in report(calibration).figures if title.startswith("How the set-up")]
    assert ROWS / 15 < int(re.findall(rf"first (\d+) of {ROWS} rows", says)[0]) < ROWS / 3


def test_rows_that_are_stated_to_be_noisy_hide_nothing(measured, settled):
    arm, _, data = measured
    worse = np.arange(ROWS) % 3 == 0
    noise = np.random.default_rng(1).normal(scale=1e-3, size=(ROWS, 1, 3)) * worse[:, None, None]
    stated = replace(data, targets=data.targets + noise, sigma_m=np.where(worse, 1e-3, 0.0))
    assert ta.calibrate(arm.robot, stated, refit=False).validation.drift is not None


def test_outliers_hide_nothing(measured):
    """One row in thirty, off by a few millimetres."""
    arm, _, data = measured
    wild = np.arange(ROWS) % 30 == 7
    far = np.random.default_rng(3).normal(scale=3e-3, size=(ROWS, 1, 3)) * wild[:, None, None]
    calibration = ta.calibrate(arm.robot, replace(data, targets=data.targets + far), refit=False)
    rows = rows_of(calibration)
    assert np.corrcoef(rows.moved[:, 2], warming(ROWS)[rows.data.rows - 1, 2])[0, 1] > 0.9


def test_small_set_ups_leave_their_share_of_the_looks_to_others():
    group = np.array(["a"] * 5000 + ["b"] * 5 + ["c"] * 5 + ["d"] * 400)
    chosen = group[drifting.some_of_each(group, 1000)]
    assert dict(zip(*np.unique(chosen, return_counts=True), strict=True)) == {
        "a": 590,
        "b": 5,
        "c": 5,
        "d": 400,
    }
    assert np.array_equal(drifting.some_of_each(group[4900:], 1000), np.arange(510))
    many = np.repeat(np.arange(200).astype(str), 100)
    assert len(drifting.some_of_each(many, 1000)) == 200 * 2 * drifting.FEWEST_ROWS


def test_several_targets_of_which_some_were_not_measured_move_together(measured):
    arm, _, data = measured
    two = np.repeat(data.targets, 2, axis=1)
    two[::2, 1] = two[1::4, 0] = np.nan
    calibration = ta.calibrate(arm.robot, replace(data, targets=two), use="targets", refit=False)
    rows = rows_of(calibration)
    assert np.corrcoef(rows.moved[:, 2], warming(ROWS)[rows.data.rows - 1, 2])[0, 1] > 0.9


def test_errors_are_told_at_the_first_target_that_a_row_holds(measured):
    """Where each row holds one of three, all rows are judged."""
    arm, steady, _ = measured
    points = np.full((ROWS, 3, 3), np.nan)
    which = np.arange(ROWS) % 3
    tools = np.array([[0.0, 0.0, 0.0], [0.05, 0.0, 0.02], [0.0, 0.06, 0.03]])
    turns = np.array([arm.robot.pose(row[None])[0, :3, :3] for row in steady.readings])
    shifts = np.einsum("nij,nj->ni", arm.world_from_base[:3, :3] @ turns, tools[which])
    points[np.arange(ROWS), which] = steady.targets[:, 0] + shifts
    spread = replace(steady, targets=points)
    found = ta.calibrate(arm.robot, spread, refit=False)
    alone = ta.calibrate(arm.robot, steady, refit=False)
    assert found.held is not None
    assert np.isfinite(found.held.errors["variable"].position).all()
    assert held_mean(found) < 1.5 * held_mean(alone)


def test_what_is_left_in_is_what_an_evaluation_finds(measured):
    """Of the held-out rows as they were measured, with frames and targets as they are."""
    arm, _, data = measured
    calibration = ta.calibrate(arm.robot, data, refit=False, seed=3)
    held = data.select(np.random.default_rng(3).permutation(ROWS)[int(0.7 * ROWS) :])
    found = ta.evaluate(calibration, held, keep_frames=True).errors["variable"].position.mean
    assert drift_of(calibration).left_in_mean_mm["variable"] == pytest.approx(found, rel=1e-9)


def test_a_drift_that_only_the_first_look_shows_is_let_be(measured, monkeypatch):
    arm, steady, _ = measured
    looks = []

    def shown(progress, left, weight, wanted, most_steps):
        looks.append(len(left))
        moved = np.outer(wanted - 0.5, [0.0, 0.0, 1e-3])
        return (moved, 1e-4, [], 20.0) if len(looks) == 1 else (moved, 1e-4, [], 0.0)

    monkeypatch.setattr(drifting, "find_drift", shown)
    calibration = ta.calibrate(arm.robot, steady, refit=False)
    # Three of rough fits, and one of the finished fit.
    assert len(looks) == 4
    assert calibration.validation.drift is None
    undisturbed = ta.calibrate(arm.robot, steady, refit=False, drift="none").validation.holdout
    found = calibration.validation.holdout["variable"].position.mean
    assert found == pytest.approx(undisturbed["variable"].position.mean, rel=0.05)


@pytest.mark.parametrize("after", [32, 88])
def test_what_was_bumped_is_told_with_its_rows(measured, tmp_path, after):
    arm, _, data = measured
    bump = np.outer(np.arange(ROWS) >= after, [0.0, 4e-4, 3e-4])
    calibration = ta.calibrate(arm.robot, moved(data, bump), refit=False)
    left_in = ta.calibrate(arm.robot, moved(data, bump), drift="none", refit=False)
    assert held_mean(calibration) < 0.5 * held_mean(left_in)
    ((jump,),) = drift_of(calibration).jumps.values()
    before, behind = (int(row) for row in re.findall(r"row (\d+)", jump.between))
    assert before <= after < behind <= before + 8
    assert jump.mm == pytest.approx(0.5, rel=0.25)
    (notice,) = [notice for notice in calibration.notices if notice.kind == "drift"]
    assert jump.words in str(notice)
    assert "was touched" in str(notice)
    made = report(calibration)
    assert jump.between in {advice.kind: advice.words for advice in made.advice}["gave_way"]
    (says,) = [says for title, says in made.figures if title.startswith("How the set-up moved")]
    assert jump.words in says
    calibration.save(tmp_path / "a.calib")
    assert ta.Calibration.load(tmp_path / "a.calib").validation.drift == drift_of(calibration)


def test_an_instrument_that_stood_elsewhere_is_no_slip(measured):
    arm, steady, _ = measured
    turn = Rotation.from_rotvec([0.02, -0.01, 0.5]).as_matrix()
    elsewhere = np.arange(ROWS)[:, None, None] >= 72
    data = replace(
        steady, targets=np.where(elsewhere, steady.targets @ turn.T + [2.0, -1.0, 0.1], steady.targets)
    )
    calibration = ta.calibrate(arm.robot, data, refit=False)
    ((jump,),) = drift_of(calibration).other_places.values()
    (notice,) = [notice for notice in calibration.notices if notice.kind == "another_place"]
    assert jump.between in str(notice)
    assert "column `group`" in str(notice)
    before, behind = (int(row) for row in re.findall(r"row (\d+)", jump.between))
    assert before <= 72 < behind <= before + 4
    advice = report(calibration).advice
    assert jump.between in advice[0].words
    assert "gave_way" not in {each.kind for each in advice}


def test_a_file_of_before_does_not_claim_it(settled):
    arrays, content = pack(settled, with_rows=True)
    del content["options"]["drift"]
    content = json.loads(json.dumps(content))
    assert unpack(arrays, content, where="old.calib")["options"].drift == "none"


def test_no_drift_takes_nothing_out(measured):
    _, steady, _ = measured
    assert Drift.none(steady).taken_out(steady) is steady
    assert not Drift.none(steady).spans(steady)


def test_the_command_line_finds_it_or_leaves_it_in(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arm = VirtualArm.paper(seed=4)
    table = arm.measure_table(arm.poses(ROWS))
    table[["x", "y", "z"]] += warming(ROWS)
    table.to_csv("m.csv", index=False)

    def calibrated(*more):
        status = main(["calibrate", "rv-m2", "m.csv", "-o", "out", "--no-refit", *more])
        out, err = capsys.readouterr()
        return status, out, " ".join(err.split())

    status, out, err = calibrated("--json")
    assert status == 0
    assert json.loads(out)["drift"]["moved_mm"]["m"] > 0.1
    assert "The set-up moved while it was measured" in err
    status, out, err = calibrated("--json", "--drift", "none")
    assert status == 0
    assert json.loads(out)["drift"] is None
    assert "moved while" not in err
    status, _, err = calibrated("--drift", "some")
    assert status == 2
    assert 'drift: "some" is not known. Either auto or none' in err


def test_the_report_shows_how_the_set_up_moved(settled):
    made = report(settled)
    told = {advice.kind: advice.words for advice in made.advice}
    assert "moved by 0.1" in told["warm_up"]
    (says,) = [says for title, says in made.figures if title.startswith("How the set-up moved")]
    first = int(re.findall(rf"first (\d+) of {ROWS} rows", says)[0])
    assert ROWS / 15 < first < ROWS / 3, "half of it took an eighth of the session"
    assert drift_of(settled).words in words_of(made.html)
    without = report(settled.without_rows())
    assert not [title for title, _ in without.figures if title.startswith("How the set-up moved")]
    assert "warm_up" in {advice.kind for advice in without.advice}


def test_the_time_is_that_of_all_fits(measured, monkeypatch):
    """Each of which takes a second here."""
    arm, _, data = measured
    made = []

    def counted(task, rows, *known):
        made.append(len(rows))
        return replace(fit_rows(task, rows, *known), seconds={"constant": 1.0, "variable": 1.0})

    monkeypatch.setattr(drifting, "fit_rows", counted)
    calibration = ta.calibrate(arm.robot, data, refit=False)
    assert len(made) > 1
    assert calibration.seconds == {"constant": len(made), "variable": len(made)}
