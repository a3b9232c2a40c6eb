"""FANUC and MELFA: joints near half a turn, where turn numbers change."""

from dataclasses import replace

import numpy as np
import pytest

from tests import test_programs_melfa as melfa
from tests import test_programs_tp as tp
from tests.program_tools import reasons, rewritten
from truearm.programs.solving import AMBIGUOUS
from truearm.robot import Robot

HALF_TURN = {0: "N U T, 0, 0, 0", 1: "N U T, 0, 0, 1", -1: "N U T, 0, 0, -1"}
BEHIND = np.deg2rad(0.05) * np.eye(6)[5]


def fanuc(degrees, before, turn):
    """A target where J6 is at `degrees`, with a turn number; the arm comes from where J6 is at `before`."""
    arm = Robot.load("fanuc-lr-mate-200id")
    there, here = (np.deg2rad([20, 10, -20, 30, -60, last]) for last in (degrees, before))
    stated = tp.pose(arm, 2, there).replace(tp.config_text(arm, there), HALF_TURN[turn])
    text = tp.program(["J P[1] 10% FINE", "J P[2] 10% FINE"], [tp.joints(1, here, 0, 0), stated])
    return tp.TP, text, arm


def mitsubishi(degrees, before, turn):
    """The same in MELFA BASIC."""
    arm = Robot.load("mitsubishi-rv-4fl")
    there, here = ([10, 20, 80, 30, 60, last] for last in (degrees, before))
    stated = melfa.position(arm, np.deg2rad(there)).split(")(")[0]
    joints = ",".join(f"{value:.3f}" for value in here)
    lines = ["1 Tool P_NTool", "2 Mov J1", "3 Mov P1", f"J1=({joints})"]
    return melfa.MELFA, "\n".join([*lines, f"P1={stated})(7,{(turn & 15) << 20})\n"]), arm


@pytest.mark.parametrize("before", [-60.0, -1.0, 60.0])
@pytest.mark.parametrize(
    ("degrees", "turn"), [(179.993, 0), (-179.993, 0), (180.007, 1), (-180.007, -1), (180.02, 1)]
)
@pytest.mark.parametrize("written", [fanuc, mitsubishi])
def test_near_half_a_turn_the_turn_number_counts_wherever_the_arm_comes_from(written, degrees, turn, before):
    done = rewritten(*written(degrees, before, turn), by=BEHIND)
    assert reasons(done) == []
    assert np.rad2deg(done.nominal[-1, 5]) == pytest.approx(degrees, abs=0.004)


@pytest.mark.parametrize("before", [-60.0, 60.0])
@pytest.mark.parametrize("degrees", [179.9995, 180.0, -179.9995])
@pytest.mark.parametrize("written", [fanuc, mitsubishi])
def test_on_half_a_turn_rounding_leaves_open_which_is_meant(written, degrees, before):
    done = rewritten(*written(degrees, before, 0), by=BEHIND)
    assert [reason for *_, reason in reasons(done)] == [AMBIGUOUS]


@pytest.mark.parametrize("written", [fanuc, mitsubishi])
def test_a_number_beyond_the_edge_still_names_the_only_joints_there_are(written):
    language, text, arm = written(179.993, 60.0, 1)
    limited = arm.limits.copy()
    limited[5] = np.deg2rad([-200.0, 200.0])
    done = rewritten(language, text, replace(arm, limits=limited), by=BEHIND)
    assert np.rad2deg(done.nominal[-1, 5]) == pytest.approx(179.993, abs=0.004)
