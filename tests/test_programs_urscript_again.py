"""URScript variables that are assigned again, as RoboDK does with frames: their value where they are used."""

import time

import numpy as np
import pytest

from tests.program_tools import read, reasons, rewritten
from tests.test_programs_urscript import SHIFT, UR, pose_text
from truearm.robot import Robot

NEAR = [0.3, -1.3, 1.4, -1.7, -1.5, 0.4]
Q1, Q2 = [0.32, -1.32, 1.42, -1.72, -1.52, 0.42], [0.35, -1.3, 1.4, -1.7, -1.5, 0.4]
FIRST, SECOND = [0.05, 0.02, 0.0, 0.0, 0.0, 0.1], [-0.02, 0.1, 0.03, 0.1, 0.0, -0.2]
AGAIN = "assigned in line"
DOUBLED = (
    "frame = pose_trans(frame, frame)\n" * 18
    + "number = number + number\n" * 25
    + "list = [0]\n"
    + "list = [list[list[0]]]\n" * 25
)


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
    use = f"  {loop}\n    movej({NEAR})\n    movel(pose_trans(frame, p[{{q2}}]))\n  end"
    result = rewritten(UR, job(robot, use=use), robot, by=SHIFT)
    assert not result.listed
    assert result.changed.all()
    np.testing.assert_allclose(result.nominal, [NEAR, Q1, NEAR, Q2], atol=1e-7)


@pytest.mark.parametrize(
    "between",
    [
        "  if x: return\n  end\n",
        "  if x: halt end\n",
        "  while x: if y: break end end\n",
        "  later()\n  def later():\n    sync()\n  end\n",
        "  i = 0\n  while i < 3:\n    i = i + 1\n  end\n",
        "  sec lamp():\n    set_digital_out(1, True)\n  end\n",
        "  thread watch():\n    sync()\n  end\n  run watch()\n",
    ],
)
def test_what_changes_no_variable_leaves_it_known(robot, between):
    result = rewritten(UR, job(robot, between=between), robot, by=SHIFT)
    assert result.changed.all()
    np.testing.assert_allclose(result.nominal, [NEAR, Q1, Q2], atol=1e-7)


@pytest.mark.parametrize("line", ["x = get_inverse_kin(p{0})", "x = p{0}", "textmsg(p{0})"])
def test_a_pose_is_no_call_of_a_program_that_is_named_p(robot, line):
    target = f"p[{pose_text(robot, Q1)}]"
    lines = [f"movej({NEAR})", line.format(FIRST), f"movel({target})"]
    text = "def p():\n  set_tcp(p[0, 0, 0.1203, 0, 0, 0])\n  " + "\n  ".join(lines) + "\nend\n"
    assert rewritten(UR, text, robot, by=SHIFT).changed.all()


def test_a_list_that_is_counted_is_not_changed(robot):
    text = f"i = [{NEAR}].length()\nplaces = [{NEAR}]\nn = places.length()\nmovej(places[0])\n"
    assert rewritten(UR, text, robot, by=SHIFT).changed.all()


def test_a_list_of_frames_is_changed_by_its_methods(robot):
    text = f"""\
set_tcp(p[0, 0, 0.1203, 0, 0, 0])
frames = [p{FIRST}]
movej({NEAR})
frames.insert(0, p{SECOND})
movel(pose_trans(frames[0], p[{pose_text(robot, Q1, feature=FIRST)}]))
"""
    result = rewritten(UR, text, robot, by=SHIFT)
    assert reasons(result)[-1][0] == 5
    assert "is changed" in reasons(result)[-1][2]


def test_a_list_is_made_of_what_its_elements_were_then(robot):
    text = f"""\
set_tcp(p[0, 0, 0.1203, 0, 0, 0])
movej({NEAR})
i = 0
place = p[{pose_text(robot, Q1)}]
places = [place, place]
place = p[{pose_text(robot, Q2)}]
i = i + 1
movel(places[i])
movel(place)
"""
    result = rewritten(UR, text, robot, by=SHIFT)
    np.testing.assert_allclose(result.nominal, [NEAR, Q1, Q2], atol=1e-7)


