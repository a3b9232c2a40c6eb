"""URScript programs: what is a target, what is not, and that numbers alone are changed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.program_tools import names_changed, read, reasons, rewritten, says, skeleton, survives
from truearm.errors import InputError, WorkError
from truearm.programs.program import LinearStep
from truearm.programs.tables import Motion
from truearm.programs.urscript import UrScript
from truearm.robot import Robot

UR = UrScript()
SHIFT = np.deg2rad([0.11, -0.07, 0.05, 0.03, -0.02, 0.09])

SAMPLE = """\
# movej([0, 0, 0, 0, 0, 0]) is a comment, not a move
def Montage():
  set_tcp(p[0.0, 0.0, 0.1203, 0.0, 0.0, 0.0])
  set_payload(1.25, [0, 0, 0.05])
  global Waypoint_1_p=p[{p1}]
  global Waypoint_1_q=[{q1}]
  home = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0]
  feature = p[0.05, 0.02, 0.0, 0.0, 0.0, 0.1]
  $ 1 "Robot Program"
  textmsg("movej([1, 2, 3, 4, 5, 6]) # no move", 3)
  movej(home, a=1.4, v=1.05)
  movej(get_inverse_kin(Waypoint_1_p, qnear=Waypoint_1_q), a=1.3962634015954636, v=1.0471975511965976)
  movej([d2r(10.5), d2r(-90.25), 1.5, -1.2,
         -1.5, # the fifth
         2e-1], r=0.01)
  movel(pose_trans(feature, p[{p2}]), a=1.2, v=0.25)
  movel(pose_add(p[{p3}], p[0, 0, 0.01, 0, 0, 0]))
  movep(p[{p4}], r=0.005)
  movec(p[{p5}], p[{p6}], a=1.2, v=0.25, r=0.02)
  servoj([0.1, -1.5, 1.5, -1.5, -1.5, 0.0], t=0.002)
end
"""


@pytest.fixture(scope="module")
def robot():
    return Robot.load("ur10e")


def pose_text(robot, q, tool=(0, 0, 0.1203), feature=None, decimals=9):
    """x, y, z, rx, ry, rz of a tool at readings `q`, in a feature's frame."""
    from scipy.spatial.transform import Rotation

    flange_from_tool = np.eye(4)
    flange_from_tool[:3, 3] = tool
    pose = robot.flange_chain.pose(robot.joints_from_readings(np.atleast_2d(q)))[0] @ flange_from_tool
    if feature is not None:
        base_from_feature = np.eye(4)
        base_from_feature[:3, 3] = feature[:3]
        base_from_feature[:3, :3] = Rotation.from_rotvec(feature[3:]).as_matrix()
        pose = np.linalg.inv(base_from_feature) @ pose
    numbers = [*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_rotvec()]
    return ", ".join(f"{number:.{decimals}f}" for number in numbers)


Q1 = np.array([0.3, -1.3, 1.4, -1.7, -1.5, 0.4])
PATH = np.array([0.2, -1.4, 1.5, -1.6, -1.5, 0.2]) + 0.02 * np.arange(6)[:, None]


@pytest.fixture(scope="module")
def sample(robot):
    poses = {f"p{k + 1}": pose_text(robot, PATH[k]) for k in range(6)}
    poses["p1"] = pose_text(robot, Q1)
    poses["p2"] = pose_text(robot, PATH[1], feature=np.array([0.05, 0.02, 0.0, 0.0, 0.0, 0.1]))
    lower = pose_text(robot, PATH[2]).split(", ")
    lower[2] = f"{float(lower[2]) - 0.01:.9f}"
    poses["p3"] = ", ".join(lower)
    return SAMPLE.format(q1=", ".join(f"{q:.16f}" for q in Q1), **poses)


def test_every_target_of_the_sample_is_corrected(robot, sample):
    result = rewritten(UR, sample, robot, by=SHIFT)
    assert reasons(result) == []
    assert names_changed(result) == ["Waypoint_1_p", "home", 13, 16, 17, 18, 19, 19, 20]
    again = says(UR, result.contents[0], robot)
    corrected = result.nominal + SHIFT
    assert np.abs(again - corrected)[result.changed].max() < 1e-6
    moved = rewritten(UR, sample, robot).nominal
    assert np.abs(moved[result.changed] - result.nominal[result.changed]).max() == 0.0


