"""Figures of the report: what varies with a feature, maps, arrows in space, waves and repeats."""

import re

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from tests.report_support import figures_of, repeated_measurements, small_calibration, words_of
from tests.test_distance_zero import wire
from truearm.cli import main
from truearm.reporting.advice import advise
from truearm.reporting.curves import in_words
from truearm.reporting.facts import Facts
from truearm.reporting.levers import taken_over
from truearm.reporting.numbers import fixed, without_zeros
from truearm.reporting.page import page
from truearm.reporting.parts import Head
from truearm.reporting.report import report
from truearm.simulation import Imperfections, VirtualArm

WARMEST_C = 35.0
COLDEST_C = 15.0
TURN = 2e-3


@pytest.fixture(scope="module")
def warmed():
    """The report of an arm whose joint 2 turns by TURN as it warms up, and how far that moves it, mm."""
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1, imperfections=Imperfections(share=0.0, noise_mm=0.02))
    q = arm.poses(120)
    warmth = np.random.default_rng(0).uniform(0.0, 1.0, len(q))
    turn = TURN * np.eye(6)[1]
    table = arm.measure_table(q + warmth[:, None] * turn)
    table["q2"] -= TURN * warmth
    table["temperature_c"] = COLDEST_C + (WARMEST_C - COLDEST_C) * warmth
    data = ta.Measurements.from_dataframe(table)
    moved = 1e3 * np.linalg.norm(arm.true_position(q + turn) - arm.true_position(q), axis=1)
    return report(ta.calibrate(arm.robot, data, features=("temperature_c",), refit=False)), moved.mean()


@pytest.fixture(scope="module")
def variable():
    return small_calibration("variable")


@pytest.fixture(scope="module")
def drawn(variable):
    """Figures of a report by their titles."""
    made = report(variable)
    titles = [title for title, _ in made.figures]
    return dict(zip(titles, figures_of(made.html)["figures"], strict=True))


def test_what_varies_with_a_feature_is_told(warmed):
    made, true_mm = warmed
    says = dict(made.figures)
    moved = re.findall(r"by (\d\.\d+) mm on average", says["Variation along temperature_c"])
    assert float(moved[0]) == pytest.approx(0.98 * true_mm, rel=0.1)
    along = next(words for title, words in says.items() if title.startswith("Which parameter varies"))
    assert "the effect is largest along temperature_c" in along
    assert words_of(made.html).count("features are at the medians of the rows: temperature_c = ") == 3


def test_noise_of_several_targets_is_said_to_be_of_all(tmp_path, monkeypatch, capsys):
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1)
    q = arm.poses(40)
    table = arm.measure_table(q)
    arm.target_in_flange = np.add(arm.target_in_flange, [0.1, 0.0, 0.0])
    table[["x2", "y2", "z2"]] = arm.measure_table(q)[["x", "y", "z"]].to_numpy()
    monkeypatch.chdir(tmp_path)
    table.to_csv("two.csv", index=False)
    for use, of_all in (("targets", True), ("position", False)):
        assert main(["calibrate", "ur10", "two.csv", "-o", use, "--use", use, "--no-refit"]) == 0
        told = " ".join(capsys.readouterr().out.split())
        assert ("mm per coordinate of all targets together." in told) == of_all
        page = words_of((tmp_path / use / "report.html").read_text())
        assert "mean error that noise alone would leave" in page
        assert ("noise alone would leave on all targets together" in page) == of_all


def test_every_cell_with_measured_poses_is_filled_and_good_ones_are_dark(drawn, variable):
    maps = {title: figure for title, figure in drawn.items() if title.startswith("Standard deviation over")}
    assert len(maps) == 4
    for figure in maps.values():
        cells, dots = figure["traces"]
        assert cells["zmax"] >= 1.99 * Facts(variable).mean_mm()
        z = np.array(cells["z"], dtype=float)
        for x, y in zip(dots["x"], dots["y"], strict=True):
            column = np.argmin(np.abs(np.array(cells["x"]) - x))
            row = np.argmin(np.abs(np.array(cells["y"]) - y))
            assert np.isfinite(z[row, column])


@pytest.mark.parametrize(("use", "compared"), [("variable", True), ("constant", False), ("bounds", False)])
def test_standard_deviations_are_compared_with_errors_where_both_are_of_one_kind(variable, use, compared):
    found = small_calibration("constant") if use == "constant" else variable
    text = words_of(report(found.without_rows() if use == "bounds" else found).html)
    assert ("in brighter cells they are known worse" in text) == compared
    assert ("with what the constants leave (root" in text) == (use == "constant")
    assert ("without noise of the measurement (root" in text) == (use != "constant")


def test_a_report_on_distances_names_one_point_and_compares_no_error_with_it():
    made = report(ta.calibrate(ta.Robot.load("ur5e"), wire(0.0), model="constant", refit=False))
    text = words_of(made.html)
    assert "moves the flange by" in text
    assert "Standard deviation of the flange as" in text
    assert "of the flange, as the robot file names no tool)" in text
    assert "robot file's tool" not in text
    assert "known worse" not in text


