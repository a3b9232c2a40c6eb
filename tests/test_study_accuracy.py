"""`truearm study accuracy`, as a user runs it: results, going on, splits, and what is refused."""

import json
from itertools import islice

import numpy as np
import pytest

from truearm.cli import main
from truearm.errors import InputError, UsageError
from truearm.robot import Robot
from truearm.simulation import VirtualArm
from truearm.studies.accuracy import judging, libraries, running
from truearm.studies.accuracy.cells import Asked, list_cells, parse_sizes, study_seeds
from truearm.studies.accuracy.page import page
from truearm.studies.accuracy.results import MARK, Kept, key_of
from truearm.studies.accuracy.sets import parse_sets, read_set
from truearm.studies.accuracy.splits import KINDS, Cut, cuts, divide
from truearm.workers import Done

POSES = 80
FAST = ["--methods", "nominal,constant,grid", "--sizes", "20,30", "--seeds", "2", "--quick"]


@pytest.fixture(scope="module")
def table():
    arm = VirtualArm(Robot.load("ur10"), seed=3)
    table = arm.measure_table(arm.poses(POSES))
    return table.assign(**{f"{axis}2": table[axis] for axis in "xyz"}, place=np.arange(POSES) // 4)


@pytest.fixture
def file(table, tmp_path):
    path = tmp_path / "arm.csv"
    table.to_csv(path, index=False)
    return path


@pytest.fixture
def here(monkeypatch):
    """Tasks are done in this process, and counted."""
    ran = []

    def run_tasks(function, items, **_):
        for index, item in enumerate(items):
            ran.append(item.method)
            yield Done(index, value=function(item))

    monkeypatch.setattr(running, "run_tasks", run_tasks)
    return ran


def study(file, out, *more):
    return main(["study", "accuracy", f"ur10={file}", "-o", str(out), *more])


def test_a_user_gets_tables_curves_and_results(file, tmp_path, capsys):
    out = tmp_path / "out"
    given = ["--methods", "nominal,constant", "--sizes", "30", "--seeds", "1", "--splits", "random,clusters"]
    assert study(file, out, *given, "--workers", "1", "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((out / "accuracy.json").read_text())
    names = {path.name for path in out.iterdir()}
    stems = ("learning_curves.png", "learning_curves.svg")
    assert names == {"accuracy.json", "accuracy.md", "results.jsonl", *stems}
    assert printed["asked"] == printed["there"] == 4
    for kept in map(json.loads, (out / "results.jsonl").read_text().splitlines()):
        assert all(float(f"{value:.5g}") == value for value in (*kept["errors"].values(), kept["fit_s"]))
    for group in printed["groups"]:
        assert group["methods"]["constant"]["mean_mm"] < group["methods"]["nominal"]["mean_mm"]
    assert "clusters of joint space held out" in (out / "accuracy.md").read_text()


def test_an_interrupted_study_goes_on(file, tmp_path, here, capsys):
    out = tmp_path / "out"
    assert study(file, out, *FAST, "--splits", "random") == 0
    done, lines = len(here), (out / "results.jsonl").read_text().splitlines(keepends=True)
    assert done == len(lines) == 3 * 2 * 2
    (out / "results.jsonl").write_text("".join(lines[:5]) + lines[5][:40])
    assert study(file, out, *FAST, "--splits", "random", "--so-far") == 0
    assert "5 of 12 results are there, 0 of them found now" in capsys.readouterr().out
    page = (out / "accuracy.md").read_text()
    assert study(file, out, *FAST, "--sizes", "40", "--splits", "random", "--so-far") == 1
    assert "Give --so-far the files and options of the study" in capsys.readouterr().err
    assert (out / "accuracy.md").read_text() == page
    assert study(file, out, *FAST, "--splits", "random") == 0
    assert len(here) - done == done - 5
    again = [json.loads(line) for line in (out / "results.jsonl").read_text().splitlines()]
    assert {_but_times(one) for one in again} == {_but_times(json.loads(line)) for line in lines}
    assert study(file, out, *FAST, "--splits", "random", "--again", "grid") == 0
    assert here[-4:] == ["grid"] * 4


def _kept(out):
    """Lines of the results, by what they are known by."""
    lines = (out / "results.jsonl").read_text().splitlines()
    found = {key_of(json.loads(line)): line for line in lines}
    assert len(found) == len(lines)
    return found


def test_only_what_is_asked_is_found_anew(file, tmp_path, here):
    out = tmp_path / "out"
    assert study(file, out, *FAST, "--splits", "random") == 0
    before = _kept(out)
    asked = ["--methods", "constant,grid", "--sizes", "20", "--seeds", "1", "--quick", "--splits", "random"]
    del here[:]
    assert study(file, out, *asked, "--again", "grid") == 0
    assert here == ["grid"]
    after = _kept(out)
    assert after.keys() == before.keys()
    assert sum(after[key] != before[key] for key in before) == 1


def test_a_run_that_finds_results_anew_goes_on(file, tmp_path, here, monkeypatch, capsys):
    out, given = tmp_path / "out", [*FAST, "--splits", "random"]
    assert study(file, out, *given, "--methods", "constant") == 0
    anew = [*given, "--methods", "constant,grid", "--again", "constant,grid"]
    run_tasks = vars(running)["run_tasks"]
    monkeypatch.setattr(running, "run_tasks", lambda *args, **_: _until(run_tasks(*args), 5))
    assert study(file, out, *anew) == 130
    assert "the same command goes on with the others" in _words(capsys.readouterr().err)
    assert len(here) == 4 + 5
    monkeypatch.setattr(running, "run_tasks", run_tasks)
    assert study(file, out, *anew) == 0
    assert len(here) == 4 + 8
    results = json.loads((out / "accuracy.json").read_text())["results"]
    assert not any(MARK in result for result in results)
    assert study(file, out, *anew) == 0
    assert len(here) == 4 + 8 + 8
    assert len(_kept(out)) == 8


def _until(done, count):
    """So many of what is done, then an interruption."""
    yield from islice(done, count)
    raise KeyboardInterrupt


def test_earlier_results_stay_until_those_found_anew_are_there(file, tmp_path, here, monkeypatch, capsys):
    out, given = tmp_path / "out", [*FAST, "--splits", "random"]
    assert study(file, out, *given) == 0
    before = _kept(out)
    broken = [Done[str](index, error=RuntimeError("broken")) for index in range(4)]
    with monkeypatch.context() as patch:
        patch.setattr(running, "run_tasks", lambda *_, **__: (done for done in broken))
        assert study(file, out, *given, "--again", "grid") == 1
        told = capsys.readouterr()
        assert "8 of 12 results are there" in told.out
        assert "4 results are missing, the first of grid" in _words(told.err)
    assert _kept(out) == before
    assert study(file, out, *given, "--so-far") == 0
    assert "12 of 12 results are there" in capsys.readouterr().out


def test_what_an_interruption_leaves_is_told(file, tmp_path, monkeypatch, capsys):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(running, "conduct", interrupted)
    given = [*FAST, "--splits", "random"]
    assert study(file, tmp_path / "out", *given) == 130
    assert "There is no result yet" in capsys.readouterr().err
    (tmp_path / "out" / "results.jsonl").touch()
    assert study(file, tmp_path / "out", *given) == 130
    assert f"Results so far are in {tmp_path / 'out'}" in " ".join(capsys.readouterr().err.split())


def _words(text):
    return " ".join(text.split())


def _but_times(record):
    return json.dumps({key: record[key] for key in record if key not in ("fit_s", "predict_us")})


def test_a_method_that_cannot_be_fitted_says_why_and_stops_no_other(file, tmp_path, here, capsys):
    out = tmp_path / "out"
    given = ["--methods", "nominal,constant", "--sizes", "5,30", "--seeds", "1", "--splits", "random"]
    assert study(file, out, *given) == 0
    assert "2 of 4 results are there, 2 of them found now. 2 more could not be fitted" in _words(
        capsys.readouterr().out
    )
    text = (out / "accuracy.md").read_text()
    assert "Could not be fitted" in text
    assert "15 measured values in 5 training rows" in text
    assert str(file.parent) not in text


def test_groups_are_of_set_ups_and_joints_too(table, tmp_path, capsys):
    file, layer = tmp_path / "arm.csv", 0.5 * (np.arange(POSES) // 8)
    table.assign(group=np.where(np.arange(POSES) < 40, "east", "west"), q1=layer).to_csv(file, index=False)
    sets = parse_sets([f"ur10={file}"], None)
    for columns in (("q1",), ("group", "q1")):
        cell = list_cells(sets, Asked(("groups",), columns, ("30",), (7,)))[0]
        split = divide(sets[0], cell.cut, 7)
        assert not set(layer[split.train]) & set(layer[split.holdout])
    assert study(file, tmp_path / "out", *FAST, "--splits", "groups", "--split-by", "group") == 1
    assert "fewer than 5 held-out rows of set-ups that train" in _words(capsys.readouterr().err)


@pytest.mark.parametrize(
    ("rows", "given", "words"),
    [
        (12, [], "arm.csv has 12 rows, of which 8 can train, fewer than the 20 or 30 asked for"),
        (80, ["--splits", "target"], 'has 80 rows, which cannot be split by "target"'),
    ],
)
def test_a_study_that_nothing_can_be_asked_of_is_refused(rows, given, words, table, tmp_path, capsys):
    few, enough, out = tmp_path / "arm.csv", tmp_path / "more.csv", tmp_path / "out"
    one_target = table.drop(columns=["x2", "y2", "z2"])
    one_target.head(rows).to_csv(few, index=False)
    assert study(few, out, *FAST, "--splits", "random", *given) == 1
    assert words in capsys.readouterr().err
    assert not out.exists()
    table.to_csv(enough, index=False)
    assert study(few, out, f"ur10={enough}", *FAST, "--splits", "random", *given, "--workers", "1") == 0
    assert f"Warning: Nothing is asked of a set: {few.parent}" in capsys.readouterr().err


def test_a_method_that_breaks_is_told_and_tried_again(file, tmp_path, monkeypatch, capsys):
    def breaks(function, items, **_):
        for index, item in enumerate(items):
            broken = item.method == "grid"
            yield Done(index, error=ValueError("no luck")) if broken else Done(index, value=function(item))

    monkeypatch.setattr(running, "run_tasks", breaks)
    out = tmp_path / "out"
    assert study(file, out, *FAST, "--splits", "random") == 1
    assert "4 results are missing, the first of grid: no luck" in capsys.readouterr().err
    assert len(Kept(out).records) == 8
    assert (out / "accuracy.md").exists()


def test_every_split_leaves_out_what_it_says(file, table):
    one = parse_sets([f"ur10={file}"], None)[0]
    found = cuts(read_set(one), KINDS, ("place",), 0)
    assert [cut.kind for cut in found] == ["tails"] * 6 + ["clusters", "groups", "target", "random"]
    for cut in found:
        split = divide(one, cut, 0)
        assert not set(split.train) & set(split.holdout)
        assert len(split.train) + len(split.holdout) == POSES
    low = divide(one, Cut("tails", "q1:low:0.3"), 0)
    q1 = table["q1"].to_numpy()
    assert q1[low.holdout].max() < q1[low.train].min()
    places = divide(one, found[7], 0)
    assert not set(table["place"][places.train]) & set(table["place"][places.holdout])


def test_tails_change_sides_from_seed_to_seed(file):
    read = read_set(parse_sets([f"ur10={file}"], None)[0])
    sides = [[cut.detail.split(":")[1] for cut in cuts(read, ("tails",), (), turn)] for turn in (0, 1)]
    assert sides[0] == ["low", "high"] * 3
    assert sides[1] == ["high", "low"] * 3


def test_columns_that_hardly_any_rows_share_make_no_groups(file):
    read = read_set(parse_sets([f"ur10={file}"], None)[0])
    assert cuts(read, ("groups",), ("x2",), 0) == []
    assert cuts(read, ("groups",), ("absent",), 0) == []


def test_sizes_beyond_the_training_rows_are_left_out_and_the_middle_comes_first(file):
    sets = parse_sets([f"ur10={file}"], None)
    cells = list_cells(sets, Asked(("random",), (), ("20", "50", "100", "400", "all"), (7, 0)))
    assert [(cell.seed, cell.size, cell.poses) for cell in cells[:3]] == [
        (7, "20", 20),
        (7, "50", 50),
        (7, "all", 56),
    ]
    assert len(cells) == 6
    assert study_seeds(3) == (7, 0, 1)


def test_the_same_job_gives_the_same_result(file):
    sets = parse_sets([f"ur10={file}"], None)
    cell = list_cells(sets, Asked(("random",), (), ("30",), (7,)))[0]
    first, second = (judging.run_job(judging.Job(cell, "grid", quick=True))[0] for _ in range(2))
    assert _but_times(first) == _but_times(second)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["--methods", "gp-joints"], 'no method "gp-joints"'),
        (["--splits", "tail"], 'no split "tail"'),
        (["--splits", "groups"], "needs columns"),
        (["--split-by", "nowhere"], 'no set has a column "nowhere"'),
        (["--sizes", "10,many"], '"many" is no number of poses'),
        (["--sizes", "10,10"], "Each size once"),
        (["--again", "nothing"], 'no method "nothing"'),
        (["--methods", "grid,knn", "--again", "grid,ours"], '--again: "ours": not compared here'),
        (["--again", "grid", "--so-far"], "--so-far runs nothing"),
    ],
)
def test_wrong_usage_is_refused_before_any_work(file, tmp_path, given, message, here, capsys):
    assert study(file, tmp_path / "out", *given) == 2
    assert message in capsys.readouterr().err
    assert here == []


