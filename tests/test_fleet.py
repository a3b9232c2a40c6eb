"""Fleets: the file, what needs attention, drift, what is kept, and a cluster whose worker is killed."""

import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager
from typing import Any

import dask
import numpy as np
import pytest
from distributed import LocalCluster

import truearm as ta
from tests.in_process import in_this_process
from tests.report_support import figures_of
from truearm.errors import InputError, UsageError
from truearm.fleet import Fleet, run_fleet, running
from truearm.fleet.attention import Reason, order, reasons
from truearm.fleet.drift import MOVED, drift_of
from truearm.fleet.fleet_file import LimitsSection
from truearm.fleet.inputs import find_inputs
from truearm.fleet.page import fleet_page
from truearm.fleet.rows import Judged
from truearm.simulation import Imperfections, VirtualArm

POSES = 60
HEAD = """
[defaults]
robot = "ur10"
measurements = "{arm}.csv"
model = "constant"
report = false
"""
FIRST = HEAD + "".join(f'[[arm]]\nname = "{name}"\n' for name in ("R1", "R2", "R3"))
STEADY = Imperfections(share=0.0)


def arms(*names, **more):
    """Sections of arms; `more` holds lines of single ones."""
    return "".join(f'[[arm]]\nname = "{name}"\n{more.get(name, "")}\n' for name in names)


def table(seed, day):
    arm = VirtualArm(ta.Robot.load("ur10"), seed=seed, imperfections=STEADY)
    return arm.measure_table(arm.poses(POSES, seed=day), seed=day)


@pytest.fixture(scope="module", autouse=True)
def without_workers():
    """Arms are calibrated in this process, but for those that a cluster is asked for."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(running, "run_tasks", in_this_process)
        yield


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    """Measurements of three arms on two days; between them R3 became another arm."""
    folder = tmp_path_factory.mktemp("plant")
    for name, seed, later in (("R1", 1, 1), ("R2", 2, 2), ("R3", 3, 4)):
        table(seed, 0).to_csv(folder / f"{name}.csv", index=False)
        table(later, 1).to_csv(folder / f"{name}-later.csv", index=False)
    return folder


@pytest.fixture(scope="module")
def runs(plant):
    """The fleet of the first day and of the second, which knows the first."""
    first = run_fleet(Fleet.from_toml(FIRST, folder=plant), plant / "first", workers=1)
    later = HEAD.replace("{arm}.csv", "{arm}-l*.csv") + 'previous = "first/{arm}/calibration.calib"\n'
    text = later + arms("R1", "R2", "R3", "R4")
    return first, run_fleet(Fleet.from_toml(text, folder=plant), plant / "second", workers=1)


def test_a_program_without_a_guard_runs_a_fleet(plant, tmp_path):
    (tmp_path / "fleet.toml").write_text(HEAD.replace("{arm}", str(plant / "{arm}")) + arms("R1", "R2"))
    text = (
        "from truearm.fleet import Fleet, run_fleet\n"
        "run = run_fleet(Fleet.load('fleet.toml'), 'results', workers=2)\n"
        "print([arm.verdict for arm in run.arms])\n"
    )
    (tmp_path / "program.py").write_text(text)
    command = [sys.executable, "program.py"]
    done = subprocess.run(command, check=False, cwd=tmp_path, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("['good', 'good']\n", "")


@pytest.fixture
def again(plant, runs, tmp_path):
    """A copy of the first day's results."""
    return shutil.copytree(plant / "first", tmp_path / "again")


def by_name(run):
    return {arm.row["arm"]: arm for arm in run.arms}


def test_arms_that_need_attention_come_first(runs):
    first, second = runs
    assert [arm.verdict for arm in first.arms] == ["good"] * 3
    assert [(arm.row["arm"], arm.verdict) for arm in second.arms] == [
        ("R4", "failed"),
        ("R3", "attention"),
        ("R1", "good"),
        ("R2", "good"),
    ]
    assert "no file is like this" in by_name(second)["R4"].reasons[0].words
    assert second.failed == 1


