"""The study of the paper's simulations: one seed of each figure, and what it writes."""

import json
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from truearm.cli import main
from truearm.defaults import PAPER_FIGURES
from truearm.errors import UsageError
from truearm.fits.parameters import ALPHA, THETA, A, D
from truearm.studies import paper, paper_results, setting
from truearm.studies.claims import CLAIMS, judged
from truearm.studies.metrics import over_seeds, quantiles
from truearm.studies.panels import ROWS, TITLES, panels, save_panels
from truearm.studies.paper import run
from truearm.studies.paper_results import PaperStudy, conduct_study, save_pictures
from truearm.studies.statements import STATEMENTS, checked

SCHEMES = {"uncalibrated", "conventional", "regional", "fcmac", "fcmac_shrunk", "variable"}
FEW_POSES = 200


@pytest.fixture(scope="module")
def study():
    """One seed of every figure, with few regions so that it is quick."""
    patch = pytest.MonkeyPatch()
    patch.setattr(paper, "JOINT_REGIONS", 16)
    patch.setattr(paper, "SPHERE_REGIONS", 4)
    patch.setattr(paper, "READINGS", setting.READINGS[::2])
    patch.setattr("truearm.studies.experiment.WORKSPACE_POSES", FEW_POSES)
    yield conduct_study([0], PAPER_FIGURES)
    patch.undo()


def test_paper_json_has_the_stated_shape(study):
    result = study.result
    for name in ("figure6", "figure7", "noise"):
        assert set(result[name]) >= SCHEMES
        found = result[name]["fcmac"]
        assert set(found["path"]) >= {"mean_mm", "rms_mm", "max_mm", "jump_mm", "cep_jump"}
        assert set(found["workspace"]) >= {"mean_mm", "rms_mm", "max_mm"}
        assert set(found["path"]["mean_mm"]) == {"median", "p05", "p95"}
    assert set(result["figure8"]["variable"]["path"]) == {"inside", "rest"}
    assert set(result["paths"]) >= SCHEMES
    assert set(result["cmac"]) >= {"cmac", "fcmac", "sensitivity"}
    json.dumps(result, allow_nan=False)


def test_calibration_helps_and_varying_helps_more(study):
    mean = {
        name: part["workspace"]["mean_mm"]["median"]
        for name, part in study.result["figure6"].items()
        if name != "facts"
    }
    assert mean["variable"] < mean["regional"] < mean["conventional"] < mean["uncalibrated"]


def test_the_network_smooths_what_regions_break(study):
    jump = {
        name: study.result["figure6"][name]["path"]["cep_jump"]["median"] for name in ("regional", "fcmac")
    }
    assert jump["fcmac"] < 0.5 * jump["regional"]


def test_measurements_of_parents_and_tests_are_counted(study):
    facts = study.result["figure6"]["facts"]
    assert facts["measurements"]["median"] == 16 * 20
    assert facts["measured_in_all"]["median"] == 31 * 30


def test_the_papers_own_numbers_are_checked(study):
    agreed = {entry["paper"]: entry["agrees"] for entry in study.result["statements"]}
    assert agreed["15 of 25 parameters are observable, by name"]
    assert agreed["39 sensor cells, 2057 association cells, 27 a point"]
    assert {True, False} == set(agreed.values())


@pytest.mark.parametrize(("noisy_mm", "agrees"), [(0.083, True), (0.728, False)])
def test_with_noise_results_are_similar_where_the_largest_error_stays_below_the_conventional_one(
    noisy_mm, agrees
):
    def sizes(mean, largest):
        each = {"mean_mm": {"median": mean}, "max_mm": {"median": largest}}
        return {"path": each, "workspace": each}

    clean = {"conventional": sizes(0.066, 0.198), "fcmac": sizes(0.010, 0.072)}
    noisy = {"conventional": sizes(0.066, 0.199), "fcmac": sizes(0.056, noisy_mm)}
    assert not any("noise" in each["paper"] for each in checked({"noise": noisy}))
    similar = [each for each in STATEMENTS if each.figures == "figure6 noise"]
    found = [each.check({"figure6": clean, "noise": noisy}) for each in similar]
    assert [agreed for _, agreed in found] == [agrees, agrees]
    assert all(f"0.072 and {noisy_mm:.3f} mm; conventional" in words for words, _ in found)


def test_every_claim_is_judged_and_stands_in_the_page(study):
    assert len(study.result["claims"]) == len(CLAIMS)
    for entry in study.result["claims"]:
        assert entry["claim"] in study.page


def test_pictures_are_written_for_print(study, tmp_path, monkeypatch):
    assert set(study.drawn) == {"figure6", "figure7", "figure8", "noise", "cmac"}
    monkeypatch.setitem(ROWS, "figure6", ("variable",))
    few = PaperStudy(study.result, {"figure6": study.drawn["figure6"]})
    files = {path.name for path in save_pictures(few, tmp_path)}
    assert files == {
        f"{stem}.{ending}" for stem in ("figure6", "division_joint") for ending in ("png", "svg")
    }
    before = {ending: (tmp_path / f"figure6.{ending}").read_bytes() for ending in ("png", "svg")}
    assert before["png"].startswith(b"\x89PNG")
    assert b"variable model (ours)</text>" in before["svg"]
    save_panels(few.drawn, tmp_path)
    assert {ending: (tmp_path / f"figure6.{ending}").read_bytes() for ending in before} == before