def test_sets_need_an_arm_and_names_of_their_own(file, tmp_path, capsys):
    assert main(["study", "accuracy", str(file), "-o", str(tmp_path / "out")]) == 2
    assert "names no arm" in capsys.readouterr().err
    with pytest.raises(UsageError, match='two files are called "arm"'):
        parse_sets(["ur10=a/arm.csv", "ur10=b/arm.csv"], None)
    assert main(["study", "accuracy", "ur10=absent.csv", "-o", str(tmp_path / "out")]) == 1
    assert "no such file" in capsys.readouterr().err


def test_a_missing_library_is_named_with_what_installs_it(monkeypatch):
    monkeypatch.setattr(libraries, "find_spec", lambda _: None)
    with pytest.raises(UsageError, match=r'pip install "\.\[study\]"'):
        libraries.require(["lightgbm", ""])
    libraries.require([""])


def test_a_directory_with_something_else_is_refused(tmp_path):
    (tmp_path / "results.jsonl").write_text("nothing of ours\n")
    with pytest.raises(InputError, match=r"results\.jsonl, line 1: this is no result"):
        Kept(tmp_path)


def test_sizes_are_numbers_and_all():
    assert parse_sizes("25, 100,all") == ("25", "100", "all")


def test_the_page_says_who_is_first_and_what_is_missing():
    methods = {
        "constant": _found(0.2),
        "curves": _found(0.1),
        "ours": _found(0.102),
    }
    plain = {"best_without_curves": "constant", "ratio_without_curves": 0.51, "runs_without_curves": 1}
    first = {"best": "curves", "ours_mm": 0.102, "best_mm": 0.1, "runs": 1}
    lead = {**first, "ratio": 1.02, "level": True, **plain}
    text = _page_of(methods, lead)
    assert "1 of 4 results are not there yet" in text
    assert "Versions that found the results: 1 (2), 2 (1)" in text
    assert "Held-out rows: 100: 40" in text
    assert "| arm | random rows held out | **0.102** (1.02 curves) |" in text
    assert "| arm | random rows held out | 0.51 constant |" in text
    assert "| constant D-H, theta curves | **0.100** |" in text


