"""MELFA BASIC: which tool a motion has and what a target is, if it is certain; how files may be written."""

import random
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.program_tools import Bend, names_changed, read, reasons, rewritten, says
from tests.test_programs_melfa import FINE_STEPS, FLANGE, MELFA, SHIFT, Q, line_numbers, long_line, position
from truearm.programs.frames import Frames
from truearm.programs.source import Source
from truearm.robot import Robot

TOOL = "Tool (0,0,120,0,0,0)"
OTHER = "Tool (0,0,60,0,0,0)"
UNSURE = "which tool is set here depends on how the program runs"


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mitsubishi-rv-4fl")


def program(robot, lines, tool_z=0.12, **others):
    """Numbered lines, and behind them P1 to P3 at three places of the tool, and other variables."""
    places = [f"P{n}={position(robot, q, tool_z)}" for n, q in enumerate(Q, 1)]
    stored = [f"{name}={value}" for name, value in others.items()]
    return "\n".join([*(f"{10 * n} {line}" for n, line in enumerate(lines, 1)), *places, *stored, ""])


def left(robot, lines, frames="", **others):
    """Reasons of what is left as it is, by name, those of what no motion goes to left out."""
    result = rewritten(MELFA, program(robot, lines, **others), robot, by=SHIFT, frames=frames)
    return {name: reason for _, name, reason in reasons(result) if reason != "no motion goes there"}


UNCERTAIN = {
    "a branch that may not be taken": ["If M_In(1)=1 Then", TOOL, "EndIf", "Mov P1"],
    "a branch of a line": ["If M_In(1)=1 Then " + TOOL, "Mov P1"],
    "a branch that jumps over it": ["If M_In(1)=1 Then *L1", TOOL, "*L1", "Mov P1"],
    "a jump over it by number": ["If M_In(1)=1 Then 30", TOOL, "Mov P1"],
    "a subroutine called before and behind it": [
        "GoSub *HOME", TOOL, "GoSub *HOME", "End", "*HOME", "Mov P1", "Return",
    ],
    "a loop of labels": ["*LOOP", "Mov P1", TOOL, "GoTo *LOOP"],
    "a loop of numbers": ["Mov P1", TOOL, "GoTo 10"],
    "a loop": [OTHER, "For M1=1 To 3", "Mov P1", TOOL, "Next M1"],
    "a loop that may not run": ["While M1<3", TOOL, "WEnd", "Mov P1"],
    "a case that may not be chosen": ["Select M1", "Case 1", TOOL, "Break", "End Select", "Mov P1"],
    "a subroutine that may be chosen": ["On M1 GoSub *T", "Mov P1", "End", "*T", TOOL, "Return"],
    "an interrupt": [
        TOOL, "Def Act 1,M_In(1)=1 GoSub *T", "Act 1=1", "Dly 1", "Mov P1", "End", "*T", OTHER, "Return 1",
    ],
    "blocks that do not fit": [TOOL, "EndIf", "Mov P1", OTHER],
    "a label that is not there": [TOOL, "Mov P1", "If M1=1 Then *GONE", OTHER],
}  # fmt: skip


@pytest.mark.parametrize("case", UNCERTAIN)
def test_a_tool_that_not_all_ways_to_a_motion_set_is_not_certain(robot, case):
    assert left(robot, UNCERTAIN[case]) == {"P1": UNSURE}


