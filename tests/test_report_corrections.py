"""What reports say of corrections, and of parameters, of arms whose joints turn and slide."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from truearm.reporting.corrections import compensation, largest, tool_moves_mm
from truearm.reporting.facts import Facts
from truearm.reporting.parameters import shifted
from truearm.reporting.parts import Figure
from truearm.reporting.varying_parameters import varying_parameters
from truearm.simulation import VirtualArm

POSES = 30
SHOTS = 3
JOINTS = {"deg": ["1", "2", "4"], "mm": ["3"]}


@pytest.fixture(scope="module")
def facts():
    """Of a SCARA, whose third joint slides; each pose was measured three times."""
    arm = VirtualArm(ta.Robot.load("adept-cobra-600"), seed=2)
    rows = arm.measure(np.tile(arm.poses(POSES), (SHOTS, 1)))
    return Facts(ta.calibrate(arm.robot, rows, model="constant", drift="none"))


def test_joints_that_turn_and_joints_that_slide_have_an_axis_each(facts):
    figures = [part for part in compensation(facts).parts if isinstance(part, Figure)]
    shown = {figure.title: figure for figure in figures}
    for unit, joints in JOINTS.items():
        figure = shown[f"Corrections of the joints, {unit}"]
        assert [trace["name"] for trace in figure.traces] == joints
        assert figure.layout["yaxis"]["title"]["text"] == f"correction, {unit}"
    assert "The corrections of joint 3 are" in shown["Corrections of the joints, mm"].says


def test_that_joint_is_said_to_matter_most_whose_corrections_move_the_tool_most(facts):
    found = facts.waypoints.found
    change = found.q - found.nominal
    robot = replace(facts.calibration.robot, tool=shifted(facts.point))
    good = ~found.refused
    start, moved = found.nominal[good], []
    for joint in range(4):
        alone = np.where(np.arange(4) == joint, change[good], 0.0)
        moved.append(1e3 * np.linalg.norm(robot.position(start + alone) - robot.position(start), axis=1))
    told = tool_moves_mm(facts, start, change[good])
    assert told == pytest.approx(np.transpose(moved), rel=0.02, abs=1e-3)
    first = max((0, 1, 3), key=lambda joint: np.median(moved[joint]))
    figures = [part for part in compensation(facts).parts if isinstance(part, Figure)]
    (figure,) = (figure for figure in figures if figure.title == "Corrections of the joints, deg")
    assert f"The corrections of joint {first + 1} move the tool most." in figure.says


def test_a_pose_that_was_measured_several_times_is_one_line_of_the_largest_corrections(facts):
    made = facts.waypoints
    (table,) = largest(facts, made.data, made.found)
    named = [made.data.rows.tolist().index(int(str(row[0]))) for row in table.rows]
    assert len(np.unique(made.data.readings[named], axis=0)) == len(named) == 6
    assert "Of rows of one pose" in table.says
    assert [part.split()[1] for part in str(table.rows[0][4]).split(", ")] == ["deg", "deg", "mm", "deg"]


def test_a_sliding_joint_is_said_to_have_no_constant_and_no_standard_deviation_of_the_whole(facts):
    table = varying_parameters(facts)
    rows = {row[0]: row for row in table.rows}
    at = {name: list(table.columns).index(name) for name in ("constant part", "standard deviation")}
    assert [rows["d3"][at[name]] for name in at] == ["none", ""]
    assert rows["theta4"][at["constant part"]] == "nominal"
    assert float(str(rows["a2"][at["standard deviation"]])) > 0.0
    assert "it has no constant (none)" in table.says