def test_the_page_has_a_column_for_each_block():
    means = {"constant": 0.5, "ours-own": 0.3, "ours-smooth": 0.25, "ours-wrist": 0.2, "ours": 0.1}
    methods = {name: _found(mean) for name, mean in means.items()} | {"ours-sag": {"failed": 1}}
    text = _page_of(methods, None)
    assert "| constant | + own | + smooth | + major | + wrist | + sag | + waves: ours |" in text
    assert "| arm | random rows held out | 100 | 1 | 0.500 | 0.300 | 0.250 |  | 0.200 |  | 0.100 |" in text


def _page_of(methods, lead):
    """The page of one set and split, of whose four results one is missing."""
    sizes = {"size": "100", "runs": 1, "seeds": 1, "n_train": 100, "n_holdout": 40}
    group = {"set": "arm", "split": "random", **sizes}
    return page(
        {
            "version": "2",
            "versions": {"1": 2, "2": 1},
            "asked": 4,
            "there": 3,
            "failed": 0,
            "sizes": ["100"],
            "sets": {"arm": {"robot": "ur10", "rows": 200}},
            "groups": [{**group, "methods": methods, "lead": lead}],
            "results": [],
        }
    )


def _found(mean):
    errors = dict.fromkeys(("p95_mm", "p99_mm", "max_mm", "worst_mean_mm"), 2.0 * mean)
    return {
        "mean_mm": mean,
        "failed": 0,
        "runs": 1,
        "coverage_95": None,
        "fit_s": 1.0,
        "predict_us": 2.0,
        **errors,
    }