def test_no_line_ends_within_the_name_of_an_option():
    advice = [("Use it.", "Say <--use-pose pose>, or --holdout 0.25: not -- as a dash-")]
    drawn = page(Head(title="Report", about="an arm", advice=advice), [])
    told = "Say &lt;<code>--use-pose</code> pose&gt;, or <code>--holdout</code> 0.25: not -- as a dash-"
    assert told in drawn
    assert re.search(r"code \{[^}]*white-space: nowrap", drawn)


def test_arrows_and_arm_lie_within_the_axes_that_the_page_fits_into_view(drawn):
    figure = drawn["Errors in space, enlarged"]
    assert all(choice["label"].endswith(":1") for choice in figure["choices"])
    for choice in figure["choices"]:
        scene = choice["layout"]["scene"]
        sides = {}
        for name in "xyz":
            low, high = scene[f"{name}axis"]["range"]
            sides[name] = high - low
            for trace, is_shown in zip(figure["traces"], choice["shown"], strict=True):
                values = [value for value in trace[name] if value is not None]
                assert not is_shown or (low <= min(values) and max(values) <= high)
        ratios = [scene["aspectratio"][name] / sides[name] for name in "xyz"]
        np.testing.assert_allclose(ratios, ratios[0], rtol=1e-2)


def test_every_parameter_has_its_name_below_a_map(drawn):
    titles = ("Which parameter varies", "Correlations of the constant")
    maps = [figure["layout"] for title, figure in drawn.items() if title.startswith(titles)]
    assert len(maps) == 2
    assert {layout["xaxis"]["dtick"] for layout in maps} == {1}


def test_no_button_has_a_zero_with_a_sign(variable, drawn):
    labels = [choice["label"] for figure in drawn.values() for choice in figure["choices"]]
    assert not [label for label in labels if re.search(r"-0\b(?!\.)", label)]
    assert fixed(-0.3, 0) == "0"


def test_decimals_of_refusals_end_without_zeros():
    said = "joint 10 turns by 2.2370 deg from -360.0479 deg, 1.0000 deg of 120.00 is allowed."
    assert without_zeros(said) == "joint 10 turns by 2.237 deg from -360.0479 deg, 1 deg of 120 is allowed."
    assert without_zeros("of 0.0000 mm") == "of 0 mm"


def test_few_poses_have_no_lines_along_joints_and_no_share_of_all_errors():
    """Twenty make two stretches: they are neither compared nor joined."""
    arm = VirtualArm.paper(seed=2)
    found = report(ta.calibrate(arm.robot, arm.measure(arm.poses(40)), model="constant", holdout=0.5))
    figures = dict(zip([title for title, _ in found.figures], figures_of(found.html)["figures"], strict=True))
    assert dict(found.figures)["Error along joint 1"].startswith("Too few poses")
    assert {trace["mode"] for trace in figures["Error along joint 1"]["traces"]} == {"markers"}
    assert "These 12 of 20 held-out rows" in words_of(found.html)
    few = report(ta.calibrate(arm.robot, arm.measure(arm.poses(40)), model="constant", holdout=0.25))
    assert "held-out rows make up" not in words_of(few.html)


def test_errors_of_shots_are_counted_in_rows():
    robot, data = repeated_measurements(sides_apart_mm=0.0, noise_mm=0.05)
    for measured, counted in ((data, "rows"), (data.select(np.arange(1, len(data), 16)), "poses")):
        made = report(ta.calibrate(robot, measured, model="constant", drift="none"))
        assert f"95 % of the {counted} have an error below" in words_of(made.html)
        assert f"share of the {counted}, %" in made.html


@pytest.mark.parametrize(("amplitude", "told"), [(0.0003, False), (0.02, True)])
def test_a_wave_within_its_band_is_no_finding(amplitude, told):
    x = np.linspace(-150.0, 150.0, 121)
    values = 2e-4 * x + amplitude * np.sin(2.0 * np.pi * x / 50.0)
    assert ("A wave with a period" in in_words("theta1", "deg", x, values, "deg", 0.0076)) == told


@pytest.mark.parametrize("sure", [None, 1e-7])
def test_a_curve_of_rounding_alone_has_neither_size_nor_wave(sure):
    x = np.linspace(-150.0, 150.0, 121)
    words = in_words("theta1", "deg", x, 1e-5 * np.sin(2.0 * np.pi * x / 50.0), "deg", sure)
    assert "varies by less than 0.0001 deg" in words
    assert "A wave" not in words


def test_distances_from_the_mean_of_a_pose_are_those_of_the_table():
    robot, data = repeated_measurements(sides_apart_mm=0.0, noise_mm=0.05)
    points = data.targets[1::2, 0].reshape(-1, 8, 3)
    apart = 1e3 * np.linalg.norm(points - points.mean(axis=1, keepdims=True), axis=2)
    says = dict(report(ta.calibrate(robot, data, model="constant", drift="none")).figures)[
        "How well poses repeat"
    ]
    raw, free = (float(found) for found in re.findall(r"lie (\d\.\d+) mm", says))
    assert raw == pytest.approx(apart.mean(), abs=0.001)
    assert free == pytest.approx(apart.mean() * np.sqrt(8 / 7), abs=0.001)


