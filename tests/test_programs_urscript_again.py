"""URScript variables that are assigned again, as RoboDK does with frames: their value where they are used."""

import numpy as np
import pytest

from tests.program_tools import read, reasons, rewritten
from tests.test_programs_urscript import SHIFT, UR, pose_text
from truearm.robot import Robot

NEAR = [0.3, -1.3, 1.4, -1.7, -1.5, 0.4]
Q1, Q2 = [0.32, -1.32, 1.42, -1.72, -1.52, 0.42], [0.35, -1.3, 1.4, -1.7, -1.5, 0.4]
FIRST, SECOND = [0.05, 0.02, 0.0, 0.0, 0.0, 0.1], [-0.02, 0.1, 0.03, 0.1, 0.0, -0.2]
AGAIN = "assigned in line"


@pytest.fixture(scope="module")
def robot():
    return Robot.load("ur10e")


def job(robot, *, between="", use="  movel(pose_trans(frame, p[{q2}]), a=1.2, v=0.25)", behind=""):
    """A program with two frames in one variable, one after the other."""
    q2 = pose_text(robot, Q2, feature=SECOND)
    return f"""\
def job():
  def grip(value):
    set_standard_digital_out(1, value)
  end
  global frame = p[0, 0, 0, 0, 0, 0]
  set_tcp(p[0, 0, 0.1203, 0, 0, 0])
  movej({NEAR})
  frame = p{FIRST}
  movel(pose_trans(frame, p[{pose_text(robot, Q1, feature=FIRST)}]), a=1.2, v=0.25)
  grip(True)
{between}  frame = p{SECOND}
{use.format(q2=q2)}
end
{behind}job()
"""


def test_a_frame_that_is_set_again_is_what_it_was_set_to_last(robot):
    result = rewritten(UR, job(robot), robot, by=SHIFT)
    assert result.changed.all()
    assert not result.listed
    np.testing.assert_allclose(result.nominal, [NEAR, Q1, Q2], atol=1e-7)
    assert result.contents[0].decode().count(f"p{FIRST}") == 1


@pytest.mark.parametrize("loop", ["while True:", "if x:"])
def test_it_may_be_used_in_loops_and_branches_behind(robot, loop):
    use = f"  {loop}\n    movel(pose_trans(frame, p[{{q2}}]))\n  end"
    text = job(robot, use=use)
    result = rewritten(UR, text, robot, by=SHIFT)
    assert AGAIN not in str(result.listed)


@pytest.mark.parametrize(
    "others",
    [
        {"between": "  while x:\n    frame = p[0, 0, 0, 0, 0, 0]\n  end\n"},
        {"between": "  if x:\n    frame = p[0, 0, 0, 0, 0, 0]\n  end\n"},
        {"between": "  def other():\n    frame = p[0, 0, 0, 0, 0, 0]\n  end\n"},
        {"between": "  thread other():\n    movel(pose_trans(frame, p[0.1, 0.2, 0.3, 0, 0, 0]))\n  end\n"},
        {"between": "  frame[2] = 0.1\n"},
        {"behind": "def twice():\n  job()\nend\n"},
        {"use": "  job()\n  movel(pose_trans(frame, p[{q2}]))"},
    ],
)
def test_what_is_not_certain_is_listed(robot, others):
    result = rewritten(UR, job(robot, **others), robot, by=SHIFT)
    assert any(AGAIN in reason or "is changed" in reason for _, _, reason in reasons(result))


STILL = {
    "grip(1)": True,
    "if x: \n grip(1) \n elif y: \n sleep(1) \n else: \n sync() \n end": True,
    "while x: \n sync() \n end": True,
    "go()": False,
    "via()": False,
    "if x: \n go() \n end": False,
    "while x: \n movej([0, -1, 1, -1, -1, 0]) \n end": False,
    "if x: \n freedrive_mode() \n end": False,
}


@pytest.mark.parametrize("between", STILL)
def test_where_the_arm_stands_is_known_behind_what_does_not_move_it(robot, between):
    text = f"""\
def grip(value):
  if value:
    set_standard_digital_out(1, value)
  end
end
def go():
  movej({Q2})
end
def via():
  go()
end
set_tcp(p[0, 0, 0.1203, 0, 0, 0])
movej({NEAR})
{between}
movel(p[{pose_text(robot, Q1)}])
"""
    program = read(UR, text, robot)
    assert bool(program.moves.follows[-1]) == STILL[between]
    known = np.isfinite(rewritten(UR, text, robot, by=SHIFT).nominal[-1]).all()
    assert known == STILL[between]


def test_a_target_may_be_assigned_again_too(robot):
    text = f"""\
set_tcp(p[0, 0, 0.1203, 0, 0, 0])
movej({NEAR})
place = p[{pose_text(robot, Q1)}]
movel(place)
place = p[{pose_text(robot, Q2)}]
movel(place)
"""
    result = rewritten(UR, text, robot, by=SHIFT)
    np.testing.assert_allclose(result.nominal, [NEAR, Q1, Q2], atol=1e-7)
    assert result.changed.all()


def test_a_tcp_in_a_variable_that_is_assigned_again_is_not_known(robot):
    text = f"""\
grip = p[0, 0, 0.1, 0, 0, 0]
grip = p[0, 0, 0.1203, 0, 0, 0]
set_tcp(grip)
movej({NEAR})
movel(p[{pose_text(robot, Q1)}])
"""
    result = rewritten(UR, text, robot, by=SHIFT)
    assert "the TCP is computed when the program runs" in str(result.listed)