CERTAIN = {
    "labels and loops behind it": [
        "Servo On", "If M_Svo=0 Then Servo On", TOOL, "*LOOP", "Mov P1", "For M1=1 To 3", "Mvs P2", "Next",
        "GoSub *PICK", "If M1=1 Then Mov P1 Else GoTo *LOOP", "GoTo *LOOP", "*PICK", "Mvs P3", "Return",
    ],
    "a label before it": ["*MAIN", TOOL, "Mov P1", "Mov P2", "Mov P3", "GoTo *MAIN"],
    "a subroutine sets it": [
        "GoSub *INIT", "*LOOP", "Mov P1", "GoSub *PICK", "GoTo *LOOP", "*INIT", TOOL, "Return", "*PICK",
        "Mov P2", "Mov P3", "Return",
    ],
    "a subroutine before it": ["GoSub *INIT", TOOL, "Mov P1", "Mov P2", "Mov P3", "End", "*INIT", "Return"],
    "both branches set it": ["If M1=1 Then", TOOL, "Else", TOOL, "EndIf", "Mov P1", "Mov P2", "Mov P3"],
    "each branch its own": [
        "If M1=1 Then", TOOL, "Mov P1", "Mov P2", "Else", OTHER, "EndIf", TOOL, "Mov P3",
    ],
    "cases": [
        "Select M1", "Case 1", OTHER, "Break", "Case 2", TOOL, "Mov P1", "Break", "Default", TOOL, "Mov P2",
        "End Select", TOOL, "Mov P3",
    ],
    "an interrupt that leaves it": [
        "Def Act 1,M_In(1)=1 GoSub *T,S", TOOL, "Act 1=1", "Mov P1", "Mov P2", "End",
        "*T", "Mov P3", "Return 0",
    ],
    "nothing leads there": [TOOL, "Mov P1", "Mov P2", "End", "*BYHAND", "Mov P3", "End"],
}  # fmt: skip


@pytest.mark.parametrize("case", CERTAIN)
def test_a_tool_that_all_ways_to_a_motion_set_is_certain(robot, case):
    result = rewritten(MELFA, program(robot, CERTAIN[case]), robot, by=SHIFT)
    assert reasons(result) == []
    assert names_changed(result) == ["P1", "P2", "P3"]
    assert np.abs(result.nominal - Q).max() < 1e-4


@pytest.mark.parametrize(
    "setting", ["M_Tool(1)=2", "M_Tool=2", "Mov P2 Wth M_Tool=2", "Mov P2 WthIf M_In(1)=1,M_Tool=2"]
)
def test_the_number_of_a_tool_replaces_the_one_before(robot, setting):
    assert "tool" in left(robot, [TOOL, setting, "Mov P1"])["P1"]


def test_motions_that_track_a_conveyor_are_left(robot):
    assert "Trk On" in left(robot, [TOOL, "Trk On,PX,P_Curr", "Mvs P1", "Trk Off"])["P1"]
    assert left(robot, [TOOL, "Trk On,PX,P_Curr", "Trk Off", "Mvs P1"]) == {}


CALLED = "the program called in line 3 may have set another "
RELEASED = "RelM in line 3 lets another program have the arm, which may set another "


@pytest.mark.parametrize(
    ("call", "told"),
    [('CallP "SETTOOL"', CALLED), ('If M1=1 Then CallP "X",M2', CALLED), ("RelM", RELEASED)],
)
def test_another_program_may_set_tool_and_base(robot, call, told):
    result = left(robot, [TOOL, "Mov P1", call, "Mov P2", TOOL, "Mov P3"])
    assert result == {"P2": f"{told}tool", "P3": f"{told}base"}
    assert "P3" not in left(robot, [TOOL, "Mov P1", call, TOOL, "Base 0", "Mov P3"])


@pytest.mark.parametrize("getting", ["GetM 2", "If M_In(1)=1 Then GetM 3", "getm M1"])
def test_places_of_another_mechanism_are_left(robot, getting):
    lines = [TOOL, "Mov P1", getting, OTHER, "Base 0", "Mov P2", "GetM 1", "@", "Base 0", "Mvs P3"]
    told = "in line 6 it is a place of the mechanism that GetM gets in line 3, and mechanism 1 is corrected"
    again = [TOOL if line == "@" else line for line in lines]
    assert left(robot, again) == {"P2": told}
    bent = rewritten(MELFA, program(robot, again), robot, by=Bend(), spacing=FINE_STEPS)
    assert bent.inserted == 0, "where the arm stands behind another mechanism's motions is not known"
    never = [line for line in lines if line != "@"]
    lost = "GetM in line 7 changes the mechanism, and its tool is not known until it is set again"
    assert left(robot, never) == {"P2": told, "P3": lost}


