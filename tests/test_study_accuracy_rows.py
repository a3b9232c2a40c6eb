"""`truearm study accuracy`: which rows train, which are judged, and which cannot be asked for."""

import json
from dataclasses import replace
from typing import cast

import numpy as np
import pandas as pd
import pytest

from truearm.cli import main
from truearm.robot import Robot
from truearm.simulation import VirtualArm
from truearm.studies.accuracy import running, summary
from truearm.studies.accuracy.cells import Asked, check_askable, list_cells
from truearm.studies.accuracy.judging import Job
from truearm.studies.accuracy.methods.searching import folds
from truearm.studies.accuracy.page import page
from truearm.studies.accuracy.poses import Poses, prepare
from truearm.studies.accuracy.results import Kept
from truearm.studies.accuracy.running import Study
from truearm.studies.accuracy.sets import parse_sets, read_set
from truearm.studies.accuracy.splits import FEWEST_JUDGED, KINDS, Kind, cuts, divide
from truearm.workers import Done

POSES = 60
ALL = Asked(KINDS, (), ("20", "all"), (7, 0))


@pytest.fixture(scope="module")
def table():
    """One target of a virtual UR10."""
    arm = VirtualArm(Robot.load("ur10"), seed=3)
    return arm.measure_table(arm.poses(POSES))


@pytest.fixture
def read_as(tmp_path):
    """A set of a table."""

    def made(table):
        table.to_csv(tmp_path / "arm.csv", index=False)
        return parse_sets([f"ur10={tmp_path / 'arm.csv'}"], None)[0]

    return made


@pytest.fixture
def here(monkeypatch):
    """Tasks are done in this process."""

    def run_tasks(function, items, **_):
        for index, item in enumerate(items):
            yield Done(index, value=function(item))

    monkeypatch.setattr(running, "run_tasks", run_tasks)


def _twice(table):
    """The poses there and back, the last in one visit, with readings that differ by next to nothing."""
    again = table.iloc[::-1].copy()
    again[[f"q{j}" for j in range(1, 7)]] += 5e-5
    return pd.concat([table, again], ignore_index=True)


def _two_targets(table, first, second):
    """Rows that hold target 1 where `first` says so, and target 2 where `second` does."""
    found = table.assign(**{f"{axis}2": table[axis] + 0.05 for axis in "xyz"})
    found.loc[~first, list("xyz")] = np.nan
    found.loc[~second, [f"{axis}2" for axis in "xyz"]] = np.nan
    return found


def test_rows_of_a_pose_are_on_one_side(table, read_as):
    one = read_as(_twice(table))
    pose = read_set(one).pose
    assert len(set(pose.tolist())) == POSES
    for cut in cuts(read_set(one), KINDS, (), 0):
        split = divide(one, cut, 7)
        assert not set(pose[split.train]) & set(pose[split.holdout])
        assert len(split.train) + len(split.holdout) == 2 * POSES - 1