def test_drift_is_what_changed_and_not_noise(runs, plant):
    found = {name: arm.row["drift"] for name, arm in by_name(runs[1]).items() if name != "R4"}
    one, other = (VirtualArm(ta.Robot.load("ur10"), seed=seed, imperfections=STEADY) for seed in (3, 4))
    q = ta.Measurements.read_csv(plant / "R3-later.csv").readings
    true_mm = 1e3 * np.linalg.norm(one.true_position(q) - other.true_position(q), axis=1)
    assert 0.5 < found["R3"]["mean_mm"] / true_mm.mean() < 2.0, "but for what belongs to base and target"
    assert found["R3"]["share_beyond"] == 1.0
    first = {name: arm.row["mean_mm"] for name, arm in by_name(runs[0]).items()}
    assert {name: drift["previous_mean_mm"] for name, drift in found.items()} == first
    assert found["R3"]["moved"]
    assert min(entry["standard_errors"] for entry in found["R3"]["moved"]) > MOVED
    for name in ("R1", "R2"):
        assert found[name]["moved"] == []
        assert found[name]["share_beyond"] < 0.1
        assert found[name]["mean_mm"] < 2.0 * found[name]["std_mm"]


def test_an_arm_that_did_not_change_did_not_drift(plant, runs):
    calibration = ta.Calibration.load(plant / "first" / "R1" / "calibration.calib")
    data = ta.Measurements.read_csv(plant / "R1.csv")
    found = drift_of(calibration, calibration, data)
    assert (found["mean_mm"], found["max_mm"], found["moved"]) == (0.0, 0.0, [])
    assert found["poses"] == POSES


def test_the_files_of_a_fleet_say_the_same(runs, plant):
    folder = plant / "second"
    content = json.loads((folder / "fleet.json").read_text())
    assert content == runs[1].content
    assert content["counts"] == {"good": 2, "attention": 1, "failed": 1}
    lines = list(csv.DictReader((folder / "fleet.csv").read_text().splitlines()))
    assert [line["arm"] for line in lines] == [arm["arm"] for arm in content["arms"]]
    for line, arm in zip(lines, content["arms"], strict=True):
        assert line["verdict"] == arm["verdict"]
        if arm["status"] == "done":
            assert float(line["mean_mm"]) == arm["mean_mm"]
            assert line["errors_of"] == arm["errors_of"] == "position"
            assert arm["drift"]["previous_errors_of"] == "position"
            assert float(line["drift_mean_mm"]) == arm["drift"]["mean_mm"]
    page = (folder / "fleet.html").read_text()
    for words in ("2 of 4 arms are good, 1 needs attention, 1 could not be calibrated.", "R3"):
        assert words in page


def test_each_arm_has_its_calibration(runs, plant):
    alone = ta.calibrate(
        ta.Robot.load("ur10"), ta.Measurements.read_files([plant / "R1.csv"]), model="constant"
    )
    made = ta.Calibration.load(plant / "first" / "R1" / "calibration.calib")
    q = alone.robot.limits.mean(axis=1)
    assert np.array_equal(made.position(q), alone.position(q))
    summary = json.loads((plant / "first" / "R1" / "summary.json").read_text())
    assert summary["data_sha256"] == alone.summary["data_sha256"]


def test_finished_arms_are_not_done_again(plant, again):
    written = {path: path.stat().st_mtime_ns for path in again.glob("*/calibration.calib")}
    assert run_fleet(Fleet.from_toml(FIRST, folder=plant), again).done_before == len(written) == 3
    assert {path: path.stat().st_mtime_ns for path in written} == written
    (again / "R1" / "calibration.calib").write_bytes(b"altered")
    (again / "R2" / "arm.json").unlink()
    other = FIRST.replace('name = "R3"', 'name = "R3"\nseed = 8')
    assert run_fleet(Fleet.from_toml(other, folder=plant), again, workers=1).done_before == 0
    assert run_fleet(Fleet.from_toml(other, folder=plant), again).done_before == 3
    (again / "R1" / "summary.json").unlink()
    assert run_fleet(Fleet.from_toml(other, folder=plant), again, workers=1).done_before == 2
    assert (again / "R1" / "summary.json").is_file()