def test_the_mechanism_that_a_program_gets_at_its_start_is_the_arm(robot):
    assert left(robot, ["GetM 1", TOOL, "Mov P1", "Mov P2", "Mov P3"]) == {}
    assert left(robot, [TOOL, "RelM", "GetM 1", TOOL, "Base 0", "Mov P1"]) == {}
    assert "P1" in left(robot, ["GetM 2", "*L", TOOL, "Mov P1", "GetM 1", "GoTo *L"])


def test_bases_are_followed_like_tools_and_apart_from_them(robot):
    frames = '[object."base 1"]\nxyz = [0, 0, 0]\n[object."base"]\nxyz = [0, 0, 0]\n'
    assert left(robot, [TOOL, "Base 1", "*L1", "Mov P1", "GoTo *L1"], frames) == {}
    found = left(robot, [TOOL, "*L1", "Mov P1", "Base 1", "GoTo *L1"], frames)
    assert found == {"P1": "which base is set here depends on how the program runs"}
    several = [TOOL, "Base (1,0,0,0,0,0)", "Mov P1", "Base (2,0,0,0,0,0)", "Mov P2"]
    assert "several bases" in left(robot, several, frames)["P1"]


OFFSETS = {
    "Mov P1*POFF": ("POFF.Z=-100", "a target is computed from it in line 3 when the program runs"),
    "Mov P1+PA(1)": ("PA(M1)=P_Curr", "a target is computed from it in line 3 when the program runs"),
    "Tool POFF\n31 Mov P1": ("POFF.Z=200", "the tool is computed when the program runs"),
    "Tool PA(1)\n31 Mov P1": ("PA(M1).Z=200", "the tool is computed when the program runs"),
    "Tool POFF\n32 Mov P1": ("If M1=1 Then POFF=P_Curr", "the tool is computed when the program runs"),
    "Tool POFF\n33 Mov P1": ("Input #1,POFF", "the tool is computed when the program runs"),
}


@pytest.mark.parametrize("use", OFFSETS)
def test_an_offset_or_tool_that_the_program_changes_is_not_its_constant(robot, use):
    stored = {"POFF": "(0,0,0,0,0,0)(7,0)", "PA(1)": "(0,0,0,0,0,0)(7,0)"}
    setting, reason = OFFSETS[use]
    assert left(robot, [TOOL, setting, use], **stored)["P1"] == reason
    assert "P1" not in left(robot, [TOOL, "If POFF.Z>3 Then M1=POFF.Z+PA(1).Z", use], **stored)


FUNCTION = ["End", "Function M Grip(M1)", "Mvs P3", "Grip=1", "FEnd"]
RUNNING = ["M1=Grip(1)", "GRIP(1)", "If Grip(1)=1 Then M1=2", "Dly 0.1:M1=Abs(Grip(1))"]


@pytest.mark.parametrize("call", RUNNING)
def test_behind_a_function_that_may_move_the_arm_it_stands_anywhere(robot, call):
    text = program(robot, [TOOL, "Mov P1", call, "Mvs P2", *FUNCTION])
    assert read(MELFA, text, robot).moves.follows.tolist() == [False, False, False]


@pytest.mark.parametrize("line", ["M1=Abs(M2)", "MGrip=1", "Dly 0.5", "M_Out(1)=1", "*L1", "End"])
def test_a_function_is_entered_by_its_name_alone(robot, line):
    text = program(robot, [TOOL, "Mov P1", line, "Mvs P2", *FUNCTION])
    assert read(MELFA, text, robot).moves.follows.tolist() == [False, line[0] not in "*E", False]


