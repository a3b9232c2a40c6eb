"""Calibrations with which compensation refuses most measured rows: the report and the screen say so."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.report_support import small_calibration
from truearm.cli.calibrate import suggest_next
from truearm.reporting.charts import colour_bar
from truearm.reporting.facts import Facts
from truearm.reporting.report import report
from truearm.reporting.verdict import tone
from truearm.simulation import Imperfections, VirtualArm


@pytest.fixture(scope="module")
def turned():
    """Of an arm whose joint 5 has its zero so far off that all corrections turn the tool by too much."""
    robot = ta.Robot.load("abb-irb-120")
    table = robot.table.copy()
    table[4, 0] += np.radians(1.5)
    arm = VirtualArm(replace(robot, table=table), seed=1, imperfections=Imperfections(share=0.0))
    return ta.calibrate(robot, arm.measure(arm.poses(60)), model="constant")


def test_a_report_says_first_that_most_is_refused_and_why(turned):
    first = report(turned).advice[0]
    assert first.kind == "mostly_refused"
    assert "Of 60 measured rows, corrected as waypoints, " in first.words
    assert "such as: the correction turns the tool by 1.5" in first.words
    assert "--largest-deg allows more." in first.words
    assert tone(Facts(turned)) == "fair"


def test_the_command_that_comes_next_allows_what_would_be_refused(turned, tmp_path, capsys):
    suggest_next(turned, tmp_path / "calibration.calib")
    printed = capsys.readouterr().out
    assert "the correction turns the tool by" in " ".join(printed.split())
    assert " PROGRAM --controller MODEL --largest-deg NUMBER --dry-run" in printed


def test_where_most_is_corrected_nothing_is_said():
    facts = Facts(small_calibration("constant"))
    assert facts.waypoints is not None
    assert (facts.mostly_refused, facts.waypoints.allowing) == ("", "")


def test_ticks_of_colour_bars_have_no_prefixes():
    """A unit stands in the title: 500µ below mm is another one."""
    assert colour_bar("mm")["exponentformat"] == "none"
