"""The report of a calibration: its numbers are those of summary.json, and it needs nothing but itself."""

import re
from dataclasses import replace

import numpy as np
import plotly.graph_objects as go
import pytest

import truearm as ta
from tests.calibration_file_support import read_calibration_file, write_calibration_file
from tests.remastered import remastered
from tests.report_support import (
    errors_table,
    figures_of,
    repeated_measurements,
    script_of,
    small_calibration,
    words_of,
)
from truearm.certainty.standard_errors import of_covariance
from truearm.doubts.of_results import CONSTANT_BETTER
from truearm.errors import Notice
from truearm.fits.options import CalibrationOptions
from truearm.reporting.facts import Facts
from truearm.reporting.gravity import sag
from truearm.reporting.option_words import GENERAL, SCHEMES, VARIABLE, shown_options
from truearm.reporting.parts import Figure, Text
from truearm.reporting.report import report
from truearm.reporting.script import licence_notice
from truearm.reporting.varying import varying
from truearm.reporting.waves import strongest_wave
from truearm.simulation import Imperfections, VirtualArm
from truearm.simulation.imperfections import Deflection, Mass

STATISTICS = ("mean_mm", "rms_mm", "p95_mm", "p99_mm", "max_mm")
MODELS = ("variable", "constant", "regions", "fcmac", "cmac")
MOST_BYTES = 4_000_000
FETCHES = re.compile(
    r"""(?:\b(?:src|href|action|data)\s*=\s*["']?|url\(|@import|fetch\(|import\()\s*(https?:|//)"""
)


@pytest.fixture(scope="module")
def calibrations():
    return {model: small_calibration(model, repeatability_mm=0.05) for model in MODELS}


@pytest.fixture(scope="module")
def reports(calibrations):
    return {model: report(calibration) for model, calibration in calibrations.items()}


def test_tables_have_titles_for_people(reports):
    titles = re.findall("<h3[^>]*>([^<]*)", reports["variable"].html)
    assert "Options" in titles
    assert not [title for title in titles if re.search(r"[a-z][A-Z]|_", title)]


@pytest.mark.parametrize("model", MODELS)
def test_the_table_is_that_of_the_summary(calibrations, reports, model):
    summary = calibrations[model].summary
    shown = errors_table(reports[model].html)
    for name in ("nominal", "constant"):
        assert shown[name] == [f"{summary['holdout'][name][key]:.3f}" for key in STATISTICS]


@pytest.mark.parametrize("model", MODELS)
def test_the_verdict_is_that_of_the_summary(calibrations, reports, model):
    summary = calibrations[model].summary
    numbers = [float(text) for text in re.findall(r"\d+\.\d+", reports[model].verdict)]
    after, before = summary["holdout"][model], summary["holdout"]["nominal"]
    wanted = [after["mean_mm"], after["max_mm"], before["mean_mm"], before["max_mm"]]
    np.testing.assert_allclose(numbers[:4], wanted, atol=0.006)
    assert f"On {summary['n_holdout']} held-out poses" in reports[model].verdict


@pytest.mark.parametrize("model", MODELS)
def test_a_page_asks_for_nothing_from_elsewhere(reports, model):
    page = reports[model].html
    assert FETCHES.search(page) is None
    assert "<link" not in page.replace('<link rel="icon" href="data:,">', "")


def test_the_search_for_fetches_finds_them():
    for text in (
        '<script src="https://a.b/c.js">',
        "<img src=//a/b>",
        "url( http://x )",
        "@import 'https://",
    ):
        assert FETCHES.search(text.replace("'", "")), text


@pytest.mark.parametrize("model", MODELS)
def test_every_figure_is_one_that_plotly_knows_with_units_and_a_sentence(reports, model):
    content = figures_of(reports[model].html)
    palette = content["palettes"]["dark"]
    assert content["palettes"]["light"].keys() == palette.keys()
    assert len(content["figures"]) == len(reports[model].figures)
    for figure, (title, says) in zip(content["figures"], reports[model].figures, strict=True):
        assert says.endswith("."), title
        assert re.search(r"\d", says), title
        go.Figure(coloured({"data": figure["traces"], "layout": figure["layout"]}, palette))
        flat = [trace for trace in figure["traces"] if trace["type"] not in ("scatter3d", "icicle")]
        if flat:
            for name in ("xaxis", "yaxis"):
                assert figure["layout"][name]["title"]["text"], title
    go.Figure(coloured({"layout": content["layout"]}, palette))