def test_the_poses_mean_what_they_were_written_for(robot, sample):
    nominal = rewritten(UR, sample, robot).nominal
    targets = read(UR, sample, robot).targets
    wanted = {"Waypoint_1_p": Q1, "Waypoint_1_q": Q1}
    for number, name in targets.names.items():
        if name in wanted:
            assert np.abs(nominal[number] - wanted[name]).max() < 1e-7, name
    assert np.abs(nominal[[4, 5, 6, 8]] - PATH[[1, 2, 3, 5]]).max() < 1e-7
    via = robot.flange_chain.pose(robot.joints_from_readings(np.stack([nominal[7], PATH[4]])))[:, :3]
    tips = via @ [0.0, 0.0, 0.1203, 1.0]
    assert np.abs(tips[0] - tips[1]).max() < 1e-8, "of a via point movec heeds the position alone"


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_numbers_alone_are_changed(robot, sample, ending):
    text = (
        sample.replace("# the fifth", "# le cinqui\u00e8me: 5.0 \u00b0")
        .replace("\n", ending)
        .encode("latin-1")
    )
    result = rewritten(UR, text, robot, by=SHIFT)
    assert result.contents[0] != text
    assert skeleton(result.contents[0]) == skeleton(text)
    old, new = (one.decode("latin-1").split(ending) for one in (text, result.contents[0]))
    same = [line for line, (a, b) in enumerate(zip(old, new, strict=True), 1) if a == b]
    assert same == [1, 2, 3, 4, 6, 8, 9, 10, 11, 12, 21, 22]
    assert rewritten(UR, text, robot).contents[0].decode("latin-1").splitlines()[0] == sample.splitlines()[0]


def test_decimals_are_at_least_those_of_the_source(robot):
    text = "movej([0.1234567890123, -1.5, 1.5, -1, -1.5, 2e-1])\n"
    changed = rewritten(UR, text, robot, by=SHIFT).contents[0].decode()
    decimals = [len(part.partition(".")[2]) for part in changed[7:-3].split(", ")]
    assert decimals[0] == 13
    assert min(decimals) >= 6


def test_tools_offsets_and_payload_are_known(robot, sample):
    program = read(UR, sample, robot)
    assert {e.tool.true[2, 3] for e in program.environments} == {0.1203}
    assert {e.payload_kg for e in program.environments} == {1.25}
    before = [e.before[:3, 3].tolist() for e in program.environments]
    assert [0.05, 0.02, 0.0] in before
    assert [0.0, 0.0, 0.01] in before


def test_motions_are_told_apart(robot, sample):
    moves = read(UR, sample, robot).moves
    kinds = [Motion(int(kind)).name for kind in moves.motion]
    assert kinds == [
        "JOINT", "SEED", "JOINT", "JOINT", "LINEAR", "LINEAR", "LINEAR", "VIA", "CIRCULAR", "JOINT",
    ]  # fmt: skip
    assert moves.blended.tolist() == [False, False, False, True, False, False, True, True, True, True]


WITHIN = "it stands within another statement, or the statement cannot be read"
LISTED = {
    "movej([0.1, -1.57, 1.5+0.1, 0, 1, 2])": "number 3 of it is written as an expression",
    "movej(q_now)": '"q_now" is not assigned in this file',
    "movel(get_actual_tcp_pose())": "its target is computed by get_actual_tcp_pose when the program runs",
    "movel(pose_trans(get_tcp(), p[0, 0, 0.1, 0, 0, 0]))": "a pose is computed when the program runs",
    "speedl([0, 0, 0.1, 0, 0, 0], 0.5, 0.1)": "it is a speed, not a target",
    "movej()": "it has no target",
    "movej([1, 2, 3])": "its target is computed when the program runs",
    "x = movej([0, -1.5, 1.5, -1.5, -1.5, 0])": WITHIN,
    "movej([0, -1.5, 1.5": WITHIN,
}


@pytest.mark.parametrize("statement", LISTED)
def test_what_is_not_certain_is_listed(robot, statement):
    result = rewritten(UR, f"def p():\n  {statement}\nend\n", robot, by=SHIFT)
    assert [(one.line, one.column) for one in result.listed] == [(2, 7 if statement[0] == "x" else 3)]
    assert result.listed[0].reason == LISTED[statement]
    assert not result.changed.any()


def test_variables_assigned_twice_or_changed_are_not_constant(robot):
    text = """\
a = [0, -1.5, 1.5, -1.5, -1.5, 0]
if x: a = [0, -1.4, 1.5, -1.5, -1.5, 0] end
b = [0, -1.5, 1.5, -1.5, -1.5, 0]
b[1] = -1.4
c = [0, -1.5, 1.5, -1.5, -1.5, 0]
def go(d):
  movej(d)
end
go(c)
movej(a)
movej(b)
movej(c)
"""
    result = rewritten(UR, text, robot, by=SHIFT)
    found = {line: reason for line, _, reason in reasons(result)}
    assert found[7] == '"d" is changed when the program runs, in line 6'
    assert found[10] == '"a" is assigned in line 2 and elsewhere, or is computed'
    assert found[11] == '"b" is changed when the program runs, in line 4'
    assert found[5] == '"c" is also used in line 9 for something else than a motion'
    assert not result.changed.any()


