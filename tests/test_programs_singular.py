"""Joint targets at singularities, as home positions with a stretched wrist are: listed, and no refusals."""

import numpy as np
import pytest

import truearm as ta
from tests.programs_rig import ABB, KUKA, models, read, rewritten
from truearm.errors import WorkError
from truearm.simulation import VirtualArm

AXES = "[9E9,9E9,9E9,9E9,9E9,9E9]"
HOME = f"MoveAbsJ [[0,0,0,0,0,0],{AXES}],v100,fine,tool0;"
BENT = f"MoveAbsJ [[0,10,10,0,40,0],{AXES}],v100,fine,tool0;"
NOT_REACHED, TOO_FAR = 2, 5


def program_of(*moves):
    lines = "\n".join(moves)
    return read("home.mod", f"MODULE Home\nPROC main()\n{lines}\nENDPROC\nENDMODULE\n", ABB)


@pytest.mark.parametrize("code", [NOT_REACHED, TOO_FAR])
def test_a_home_with_a_stretched_wrist_is_listed_and_the_others_are_changed(code):
    done = rewritten(program_of(HOME, BENT, HOME), models(ABB, refuse=(0, 2), code=code))
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


@pytest.mark.parametrize("code", [NOT_REACHED, TOO_FAR])
def test_refusals_away_from_singularities_stay_what_they_are(code):
    with pytest.raises(WorkError, match="1 of 2 targets cannot be corrected"):
        rewritten(program_of(BENT, HOME), models(ABB, refuse=(0,), code=code))


def test_a_home_that_a_turned_wrist_would_meet_is_listed(tmp_path):
    arm = VirtualArm(ABB, seed=1)
    measured = arm.measure(arm.poses(80, seed=1), orientation=True)
    compensator = ta.Compensator(ta.calibrate(ABB, measured, model="constant", refit=False))
    tool = np.eye(4)
    tool[2, 3] = 0.15
    assert [one.code for one in compensator.joints(np.zeros(6), tool=tool).refusals] == [TOO_FAR]
    path = tmp_path / "home.mod"
    gripper = "PERS tooldata tGrip:=[TRUE,[[0,0,150],[1,0,0,0]],[1.5,[0,0,50],[1,0,0,0],0,0,0]];"
    moves = "\n".join(move.replace("tool0", "tGrip") for move in (HOME, BENT))
    path.write_text(f"MODULE Home\n{gripper}\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n")
    done = ta.compensate_program(path, compensator, controller="nominal")
    assert done.changed.tolist() == [False, True]
    assert "singularity" in done.listed[0].reason
