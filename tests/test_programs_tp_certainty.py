"""FANUC listings: frames and targets that are certain only while a program runs; how files may be written."""

import re

import numpy as np
import pytest

from tests.program_tools import Bend, names_changed, read, reasons, rewritten, says
from tests.test_programs_tp import FINE_STEPS, FRAMES, SHIFT, TP, Q, joints, long_line, pose, program
from truearm.robot import Robot

MOVE = "L P[1] 10mm/sec FINE"
OFFSET = "an offset known at run time is added"
SENSED = "the path is changed at run time by a sensor"


@pytest.fixture(scope="module")
def robot():
    return Robot.load("fanuc-lr-mate-200id")


def left(robot, lines, *, current=False):
    """Reasons of what is left as it is of P[1], in user frame 1 or the current one, and of P[2] of joints."""
    first = pose(robot, 1, Q[0], ("1", "2"))
    first = first.replace("UF : 1, UT : 2", "UF : F, UT : F") if current else first
    text = program(lines, [first, joints(2, Q[0])])
    found = reasons(rewritten(TP, text, robot, by=SHIFT, frames=FRAMES))
    return {name: reason for _, name, reason in found if reason != "no motion goes there"}


UNKNOWN = "which UFRAME is set in line 7 is known only when the program runs"
SET = {
    "UFRAME[R[1:frm]]=PR[10:vision]": UNKNOWN,
    "UFRAME[AR[1]]=PR[10]": UNKNOWN,
    "UFRAME[GP1:R[1]]=PR[10]": UNKNOWN,
    "$MNUFRAME[1,R[1]]=PR[10]": UNKNOWN,
    "$GROUP[1].$UFRAME=PR[10]": UNKNOWN,
    "UFRAME[GP1:1]=PR[10:vision]": "UFRAME[1] is set in line 7 when the program runs",
    "UFRAME[1:table]=PR[GP1:10]": "UFRAME[1] is set in line 7 when the program runs",
    "$MNUFRAME[1,1]=PR[10]": "UFRAME[1] is set in line 7 when the program runs",
    "IF (DI[1]=ON),UFRAME[1]=PR[10]": "UFRAME[1] is set in line 7 when the program runs",
    "UTOOL[GP1:2:grip]=PR[10]": "UTOOL[2] is set in line 7 when the program runs",
    "UTOOL[R[3]]=PR[10]": "which UTOOL is set in line 7 is known only when the program runs",
    "UFRAME[GP2:1]=PR[10]": "",
    "UFRAME[3]=PR[10]": "",
    "$MNUFRAME[2,1]=PR[10]": "",
    "PR[10]=UFRAME[1]": "",
}


@pytest.mark.parametrize("line", SET)
def test_a_frame_that_the_program_may_set_is_not_that_of_the_file(robot, line):
    assert left(robot, [f"  {line}", MOVE]).get("P[1]", "") == SET[line]


def test_frame_zero_cannot_be_set(robot):
    text = program(["  UFRAME[R[1]]=PR[1]", "  UTOOL[R[1]]=PR[1]", MOVE], [pose(robot, 1, Q[0])])
    assert rewritten(TP, text, robot, by=SHIFT).changed.all()


CURRENT = {
    ("UFRAME_NUM=1", "UTOOL_NUM=2"): True,
    ("UFRAME_NUM[GP1]=1", "UTOOL_NUM[GP1]= 2"): True,
    ("UFRAME_NUM[GP1,GP2]=1", "UTOOL_NUM=2"): True,
    ("$MNUFRAMENUM[1]=1", "$MNUTOOLNUM[1]=2"): True,
    ("UFRAME_NUM=1", "UTOOL_NUM=2", "UFRAME_NUM[GP2]=3", "$MNUTOOLNUM[2]=R[1]"): True,
    ("UFRAME_NUM=1", "UTOOL_NUM=2", "UFRAME_NUM[GP1]=3"): False,
    ("UFRAME_NUM=1", "UTOOL_NUM=2", "UFRAME_NUM[GP1]=R[1:my frame]"): False,
    ("UFRAME_NUM=1", "UTOOL_NUM=2", "UTOOL_NUM[GP1]=AR[1]"): False,
    ("UFRAME_NUM=R[1:my frame]", "UTOOL_NUM=2"): False,
    ("UFRAME_NUM=1", "UTOOL_NUM=2", "$MNUTOOLNUM[R[1]]=3"): False,
    ("UFRAME_NUM=1", "UTOOL_NUM=2", "IF (DI[1]),UTOOL_NUM[GP1]=(3)"): False,
}