def test_progress_says_that_it_counts_the_arms_that_are_left(plant, again):
    named = []

    @contextmanager
    def stages(name):
        named.append(name)
        yield

    (again / "R1" / "arm.json").unlink()
    run_fleet(Fleet.from_toml(FIRST, folder=plant), again, workers=1, stages=stages)
    assert named == ["looking for what is done", "arm 1 of 1 that are left"]


def test_limits_can_be_changed_without_new_fits(plant, again):
    strict = Fleet.from_toml(FIRST + "[limits]\nmean_mm = 1e-3\nmax_mm = 1e-3\n", folder=plant)
    run = run_fleet(strict, again)
    assert run.done_before == 3
    assert [reason.kind for reason in run.arms[0].reasons] == ["mean", "max"]


def test_what_each_arm_fails_with_is_said(plant, runs, tmp_path):
    (tmp_path / "R2.txt").write_text("no calibration")
    small = VirtualArm.paper(seed=2)
    small.measure_table(small.poses(POSES)).to_csv(tmp_path / "R6.csv", index=False)
    bad = {
        "R1": 'robot = "ur99"',
        "R2": f'previous = "{tmp_path / "R2.txt"}"',
        "R3": 'robot = "rv-m2"',
        "R4": f'measurements = "R1.csv"\nprevious = "{tmp_path}/out/R4/calibration.calib"',
        "R5": 'measurements = ["R1.csv", "R1.csv"]',
        "R6": f'robot = "rv-m2"\nmeasurements = "{tmp_path}/R6.csv"\nprevious = "first/R1/calibration.calib"',
    }
    run = run_fleet(Fleet.from_toml(HEAD + arms(*bad, **bad), folder=plant), tmp_path / "out", workers=1)
    words = {name: arm.row["error"] for name, arm in by_name(run).items()}
    for name, said in {
        "R1": 'no robot "ur99"',
        "R2": "R2.txt: this is no calibration file",
        "R3": "5 joints",
        "R4": "It would be lost",
        "R5": "named twice",
        "R6": "this is a calibration of UR10, with 6 joints. The arm has 5",
    }.items():
        assert said in words[name]
    assert run.traces == {}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", 'key "arm" is missing'),
        ("[[arm]", "not TOML"),
        ("arm = []", "arm: [] cannot be used. Must not be empty"),
        (
            arms("R1"),
            'arm "R1": key "robot" is missing. Each arm has a robot and measurements. Give it there or',
        ),
        (HEAD + arms("R1", R1="modle = 3"), 'arm "R1": unknown key "modle". Did you mean "model"'),
        (
            HEAD + arms("R1", R1='model = "fuzzy"'),
            'arm "R1", model: "fuzzy" is not known. Either variable or',
        ),
        (HEAD + arms("R1", R1='holdout = "0.3"'), "arm \"R1\", holdout: '0.3' cannot be used"),
        (
            HEAD + arms("R1", R1="holdout = 3"),
            'arm "R1": the share to hold out is 3. It must be between 0 and 1',
        ),
        (HEAD + arms("R1", R1="seed = 1.5"), 'arm "R1", seed: 1.5 cannot be used. Must be a whole number'),
        (HEAD + arms("R1", R1="measurements = 3"), "measurements: 3 cannot be used. Must be a list"),
        (HEAD + arms("R1", "r1"), 'the name "R1" is given twice'),
        (HEAD + arms("../R1"), '"../R1" cannot be the name of an arm. It names a directory'),
        (HEAD + arms("fleet.csv"), '"fleet.csv" cannot be the name of an arm'),
        (HEAD + "name = 'x'\n" + arms("R1"), 'defaults: unknown key "name"'),
        (HEAD + arms("R1") + "[limits]\nmean_mm = 0", "limits, mean_mm: 0 cannot be used"),
    ],
)
def test_a_bad_fleet_file_is_told_with_key_and_rule(text, words):
    with pytest.raises(InputError) as told:
        Fleet.from_toml(text, where="plant.toml")
    assert str(told.value).startswith("plant.toml")
    assert words in str(told.value)