def coloured(value, palette):
    """A figure with the palette's colours for their names."""
    if isinstance(value, str) and value.startswith("@"):
        return palette[value[1:]]
    if isinstance(value, list):
        return [coloured(entry, palette) for entry in value]
    if isinstance(value, dict):
        return {key: coloured(entry, palette) for key, entry in value.items()}
    return value


def test_the_plotting_script_is_whole_and_keeps_its_licence(reports):
    page = reports["constant"].html
    assert script_of(page).startswith("/**\n* plotly.js v")
    assert "Copyright" in licence_notice()
    assert all(line in words_of(page) for line in licence_notice().splitlines())
    assert "Permission is hereby granted, free of charge" in page


def test_a_thousand_poses_stay_small():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=5)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(1000)), model="constant")
    page = report(calibration).html
    assert len(page.encode()) < MOST_BYTES
    assert "Outliers" not in words_of(page)


def test_worst_poses_are_named_by_their_rows(calibrations, reports):
    held = calibrations["variable"].held
    worst = int(np.argmax(held.errors["variable"].distance_m))
    table = reports["variable"].html.partition("Worst poses")[2].partition("</table>")[0]
    first = re.findall(r"<td[^>]*>(.*?)</td>", table)
    assert first[0] == str(held.rows[worst])
    assert first[3] == f"{1e3 * held.errors['variable'].distance_m[worst]:.3f}"


def test_errors_row_by_row_are_those_of_the_validation(calibrations):
    for calibration in calibrations.values():
        for name, errors in calibration.held.errors.items():
            assert errors.statistics() == calibration.validation.holdout[name]
        assert len(calibration.held) == calibration.validation.n_holdout


def test_held_rows_come_back_from_the_file(calibrations, tmp_path):
    held = calibrations["variable"].held
    calibrations["variable"].save(tmp_path / "arm.calib")
    again = ta.Calibration.load(tmp_path / "arm.calib").held
    assert again is not None
    np.testing.assert_array_equal(again.readings, held.readings)
    assert (again.rows.tolist(), again.sources.tolist()) == (held.rows.tolist(), held.sources.tolist())
    for name, errors in held.errors.items():
        np.testing.assert_array_equal(again.errors[name].position, errors.position)


def test_a_file_from_before_held_rows_were_kept_is_reported(calibrations, tmp_path):
    path = tmp_path / "arm.calib"
    calibrations["constant"].save(path)
    arrays, content = read_calibration_file(path)
    content = {key: value for key, value in content.items() if key not in ("held", "schema", "sha256")}
    kept = {name: array for name, array in arrays.items() if not name.startswith("held.")}
    write_calibration_file(path, kept, content)
    old = ta.Calibration.load(path)
    assert old.held is None
    assert "Worst poses" not in report(old).html


@pytest.mark.parametrize("model", ["variable", "constant"])
def test_a_stripped_file_has_no_measurements_and_its_report_says_so(calibrations, tmp_path, model):
    whole = calibrations[model]
    whole.save(tmp_path / "arm.calib", with_rows=False)
    arrays, _ = read_calibration_file(tmp_path / "arm.calib")
    assert not [name for name in arrays if name.startswith(("held.", "rows.", "outcome."))]
    page = report(ta.Calibration.load(tmp_path / "arm.calib")).html
    assert words_of(page).count("The measurements were left out of this file") == 3
    assert errors_table(page) == errors_table(report(whole).html)
    assert words_of(report(whole.without_rows()).html).count("left out of this file") == 3


