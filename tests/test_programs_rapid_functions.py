"""ABB RAPID: functions that are called in expressions may move the arm and displace its targets."""

import numpy as np
import pytest

from tests.programs_rig import ABB, read
from tests.test_programs_rapid import numbers
from truearm.programs.rapid_reading import DISPLACED

NOWHERE = np.eye(4)
TARGETS = "\n".join(
    f"CONST robtarget {name}:={numbers(q_deg, NOWHERE, NOWHERE)};"
    for name, q_deg in {"pA": [5, 12, 22, 10, 45, -20], "pB": [8, 14, 24, 12, 47, -22]}.items()
)
GO = "v100,fine,tool0;"
MOVING = f"FUNC bool F(num n)\nMoveL pA,{GO}\nRETURN TRUE;\nENDFUNC\n"
DISPLACING = "FUNC bool F(num n)\nPDispSet pd;\nRETURN TRUE;\nENDFUNC\n"
QUIET = """LOCAL FUNC num Height(num n, \\switch Up)
VAR num more{2}:=[1,2];
FOR i FROM 1 TO Dim(more,1) DO
n:=n+more{i}*Sin(-n); ! MoveL pA,v100
ENDFOR
IF n>3 AND NOT Present(Up) RETURN n;
TEST n
CASE 1,2: SetDO do1,1; WaitTime 0.5;
DEFAULT: TPWrite "MoveL"\\Num:=n;
ENDTEST
RETURN Twice(n);
ENDFUNC
FUNC num Twice(num n)
RETURN 2*n;
ENDFUNC
"""


def read_with(body, functions):
    text = f"MODULE M\n{TARGETS}\nPROC main()\n{body}\nENDPROC\n{functions}ENDMODULE\n"
    return read("m.mod", text, ABB)


def last_follows(between, functions, target="pB"):
    program = read_with(f"MoveJ pA,{GO}\n{between}\nMoveL {target},{GO}", functions)
    main = program.moves.at < program.sources[0].text.index("ENDPROC")
    return bool(program.moves.follows[main][-1])


MAY_MOVE = [
    "ok:=F(1);",
    "ok:=F(1) AND TRUE;",
    "ok:=Elsewhere(1);",
    "n:=Round(Elsewhere());",
    "VAR bool here:=F(1);",
    "IF F(1) ok:=TRUE;",
    "IF NOT F(1) THEN",
    "WaitUntil F(1);",
    'TPWrite "a"\\Bool:=F(1);',
    "n:=Shift(2);",
]
SHIFT = "FUNC num Shift(num n)\nIF n=2 Move2;\nRETURN n;\nENDFUNC\n"


@pytest.mark.parametrize("between", MAY_MOVE)
def test_behind_a_function_that_may_move_the_arm_it_stands_anywhere(between):
    assert not last_follows(between, MOVING + SHIFT)


@pytest.mark.parametrize("target", ["Offs(pB,0,0,Num(F(1)))", "RelTool(pB,0,0,5\\Rz:=F(1))"])
def test_a_function_in_a_motion_runs_before_it(target):
    assert not last_follows("", MOVING, target)


@pytest.mark.parametrize(
    "between",
    ["n:=Height(1\\Up)+Abs(CRobT());", "ok:=(n>1) AND (Twice(1)=2);", "WaitUntil(DInput(di1)=1);"],
)
def test_behind_a_function_that_only_computes_it_stands_where_it_stood(between):
    assert last_follows(between, QUIET)
    assert last_follows("", QUIET, "Offs(pB,0,0,Height(2))")


@pytest.mark.parametrize("more", ["n:=F(n);", "Shift;", "%name%;", "lbl:", "n:=n; MoveL pB,v100,fine,tool0;"])
def test_a_function_that_runs_what_may_move_the_arm_may_move_it(more):
    changed = QUIET.replace("RETURN 2*n;", f"{more}\nRETURN 2*n;")
    assert not last_follows("n:=Height(1);", changed + MOVING)


MOVE = f"MoveL pB,{GO}"
DISPLACED_IN = [
    f"ok:=F(1);\n{MOVE}",
    f"IF F(1) {MOVE}",
    f"IF F(1) THEN\nENDIF\n{MOVE}",
    f"IF ok THEN\nn:=1;\nELSEIF F(1) THEN\n{MOVE}\nENDIF",
    f"IF ok THEN\nn:=1;\nELSEIF F(1) THEN\nn:=2;\nELSE\n{MOVE}\nENDIF",
    f"IF ok THEN\nn:=1;\nELSEIF F(1) THEN\nPDispOff;\nELSEIF n=1 THEN\nPDispOff;\nENDIF\n{MOVE}",
    f"TEST n\nCASE 1:\nn:=1;\nCASE F(1):\nn:=2;\nENDTEST\n{MOVE}",
    f"WHILE F(1) DO\nPDispOff;\nENDWHILE\n{MOVE}",
]
UNDISPLACED_IN = [
    f"IF ok THEN\n{MOVE}\nELSEIF F(1) THEN\nn:=2;\nENDIF",
    f"IF ok THEN\nn:=1;\nELSEIF F(1) THEN\nPDispOff;\nELSE\nPDispOff;\nENDIF\n{MOVE}",
    f"IF ok THEN\nIF ok THEN\nELSEIF F(1) THEN\nENDIF\nELSE\n{MOVE}\nENDIF",
    f"n:=Twice(1);\n{MOVE}",
]


@pytest.mark.parametrize("body", DISPLACED_IN + UNDISPLACED_IN)
def test_behind_a_function_that_displaces_targets_are_displaced(body):
    (move,) = (program := read_with(f"PDispOff;\n{body}", DISPLACING + QUIET)).moves.environment
    assert program.environments[move].cartesian_problem == (DISPLACED if body in DISPLACED_IN else "")
