"""The paper's experiment in small: two regions, the real process, all that is written, and going on."""

import io
import json
from contextlib import redirect_stdout

import numpy as np
import pytest
from distributed import LocalCluster

from tests.in_process import in_this_process
from truearm.cell.session import Session
from truearm.cli import main
from truearm.errors import InputError, WorkError
from truearm.stages import no_stages
from truearm.studies.process import judging, several
from truearm.studies.process.planning import plan_experiment
from truearm.studies.process.setting import Setting, path, space

REGIONS, POSES = 2, 12
SMALL = ("--regions", f"{REGIONS}", "--poses", f"{POSES}", "--seeds", "2")


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Where a small experiment on two arms was made, the second on a cluster, and what it printed."""
    directory, printed = tmp_path_factory.mktemp("experiments") / "small", io.StringIO()
    with (
        LocalCluster(
            n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0", silence_logs=50
        ) as cluster,
        redirect_stdout(printed),
    ):
        place = ["--scheduler", cluster.scheduler_address]
        assert main(["study", "experiment", "-o", str(directory), *SMALL, "--json", *place]) == 0
    return directory, json.loads(printed.getvalue())


def test_the_path_of_figure_10_is_within_reach_and_within_the_space():
    box = space()
    assert box.readings(path())[1].all()
    assert (path() >= box.low).all()
    assert (path() <= box.high).all()


def test_every_region_gets_its_poses_at_whole_tenths_of_a_degree():
    plan = plan_experiment(Setting(regions=5))
    purposes = np.array(plan.poses.purpose)
    for leaf in plan.regions.leaves:
        mine = plan.leaf == leaf
        assert (purposes[mine] == "train").sum() == 20
        assert (purposes[mine] == "validate").sum() == 10
    tenths = np.degrees(plan.poses.readings) * 10.0
    assert np.abs(tenths - np.rint(tenths)).max() < 1e-9
    assert not plan.poses.readings[:, 3:].any()


def test_the_experiment_in_small(small):
    directory, result = small
    assert result == json.loads((directory / "experiment.json").read_text())
    figure = result["figure10"]
    errors = {name: part["workspace"]["mean_mm"] for name, part in figure.items()}
    assert errors["variable"] < errors["conventional"] < 0.5 * errors["uncalibrated"]
    assert result["session"]["measurements"] + result["session"]["skipped"] >= REGIONS * POSES
    assert {each["place"] for each in result["statements"]} >= {"Fig. 10(a)", "Fig. 10(c, d)"}
    page = (directory / "experiment.md").read_text()
    assert all(each["ours"] in page for each in result["statements"])
    for name in ("figure10.png", "figure10.svg", "cell.toml", "session.db"):
        assert (directory / name).stat().st_size > 0
    for session_file in (directory / "session.db", directory / "arm-7" / "session.db"):
        with Session(session_file, writing=False) as session:
            assert session.rows("SELECT count(*) FROM outcomes") == session.rows("SELECT count(*) FROM steps")


def test_several_arms_tell_what_holds_beyond_the_first(small):
    directory, result = small
    over = result["over_arms"]
    assert over["seeds"] == [6, 7]
    spread = over["figure10"]["conventional"]["path"]["mean_mm"]
    assert spread["p05"] < spread["median"] < spread["p95"]
    assert result["figure10"]["conventional"]["path"]["mean_mm"] != spread["median"]
    assert len(over["statements"]) == len(result["statements"])
    assert "## On 2 arms" in (directory / "experiment.md").read_text()


def test_another_experiment_does_not_go_on_with_this_session(tmp_path, capsys):
    plan_again = ["study", "experiment", "-o", str(tmp_path), "--regions", "2", "--poses", "8"]
    (tmp_path / "session.db").write_bytes(b"not a session")
    assert main(plan_again) == 1
    assert "this is no session file" in capsys.readouterr().err


def test_a_session_of_other_regions_is_left_alone_with_its_cell_file(small, capsys):
    directory, _ = small
    before = {name: (directory / name).read_bytes() for name in ("cell.toml", "experiment.json")}
    assert main(["study", "experiment", "-o", str(directory), "--regions", "3", "--poses", f"{POSES}"]) == 1
    assert "session.db" in " ".join(capsys.readouterr().err.split())
    assert {name: (directory / name).read_bytes() for name in before} == before


def test_an_arm_that_fails_is_named_and_stops_none_of_the_others(tmp_path, monkeypatch):
    settings, asked = [Setting(seed=seed) for seed in (1, 2, 3)], []

    def conducted(setting, *_):
        asked.append(setting.seed)
        if setting.seed == 2:
            raise WorkError("nothing was measured", where="session.db")
        return {}, None

    monkeypatch.setattr(several, "conduct_experiment", conducted)
    monkeypatch.setattr(several, "run_tasks", in_this_process)
    with pytest.raises(WorkError, match=r"^arm 2, session\.db: nothing was measured"):
        several.conduct_arms(settings, tmp_path, lambda _: None, no_stages)
    assert asked == [1, 2, 3]


def test_a_worker_that_does_not_see_the_directory_measures_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(several, "conduct_experiment", lambda *_: ({}, None))
    monkeypatch.setattr(several, "make_directory", lambda _: None)
    monkeypatch.setattr(several, "run_tasks", in_this_process)
    with pytest.raises(InputError, match=r"arm-2: there is no such directory where a worker runs"):
        several.conduct_arms([Setting(seed=1), Setting(seed=2)], tmp_path, lambda _: None, no_stages)


def test_workers_that_contradict_each_other_are_refused_before_anything_is_measured(tmp_path, capsys):
    place = ["--workers", "1", "--scheduler", "tcp://127.0.0.1:1"]
    assert main(["study", "experiment", "-o", str(tmp_path), *SMALL, *place]) == 2
    assert "both a scheduler and a number of workers" in capsys.readouterr().err
    assert not (tmp_path / "session.db").exists()


def test_fewer_poses_than_a_region_needs_are_refused_before_any_work(tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["study", "experiment", "-o", str(out), "--regions", "2", "--poses", "5"]) == 2
    assert "15 parameters of a region" in " ".join(capsys.readouterr().err.split())
    assert not out.exists()


def test_what_the_paper_says_of_its_size_is_not_said_of_another(small):
    directory, result = small
    agrees = {each["paper"]: each["agrees"] for each in result["statements"]}
    sized = [agrees[said] for said in agrees if "85 regions" in said or "couple of hours" in said]
    assert sized == [None, None]
    assert f"of {REGIONS} regions, as measured" in (directory / "experiment.md").read_text()
    claimed = {each["claim"] for each in result["claims"]}
    assert "hours of measuring" not in claimed


def test_hours_are_judged_of_an_experiment_as_large_as_the_papers():
    session = {"regions": 85.0, "poses": 20.0, "hours": 3.5, "measurements": 2520.0, "hours_in_all": 5.0}
    (hours,) = (each for each in judging.STATEMENTS if "couple of hours" in each.paper)
    assert hours.check({"session": session})[1] is False
    assert hours.check({"session": {**session, "hours": 2.4}})[1] is True
    assert hours.check({"session": {**session, "regions": 4.0, "hours": 0.1}})[1] is None