def test_the_same_calibration_makes_the_same_page(calibrations, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    first, second = (report(calibrations["variable"]).html for _ in range(2))
    assert first == second
    assert "2023-11-14 22:13 UTC" in first


def test_names_are_text_and_nothing_else():
    arm = VirtualArm.paper(seed=2)
    table = arm.measure_table(arm.poses(40))
    table["group"] = "<script>alert(1)</script>"
    data = ta.Measurements.from_dataframe(table, name="</script><b>")
    page = report(ta.calibrate(arm.robot, data, model="constant")).html
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert(1)" in page
    assert "</script><b>" not in page


def test_repeated_poses_tell_scatter_and_sides():
    robot, data = repeated_measurements(sides_apart_mm=0.2, noise_mm=0.01)
    text = words_of(report(ta.calibrate(robot, data, model="constant")).html)
    assert "No pose was measured twice" not in text
    apart, alone = re.findall(r"joint 2 25 (\d\.\d+) (\d\.\d+)", text)[0]
    assert float(apart) == pytest.approx(0.2, abs=0.01)
    assert float(alone) == pytest.approx(0.01 * np.sqrt(3 * 2 / 4), rel=0.3)
    assert "ISO 9283" not in text


def test_rows_say_themselves_from_which_side_joints_came():
    """As sessions export them: a repeat comes at once from the other side, and at the end from the first."""
    arm = VirtualArm.paper(seed=2)
    q = arm.poses(40, seed=4)
    twice = np.repeat(q, 2, axis=0)
    sides = np.concatenate([np.tile([1, -1], len(q)), np.ones(len(q), dtype=int)])
    table = arm.measure_table(np.concatenate([twice, q]), seed=4).assign(approach=sides)
    table["z"] += 0.1e-3 * sides
    text = words_of(
        report(ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant")).html
    )
    assert "The column approach says from which side all joints came." in text
    apart, _ = re.findall(r"all joints 40 (\d\.\d+) (\d\.\d+)", text)[0]
    assert float(apart) == pytest.approx(0.2, abs=0.05)
    assert "The sides lie farther apart than scatter and chance may make of 40 poses." in text
    silent = words_of(
        report(
            ta.calibrate(
                arm.robot, ta.Measurements.from_dataframe(table.drop(columns="approach")), model="constant"
            )
        ).html
    )
    assert "The column approach" not in silent


def test_advice_follows_from_the_data(calibrations, reports):
    kinds = {model: [advice.kind for advice in reports[model].advice] for model in MODELS}
    assert "no_orientation" in kinds["variable"]
    assert "try_variable" in kinds["constant"]
    assert "few_held_out" in kinds["variable"]
    robot = VirtualArm.paper(seed=2)
    data = robot.measure_table(robot.poses(90))
    data["x"] += np.where(data.index == 4, 0.05, 0.0)
    found = report(ta.calibrate(robot.robot, ta.Measurements.from_dataframe(data), model="constant"))
    assert found.advice[0].kind == "outliers"
    assert "row 5" in found.advice[0].words


def test_a_few_rows_with_a_large_sigma_do_not_raise_the_floor():
    robot = VirtualArm.paper(seed=2)
    data = robot.measure_table(robot.poses(80))
    floors = []
    for few in (0.015, 1.5):
        table = data.assign(sigma_mm=np.where(data.index % 20 == 3, few, 0.015))
        found = ta.calibrate(robot.robot, ta.Measurements.from_dataframe(table), model="constant")
        floors.append(floor_of(found, sigmas=table["sigma_mm"]))
        assert "beyond what rows state as their sigma" in words_of(report(found).html)
    assert floors[1] - floors[0] < 0.2


def floor_of(calibration, sigmas):
    """The mean error that noise alone would leave, mm, which is the mean of the rows' own."""
    facts = Facts(calibration)
    noise = facts.summary["noise_mm"]
    expected = np.sqrt(8.0 / np.pi) * np.hypot(noise, sigmas).mean()
    assert facts.floor_mm == pytest.approx(expected)
    return facts.floor_mm


def test_a_variable_model_that_does_worse_is_not_said_to_gain(calibrations):
    whole = calibrations["variable"].without_rows()
    errors = whole.validation.holdout
    swapped = {**errors, "variable": errors["constant"], "constant": errors["variable"]}
    worse = replace(whole, validation=replace(whole.validation, holdout=swapped))
    told = {advice.kind: advice.words for advice in report(worse).advice}
    assert "gains little or nothing" in told["constant_suffices"]
    notice = Notice(CONSTANT_BETTER, "Constant parameters do better: give --model constant.")
    surely = {advice.kind: advice.words for advice in report(replace(worse, notices=(notice,))).advice}
    assert surely[CONSTANT_BETTER] == str(notice)
    assert "constant_suffices" not in surely


def test_compensation_uses_what_varies_where_it_takes_the_model(reports):
    for model in ("variable", "regions", "fcmac"):
        assert ("Compensation uses the latter" in words_of(reports[model].html)) == (model == "variable")


@pytest.mark.parametrize(("step_deg", "wanted"), [(10.0, "between_the_grid"), (0.01, "noise_floor")])
def test_on_a_grid_the_noise_floor_is_not_said_to_be_reached(step_deg, wanted):
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1, imperfections=Imperfections(share=0.0, noise_mm=0.05))
    readings = np.radians(step_deg * np.round(np.degrees(arm.poses(100)) / step_deg))
    found = ta.calibrate(arm.robot, arm.measure(readings), use="position", refit=False)
    for calibration in (found, found.without_rows()):
        told = {advice.kind: advice.words for advice in report(calibration).advice}
        assert set(told) & {"between_the_grid", "noise_floor"} == {wanted}
        assert ("truearm evaluate" in told[wanted]) == (wanted == "between_the_grid")


def test_the_report_of_an_update_says_what_was_judged_how():
    arm = VirtualArm.paper(seed=2)
    old = small_calibration("constant")
    found = ta.update(old, remastered(arm, arm.poses(15, seed=9), [0.0, 0.6, 0.0, 0.0, 0.0], seed=9))
    made = report(found.calibration)
    text = words_of(made.html)
    first = errors_table(made.html.partition("</table>")[0])
    for name, errors in found.calibration.validation.holdout.items():
        assert first[name][0] == f"{errors.position.mean:.3f}"
    assert made.verdict.startswith("On 15 left-out poses, each predicted from the others,")
    assert f"{found.before.position.max:.2f}" in made.verdict
    assert "training pose" not in text
    assert "held out" not in text.partition("The update")[0]
    held = old.validation
    assert f"on {held.n_holdout} held-out poses of its own data" in text
    assert f"constant {held.holdout['constant'].position.mean:.3f}" in text
    assert "joint 1 kept confounded with the frame" in text
    assert "more_poses" not in [advice.kind for advice in made.advice]
    titles = [title for title, _ in made.figures]
    along = figures_of(made.html)["figures"][titles.index("Error along joint 1")]
    assert [(trace["name"], trace["mode"]) for trace in along["traces"]] == [
        ("nominal", "markers"),
        ("constant", "markers"),
    ]
    assert along["layout"]["yaxis"]["type"] == "log"


@pytest.mark.parametrize(
    ("compliance", "words"), [(2e-6, "Vertical levers stand out."), (0.0, "smaller than the noise")]
)
def test_levers_stand_out_where_links_give_way(compliance, words):
    deflection = Deflection((compliance,) * 6, (Mass(2, 8.0), Mass(3, 5.0), Mass(5, 2.0)))
    errors = Imperfections(share=0.0, noise_mm=0.02, deflection=deflection)
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1, imperfections=errors)
    made = sag(Facts(ta.calibrate(arm.robot, arm.measure(arm.poses(90)))))
    assert made is not None
    assert words in made.says
    assert "weight" not in made.says
    assert "up to less than" not in made.says


