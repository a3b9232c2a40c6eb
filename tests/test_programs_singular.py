"""Joint targets at singularities, as home positions with a stretched wrist are: listed, and no refusals."""

import pytest

from tests.programs_rig import ABB, KUKA, models, read, rewritten
from truearm.errors import WorkError

AXES = "[9E9,9E9,9E9,9E9,9E9,9E9]"
HOME = f"MoveAbsJ [[0,0,0,0,0,0],{AXES}],v100,fine,tool0;"
BENT = f"MoveAbsJ [[0,10,10,0,40,0],{AXES}],v100,fine,tool0;"
NOT_REACHED, TOO_FAR = 2, 5


def program_of(*moves):
    lines = "\n".join(moves)
    return read("home.mod", f"MODULE Home\nPROC main()\n{lines}\nENDPROC\nENDMODULE\n", ABB)


def test_a_home_with_a_stretched_wrist_is_listed_and_the_others_are_changed():
    done = rewritten(program_of(HOME, BENT, HOME), models(ABB, refuse=(0, 2), code=NOT_REACHED))
    assert done.changed.tolist() == [False, True, False]
    assert [one.line for one in done.listed] == [3, 5]
    assert all("singularity" in one.reason for one in done.listed)
    assert not done.kept
    written = done.contents[0].decode().splitlines()
    assert [written[2], written[4]] == [HOME, HOME]


def test_the_candle_of_a_kuka_is_listed():
    candle, bent = "PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0,E1 0.0}", "PTP {A1 0,A2 -80,A3 90,A4 0,A5 40,A6 0}"
    program = read("home.src", f"DEF home()\n{candle}\n{bent}\nEND\n", KUKA)
    done = rewritten(program, models(KUKA, refuse=(0,), code=NOT_REACHED))
    assert done.changed.tolist() == [False, True]
    assert [one.line for one in done.listed] == [2]


def test_straight_motion_from_it_is_warned_of():
    place = f"[[350,30,300],[0,0,1,0],[0,0,0,0],{AXES}]"
    program = program_of(HOME, BENT, f"MoveJ {place},v100,z10,tool0;", HOME)
    done = rewritten(program, models(ABB, refuse=(0, 3), code=NOT_REACHED))
    assert done.changed.tolist() == [False, True, True, False]
    assert [notice.kind for notice in done.notices] == ["steps"]


@pytest.mark.parametrize(("moves", "code"), [((HOME, BENT), TOO_FAR), ((BENT, HOME), NOT_REACHED)])
def test_other_refusals_stay_what_they_are(moves, code):
    with pytest.raises(WorkError, match="1 of 2 targets cannot be corrected"):
        rewritten(program_of(*moves), models(ABB, refuse=(0,), code=code))