def test_a_tool_that_is_stored_as_it_is_assigned_is_its_constant(robot):
    lines = ["PGRIP=(0,0,120,0,0,0)(0,0)", "Tool PGRIP", "Mov P1"]
    assert left(robot, lines, PGRIP="(+0.00,+0.00,+120.00,+0.00,+0.00,+0.00)(0,0)") == {}
    (reason,) = set(left(robot, lines, PGRIP="(+0.00,+0.00,+121.00,+0.00,+0.00,+0.00)(0,0)").values())
    assert reason == "the tool is computed when the program runs"


def test_a_constant_that_is_written_in_the_motion_is_an_offset(robot):
    lines = ["Tool P_NTool", "Mov P1*(0,0,-50,0,0,0)(0,0)", "Mvs P2+(0, 0, 20, 0, 0, 0)"]
    environments = read(MELFA, program(robot, lines, 0.0), robot).environments
    assert [one.after[2, 3] for one in environments] == [-0.05, 0.0]
    assert [one.before[2, 3] for one in environments] == [0.0, 0.02]


def test_every_motion_of_a_line_is_seen(robot):
    lines = [TOOL, "Mov P2", "If M1=1 Then Mov P1 Else Mov P2,-50", "*L1:If M1=2 Then Mvs P1 Else Mvs P3"]
    assert left(robot, lines)["P2"].startswith("it is used as it stands and with offsets")
    result = rewritten(MELFA, program(robot, lines), robot, by=SHIFT)
    assert names_changed(result) == ["P1", "P3"]
    moves = read(MELFA, program(robot, lines), robot).moves
    assert moves.follows.tolist() == [False, False, False, False, False]
    assert len(moves.target) == 5


def test_words_of_motions_elsewhere_are_none(robot):
    lines = [TOOL, "Mov P1 ' then Mov P2", 'C1$="Mov P3,-50"', "*MvPick", "GoSub *MvPick ", "MvTune 2"]
    result = rewritten(MELFA, program(robot, lines), robot, by=SHIFT)
    assert names_changed(result) == ["P1"]
    assert [reason for _, _, reason in reasons(result)] == ["no motion goes there"] * 2


COMPUTING = {
    "Mvs PA(M1),-50": "PA(1)",
    "Mvs P1+P2+P_01": "P1",
    "Mov P1*P_01": "P1",
    "Mov P2,P1.Z": "P1",
    "Mov P2 Wth M1=P1.Z": "P1",
    "EMvs P1": "P1",
    "M1=PA(M2).X": "PA(1)",
    "If M1=1 Then P2=P1": "P1",
}


@pytest.mark.parametrize("statement", COMPUTING)
def test_what_a_target_is_computed_from_is_left_as_it_is(robot, statement):
    stored = {"PA(1)": position(robot, Q[0], 0.12), "PA(2)": position(robot, Q[1], 0.12)}
    name = COMPUTING[statement]
    plain = program(robot, [TOOL, "Mov P1", "Mov PA(1)", "Mov P2"], **stored)
    assert name in names_changed(rewritten(MELFA, plain, robot, by=SHIFT))
    text = program(robot, [TOOL, "Mov P1", "Mov PA(1)", "Mov P2", statement], **stored)
    result = rewritten(MELFA, text, robot, by=SHIFT)
    assert name not in names_changed(result)
    why = {shown: reason for _, shown, reason in reasons(result)}
    assert "in line 5" in why[name]
    assert "PA(1)" not in why or "in line 5" in why["PA(2)"]


def test_an_array_that_is_declared_is_not_used_by_that(robot):
    stored = {"PA(2)": position(robot, Q[0], 0.12)}
    assert left(robot, ["Dim PA(2)", TOOL, "Mov PA(2)", "Mov P1"], **stored) == {}