OTHER = "frame = p[0, 0, 0, 0, 0, 0]"
UNCERTAIN = {
    "in a loop": {"between": f"  while x:\n    {OTHER}\n  end\n"},
    "in a branch": {"between": f"  if x:\n    {OTHER}\n  end\n"},
    "in a branch of one line": {"between": f"  if x: {OTHER} end\n"},
    "in the other branch of one line": {"between": f"  if x: sync() else: {OTHER} end\n"},
    "in a case": {"between": f"  switch x:\n    case 1:\n      {OTHER}\n    end\n  end\n"},
    "in a nested function": {"between": f"  def other():\n    {OTHER}\n  end\n"},
    "in a function that is called before": {"behind": f"def other():\n  {OTHER}\nend\n"},
    "local to another function": {"behind": f"def other():\n  local {OTHER}\nend\n"},
    "a parameter of another function": {"behind": "def other(frame):\n  sync()\nend\n"},
    "in a secondary program": {"between": f"  sec other():\n    {OTHER}\n  end\n"},
    "in a thread": {"between": f"  thread other():\n    {OTHER}\n  end\n  run other()\n"},
    "used in a thread": {
        "between": "  thread other():\n    movel(pose_trans(frame, p[0.1, 0.2, 0.3, 0, 0, 0]))\n  end\n"
    },
    "an element": {"between": "  frame[2] = 0.1\n"},
    "an element behind another statement": {"between": "  sync() frame[2] = 0.1\n"},
    "added to": {"between": "  frame += p[0, 0, 0.1, 0, 0, 0]\n"},
    "changed by a method": {"between": f"  frame.append({NEAR})\n"},
    "changed by a method of an element": {"between": f"  frame[2].append({NEAR})\n"},
    "changed by a method within a motion": {"between": f"  movej(get({NEAR}, frame.pop()))\n"},
    "a second statement of a line": {"between": f"  x = 1; {OTHER}\n"},
    "a statement behind a call": {"between": f"  sync() {OTHER}\n"},
    "a statement behind an end": {"between": f"  if x:\n    sync()\n  end {OTHER}\n"},
    "global and local": {"between": f"  local {OTHER}\n"},
    "local without a value": {"between": "  local frame\n"},
    "a run within another function": {"behind": "def twice():\n  job()\nend\n"},
    "a run within a motion": {"behind": f"def twice():\n  movej({NEAR}, a=job())\nend\n"},
    "a run within many motions": {"behind": "def twice():\n" + f"  movej({NEAR}, a=job())\n" * 5 + "end\n"},
    "a run within a payload": {"behind": "def twice():\n  set_payload(job())\nend\n"},
    "a run within a TCP": {"behind": "def twice():\n  set_tcp(job())\nend\n"},
    "a run within a value": {"behind": "def twice():\n  x = [1, job()]\nend\n"},
    "a run within a default": {"behind": "def twice(x=job()):\n  sync()\nend\n"},
    "a run as a thread": {"behind": "run job()\n"},
    "a run within itself": {"use": "  job()\n  movel(pose_trans(frame, p[{q2}]))"},
    "statements from elsewhere": {"between": "  interpreter_mode()\n"},
    "an end too many": {"behind": "end\n"},
    "a block without an end": {"behind": "while x:\n"},
    "a block within a statement": {"between": "  sync() if x:\n    sync()\n  end\n"},
    "an open bracket": {"behind": "sync(\n"},
    "an else of a loop": {"between": "  while x:\n    sync()\n  else:\n    sync()\n  end\n"},
}


@pytest.mark.parametrize("others", UNCERTAIN)
def test_what_is_not_certain_is_listed(robot, others):
    result = rewritten(UR, job(robot, **UNCERTAIN[others]), robot, by=SHIFT)
    # The first targets are of Q1; no target may be the one that the last assignment would give.
    assert any(AGAIN in reason or "is changed" in reason for _, _, reason in reasons(result))
    known = result.nominal[np.isfinite(result.nominal).all(axis=1)]
    assert not (np.abs(known - Q2).max(axis=1) < 1e-3).any()


def test_a_thread_may_run_twice_at_once(robot):
    text = job(robot).replace("def job()", "thread job()").replace("\njob()", "\nrun job()\nrun job()")
    result = rewritten(UR, text, robot, by=SHIFT)
    assert [line for line, _, reason in reasons(result) if AGAIN in reason] == [9, 12]


def test_a_variable_declared_behind_its_first_value_may_be_another(robot):
    text = (
        job(robot).replace("global frame", "frame").replace(f"frame = p{SECOND}", f"global frame = p{SECOND}")
    )
    result = rewritten(UR, text, robot, by=SHIFT)
    assert [line for line, _, reason in reasons(result) if AGAIN in reason] == [9, 12]