@pytest.mark.parametrize("lines", CURRENT)
def test_the_current_frame_in_all_spellings(robot, lines):
    found = left(robot, [*(f"  {line}" for line in lines), MOVE], current=True)
    assert ("P[1]" not in found) == CURRENT[lines]
    assert CURRENT[lines] or "is not one number throughout the program" in found["P[1]"]


MAY_CALL = (
    "HOME",
    "Open hand 1",
    "TOOL CHANGE 2",
    "CALL GRIP",
    "call grip",
    "RUN GRIP",
    "WAIT DI[1]=ON,CALL GRIP",
    "IF R[1]=1,CALL GRIP",
    "IF R[1]=1,HOME",
    "IF PR[1,R[2]]=5,HOME",
    "SELECT R[1]=1,CALL GRIP",
    "=2,CALL GRIP",
    "ELSE,CALL GRIP",
    "ERROR_PROG=GRIP",
    "MONITOR WATCH",
    "L PAL_1[A_1] 100mm/sec FINE",
)
ONLY_HERE = (
    "",
    "DO[1]=ON",
    "DO[1:CALL ME]=PULSE,0.5sec",
    "R[R[1]]=R[1]+1",
    "PR[R[1],2]=PR[3,2]",
    "PR[1]=LPOS",
    "$MCR.$GENOVERRIDE=50",
    "WAIT .5(sec)",
    "WAIT DI[1]=ON TIMEOUT,LBL[9]",
    "Timer[1]=START",
    "PAYLOAD[1]",
    "OVERRIDE=50%",
    "LINEAR_MAX_SPEED=200",
    "COL GUARD ADJUST 100",
    "Arc End[1]",
    "Skip condition DI[1]=ON",
    "LOCK PREG",
    "VISION RUN_FIND 'A'",
)
BRANCHING = (
    "LBL[1]",
    "jmp lbl[1]",
    "IF R[1]=1,JMP LBL[1]",
    "IF (DI[1]),PR[1,2]=(5)",
    "IF (R[1]=1) THEN",
    "SELECT R[1]=1,JMP LBL[1]",
    "=2,JMP LBL[2]",
    "ELSE,JMP LBL[3]",
    "ENDFOR",
)


@pytest.mark.parametrize("line", MAY_CALL + ONLY_HERE + BRANCHING)
def test_what_may_run_something_else_is_no_way_from_target_to_target(robot, line):
    """Macros are called by their name alone, and may move the arm and set frames."""
    position = pose(robot, 1, Q[0], ("1", "2")).replace("UF : 1, UT : 2", "UF : F, UT : F")
    lines = ["  UFRAME_NUM=1", "  UTOOL_NUM=2", "J P[2] 10% FINE", f"  {line}", MOVE]
    found = read(TP, program(lines, [position, joints(2, Q[0])]), robot, FRAMES)
    assert found.moves.follows.tolist() == [False, line in ONLY_HERE]
    why = found.environments[found.moves.environment[1]].tool.unknown
    assert why == ("line 10 may call a program or macro that sets UTOOL_NUM" if line in MAY_CALL else "")


SHIFTED = {
    ("Track TAST[1]", MOVE, "Track End"): SENSED,
    ("TRACK AVC[R[2]]", "Weave Sine[1]", MOVE, "Weave End", "Track End"): SENSED,
    ("Touch Offset PR[3]", MOVE, "Touch Offset End"): OFFSET,
    ("MP Offset PR[3] RPM[1]", MOVE, "MP Offset End"): OFFSET,
    ("LBL[1]", MOVE, "Track TAST[1]", "IF R[1]=1,JMP LBL[1]", "Track End"): SENSED,
    ("FOR R[1]=1 TO 3", MOVE, "Track TAST[1]", "ENDFOR"): SENSED,
    ("Track TAST[1]", "L PR[1] 10mm/sec FINE Skip,LBL[9]", "Track End", "LBL[9]", MOVE): SENSED,
    ("L P[1] 10mm/sec FINE Search[-Z]",): SENSED,
    ("Track TAST[1]", "L PR[1] 10mm/sec FINE", "Track End", MOVE): "",
    ("Weave Sine[1]", MOVE, "Weave End[1]"): "",
    ("OFFSET CONDITION PR[1]", "TOOL_OFFSET CONDITION PR[2]", "SKIP CONDITION DI[1]=ON", MOVE): "",
    ("L P[1:Touch offset] 10mm/sec FINE",): "",
}


@pytest.mark.parametrize("lines", SHIFTED)
def test_targets_that_are_moved_while_the_program_runs(robot, lines):
    body = [line if line.startswith("L ") else f"  {line}" for line in lines]
    assert left(robot, body).get("P[1]", "") == SHIFTED[lines]