@pytest.mark.parametrize("numbered", [True, False])
@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_a_byte_order_mark_stays_first_and_any_line_end_is_read(robot, ending, numbered):
    text = program(robot, [TOOL, "Mov P1", "Mov P2", "Mov P3", "End"])
    text = text if numbered else re.sub(r"(?m)^\d+ ", "", text)
    content = b"\xef\xbb\xbf" + text.replace("\n", ending).encode()
    done = rewritten(MELFA, content, robot, by=SHIFT, mark="compensated").contents[0]
    assert done.startswith(b"\xef\xbb\xbf9 ' compensated" if numbered else b"\xef\xbb\xbf' compensated")
    assert done.count(b"\xef\xbb\xbf") == 1
    assert done.count(ending.encode()) == content.count(ending.encode()) + 1
    assert np.abs(says(MELFA, done, robot) - Q - SHIFT).max() < 1e-4


@pytest.mark.parametrize("ending", ["\n", "\r"])
def test_waypoints_get_numbers_behind_a_byte_order_mark(robot, ending):
    text = "\xef\xbb\xbf" + long_line(robot, ["1 Mov P1", "2 Mvs P3", "3 End"]).replace("\n", ending)
    done = rewritten(MELFA, text, robot, by=Bend(), frames=FLANGE, spacing=FINE_STEPS)
    assert done.inserted >= 2
    numbers = line_numbers(done.contents[0].removeprefix(b"\xef\xbb\xbf"))
    assert numbers == sorted(set(numbers))
    assert len(numbers) == 3 + done.inserted


class Written:
    """A program of branches, loops and subroutines, made at random."""

    def __init__(self, chance):
        self._chance, self.lines = chance, []
        self._block(2)
        self.lines += ["End", "*S1"]
        self._block(1)
        self.lines += ["Return", "*S2"]
        self._block(1)
        self.lines += ["Return"]
        for _ in range(chance.randint(0, 2)):
            self.lines.insert(chance.randint(0, len(self.lines)), "*L1")

    def _block(self, depth):
        for _ in range(self._chance.randint(1, 4)):
            self._statement(depth)

    def _simple(self):
        tool = f"Tool (0,0,{self._chance.choice([10, 20])},0,0,0)"
        known = ["Mov P1", tool, "GoSub *S1", "GoSub *S2", "Mov P1", tool]
        return self._chance.choice([*known, "GoTo *L1"] if "*L1" in self.lines else known)

    def _statement(self, depth):
        kind = self._chance.randint(0, 8) if depth else self._chance.randint(0, 4)
        if kind < 3:
            self.lines.append(self._simple())
        elif kind < 5:
            other = self._chance.choice(["", f" Else {self._simple()}"])
            self.lines.append(f"If M1=1 Then {self._simple()}{other}")
        else:
            first, last = (("If M1=1 Then", "EndIf"), ("For M1=1 To 2", "Next M1"), ("While M1<2", "WEnd"),
                           ("Select M1", "End Select"))[kind - 5]  # fmt: skip
            middle = {5: "Else", 8: "Case 2"}.get(kind, "Mov P1")
            self.lines += [first, *(["Case 1"] if kind == 8 else [])]
            self._block(depth - 1)
            self.lines += [self._chance.choice(["Break", "Mov P1"]) if kind > 6 else "Mov P1", middle]
            self._block(depth - 1)
            self.lines.append(last)