def test_rows_of_a_pose_are_in_one_fold():
    joints = np.repeat(np.arange(20.0)[:, None], 5, axis=0) + 1e-6 * np.arange(100)[:, None]
    found = folds(cast(Poses, _Sized(joints)), 0)
    assert len(found) == 4
    for fit, judge in found:
        assert not set(fit // 5) & set(judge // 5)
        assert len(fit) + len(judge) == 100


class _Sized:
    """Poses of which only the joint values are looked at."""

    def __init__(self, joints):
        self.joints = joints

    def __len__(self):
        return len(self.joints)


def test_shots_of_a_visit_are_one_row_for_all_methods(table, read_as):
    shots = table.loc[np.repeat(np.arange(POSES), 3)].reset_index(drop=True)
    shots["x"] += np.tile([-1e-5, 0.0, 1e-5], POSES)
    read = read_set(read_as(shots))
    assert len(read.data) == POSES
    assert np.allclose(read.data.targets[:, 0], table[list("xyz")])
    assert [notice.kind for notice in read.notices][-1] == "one_row_a_visit"


def test_a_joint_that_never_moved_has_no_tail(table, read_as):
    one = read_as(table.assign(q6=0.3))
    tails = [cell for cell in list_cells([one], ALL) if cell.cut.kind == "tails"]
    assert {cell.cut.detail[:2] for cell in tails} == {f"q{joint}" for joint in range(1, 6)}


def test_what_a_set_does_not_allow_is_left_out_and_named(table, read_as):
    one = read_as(table.assign(q6=np.where(np.arange(POSES) < POSES - 6, 0.3, 0.6)))
    found = [str(notice) for notice in check_askable([one], ALL)]
    (words,) = [text for text in found if "q6" in text]
    assert words.startswith("Left out of arm: tails of joints held out q6:")
    assert "no row would be left to train on" in words
    assert "--" not in words
    assert any(cell.cut.kind == "random" for cell in list_cells([one], ALL))


def test_a_set_up_at_the_end_of_a_joint_stops_no_study(table, read_as):
    east = table["q1"] > table["q1"].quantile(0.85)
    one = read_as(table.assign(group=np.where(east, "east", "west")))
    (cell, *_) = (each for each in list_cells([one], ALL) if each.cut.detail.startswith("q1:high"))
    prepared = prepare(cell)
    assert set(prepared.held.group) == {"west"}
    assert len(prepared.held) == 9


def test_sizes_are_of_rows_that_hold_the_fitted_target(table, read_as):
    even = np.arange(POSES) % 2 == 0
    one = read_as(_two_targets(table, ~even, even))
    cells = list_cells([one], ALL)
    assert cells
    for cell in cells:
        if cell.cut.kind == "random":
            assert len(prepare(cell).train) == cell.poses
            assert np.isfinite(prepare(cell).held.targets[:, 0]).all()


def test_a_target_of_few_rows_is_not_judged(table, read_as):
    one = read_as(_two_targets(table, np.ones(POSES, dtype=bool), np.arange(POSES) < 5))
    assert not any(cell.cut.kind == "target" for cell in list_cells([one], ALL))
    (words,) = [str(notice) for notice in check_askable([one], ALL) if "another target" in str(notice)]
    assert "held-out row" in words
    for cell in list_cells([one], ALL):
        assert len(prepare(cell).held) >= FEWEST_JUDGED


def test_targets_of_set_ups_of_their_own_are_not_judged(table, read_as):
    even = np.arange(POSES) % 2 == 0
    own = _two_targets(table, even, ~even).assign(group=np.where(even, "a", "b"))
    assert not any(cell.cut.kind == "target" for cell in list_cells([read_as(own)], ALL))


def test_what_changes_the_rows_changes_what_a_result_is_known_by(table, read_as):
    one = read_as(table)
    heads = [Job(cell, "grid").head("grid") for cell in list_cells([one], ALL)]
    assert len({head["rows"] for head in heads}) == len(heads)


def _run(method, seed, mean=None):
    known = {"set": "s", "split": "random", "detail": "", "size": "100", "seed": seed, "method": method}
    if mean is None:
        return {**known, "failed": "ill conditioned"}
    errors = dict.fromkeys(("mean_mm", "rms_mm", "p95_mm", "p99_mm", "max_mm"), mean)
    return {**known, "n_train": 100, "n_holdout": 40, "errors": errors}


def test_methods_are_compared_over_the_runs_that_both_have():
    study = Study((), ALL, ("ours", "regions", "constant"))
    means = {"ours": (0.05, 0.5, 0.6), "regions": (0.10, None, None), "constant": (0.2, 1.0, 1.2)}
    records = [_run(name, seed, mean) for name, each in means.items() for seed, mean in enumerate(each)]
    group = summary._group(study, records, ("s", "random", "100"))
    assert group is not None
    assert group["lead"]["best"] in ("regions", "constant")
    assert group["lead"]["ratio"] == pytest.approx(0.5)
    assert group["methods"]["regions"]["runs"] == 1
    assert (group["runs"], group["n_holdout"]) == (3, 40)
    told = {"version": "1", "versions": {"1": 9}, "asked": 9, "there": 7, "failed": 2, "sizes": ["100"]}
    text = page({**told, "sets": {"s": {"robot": "ur10", "rows": 99}}, "groups": [group], "results": []})
    assert "| regional CEPs | 0.100 (1 of 3) |" in text
    assert "| constant D-H | 1.000 |" in text
    assert "| variable D-H (ours) | **0.500** |" in text


def test_splits_that_are_named_and_not_possible_are_told(table, read_as):
    one = read_as(table.assign(place=np.arange(POSES)))
    stated: tuple[Kind, ...] = ("groups", "target")
    asked = Asked((*stated, "random"), ("place",), ("20",), (7,))
    assert check_askable([one], asked) == []
    assert [str(notice) for notice in check_askable([one], replace(asked, stated=stated))] == [
        'Left out of arm: whole groups held out, because few of its rows are equal to others in "place".',
        "Left out of arm: judged at another target, because one target was measured.",
    ]


def _study(file, out, *more):
    given = ["--methods", "nominal,constant", "--sizes", "5", "--seeds", "1", "--splits", "random"]
    return main(["study", "accuracy", f"ur10={file}", "-o", str(out), *given, *more])


def test_failures_are_no_results_and_a_set_of_failures_is_one(table, tmp_path, here, capsys):
    table.to_csv(tmp_path / "arm.csv", index=False)
    assert _study(tmp_path / "arm.csv", tmp_path / "out") == 1
    told = capsys.readouterr()
    assert "0 of 2 results are there" in told.out
    assert 'nothing could be fitted to the set "arm"' in " ".join(told.err.split())
    assert json.loads((tmp_path / "out" / "accuracy.json").read_text())["failed"] == 2


def test_results_keep_the_version_that_found_them(table, tmp_path, here):
    table.to_csv(tmp_path / "arm.csv", index=False)
    out, sized = tmp_path / "out", ("--sizes", "30")
    assert _study(tmp_path / "arm.csv", out, *sized) == 0
    lines = [json.loads(line) for line in (out / "results.jsonl").read_text().splitlines()]
    (out / "results.jsonl").write_text(
        "".join(json.dumps({**one, "version": "0.0.9"}) + "\n" for one in lines)
    )
    assert _study(tmp_path / "arm.csv", out, *sized, "--again", "nominal") == 0
    versions = {record["method"]: record["version"] for record in Kept(out).records.values()}
    assert versions["constant"] == "0.0.9" != versions["nominal"]
    assert "Versions that found the results: 0.0.9 (1)" in (out / "accuracy.md").read_text()
