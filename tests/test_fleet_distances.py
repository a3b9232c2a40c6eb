"""Fleets with arms whose distances were measured, whose errors are not those of positions."""

import csv
import re
from typing import Any

import pytest

from tests.test_fleet import DRIFT, HEAD, ROW, arms
from truearm.cli.fleet import COLUMNS, _cells
from truearm.fits.core_set import Selection
from truearm.fleet import Fleet
from truearm.fleet.attention import reasons
from truearm.fleet.fleet_file import LimitsSection
from truearm.fleet.page import fleet_page
from truearm.fleet.rows import content, judged, table_of

WIRE: dict[str, Any] = {**ROW, "errors_of": Selection((), distances=True).errors_of}


def test_what_errors_are_of_stands_in_every_table():
    fleet = Fleet.from_toml(HEAD + arms("wire", "points"))
    both = {"wire": WIRE, "points": ROW}
    found = judged(fleet, [{**row, "arm": name, "held_out": 30} for name, row in both.items()])
    kinds = {"wire": "distance", "points": "position"}
    at = COLUMNS.index("errors of")
    assert {cells[0]: cells[at] for cells in map(_cells, found)} == kinds
    lines = csv.DictReader(table_of(found).splitlines())
    assert {line["arm"]: line["errors_of"] for line in lines} == kinds
    entries = {entry["arm"]: entry for entry in content(fleet, found, "1")["arms"]}
    for name, kind in kinds.items():
        assert entries[name]["errors_of"] == kind
        assert f"the mean {kind} error is 0.100 mm" in entries[name]["words"]
    page = fleet_page(fleet, found, ())
    for kind in kinds.values():
        assert f"nominal, {kind}" in page
        assert f"The largest {kind} error is that of" in page
    symbols = dict(re.findall(r'"name":"(\w+, \w+)".*?"symbol":"([a-z-]+)"', page))
    assert symbols == {
        "nominal, position": "diamond-open",
        "calibrated, position": "circle",
        "nominal, distance": "diamond",
        "calibrated, distance": "circle-open",
    }


@pytest.mark.parametrize(
    ("row", "limits", "kinds"),
    [
        (WIRE, {"mean_mm": 0.05}, ["unjudged"]),
        (WIRE, {"max_mm": 9.0}, ["unjudged"]),
        (WIRE, {"mean_mm": 0.05, "distance_mean_mm": 0.2}, []),
        (WIRE, {"distance_mean_mm": 0.05, "distance_max_mm": 0.2}, ["mean", "max"]),
        (ROW, {"distance_mean_mm": 0.05, "distance_max_mm": 0.2}, []),
    ],
)
def test_each_kind_of_error_has_limits_of_its_own(row, limits, kinds):
    assert [reason.kind for reason in reasons(row, [row], LimitsSection(**limits))] == kinds


def test_a_limit_that_cannot_be_judged_is_told_with_the_key_that_can():
    (found,) = reasons(WIRE, [WIRE], LimitsSection(mean_mm=0.15))
    assert found.words == (
        "Position errors, which mean_mm would limit, were not measured: distances were, whose errors are "
        "smaller. State distance_mean_mm too, or measure points."
    )


def test_arms_stand_out_of_those_alone_whose_errors_are_of_the_same_kind():
    wires = [{**WIRE, "mean_mm": mean} for mean in (0.1, 0.11, 0.09, 0.1)]
    points = {**ROW, "mean_mm": 0.24}
    assert reasons(points, [*wires, points], LimitsSection()) == []
    far = {**WIRE, "mean_mm": 0.3}
    (found,) = reasons(far, [*wires, far, points], LimitsSection())
    assert found.words == "Mean distance error 3.0 times the median of the fleet's 5 UR10 arms."


@pytest.mark.parametrize(("was", "kinds"), [("distance", []), ("position", ["worse"])])
def test_an_error_is_worse_than_one_of_its_kind_alone(was, kinds):
    drift = {**DRIFT, "previous_mean_mm": 0.04, "previous_errors_of": was}
    row = {**ROW, "drift": drift}
    assert [reason.kind for reason in reasons(row, [row], LimitsSection())] == kinds


def test_an_arm_that_gains_nothing_names_its_outliers():
    far = {"outliers": 1, "outliers_named": "row 21 (8.03 mm)"}
    row = {**WIRE, "nominal_mean_mm": 0.23, "mean_mm": 0.23, **far}
    words = [reason.words for reason in reasons(row, [row], LimitsSection()) if reason.kind == "no_gain"]
    assert len(words) == 1
    assert words[0].startswith("The calibration gains nothing: ")
    assert words[0].endswith(" Look at its outliers first: row 21 (8.03 mm).")