def lines_of(axes):
    """Where each line of these axes is drawn: x and y of its points, each (m,)."""
    return [(np.asarray(line.get_xdata()), np.asarray(line.get_ydata())) for line in axes.lines]


def test_panels_show_errors_and_ceps_of_each_scheme_beside_the_gap(study):
    drawn = study.drawn["figure8"]
    axes = panels(drawn, ROWS["figure8"]).axes
    rows = len(ROWS["figure8"])
    for row, name in enumerate(ROWS["figure8"]):
        left, right, angles = axes[2 * row], axes[2 * row + 1], axes[2 * rows + row]
        found = drawn.traces[name]
        (_, errors), *edges = lines_of(left)
        np.testing.assert_array_equal(errors, found.size_mm)
        assert [x[0] for x, _ in edges] == list(drawn.gap)
        ceps = (found.parameters - drawn.made.identified.table)[:, 1]
        lengths, turns = ([y for _, y in lines_of(each)[:2]] for each in (right, angles))
        np.testing.assert_allclose(lengths, 1e3 * ceps[:, [D, A]].T)
        np.testing.assert_allclose(turns, np.rad2deg(ceps[:, [THETA, ALPHA]]).T)
        assert TITLES[name] in left.get_title(loc="left")


def test_points_that_were_not_reached_leave_gaps_in_pictures(study):
    drawn = study.drawn["figure6"]
    errors_mm = drawn.traces["variable"].errors_mm.copy()
    errors_mm[:3] = np.nan
    lost = replace(drawn.traces["variable"], errors_mm=errors_mm)
    left = panels(replace(drawn, traces={"variable": lost}), ["variable"]).axes[0]
    _, shown = lines_of(left)[0]
    assert np.flatnonzero(np.isnan(shown)).tolist() == [0, 1, 2]
    assert left.get_ylim()[1] > np.nanmax(shown)


def test_the_path_of_figure_7_is_within_reach():
    for kind in ("joint", "sphere"):
        space = setting.space_of(kind)
        _, reached = space.readings(setting.path_of(kind))
        assert reached.all()


def test_statistics_over_seeds():
    assert quantiles([1.0, 2.0, 3.0])["median"] == 2.0
    merged = over_seeds([{"a": {"b": 1.0}}, {"a": {"b": 3.0}}])
    assert merged["a"]["b"]["median"] == 2.0
    assert np.isclose(merged["a"]["b"]["p95"], 2.9)


def test_claims_of_figures_that_were_not_run_are_left_out(study):
    assert judged([{"paths": study.result["paths"]}]) == []


def test_command_writes_its_files(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(paper, "JOINT_REGIONS", 16)
    monkeypatch.setattr("truearm.studies.experiment.WORKSPACE_POSES", FEW_POSES)
    out = tmp_path / "study"
    assert main(["study", "paper", "-o", str(out), "--figure", "cmac", "--seeds", "1", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((out / "paper.json").read_text())
    assert {path.name for path in out.iterdir()} == {"paper.json", "paper.md", "cmac.png", "cmac.svg"}
    assert "CMAC" in (out / "paper.md").read_text()


def test_figures_of_the_first_seed_are_told_as_they_are_made(monkeypatch):
    monkeypatch.setattr(paper, "RUNS", {name: lambda _: {} for name in PAPER_FIGURES})
    monkeypatch.setattr(paper, "over_seeds", lambda _: {})
    told = []

    def stages(name):
        told.append(name)
        return nullcontext()

    run([0], ("6", "cmac"), stages)
    assert told == ["figure 1 of 2", "figure 2 of 2"]


def test_unknown_figures_and_no_seeds_are_refused(tmp_path, capsys):
    with pytest.raises(UsageError, match='no figure "9"'):
        run([0], ["9"], lambda _: nullcontext())
    assert main(["study", "paper", "-o", str(tmp_path / "x"), "--figure", "9"]) == 2
    assert "no figure" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


def test_results_are_there_where_a_picture_cannot_be_written(study, tmp_path, monkeypatch):
    def no_room(*_):
        raise OSError("no space left on device")

    monkeypatch.setattr(paper_results, "conduct_study", lambda *_, **__: study)
    monkeypatch.setattr(paper_results, "save_pictures", no_room)
    assert main(["study", "paper", "-o", str(tmp_path / "out")]) == 1
    assert json.loads((tmp_path / "out" / "paper.json").read_text()) == study.result
    assert (tmp_path / "out" / "paper.md").exists()


def test_a_directory_that_cannot_be_made_is_told_before_any_work(tmp_path, monkeypatch):
    def never(*_, **__):
        raise AssertionError("nothing is to be simulated")

    monkeypatch.setattr(paper_results, "conduct_study", never)
    (tmp_path / "out").symlink_to(tmp_path / "nowhere")
    assert main(["study", "paper", "-o", str(tmp_path / "out")]) == 1
