"""The paper's experiment in small: three regions, the real process, all that is written, and going on."""

import json

import numpy as np

from truearm.cell.session import Session
from truearm.cli import main
from truearm.studies.process.planning import plan_experiment
from truearm.studies.process.setting import Setting, path, space

SMALL = ("--regions", "3", "--poses", "16")


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


def test_the_experiment_in_small(tmp_path, capsys):
    directory = tmp_path / "experiment"
    assert main(["study", "experiment", "-o", str(directory), *SMALL, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result == json.loads((directory / "experiment.json").read_text())
    figure = result["figure10"]
    errors = {name: part["workspace"]["mean_mm"] for name, part in figure.items()}
    assert errors["variable"] < errors["conventional"] < 0.5 * errors["uncalibrated"]
    assert result["session"]["measurements"] + result["session"]["skipped"] >= 48
    assert {each["place"] for each in result["statements"]} >= {"Fig. 10(a)", "Fig. 10(c, d)"}
    page = (directory / "experiment.md").read_text()
    assert all(each["ours"] in page for each in result["statements"])
    for name in ("figure10.png", "figure10.svg", "cell.toml", "session.db"):
        assert (directory / name).stat().st_size > 0
    with Session(directory / "session.db", writing=False) as session:
        assert session.rows("SELECT count(*) FROM outcomes") == session.rows("SELECT count(*) FROM steps")


def test_another_experiment_does_not_go_on_with_this_session(tmp_path, capsys):
    plan_again = ["study", "experiment", "-o", str(tmp_path), "--regions", "2", "--poses", "8"]
    (tmp_path / "session.db").write_bytes(b"not a session")
    assert main(plan_again) == 1
    assert "this is no session file" in capsys.readouterr().err