def test_a_program_that_follows_a_conveyor(robot):
    text = program([MOVE], [pose(robot, 1, Q[0])])
    for number in (0, 1):
        heading = f"/APPL\nLINE_TRACK;\n  LINE_TRACK_SCHEDULE_NUMBER      : {number};\n/MN\n"
        result = rewritten(TP, text.replace("/MN\n", heading), robot, by=SHIFT)
        assert result.changed.all() == (number == 0)
    assert reasons(result)[0][2] == "the program follows a conveyor (LINE_TRACK)"


def test_positions_that_a_computed_number_may_mean(robot):
    chosen = "J P[R[1:n]] 10% FINE"
    assert left(robot, [MOVE, chosen])["P[2]"] == "only line 8 may go there, by a computed number"
    assert "P[1]" not in left(robot, [MOVE, chosen])
    assert left(robot, [MOVE, "L P[R[1]] 9mm/sec FINE INC"])["P[1]"].startswith("line 8 may go there too: ")
    assert "may also be used in line 8" in left(robot, [MOVE, "  PR[1]=P[AR[1]]"])["P[1]"]
    nested = left(robot, [MOVE, "J P[R[R[1]]] 10% FINE"])
    assert nested["J P[R[R[1]]] 10% FINE"] == "which position it is, is computed at run time"


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_a_byte_order_mark_stays_first_and_any_line_end_is_read(robot, ending, mark):
    text = program(["J P[1] 10% FINE", "L P[2] 10mm/sec FINE"], [pose(robot, 1, Q[0]), joints(2, Q[0])])
    content = mark + text.replace("\n", ending).encode()
    done = rewritten(TP, content, robot, by=SHIFT, mark="compensated").contents[0]
    assert names_changed(rewritten(TP, content, robot, by=SHIFT)) == ["P[1]", "P[2]"]
    assert done.startswith(mark + b"/PROG")
    assert done.count(ending.encode()) == content.count(ending.encode()) + 1
    assert np.abs(says(TP, done, robot) - Q[0] - SHIFT).max() < 1e-4


def test_waypoints_end_their_lines_as_the_listing_does(robot):
    text = long_line(robot, "L P[4:END] 250mm/sec FINE")
    plain = rewritten(TP, text, robot, by=Bend(), spacing=FINE_STEPS)
    done = rewritten(TP, text.replace("\n", "\r"), robot, by=Bend(), spacing=FINE_STEPS)
    assert done.inserted >= 2
    assert done.contents[0] == plain.contents[0].replace(b"\n", b"\r")


def test_a_number_that_positions_share_tells_none_of_them(robot):
    places = [pose(robot, 2, Q[0]), joints(1, Q[0]), joints(2, Q[0]), joints(3, Q[0])]
    text = program([f"J P[{number}] 10% FINE" for number in (1, 2, 3)], places)
    done = rewritten(TP, text, robot, by=SHIFT)
    assert names_changed(done) == ["P[1]", "P[3]"]
    lines = [number for number, line in enumerate(text.splitlines(), 1) if line.startswith("P[2]")]
    why = f"/POS has its number more than once, in lines {lines[0]} and {lines[1]}"
    assert reasons(done) == [(line, "P[2]", why) for line in lines]
    assert done.program.unsure == {0, 2}


HUGE = "9" * 400
TOO_LARGE = {
    (r"0'", f"{HUGE}'"): "its CONFIG is not three letters",
    (r"0'", f"-{HUGE[:20]}'"): "its CONFIG is not three letters",
    (r"X = *[-\d.]+", "X = 1e999"): "its X is too large for a number",
    (r"W = *[-\d.]+", f"W = -{HUGE}"): "its W is too large for a number",
    (r"J1= *[-\d.]+", "J1= 1e999"): "its J1 is too large for a number",
}


@pytest.mark.parametrize("written", TOO_LARGE)
def test_a_number_that_is_too_large_leaves_its_position(robot, written):
    places = [pose(robot, 1, Q[0]), joints(2, Q[0])]
    sought, put = written
    text = re.sub(sought, put, program(["J P[1] 10% FINE", "J P[2] 10% FINE"], places))
    result = rewritten(TP, text, robot, by=SHIFT)
    assert len(names_changed(result)) == 1
    assert [reason.startswith(TOO_LARGE[written]) for *_, reason in reasons(result)] == [True]


def test_a_number_that_is_too_large_sets_no_frame(robot):
    sets = [f"  PR[1,{axis}]={HUGE if axis == 1 else 0}" for axis in range(1, 7)]
    found = left(robot, [*sets, "  UFRAME[1]=PR[1]", MOVE])
    assert found["P[1]"].endswith("when the program runs")
