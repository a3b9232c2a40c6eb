"""ABB RAPID where ConfJ or ConfL is off: the arm goes to the nearest configuration, whatever the data is."""

import numpy as np
import pytest

from tests.programs_rig import ABB, models, obeyed, read, rewritten
from tests.test_programs_rapid import UNUSED, numbers
from truearm.inverse import Inverse
from truearm.programs.solving import PERHAPS_HEEDED, UNHEEDED

GO = "v100,fine,tG;"
TURNED = np.array([15.0, -18.0, 12.0, -145.0, -77.0, -121.0])
"""Readings with configuration data of their own, in a posture that zeros do not name."""
BESIDE = TURNED + np.array([2.0, 1.0, -1.0, 0.0, 0.0, 1.0])
HERE = f"MoveAbsJ jHere,{GO}\n"
OFF_J, OFF_L, ON_J, ON_L = "ConfJ\\Off;\n", "ConfL\\Off;\n", "ConfJ\\On;\n", "ConfL\\On;\n"
OTHER = "ENDPROC\nPROC other()\n"


def zeros(q_deg):
    """A robtarget that means readings, with configuration data of zeros."""
    place, turn, _, axes = numbers(q_deg, placed=np.eye(4)).strip("[]").split("],[")
    return f"[[{place}],[{turn}],[0,0,0,0],[{axes}]]"


def text_of(body, beginning="main"):
    joints = ",".join(f"{angle:.2f}" for angle in TURNED + 1.0)
    return (
        "MODULE M\nPERS tooldata tG:=[TRUE,[[0,0,120],[1,0,0,0]],[1,[0,0,50],[1,0,0,0],0,0,0]];\n"
        f"CONST jointtarget jHere:=[[{joints}],{UNUSED}];\n"
        f"CONST robtarget pA:={zeros(TURNED)};\nCONST robtarget pB:={zeros(BESIDE)};\n"
        f"CONST robtarget pTold:={numbers(TURNED, placed=np.eye(4))};\n"
        f"PROC {beginning}()\n{body}\nENDPROC\nENDMODULE\n"
    )


def solved(body, beginning="main"):
    """By name: the readings in deg that a target is taken for, or why it is left."""
    program = read("a.mod", text_of(body, beginning), ABB)
    done = rewritten(program, models(ABB))
    why = {one.name: one.reason for one in done.listed}
    return {
        name: why.get(name, np.rad2deg(done.nominal[target]).round(2))
        for target, name in program.targets.names.items()
    }


def stands(found, q_deg):
    return not isinstance(found, str) and np.abs(found - q_deg).max() < 0.05


@pytest.mark.parametrize("move", [f"{OFF_J}{HERE}MoveJ pA,{GO}", f"{OFF_L}{HERE}MoveL pA,{GO}"])
def test_where_it_is_off_the_solution_nearest_to_the_target_before_is_meant(move):
    assert stands(solved(move)["pa"], TURNED)
    program = read("a.mod", text_of(move), ABB)
    done = rewritten(program, models(ABB))
    before = np.tile(np.deg2rad(TURNED), (len(program.targets), 1))
    found = solutions_of(done)
    by = models(ABB).compensator.by_rad
    nearest = found[np.abs(found - before[0]).max(axis=1).argmin()]
    assert np.abs(nearest - np.deg2rad(TURNED) - by).max() < 1e-4


def solutions_of(done):
    """All readings of the pose that is written for pA."""
    text = done.contents[0].decode().replace("ConfJ\\Off", "ConfJ\\On").replace("ConfL\\Off", "ConfL\\On")
    program = read("a.mod", text, ABB)
    number = next(target for target, name in program.targets.names.items() if name == "pa")
    return Inverse(ABB).solutions(ABB.pose(obeyed(program, ABB, np.zeros((9, 6)))[number]), turns=True)


@pytest.mark.parametrize(
    "body",
    [
        f"{OFF_J}MoveJ pA,{GO}",
        f"{OFF_J}{HERE}WaitTime 1;\nlabel1:\nMoveJ pA,{GO}",
        f"{OFF_J}{HERE}IF b THEN\nMoveJ pTold,{GO}\nENDIF\nMoveJ pA,{GO}",
    ],
)
def test_where_it_is_off_and_the_target_before_is_not_known_it_is_left(body):
    assert solved(body)["pa"] == UNHEEDED


@pytest.mark.parametrize(
    "body",
    [
        f"{HERE}MoveJ pA,{GO}",
        f"{OFF_L}{HERE}MoveJ pA,{GO}",
        f"{OFF_J}{HERE}MoveL pA,{GO}",
        f"{OFF_J}{ON_J}{HERE}MoveJ pA,{GO}",
        f"{OFF_J}ConfJ;\n{HERE}MoveJ pA,{GO}",
        f"IF b THEN\n{OFF_J}ELSE\n{OFF_J}ENDIF\n{ON_J}{HERE}MoveJ pA,{GO}",
        f"{OFF_J}back;\n{HERE}MoveJ pA,{GO}\nENDPROC\nPROC back()\n{ON_J}",
        f"{HERE}MoveJ pA,{GO}\n{OTHER}{OFF_J}{HERE}MoveJ pTold,{GO}{ON_J}",
        f"{HERE}MoveJ pA,{GO}\nRETURN;\n{OFF_J}",
    ],
)
def test_where_it_is_on_configuration_data_counts(body):
    found = solved(body)["pa"]
    assert found not in (UNHEEDED, PERHAPS_HEEDED) if isinstance(found, str) else not stands(found, TURNED)


