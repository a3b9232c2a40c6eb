"""Warnings where a path leads from corrected targets past places without numbers of their own."""

import numpy as np
import pytest

from tests.program_tools import read as read_text
from tests.program_tools import rewritten as rewritten_text
from tests.programs_rig import ABB, KUKA, models, read, rewritten
from tests.test_programs_krl import ALREADY
from tests.test_programs_krl import pose_text as krl_pose
from tests.test_programs_melfa import FLANGE, MELFA, position
from tests.test_programs_rapid import module, points
from tests.test_programs_tp import TP, pose, program
from tests.test_programs_urscript_steps import AWAY, HOME, TCP, UR, pose_text
from truearm.robot import Robot

STOP, PASS = "v100,fine,tG\\WObj:=wT;", "v100,z10,tG\\WObj:=wT;"
ENDS = np.deg2rad([[-10, 20, 80, 5, 70, 15], [10, 20, 80, 5, 70, 15]])
FANUC_ENDS = np.deg2rad([[-10, 20, -10, 5, -80, 15], [10, 20, -10, 5, -80, 15]])


def warned(done):
    """The lines that a warning of steps names; None without one."""
    notices = [notice for notice in done.notices if notice.kind == "steps"]
    return notices[0].rows if notices else None


def rapid(body):
    done = rewritten(read("a.mod", module(body, points()), ABB), models(ABB))
    first = done.program.sources[0].text[: done.program.sources[0].text.index("main()")].count("\n") + 1
    lines = warned(done)
    return None if lines is None else [line - first for line in lines]


def test_a_motion_to_a_place_that_is_computed_makes_a_step_in_rapid():
    between = f"MoveL pA,{STOP}\n{{}}\nMoveL pB,{STOP}"
    assert rapid(between.format(f"MoveL fPos(1),{STOP}")) == [2]
    assert rapid(between.format(f"MoveC fPos(1),fPos(2),{PASS}")) == [2]
    assert rapid(f"MoveJ pA,{STOP}\nMoveL fPos(1),{STOP}") == [2]
    assert rapid(f"MoveJ pA,{STOP}\nMoveJ fPos(1),{STOP}\nMoveL pB,{STOP}") == [2]
    assert rapid(f"MoveJ pA,{STOP}\nMoveJ fPos(1),{PASS}\nMoveJ pB,{STOP}") == [2]
    assert rapid(f"MoveJ pA,{PASS}\nMoveJ fPos(1),{STOP}\nMoveJ pB,{STOP}") == [2]


@pytest.mark.parametrize(
    ("line", "steps"),
    [
        (f"PaintL pC,{STOP}", True),
        ("SearchC di1,pHere,pC,pD,v100,tG\\WObj:=wT;", True),
        (f"arcl2 pC,v100,sm1,wd1,{STOP}", True),
        ("TriggLIOs pC,v100\\TriggData1:=tr,fine,tG\\WObj:=wT;", True),
        ("MoveL\\Conc,pC,v100,fine,tG\\WObj:=wT\\Corr;", True),
        ("MoveL pC,v100;", True),
        ("MoveExtJ jHome,v100,fine;", False),
        ("SearchExtJ di1,jPos,jHome,v100;", False),
        ("TriggCheckIO tr,5,di1,EQ,1,irq;", False),
        ("MoveHome;", False),
    ],
)
def test_a_motion_that_is_not_known_makes_a_step_in_rapid(line, steps):
    body = f"MoveJ pA,{STOP}\n{line}\nMoveJ pB,{STOP}"
    assert rapid(body) == ([2] if steps else None)


@pytest.mark.parametrize(
    "body",
    [
        f"MoveJ pA,{STOP}\nMoveJ fPos(1),{STOP}\nMoveJ pB,{STOP}",
        f"MoveL fPos(1),{PASS}\nMoveL fPos(2),{STOP}",
        f"MoveJ pA,{STOP}\nMoveL pB,{STOP}",
    ],
)
def test_a_stop_between_motions_of_the_joints_makes_no_step(body):
    assert rapid(body) is None


@pytest.mark.parametrize(
    ("motion", "steps"), [("L PR[1] 100mm/sec CNT100", True), ("J PR[1] 50% FINE", False)]
)
def test_a_position_register_makes_a_step_in_a_listing(motion, steps):
    robot = Robot.load("fanuc-lr-mate-200id")
    places = [pose(robot, number, q) for number, q in enumerate(FANUC_ENDS, 1)]
    lines = ["J P[1] 50% FINE", motion, "J P[2] 50% FINE"]
    done = rewritten_text(TP, program(lines, places), robot, by=1e-3)
    line = done.program.sources[0].text.partition(motion)[0].count("\n") + 1
    assert warned(done) == ((line,) if steps else None)


@pytest.mark.parametrize(
    ("lines", "steps"),
    [
        (["Cnt 1", "Mov P1", "Mvs PX", "Mov P3"], (3,)),
        (["Mov P1", "Mov PX", "Mvs P3"], (2,)),
        (["Mov P1", "Mov PX", "Mov P3"], None),
        (["Mov P1", "Mvs ,-50", "Mov P3"], None),
    ],
)
def test_a_variable_that_is_no_constant_makes_a_step_in_melfa(lines, steps):
    robot = Robot.load("mitsubishi-rv-4fl")
    places = [f"{name}={position(robot, q)}" for name, q in zip(("P1", "P3"), ENDS, strict=True)]
    done = rewritten_text(MELFA, "\n".join([*lines, "PX=P_Curr", *places, ""]), robot, by=1e-3, frames=FLANGE)
    assert warned(done) == steps


def test_a_target_that_is_computed_makes_a_step_in_urscript():
    robot = Robot.load("ur10e")
    text = f"{TCP}movej({HOME})\nmovel(get_target_tcp_pose())\nmovej({AWAY})\n"
    assert warned(rewritten_text(UR, text, robot, by=1e-3)) == (3,)
    assert warned(rewritten_text(UR, text.replace("movel", "movej"), robot, by=1e-3)) is None
    assert read_text(UR, f"{TCP}movel({pose_text(AWAY)})\n", robot).unplaced == []


@pytest.mark.parametrize(
    ("line", "steps"),
    [
        (f"optimovel({pose_text(HOME)})", True),
        (f"r = movel({pose_text(HOME)})", True),
        (f"if movec({pose_text(HOME)}, {pose_text(HOME)}):\nend", True),
        (f"r = servoj({HOME})", True),
        (f"optimovej({HOME})", False),
        (f"r = movej({HOME})", False),
        ("speedl([0, 0, 0.1, 0, 0, 0], 0.5, 1)", False),
    ],
)
def test_a_motion_that_is_not_followed_makes_a_step_in_urscript(line, steps):
    text = f"{TCP}movej({HOME})\n{line}\nmovej({AWAY})\n"
    done = rewritten_text(UR, text, Robot.load("ur10e"), by=1e-3)
    assert [one.line for one in done.listed] == [3]
    assert warned(done) == ((3,) if steps else None)


def test_a_target_that_is_computed_makes_a_step_in_krl():
    here, there = (krl_pose(q, decimals=5) for q in ([-30, -90, 100, 20, 45, 30], [30, -90, 100, 20, 45, 30]))
    src = f"{ALREADY}PTP {here}\nLIN $POS_ACT\nPTP {there}\nEND\n"
    line = src.partition("LIN $POS")[0].count("\n") + 1
    assert warned(rewritten(read("a.src", src, KUKA), models(KUKA))) == (line,)
    assert warned(rewritten(read("a.src", src.replace("LIN", "PTP"), KUKA), models(KUKA))) is None