def test_one_pose_with_several_offsets_is_listed(robot):
    text = f"""\
set_tcp(p[0, 0, 0.1203, 0, 0, 0])
above = p[{pose_text(robot, Q1)}]
movej([0.3, -1.3, 1.4, -1.7, -1.5, 0.4])
movel(pose_trans(above, p[0, 0, -0.05, 0, 0, 0]))
movel(above)
"""
    result = rewritten(UR, text, robot, by=SHIFT)
    assert names_changed(result) == [3]
    assert "as it stands and with offsets" in reasons(result)[0][2]


def test_branches_decide_which_tool_is_set(robot):
    text = f"""\
movej([0.3, -1.3, 1.4, -1.7, -1.5, 0.4])
if get_digital_in(1):
  set_tcp(p[0, 0, 0.2, 0, 0, 0])
  movel(p[{pose_text(robot, Q1)}])
else:
  set_tcp(p[0, 0, 0.1, 0, 0, 0])
end
movel(p[{pose_text(robot, PATH[1])}])
set_tcp(p[0, 0, 0.1203, 0, 0, 0])
movej([0.3, -1.3, 1.4, -1.7, -1.5, 0.4])
movel(p[{pose_text(robot, Q1)}])
"""
    program = read(UR, text, robot)
    by_line = {
        program.sources[0].place(int(at))[0]: program.environments[int(number)].tool
        for at, number in zip(program.moves.at, program.moves.environment, strict=True)
    }
    assert by_line[4].true[2, 3] == 0.2
    assert by_line[8].unknown == "which TCP is set here depends on how the program runs"
    assert by_line[11].true[2, 3] == 0.1203


def test_functions_loops_and_threads(robot):
    text = """\
def prog():
  set_tcp(p[0, 0, 0.1, 0, 0, 0])
  def pick():
    movej([0, -1.5, 1.5, -1.5, -1.5, 0])
    set_tcp(p[0, 0, 0.2, 0, 0, 0])
  end
  thread watch():
    while True:
      sync()
    end
  end
  run watch()
  movej([0.1, -1.5, 1.5, -1.5, -1.5, 0])
  pick()
  movej([0.2, -1.5, 1.5, -1.5, -1.5, 0])
  i = 0
  while i < 3:
    movej([0.3, -1.5, 1.5, -1.5, -1.5, 0])
    pick()
    i = i + 1
  end
end
"""
    program = read(UR, text, robot)
    tools = [program.environments[int(n)].tool for n in program.moves.environment]
    unknown = "which TCP is set here depends on how the program runs"
    assert [tool.unknown or tool.true[2, 3] for tool in tools] == [unknown, 0.1, 0.2, 0.2]
    assert program.moves.follows.tolist() == [False, False, False, False]


def test_the_body_of_an_if_is_entered_from_before_it(robot):
    move = "movej([0.1, -1.5, 1.5, -1.5, -1.5, 0])\n"
    text = f"{move}if (get_digital_in(0)):\n{move}{move}elif (get_digital_in(1)):\n{move}end\n{move}"
    program = read(UR, f"{text}if (x):\n{move}end\n", robot)
    assert program.moves.follows.tolist() == [False, True, True, False, False, True]


def test_without_set_tcp_the_frames_file_has_it(robot):
    text = f"movej([0.3, -1.3, 1.4, -1.7, -1.5, 0.4])\nmovel(p[{pose_text(robot, Q1)}])\n"
    assert "give it in a file of --frames" in reasons(rewritten(UR, text, robot))[0][2]
    frames = "[tool.tcp]\nxyz = [0, 0, 120.3]\n"
    result = rewritten(UR, text, robot, by=SHIFT, frames=frames)
    assert result.changed.all()
    assert np.abs(result.nominal - Q1).max() < 1e-7


def test_seeds_are_no_targets_in_the_representation(robot):
    stored = f"a_p = p[{pose_text(robot, Q1)}]\na_q = {Q1.tolist()}\nset_tcp(p[0, 0, 0.1203, 0, 0, 0])\n"
    done = rewritten(UR, f"{stored}movej(get_inverse_kin(a_p, qnear=a_q))\n", robot, by=SHIFT)
    assert repr(done) == "<Rewritten test.script: 1 of 1 target changed, 0 kept, 0 listed>"