STILL = {
    "grip(1)": True,
    "hand(1)": True,
    'if x: textmsg("hi") end': True,
    "movel_of(1)": True,
    "set_payload(via())": False,
    "set_payload(weight(via()))": False,
    "set_tcp(via())": False,
    "x = [via()]": False,
    "late()": False,
    "interpreter_mode()": False,
    "run go()": False,
    "thread mover(): \n go() \n end \n run mover() \n grip(1)": False,
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
def hand(value):
  if value: textmsg("hi") end
  while value: if value: sync() else: sleep(1) end end
end
def movel_of(value):
  return value + 1
end
def weight(value):
  return 1
end
def late():
  if x: textmsg("hi") end
  movej({Q2})
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


OF_TCP = {
    "grip": False,
    "tools[0]": False,
    "pose_trans(grip, p[0, 0, 0.02, 0, 0, 0])": False,
    "made": False,
    "p[0, 0, height, 0, 0, 0]": False,
    "pose_trans(fixed, p[0, 0, 0.02, 0, 0, 0])": True,
    "fixed": True,
}


@pytest.mark.parametrize("tcp", OF_TCP)
def test_a_tcp_of_a_variable_that_is_assigned_again_is_not_known(robot, tcp):
    text = f"""\
fixed = p[0, 0, 0.1003, 0, 0, 0]
height = 0.1
grip = p[0, 0, 0.1, 0, 0, 0]
tools = [grip]
set_tcp({tcp})
movej({NEAR})
movel(p[{pose_text(robot, Q1)}])
height = 0.1203
grip = p[0, 0, 0.1203, 0, 0, 0]
tools = [grip]
made = grip
set_tcp({tcp})
movej({NEAR})
movel(p[{pose_text(robot, Q1)}])
"""
    result = rewritten(UR, text, robot, by=SHIFT, frames="[tool.tcp]\nxyz = [0, 0, 110]\n")
    assert ("the TCP is computed when the program runs" not in str(result.listed)) == OF_TCP[tcp]


def test_a_payload_that_is_assigned_again_is_what_it_was_then(robot):
    text = "".join(f"mass = {mass}\nset_payload(mass)\nmovej({NEAR})\n" for mass in (1.5, 2.5))
    program = read(UR, text, robot)
    assert [program.environments[int(one)].payload_kg for one in program.moves.environment] == [1.5, 2.5]


def test_a_tcp_set_within_a_motion_is_set_before_it(robot):
    text = f"""\
def change():
  set_tcp(p[0, 0, 0.2, 0, 0, 0])
  return 1
end
set_tcp(p[0, 0, 0.1, 0, 0, 0])
movej({NEAR}, a=change())
"""
    program = read(UR, text, robot)
    (tool,) = {program.environments[int(one)].tool for one in program.moves.environment}
    assert tool.true[2, 3] == 0.2


def test_what_variables_are_made_of_many_times_is_computed_once(robot):
    text = f"""\
frame = p[0.0000001, 0, 0, 0, 0, 0]
number = 1
{DOUBLED}
set_tcp(p[0, 0, 0.1203, 0, 0, 0])
movej({NEAR})
movel(pose_trans(frame, p[{pose_text(robot, Q1, feature=np.array([0.0262144, 0, 0, 0, 0, 0]))}]))
movel(pose_trans(p[number, 0, 0, 0, 0, 0], p[3, 0, 0, 0, 0, 0]))
movej(list[list[0]])
"""
    start = time.process_time()
    program = read(UR, text, robot)
    assert time.process_time() - start < 2.0
    np.testing.assert_allclose(
        sorted(one.before[0, 3] for one in program.environments), [0.0, 0.0262144, 2.0**25], rtol=1e-12
    )
    assert np.abs(rewritten(UR, text, robot, by=SHIFT).nominal[1] - Q1).max() < 1e-7


def test_variables_made_of_themselves_are_listed(robot):
    text = "a = pose_trans(a, a)\nmovel(a)\nb = b[0]\nmovel(b)\n"
    result = rewritten(UR, text, robot, by=SHIFT)
    assert {line for line, _, _ in reasons(result)} == {2, 4}


CHAIN = "".join(f"def f{k}():\n  f{k - 1}()\nend\n" for k in range(1, 3000))
SMALL = "".join(f"def f{k}():\n  sync()\nend\nf{k}()\n" for k in range(1, 3000))


@pytest.mark.parametrize(("functions", "follows"), [(CHAIN, False), (SMALL, True)], ids=["chain", "small"])
def test_thousands_of_functions_are_read_in_no_time(robot, functions, follows):
    text = f"""\
def f0():
  set_tcp(p[0, 0, 0.1, 0, 0, 0])
  movej({Q2})
end
movej({NEAR})
{functions}f2999()
movej({Q1})
"""
    start = time.process_time()
    program = read(UR, text, robot)
    assert time.process_time() - start < 5.0
    assert bool(program.moves.follows[-1]) == follows