class Obedient:
    """Executes a program with chances for conditions; `tools` has what was set at each motion, by line."""

    def __init__(self, lines, chance):
        self.lines, self._chance = lines, chance
        self.tools: dict[int, set[int]] = {}
        self._ends: dict[int, int] = {}
        self._starts: dict[int, int] = {}
        self._middles: dict[int, list[int]] = {}
        opened: list[int] = []
        for at, line in enumerate(lines):
            if re.match(r"For|While|Select|If .* Then$", line):
                opened.append(at)
            elif re.match(r"Else|Case", line):
                self._middles.setdefault(opened[-1], []).append(at)
            elif re.match(r"Next|WEnd|End Select|EndIf", line):
                self._starts[at] = opened.pop()
                self._ends[self._starts[at]] = at
        self._tool, self._at, self._calls = 0, 0, []

    def run(self):
        for _ in range(300):
            if self._at >= len(self.lines) or self.lines[self._at] == "End":
                return
            at, self._at = self._at, self._at + 1
            self._step(at, self.lines[at])

    def _step(self, at, line):
        word = line.split()[0]
        if " Then " in line:
            parts = re.split(r" (?:Then|Else) ", line)[1:]
            self._step(at, self._chance.choice([*parts, "Dly"] if len(parts) == 1 else parts))
        elif word in {"If", "For", "While", "Select"}:
            inside = self._middles.get(at, [])
            entries = {"If": [at, *inside], "Select": [*inside, self._ends[at]]}
            self._at = 1 + self._chance.choice(entries.get(word, [at, self._ends[at]]))
        elif word in {"WEnd", "Next"}:
            self._at = self._chance.choice([self._starts[at], at + 1])
        elif word in {"Else", "Case", "Break"}:
            around = [first for first, last in self._ends.items() if first < at < last]
            kinds = {"Else": "If", "Case": "Select", "Break": "While|Select"}[word]
            self._at = 1 + self._ends[max(f for f in around if re.match(kinds, self.lines[f]))]
        elif word == "Tool":
            self._tool = int(line.split(",")[2])
        elif word == "Mov":
            self.tools.setdefault(at, set()).add(self._tool)
        elif word == "Return":
            self._at = self._calls.pop() if self._calls else len(self.lines)
        elif word in {"GoSub", "GoTo"}:
            self._calls += [self._at] if word == "GoSub" else []
            self._at = self.lines.index(line.split()[1])


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32))
def test_a_tool_that_is_held_for_certain_is_the_one_that_is_set(robot, seed):
    chance = random.Random(seed)
    lines = Written(chance).lines
    text = "\n".join([*lines, "P1=(400,0,400,180,0,180)(7,0)", ""])
    source = Source.of(Path("test.prg"), text)
    found = MELFA.read([source], robot, Frames.parse('[tool."tool 0"]\nxyz = [0, 0, 0]\n'))
    held: dict[int, set[object]] = {}
    for at, number in zip(found.moves.at, found.moves.environment, strict=True):
        tool = found.environments[int(number)].tool
        name = "" if tool.unknown else round(1e3 * float(tool.true[2, 3]))
        held.setdefault(source.place(int(at))[0] - 1, set()).add(name)
    for _ in range(30):
        runs = Obedient(lines, chance)
        runs.run()
        for line, tools in runs.tools.items():
            assert "" in held[line] or tools <= held[line], (lines[line], line, text)


PLACED = (("A", 0.0), ("B", 0.05), ("C", 0.02))


def test_start_and_end_of_an_arc_stay_as_far_from_its_centre_as_each_other(robot):
    told = (
        "it is used in line 4 by Mvr3, whose start and end have to be equally far from its centre, within "
        "0.01 mm: to have it corrected, use Mvr with a point of the arc"
    )
    lines = [TOOL, "Mov PA", "Mov PC", "Mvr3 PA,PB,PC", "Mvs P1"]
    alone = program(robot, lines, **{f"P{name}": position(robot, Q[0] + by, 0.12) for name, by in PLACED})
    done = rewritten(MELFA, alone, robot, by=SHIFT)
    assert {name: why for _, name, why in reasons(done) if why.startswith("it is")} == dict.fromkeys(
        ("PA", "PB", "PC"), told
    )
    nowhere_else = rewritten(MELFA, alone.replace("Mov PC", "Dly 1"), robot, by=SHIFT)
    assert {name for _, name, why in reasons(nowhere_else) if why == told} == {"PA", "PB"}
    for result in (done, nowhere_else):
        assert names_changed(result) == ["P1"]
        assert b"\nPC=" + position(robot, Q[0] + PLACED[2][1], 0.12).encode() in result.contents[0]