ROW: dict[str, Any] = {
    "arm": "R1",
    "status": "done",
    "robot": "UR10",
    "model": "variable",
    "rows": 100,
    "errors_of": "position",
    "mean_mm": 0.1,
    "max_mm": 0.3,
    "noise_mm": 0.03,
    "floor_mm": 0.05,
    "nominal_mean_mm": 1.0,
    "nominal_max_mm": 2.0,
    "coverage_95": 0.95,
    "outliers": 0,
    "drift": None,
    "grave": [],
}
DRIFT = {
    "mean_mm": 0.2,
    "max_mm": 0.5,
    "std_mm": 0.3,
    "share_beyond": 0.0,
    "moved": [],
    "previous_errors_of": "position",
}
SURE = {**DRIFT, "share_beyond": 0.9}


@pytest.mark.parametrize(
    ("changed", "limits", "kinds"),
    [
        ({}, {}, []),
        ({"nominal_mean_mm": 0.09}, {}, ["no_gain"]),
        ({"grave": ["It is another robot."]}, {}, ["doubt"]),
        ({"outliers": 3}, {}, ["outliers"]),
        ({"coverage_95": 0.5}, {}, ["intervals"]),
        ({"coverage_95": None}, {}, []),
        ({}, {"mean_mm": 0.05, "max_mm": 0.4}, ["mean"]),
        ({"drift": DRIFT}, {}, []),
        ({"drift": SURE}, {}, ["drift"]),
        ({"drift": SURE}, {"drift_mm": 0.5}, []),
        ({"drift": DRIFT}, {"drift_mm": 0.1}, ["drift"]),
        ({"drift": {**DRIFT, "share_beyond": None}}, {}, []),
        ({"drift": {**DRIFT, "previous_mean_mm": 0.04}}, {}, ["worse"]),
        ({"drift": {**DRIFT, "previous_mean_mm": 0.06}}, {}, []),
        ({"drift": {**DRIFT, "previous_mean_mm": 0.04}}, {"mean_mm": 0.2}, []),
    ],
)
def test_reasons(changed, limits, kinds):
    row = {**ROW, **changed}
    found = reasons(row, [row], LimitsSection(**limits))
    assert [reason.kind for reason in found] == kinds


@pytest.mark.parametrize(
    ("floor", "undecided", "said"),
    [
        (1.6, "", "There is nothing to gain"),
        (0.05, "", "The calibration does not help"),
        (0.05, "5 held-out poses do not tell", "5 held-out poses do not tell"),
    ],
)
def test_an_arm_that_does_not_gain_is_told_why(floor, undecided, said):
    row = {**ROW, "nominal_mean_mm": 1.69, "mean_mm": 1.7, "floor_mm": floor, "undecided": undecided}
    (found,) = reasons(row, [row], LimitsSection())
    assert found.words.startswith(said)


def test_what_noise_alone_would_leave_holds_the_sigma_of_rows(tmp_path):
    rows = table(1, 0)
    rows.to_csv(tmp_path / "silent.csv", index=False)
    rows.assign(sigma_mm=3.0).to_csv(tmp_path / "stated.csv", index=False)
    text = HEAD + arms("silent", "stated")
    found = by_name(run_fleet(Fleet.from_toml(text, folder=tmp_path), tmp_path / "out", workers=1))
    assert found["silent"].row["floor_mm"] < 1.0
    assert found["stated"].row["floor_mm"] > 3.0