@pytest.mark.parametrize(
    "body",
    [
        f"off;\n{HERE}MoveJ pA,{GO}\nENDPROC\nPROC off()\n{OFF_J}",
        f"{OFF_J}other;\n{OTHER}{HERE}MoveJ pA,{GO}",
        f"{OFF_J}other;\n{ON_J}{HERE}MoveJ pTold,{GO}\n{OTHER}{HERE}MoveJ pA,{GO}",
        f"WHILE b DO\n{OFF_J}{HERE}MoveJ pA,{GO}\n{ON_J}ENDWHILE",
        f"IF b {ON_J}{OFF_J}{HERE}MoveJ pA,{GO}",
        f"{OFF_J}IF b THEN\nRETURN;\nENDIF\n{HERE}MoveJ pA,{GO}\nERROR\nRETRY;",
        f"TEST n\nCASE 1:\n{OFF_J}DEFAULT:\n{OFF_J}ENDTEST\n{OFF_J}{HERE}MoveJ pA,{GO}",
        f"{OFF_J}again:\n{HERE}MoveJ pA,{GO}\nIF b GOTO again;",
    ],
)
def test_what_is_off_stays_off_until_it_is_set_again(body):
    assert stands(solved(body)["pa"], TURNED)


@pytest.mark.parametrize(
    ("body", "beginning"),
    [
        (f"IF b {OFF_J}{HERE}MoveJ pA,{GO}", "main"),
        (f"IF b THEN\n{OFF_J}ENDIF\n{HERE}MoveJ pA,{GO}", "main"),
        (f"WHILE b DO\n{HERE}MoveJ pA,{GO}\n{OFF_J}ENDWHILE", "main"),
        (f"{OFF_J}elsewhere;\n{HERE}MoveJ pA,{GO}", "main"),
        (f"other;\n{OFF_J}other;\n{OTHER}{HERE}MoveJ pA,{GO}", "main"),
        (f"{HERE}MoveJ pA,{GO}\n{OTHER}{OFF_J}", "one"),
        (f"{HERE}MoveJ pA,{GO}\nERROR\n{OFF_J}RETRY;", "main"),
        (f"{HERE}again:\n{HERE}MoveJ pA,{GO}\n{OFF_J}GOTO again;", "main"),
        (f"{HERE}MoveJ pA,{GO}\nENDPROC\nTRAP bell\n{OFF_J}ENDTRAP\nPROC last()", "main"),
    ],
)
def test_where_it_may_be_off_what_the_data_and_the_nearest_solution_say_differently_is_left(body, beginning):
    assert solved(body, beginning)["pa"] == PERHAPS_HEEDED
    assert stands(solved(body.replace("pA", "pTold"), beginning)["ptold"], TURNED)


def test_a_path_behind_a_call_is_followed_from_the_first_target_that_is_known():
    path = f"MoveL pA,{GO}\n{HERE}MoveL pB,{GO}"
    found = solved(f"{OFF_L}{OFF_J}{HERE}other;\n{OTHER}{path}")
    assert found["pa"] == UNHEEDED
    assert stands(found["pb"], BESIDE)


def test_a_target_that_two_motions_mean_differently_is_left():
    body = f"{HERE}MoveJ pA,{GO}\n{OFF_J}{HERE}MoveJ pA,{GO}"
    assert isinstance(solved(body)["pa"], str)


LOCK, UNLOCK = "SingArea\\LockAxis4;\n", "SingArea\\Wrist;\n"
ONTO = f"{HERE}MoveL pTold,{GO}\n"


@pytest.mark.parametrize(
    "body",
    [
        f"{LOCK}{ONTO}",
        f"{LOCK}{HERE}MoveC pTold,pB,{GO}",
        f"IF b THEN\n{LOCK}ENDIF\n{ONTO}",
        f"{LOCK}other;\n{UNLOCK}{HERE}MoveJ pA,{GO}\n{OTHER}{ONTO}",
        f"lock;\n{ONTO}ENDPROC\nPROC lock()\n{LOCK}",
        f"b:=Lock();\n{ONTO}ENDPROC\nFUNC bool Lock()\n{LOCK}RETURN TRUE;\nENDFUNC\nPROC last()\n",
        f"{ONTO}ENDPROC\nTRAP bell\n{LOCK}ENDTRAP\nPROC last()",
    ],
)
def test_lines_and_arcs_on_which_axis_4_is_locked_are_left(body):
    assert "SingArea \\LockAxis4" in solved(body)["ptold"]


@pytest.mark.parametrize(
    "body",
    [
        f"{UNLOCK}{ONTO}",
        f"{LOCK}{UNLOCK}{ONTO}",
        f"{LOCK}SingArea\\Off;\n{ONTO}",
        f"{LOCK}{HERE}MoveJ pTold,{GO}",
        f"{ONTO}{LOCK}{HERE}MoveL pB,{GO}",
    ],
)
def test_motions_on_which_axis_4_is_free_are_not(body):
    assert stands(solved(body)["ptold"], TURNED)


def test_behind_a_line_on_which_axis_4_is_locked_the_arm_stands_in_another_orientation():
    free = f"{OFF_L}{HERE}MoveL pTold,{GO}\n"
    assert stands(solved(f"{free}MoveL pB,{GO}")["pb"], BESIDE)
    assert solved(f"{LOCK}{free}{UNLOCK}MoveL pB,{GO}")["pb"] == UNHEEDED
