"""FANUC listings: frames that the program itself sets to constants, as post-processors write them."""

import numpy as np
import pytest

from tests.program_tools import reasons, rewritten
from tests.test_programs_tp import FRAMES, SHIFT, TP, Q, pose, program
from truearm.programs.frames import Frames
from truearm.robot import Robot

MOVE = "L P[1] 10mm/sec FINE"
OBJECT = (300.0, 50.0, -20.0, 0.0, 5.0, 45.0)
TOOL = (10.0, -5.0, 120.0, 10.0, 0.0, 30.0)


@pytest.fixture(scope="module")
def robot():
    return Robot.load("fanuc-lr-mate-200id")


def elements(values, register=9):
    return [f"  PR[{register},{axis}]={value:.3f}" for axis, value in enumerate(values, 1)]


def stated(values, frame):
    return [*elements(values), f"  {frame}=PR[9]"]


SET = [
    *stated(OBJECT, "UFRAME[1]"),
    "  UFRAME_NUM=1",
    *stated(TOOL, "UTOOL[2]"),
    "  UTOOL_NUM=2",
]


def numbers(result):
    """What the positions are changed to."""
    return result.contents[0].decode().partition("/POS")[2]


def why(robot, lines, frames=""):
    """Why the one position of a program is left; empty if it is changed."""
    text = program(lines, [pose(robot, 1, Q[0], ("1", "2"))])
    result = rewritten(TP, text, robot, by=SHIFT, frames=frames)
    assert result.changed.all() == (not result.listed)
    return next((reason for _, _, reason in reasons(result)), "")


def test_the_frames_of_this_file_are_those_of_the_frames_file():
    known = Frames.parse(FRAMES)
    np.testing.assert_allclose(known.work_object("1").true[:3, 3], np.array(OBJECT[:3]) / 1e3)
    np.testing.assert_allclose(known.tool("2").true[:3, 3], np.array(TOOL[:3]) / 1e3)


@pytest.mark.parametrize("current", [False, True])
def test_stated_frames_are_used_as_those_of_a_frames_file(robot, current):
    position = pose(robot, 1, Q[0], ("1", "2"))
    position = position.replace("UF : 1, UT : 2", "UF : F, UT : F") if current else position
    by_program = rewritten(TP, program([*SET, MOVE], [position]), robot, by=SHIFT)
    lines = ["  UFRAME_NUM=1", "  UTOOL_NUM=2", MOVE]
    by_file = rewritten(TP, program(lines, [position]), robot, by=SHIFT, frames=FRAMES)
    assert by_program.changed.all()
    assert numbers(by_program) == numbers(by_file)
    assert position not in numbers(by_program)


WRITTEN = (
    "PR[9:spare,1:X]=300",
    "PR[GP1:9,1]=300.",
    "PR[9 , 1] = (300.0)",
    "pr[9,1]=+300.00",
)


@pytest.mark.parametrize("first", WRITTEN)
def test_elements_of_registers_may_be_written_in_many_ways(robot, first):
    lines = [f"  {first}", *SET[1:], MOVE]
    assert why(robot, lines) == ""


KNOWN = (
    "R[1]=R[1]+1",
    "DO[3]=ON",
    "WAIT DI[4]=ON",
    "WAIT    .50(sec)",
    "PAYLOAD[1]",
    "MESSAGE[GO]",
    "PR[9]=LPOS",
    "PR[R[2],1]=12",
    "UFRAME_NUM[GP1]=1",
    "OVERRIDE=50%",
    "L P[1] 10mm/sec CNT10 ACC80",
    "PR[9,7]=0",
    "PAUSE",
)
UNKNOWN = (
    "CALL GRIP",
    "RUN GRIP",
    "WAIT DI[4]=ON,CALL GRIP",
    "TOOLCHANGE",
    "LBL[1]",
    "JMP LBL[1]",
    "IF R[1]=1,JMP LBL[1]",
    "FOR R[1]=1 TO 3",
    "MONITOR WATCH",
    "UFRAME[1]=PR[3]",
    "UFRAME[1]=UFRAME[4]",
    "UFRAME[R[1]]=PR[9]",
    "$MNUFRAME[1,1]=PR[9]",
    "IF (DI[1]),UFRAME[1]=PR[9]",
    "L P[1] 10mm/sec FINE TB .10sec,CALL GRIP",
    "L P[1] 10mm/sec FINE TA .10sec,P-SPS",
    "L P[1] 10mm/sec FINE Skip,LBL[3],PR[5]=LPOS",
    "DO[1]=(DI[2]) CALL GRIP",
)


@pytest.mark.parametrize("line", KNOWN)
def test_a_frame_stays_what_it_was_set_to(robot, line):
    assert why(robot, [*SET, f"  {line}", MOVE]) == ""


@pytest.mark.parametrize("line", UNKNOWN)
def test_a_frame_is_not_known_where_something_may_have_changed_it(robot, line):
    assert "when the program runs" in why(robot, [*SET, f"  {line}", MOVE])
    assert "when the program runs" in why(robot, [*SET, f"  {line}", MOVE], FRAMES)


INCOMPLETE = {
    "an axis that is not set": SET[1:],
    "an axis of another register": ["  PR[8,1]=300.000", *SET[1:]],
    "an axis that is computed": ["  PR[9,1]=R[4]", *SET[1:]],
    "a register that is set anew": [*SET[:6], "  PR[9]=P[1]", *SET[6:]],
    "any register": [*SET[:6], "  PR[R[3],2]=5", *SET[6:]],
    "a register of another group": [*SET[:6], "  PR[GP2:9,2]=5", *SET[6:]],
    "a program between": [*SET[:3], "  CALL GRIP", *SET[3:]],
    "a frame of another group": [*SET[:6], "  UFRAME[GP2:1]=PR[9]", *SET[7:]],
}


@pytest.mark.parametrize("lines", INCOMPLETE.values(), ids=INCOMPLETE.keys())
def test_a_frame_is_known_from_all_six_numbers_alone(robot, lines):
    assert why(robot, [*lines, MOVE]) != ""


def test_a_motion_before_the_frame_is_set_is_listed(robot):
    assert "when the program runs" in why(robot, [MOVE, *SET])


def test_each_motion_has_the_frame_that_was_set_last(robot):
    """One number for two objects, one after the other, as post-processors do."""
    other = tuple(value + 25.0 if axis < 3 else value for axis, value in enumerate(OBJECT))
    lines = [*SET, MOVE, *stated(other, "UFRAME[1]"), "L P[2] 10mm/sec FINE"]
    positions = [pose(robot, 1, Q[0], ("1", "2")), pose(robot, 2, Q[0], ("1", "2"))]
    result = rewritten(TP, program(lines, positions), robot, by=SHIFT)
    assert result.changed.all()
    first, second = robot.pose(result.nominal[0]), robot.pose(result.nominal[1])
    moved = (second[:3, 3] - first[:3, 3]) * 1e3
    np.testing.assert_allclose(moved, 25.0, atol=2e-3)


def test_a_position_under_two_frames_is_listed(robot):
    other = tuple(value + 25.0 if axis < 3 else value for axis, value in enumerate(OBJECT))
    text = program([*SET, MOVE, *stated(other, "UFRAME[1]"), MOVE], [pose(robot, 1, Q[0], ("1", "2"))])
    result = rewritten(TP, text, robot, by=SHIFT)
    assert not result.changed.any()
    assert reasons(result)