def test_before_its_first_set_tcp_a_program_has_the_tcp_of_the_installation(robot):
    text = f"movel(p[{pose_text(robot, Q1)}], qnear=[{', '.join(map(str, Q1))}])\n"
    text = f"movej([0.3, -1.3, 1.4, -1.7, -1.5, 0.4])\n{text}set_tcp(p[0, 0, 0.1, 0, 0, 0])\n{text}"
    own = "[tool.tcp]\nxyz = [0, 0, 100.3]\n"
    program = read(UR, text, robot, own)
    tools = [program.environments[int(n)].tool for n in program.moves.environment]
    assert [tool.unknown or tool.true[2, 3] for tool in tools] == [
        *['tool "installation" is not in the program; give it in a file of --frames'] * 2,
        0.1003,
    ]
    program = read(UR, text, robot, own + "[tool.installation]\nxyz = [0, 0, 50]\n")
    tools = [program.environments[int(n)].tool for n in program.moves.environment]
    assert [tool.true[2, 3] for tool in tools] == [0.05, 0.05, 0.1003]


def test_an_array_indexed_at_run_time_is_corrected_throughout(robot):
    poses = ", ".join(f"[{', '.join(f'{q:.6f}' for q in row)}]" for row in PATH)
    text = (
        f"path = [{poses}]\ni = 0\nwhile i < 6:\n  movej(path[i], r=0.01)\n  i = i + 1\nend\nmovej(path[2])\n"
    )
    result = rewritten(UR, text, robot, by=SHIFT)
    assert result.changed.all()
    assert np.abs(says(UR, result.contents[0], robot) - PATH - SHIFT).max() < 1e-6


def test_many_lines_are_read_as_one_is(robot):
    rng = np.random.default_rng(0)
    q = rng.uniform(-3, 3, (200, 6))
    line = "  movej([{}, {}, {}, {}, {}, {}], a=1.4, v=1.05, r={})\n"
    texts = [line.format(*(f"{value:.5f}" for value in row), 0.01 * (k % 2)) for k, row in enumerate(q)]
    texts[100:100] = [
        "  set_tcp(p[0, 0, 0.2, 0, 0, 0])\n",
        "  while True:\n",
        "    freedrive_mode()\n",
        "  end\n",
    ]
    program = read(UR, "def p():\n" + "".join(texts) + "end\n", robot)
    assert len(program.targets) == 200
    assert np.allclose(program.targets.values.reshape(-1, 6), np.round(q, 5), atol=1e-12)
    assert program.moves.blended.tolist() == [False, True] * 100
    tools = [program.environments[int(n)].tool for n in program.moves.environment]
    assert all(tool.unknown for tool in tools[:100])
    assert {tool.true[2, 3] for tool in tools[100:]} == {0.2}
    assert np.flatnonzero(~program.moves.follows).tolist() == [0, 100]


def test_another_arm_is_refused():
    with pytest.raises(InputError, match="six revolute"):
        read(UR, "movej([0,0,0,0,0,0])", Robot.load("franka-panda"))


def test_the_mark_is_a_comment_before_everything(robot):
    text = "movej([0, -1.5, 1.5, -1.5, -1.5, 0])\r\n"
    marked = rewritten(UR, text, robot, by=SHIFT, mark="compensated by truearm 1").contents[0]
    assert marked.startswith(b"# compensated by truearm 1\r\nmovej([")
    with pytest.raises(WorkError, match="compensated already"):
        rewritten(UR, marked, robot)


def test_a_step_is_a_copy_of_its_motion(robot, sample):
    program = read(UR, sample, robot)
    values, decimals = (0.1, -0.2, 0.3, 1.0, -0.5, 0.25), (6,) * 6

    def step(line, program=program):
        move = int(np.searchsorted(program.moves.at, program.sources[0].line_starts[line - 1]))
        return UR.linear_steps(program, [[LinearStep(line, 0, move, values, decimals, 0.01)]])

    numbers = "p[0.100000, -0.200000, 0.300000, 1.000000, -0.500000, 0.250000]"
    (only,) = step(16).insertions
    assert only.text == f"  movel({numbers}, a=1.2, v=0.25, r=0.00900)\n"
    assert only.start == only.end == program.sources[0].line_starts[15]
    assert len(step(11).impossible) == 1
    timed = read(UR, "movel(p[0.1, 0.2, 0.3, 0, 0, 0], t=2)\n", robot)
    assert step(1, timed).insertions == ()
    assert step(1, timed).impossible == (0,)