def test_a_wave_is_found_and_a_line_is_none():
    x = np.linspace(-150.0, 150.0, 121)
    wave = strongest_wave(x, 0.01 * x + 2.0 * np.sin(2.0 * np.pi * x / 40.0 + 0.3))
    assert wave is not None
    assert wave.period == pytest.approx(40.0, rel=0.02)
    assert wave.amplitude == pytest.approx(2.0, rel=0.02)
    assert wave.share > 0.99
    assert strongest_wave(x, 0.01 * x) is None
    assert strongest_wave(x, np.exp(-x / 100.0)) is None


@pytest.mark.parametrize(
    ("model", "joints"),
    [
        ("regions", "joint 2, joint 3, joint 4 or joint 5"),
        ("fcmac", "joint 4 or joint 5"),
        ("cmac", "joint 4 or joint 5"),
    ],
)
def test_a_scheme_is_not_said_to_vary_along_joints_that_it_does_not_divide(reports, model, joints):
    words = words_of(reports[model].html)
    assert f"The {model} model does not vary along {joints}." in words
    assert ("Variation along joint 3" in words) == (model != "regions")
    assert "Variation along joint 4" not in words
    assert "varies by 0.0000" not in words
    assert "an amplitude of 0.0000" not in words


def test_a_scheme_of_one_region_is_said_not_to_vary_and_has_no_map_of_what_varies():
    arm = VirtualArm.paper(seed=2)
    found = ta.calibrate(arm.robot, arm.measure(arm.poses(60)), model="regions", most_regions=1)
    parts = varying(Facts(found)).parts
    (text,) = (part for part in parts if isinstance(part, Text))
    assert "The regions model does not vary along any joint." in text.words
    assert not [part for part in parts if isinstance(part, Figure) and "Which parameter" in part.title]