@pytest.mark.parametrize("pattern", ["o*.csv", "{folder}/nov/o*.csv"])
def test_a_folder_with_brackets_is_no_pattern(tmp_path, pattern):
    folder = tmp_path / "a [1]"
    (folder / "nov").mkdir(parents=True)
    (tmp_path / "nov").mkdir()
    for place in (folder, tmp_path / "nov"):
        (place / "oct.csv").write_text("q1\n")
    text = HEAD + f'[[arm]]\nname = "R1"\nmeasurements = "{pattern.format(folder=tmp_path)}"\n'
    (entry,) = Fleet.from_toml(text, folder=folder).arms
    found = find_inputs(entry, tmp_path / "out").files
    assert found == ((folder if pattern == "o*.csv" else tmp_path / "nov") / "oct.csv",)


def test_a_single_outlier_is_named_with_the_error_that_it_may_make():
    spoilt = {**ROW, "rows": 50, "mean_mm": 1.191, "nominal_mean_mm": 5.0, "outliers": 1}
    spoilt |= {"outliers_named": "row 10 (17.37 mm)", "drift": {**DRIFT, "previous_mean_mm": 0.107}}
    (found,) = reasons(spoilt, [], LimitsSection())
    assert found.kind == "worse"
    assert found.words.endswith("it was 0.107 mm. 1 of 50 rows is an outlier: row 10 (17.37 mm).")
    assert reasons({**ROW, "outliers": 1}, [], LimitsSection()) == []
    both = reasons({**spoilt, "outliers": 2}, [], LimitsSection(max_mm=0.2))
    assert [("row 10" in reason.words, reason.kind) for reason in both] == [
        (False, "max"),
        (False, "worse"),
        (True, "outliers"),
    ]


def test_outliers_are_named_on_the_page_which_may_have_no_report_to_look_into(tmp_path):
    rows = table(1, 0)
    rows.loc[[6, 20], "z"] += 0.05
    rows.to_csv(tmp_path / "R1.csv", index=False)
    run = run_fleet(Fleet.from_toml(HEAD + arms("R1"), folder=tmp_path), tmp_path / "out", workers=1)
    words = next(reason.words for reason in run.arms[0].reasons if reason.kind == "outliers")
    assert words.startswith("2 of 60 rows are outliers: row ")
    assert {"row 7 (", "row 21 ("} <= set(re.findall(r"row \d+ \(", words))
    assert words in (tmp_path / "out" / "fleet.html").read_text()


def test_an_error_that_grew_is_told_with_what_it_was():
    row = {**ROW, "drift": {**DRIFT, "previous_mean_mm": 0.03}}
    (found,) = reasons(row, [row], LimitsSection())
    assert found.words == "Mean error 0.100 mm on held-out rows: it was 0.030 mm."


def test_an_error_beyond_its_limit_is_told_as_larger():
    row = {**ROW, "mean_mm": 0.15004}
    (found,) = reasons(row, [row], LimitsSection(mean_mm=0.15))
    assert "Mean error 0.15004 mm on held-out rows, beyond 0.15 mm." in found.words


def test_a_failed_arm_does_not_lead_to_the_report_of_an_earlier_run(plant, again):
    (again / "R1" / "report.html").write_text("earlier")
    text = HEAD + arms("R1", "R2", R1='robot = "ur99"')
    run = run_fleet(Fleet.from_toml(text, folder=plant), again, workers=1)
    failed = by_name(run)["R1"]
    assert failed.row["earlier"] == ["calibration.calib", "summary.json", "report.html"]
    assert "results of an earlier run: calibration.calib" in failed.reasons[0].words
    assert 'href="R1/report.html"' not in (again / "fleet.html").read_text()


