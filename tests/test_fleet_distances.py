"""Fleets with arms whose distances were measured, whose errors are not those of positions."""

import csv
import json
from typing import Any

import numpy as np
import pytest

import truearm as ta
from tests.test_fleet import DRIFT, ROW
from truearm.cli import main
from truearm.fleet.attention import reasons
from truearm.fleet.drift import drift_of
from truearm.fleet.fleet_file import LimitsSection
from truearm.simulation import Imperfections, VirtualArm

POSES = 42
WIRE: dict[str, Any] = {**ROW, "errors_of": "distance"}
HEAD = """
[defaults]
robot = "rv-m2"
model = "constant"
report = false
measurements = "{arm}.csv"
[[arm]]
name = "wire"
[[arm]]
name = "points"
"""


@pytest.fixture
def folder(tmp_path):
    """One arm, measured by points and by a wire from three anchors."""
    arm = VirtualArm(ta.Robot.load("rv-m2"), seed=1, imperfections=Imperfections(share=0.0))
    rows = arm.measure_table(arm.poses(POSES))
    rows.to_csv(tmp_path / "points.csv", index=False)
    named = np.arange(POSES) % 3
    anchors = np.array([[1.8, 0.3, -0.2], [-0.9, 1.5, 0.1], [0.3, -2.0, 0.5]])[named]
    length = np.linalg.norm(rows[["x", "y", "z"]] - anchors, axis=1)
    wire = rows.drop(columns=["x", "y", "z"]).assign(distance=length, anchor=np.array(list("abc"))[named])
    wire.to_csv(tmp_path / "wire.csv", index=False)
    return tmp_path


def test_what_errors_are_of_stands_in_every_table(folder, capsys):
    (folder / "fleet.toml").write_text(HEAD)
    assert main(["fleet", str(folder / "fleet.toml"), "-o", str(folder / "out"), "--workers", "1"]) == 0
    shown = capsys.readouterr().out
    kinds = {"wire": "distance", "points": "position"}
    for name, kind in kinds.items():
        (line,) = (line for line in shown.splitlines() if line.startswith(f" {name} "))
        assert kind in line
        assert len(line) <= 80
    lines = csv.DictReader((folder / "out" / "fleet.csv").read_text().splitlines())
    assert {line["arm"]: line["errors_of"] for line in lines} == kinds
    content = json.loads((folder / "out" / "fleet.json").read_text())
    assert {arm["arm"]: arm["errors_of"] for arm in content["arms"]} == kinds
    words = {arm["arm"]: arm["words"] for arm in content["arms"]}
    assert "the mean distance error is" in words["wire"]
    assert "the mean position error is" in words["points"]
    wire, points = (
        ta.Calibration.load(folder / "out" / name / "calibration.calib") for name in ("wire", "points")
    )
    drift = drift_of(wire, points, ta.Measurements.read_csv(folder / "points.csv"))
    assert drift["previous_errors_of"] == "distance"
    page = (folder / "out" / "fleet.html").read_text()
    assert "nominal, distance" in page
    assert "nominal, position" in page


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