def test_slices_are_deviations_from_their_means(reports):
    figures = figures_of(reports["variable"].html)["figures"]
    titles = [title for title, _ in reports["variable"].figures]
    for figure, title in zip(figures, titles, strict=True):
        if title.endswith("over the same slices"):
            values = np.concatenate([np.ravel(trace["z"]) for trace in figure["traces"]])
            assert abs(values.mean()) < 1e-3 * np.abs(values).max()
            assert figure["traces"][0]["zmin"] == -figure["traces"][0]["zmax"]
    assert any(title.endswith("over the same slices") for title in titles)


def test_a_variable_calibration_shows_its_own_constants(calibrations, reports):
    calibration = calibrations["variable"]
    shown = reports["variable"].html.partition("Parameters of the variable model")[2].partition("</table>")[0]
    cells = {
        row[0]: row[1:]
        for row in (
            re.findall(r"<td[^>]*>(.*?)</td>", part) for part in re.findall(r"<tr.*?</tr>", shown, re.DOTALL)
        )
        if row
    }
    place = dict(zip(calibration.arm.candidates.names, calibration.arm.candidates.columns, strict=True))
    for name in ("a2", "a3"):
        change = (calibration.model.constants - calibration.arm.table).ravel()[place[name]]
        assert cells[name][2] == f"{1e3 * change:+.4f}"
    assert "Parameters of the constant model" in reports["variable"].html
    assert "hold what the constants may have taken over" in reports["variable"].html
    assert "for noise: where the arm varies" in reports["constant"].html
    assert "Parameters of the variable model" not in reports["constant"].html


def test_standard_errors_of_a_file_of_an_earlier_version_promise_no_more_than_they_hold(calibrations):
    details = calibrations["variable"].constant
    old = replace(details, standard_errors=of_covariance(details.covariance, len(details.names)))
    assert "for noise: where the arm varies" in report(replace(calibrations["variable"], constant=old)).html


def test_where_no_pose_was_planned_to_validate_the_options_do_not_say_that_some_are_held_out(reports):
    planned = "poses planned to validate are held out"
    assert f"{planned} none was" in words_of(reports["constant"].html)
    arm = VirtualArm.paper(seed=2)
    table = arm.measure_table(arm.poses(60))
    table["purpose"] = np.where(table.index % 3 == 0, "validate", "train")
    found = report(ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant"))
    assert f"{planned} yes, 20 rows" in words_of(found.html)
    assert "share of the rows held out not drawn" in words_of(found.html)
    assert "share of the rows held out 0.3" in words_of(reports["constant"].html)


def test_every_option_has_words():
    assert set(CalibrationOptions().to_dict()) == {*GENERAL, *VARIABLE, *SCHEMES}
    for model in MODELS:
        assert not [words for words in shown_options(model).values() if "_" in words]


def test_how_parameters_vary_is_known_better_than_their_level(calibrations):
    calibration = calibrations["variable"]
    q = np.repeat(VirtualArm.paper(seed=2).poses(1, seed=8), 9, axis=0)
    names = ["theta2", "a3"]
    np.testing.assert_allclose(calibration.variation_std(q, names), 0.0, atol=1e-9)
    q[:, 1] += np.linspace(-0.5, 0.5, 9)
    there = calibration.variation_std(q, names)
    assert (there[[0, -1]] > there[4]).all()
    assert there.shape == (9, 2)
    assert (there > 0.0).all()
    with pytest.raises(ta.errors.UsageError, match=r'"theta22".*Did you mean'):
        calibration.variation_std(q, ["theta22"])