def test_a_page_of_many_long_names_keeps_its_figures(runs, plant):
    first = by_name(runs[0])["R1"]
    names = [f"{number:02d} {'line ' * 12}{number:02d}" for number in range(9)]
    reason = Reason("failed", "It stopped.", 1.0)
    many = [Judged(first.row | {"arm": name}, (reason,)) for name in names]
    page = fleet_page(Fleet.from_toml(FIRST, folder=plant), many, [])
    assert "4 more arms need attention." in page
    layout = figures_of(page)["figures"][0]["layout"]
    assert layout["xaxis"]["tickvals"] == names
    assert len(set(layout["xaxis"]["ticktext"])) == len(names)
    assert max(map(len, layout["xaxis"]["ticktext"])) <= 18
    assert layout["yaxis"]["type"] == "log"
    assert layout["yaxis"]["ticktext"]
    assert page.count('class="left long"') == len(names)


def test_an_arm_stands_out_of_its_kind():
    fleet = [{**ROW, "mean_mm": mean} for mean in (0.1, 0.11, 0.09, 0.3)]
    assert [[r.kind for r in reasons(row, fleet, LimitsSection())] for row in fleet] == [
        [],
        [],
        [],
        ["stands_out"],
    ]
    others = [{**row, "robot": name} for row, name in zip(fleet, "abcd", strict=True)]
    assert [reasons(row, others, LimitsSection()) for row in others] == [[]] * 4


def test_the_worst_come_first():
    rows: list[dict[str, Any]] = [
        {**ROW, "outliers": 5},
        ROW,
        {**ROW, "drift": SURE},
        {"arm": "x", "status": "failed", "error": "no"},
    ]
    places = [order(reasons(row, rows, LimitsSection())) for row in rows]
    assert sorted(range(4), key=lambda k: places[k]) == [3, 2, 0, 1]


def test_unsure_drift_beyond_a_limit_asks_for_more_poses():
    (found,) = reasons({**ROW, "drift": DRIFT}, [], LimitsSection(drift_mm=0.1))
    assert "measure more poses" in found.words


def test_results_cannot_go_where_a_file_is(plant):
    with pytest.raises(InputError, match=r"R1\.csv: a file is in the way"):
        run_fleet(Fleet.from_toml(FIRST, folder=plant), plant / "R1.csv")


def test_both_a_scheduler_and_workers_are_refused(plant, tmp_path):
    with pytest.raises(UsageError, match="both"):
        run_fleet(Fleet.from_toml(HEAD + arms("R1"), folder=plant), tmp_path, scheduler="a:1", workers=1)


def test_a_worker_of_the_cluster_is_killed_in_the_middle(plant, runs, tmp_path):
    names = [f"A{k}" for k in range(5)]
    stated = {name: f'measurements = "R{1 + k % 3}.csv"' for k, name in enumerate(names)}
    fleet = Fleet.from_toml(HEAD + arms(*names, **stated), folder=plant)
    with (
        dask.config.set({"distributed.comm.timeouts.connect": "1s"}),
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50) as cluster,
    ):
        first = cluster.workers[0].pid

        @contextmanager
        def stages(name):
            if name == "arm 2 of 5":
                os.kill(first, signal.SIGKILL)
            yield

        run = run_fleet(fleet, tmp_path, scheduler=cluster.scheduler_address, stages=stages)
    with pytest.raises(ProcessLookupError):
        os.kill(first, 0)
    assert [arm.verdict for arm in run.arms] == ["good"] * 5
    found, local = (
        [ta.Calibration.load(f) for f in files]
        for files in (
            [tmp_path / name / "calibration.calib" for name in names],
            [plant / "first" / f"R{1 + k % 3}" / "calibration.calib" for k in range(5)],
        )
    )
    for one, other in zip(found, local, strict=True):
        assert np.array_equal(one.model.constants, other.model.constants)