def test_a_step_before_a_last_line_without_an_end(robot):
    program = read(UR, "movel(p[0.1, 0.2, 0.3, 0, 0, 0], a=1)", robot)
    (only,) = UR.linear_steps(program, [[LinearStep(1, 0, 0, (0.5,) * 6, (1,) * 6, 0.01)]]).insertions
    assert only.text == "movel(p[0.5, 0.5, 0.5, 0.5, 0.5, 0.5], a=1, r=0.00900)\n"


@pytest.mark.parametrize("start", ["", "\xef\xbb\xbf"])
@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_line_ends_and_a_byte_order_mark_are_no_matter(robot, sample, start, ending):
    plain = sample.partition("\n")[2]
    text = (start + plain.replace("\n", ending)).encode("latin-1")
    result = rewritten(UR, text, robot, by=SHIFT, mark="mark")
    assert reasons(result) == []
    assert names_changed(result) == ["Waypoint_1_p", "home", 12, 15, 16, 17, 18, 18, 19]
    written = rewritten(UR, plain, robot, by=SHIFT, mark="mark").contents[0].decode()
    assert result.contents[0] == (start + written.replace("\n", ending)).encode("latin-1")


PAIR = """\
a = [0, -1.5, 1.5, -1.5, -1.5, 0]
b = [0.1, -1.4, 1.5, -1.5, -1.5, 0]
{}
list = [a, b]
movej(list[i])
movej(b)
def own_length(p):
  return length(p)
end
"""


@pytest.mark.parametrize(
    ("statement", "left"),
    [
        ("movel(interpolate_pose(a, b, 0.5))", "ab"),
        ("movej(approach(b))", "b"),
        ("movej(get_inverse_kin(get_forward_kin(a), qnear=now()))", "a"),
        ("movec(via(a), b)", "a"),
        ("mid = mean(a, b)\nmovej(mid)", "ab"),
        ("d = a[2]\nmovel(pose_trans(p[0, 0, d, 0, 0, 0], p[0.5, 0.2, 0.3, 0, 0, 0]))", "a"),
        ("movej([a[0], -1.5, 1.5, -1.5, -1.5, 0])", "a"),
        ("n = nearest(b)\nmovej(list[n])", "b"),
        ("n = own_length(a)", "a"),
        ("textmsg(own_length(a))", "a"),
        ("n = length(list)", ""),
        ("while i < length(list):\ni = i + 1\nend", ""),
        ("if list.length() > list.capacity():\nend", ""),
        ("textmsg(str_cat(to_str(a), to_str(length(list))))", ""),
        ("popup(to_str(a), title=to_str(b))", ""),
        ("if is_within_safety_limits(a):\nend", ""),
    ],
)
def test_what_the_program_computes_with_is_left(robot, statement, left):
    result = rewritten(UR, PAIR.format(statement), robot)
    found = {name: reason for _, name, reason in reasons(result) if name in ("a", "b")}
    assert set(found) == set(left)
    assert all(reason.startswith(f'"{name}" is also used in line') for name, reason in found.items())
    assert {"a", "b"} - set(found) <= set(names_changed(result))


def test_a_list_that_is_appended_to_is_not_known(robot):
    result = rewritten(UR, PAIR.format("list.append(a)"), robot, by=SHIFT)
    found = {line: reason for line, _, reason in reasons(result)}
    assert not result.changed.any()
    assert found[5] == '"list" is changed when the program runs, in line 3'
    assert found[2].startswith('"b" is also used in line')


@settings(max_examples=60)
@given(st.data())
def test_mutilated_programs_end_in_a_listing_or_an_error(robot, sample, data):
    start = data.draw(st.integers(0, len(sample)))
    end = data.draw(st.integers(start, min(len(sample), start + 60)))
    put = data.draw(st.text(st.sampled_from("()[]{},:=\n#\"'pq0.5-e $def end if movej"), max_size=12))
    assert survives(UR, sample[:start] + put + sample[end:], robot)


@settings(max_examples=40)
@given(st.text(st.characters(max_codepoint=255, exclude_characters="\x00"), max_size=200))
def test_any_text_ends_in_a_listing_or_an_error(robot, text):
    assert survives(UR, text, robot)


@pytest.mark.parametrize("text", ["(" * 5000, "if x:\n" * 5000, "movej(" + "-" * 5000, "x = " + "a[" * 3000])
def test_deep_nesting_is_no_traceback(robot, text):
    assert survives(UR, text, robot)