def test_scatter_comes_from_the_noise_where_each_side_was_measured_once():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1, imperfections=Imperfections(share=0.0, noise_mm=0.05))
    poses = arm.poses(60)
    data = arm.measure(np.vstack([poses, poses[::-2]]))
    text = words_of(report(ta.calibrate(arm.robot, data, model="constant")).html)
    rows = re.findall(r"joint \d \d+ (\d\.\d+) (\d\.\d+)", text.partition("Poses approached from both")[2])
    assert rows
    for _, alone in rows:
        assert float(alone) == pytest.approx(0.05 * np.sqrt(6.0), rel=0.2)
    assert re.search(r"No joint's sides lie farther apart than scatter and chance may make of \d+", text)


def test_a_scara_is_not_told_to_determine_what_no_target_could():
    arm = VirtualArm(ta.Robot.load("adept-cobra-600"), seed=2)
    found = ta.calibrate(arm.robot, arm.measure(arm.poses(60)), model="constant")
    assert "alpha4" in found.identifiability.undetermined
    assert "unseen_parameters" not in [advice.kind for advice in advise(Facts(found), None)]


def test_a_gantry_is_not_told_to_turn_what_no_motion_turns():
    link = '[[link]]\njoint = "prismatic"\ntheta = {t}\nd = 0\na = 0\nalpha = {t}\nlimits = [0, 1000]\n'
    head = 'name = "gantry"\nconvention = "standard"\nlength_unit = "mm"\nangle_unit = "deg"\n'
    gantry = ta.Robot.from_toml(head + "".join(link.format(t=angle) for angle in (-90, -90, 0)))
    arm = VirtualArm(gantry, seed=2)
    found = ta.calibrate(gantry, arm.measure(arm.poses(60)), model="constant")
    assert "alpha3" in found.identifiability.undetermined
    assert "unseen_parameters" not in [advice.kind for advice in advise(Facts(found), None)]


@pytest.mark.parametrize("count", [1, 2])
def test_what_targets_take_over_is_not_to_be_determined_on_the_last_axis_either(count):
    """Off it, theta6 would be taken over by the targets in place of not being seen."""
    arm = VirtualArm(ta.Robot.load("ur10"), seed=2, imperfections=Imperfections(share=0.0))
    poses, along = arm.poses(60), arm.robot.flange[:3, 2]
    tables = []
    for number in range(count):
        arm.target_in_flange = (0.1 + 0.05 * number) * along
        tables.append(arm.measure_table(poses, seed=number))
    names = {axis: f"{axis}2" for axis in "xyz"}
    table = pd.concat(
        [tables[0], *(each[["x", "y", "z"]].rename(columns=names) for each in tables[1:])], axis=1
    )
    found = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant")
    assert "theta6" in found.identifiability.undetermined
    assert "unseen_parameters" not in [advice.kind for advice in advise(Facts(found), None)]


def test_in_the_modified_convention_targets_take_over_what_follows_the_last_axis():
    arm = VirtualArm(ta.Robot.load("franka-panda"), seed=2, imperfections=Imperfections(share=0.0))
    found = ta.calibrate(arm.robot, arm.measure(arm.poses(60)), model="constant")
    assert taken_over(Facts(found)) == {"theta7", "d7"}
    assert not {"a7", "alpha7"} & set(found.identifiability.undetermined)


def test_regions_move_the_point_as_far_as_all_their_ceps_do_together():
    """Against where the models have the measured point, the regions' and without their CEPs."""
    found = small_calibration("regions")
    made, readings = report(found), found.learned_from.data.readings
    says = dict(made.figures)["The regions"]
    values, chain = found.robot.joints_from_readings(readings), found.arm.chain(found.robot.flange)
    ends = [chain.pose(values, each) for each in (found.model.parameters(values), found.model.constants)]
    point = found.model.setup.targets[0, 0]
    with_ceps, without = (end[:, :3, :3] @ point + end[:, :3, 3] for end in ends)
    apart = 1e3 * np.linalg.norm(with_ceps - without, axis=1)
    scheme = found.model.scheme
    region = scheme.regions.find(np.ascontiguousarray(values[:, list(scheme.inputs)]))
    of_regions = [np.sqrt(np.square(apart[region == k]).mean()) for k in np.unique(region)]
    median, most = (float(number) for number in re.findall(r"(\d\.\d+) mm", says))
    assert median == pytest.approx(np.median(of_regions), rel=0.3)
    assert most == pytest.approx(np.max(of_regions), rel=0.3)
    assert "-0 deg" not in says
    place = [title for title, _ in made.figures].index("The regions")
    marker = figures_of(made.html)["figures"][place]["traces"][0]["marker"]
    assert marker["cmin"] == 0.0
    assert marker["cmax"] == pytest.approx(max(marker["colors"]), rel=1e-3)
