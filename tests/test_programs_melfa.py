"""MELFA BASIC programs: variables, flags, tools and offsets, and what is left as it is."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.program_tools import (
    Bend,
    names_changed,
    read,
    reasons,
    rewritten,
    says,
    skeleton,
    survives,
)
from truearm.errors import WorkError
from truearm.programs.branches import Branches
from truearm.programs.densify import Spacing
from truearm.programs.layouts import EulerPose
from truearm.programs.marks import mark_text
from truearm.programs.melfa import MelfaBasic
from truearm.programs.melfa_configuration import StructureFlags
from truearm.programs.solving import AMBIGUOUS
from truearm.programs.tables import Motion
from truearm.programs.turning import ON_THE_EDGE, turns
from truearm.robot import Robot

MELFA = MelfaBasic()
SHIFT = np.deg2rad([0.05, -0.04, 0.03, 0.06, -0.05, 0.08])
ABC = EulerPose(columns=(2, 1, 0))


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mitsubishi-rv-4fl")


@pytest.fixture(scope="module")
def five_axes():
    return Robot.load("rv-m2")


def flags(robot, q):
    found = StructureFlags(Branches.of(robot))
    digits = found.digits(np.atleast_2d(q))
    above = digits[0, 1] == 1
    text = found.text_of_digits(digits, np.array([[2.0 * above, 0.0]]))[0]
    return f"({text[0]:.0f},{text[1]:.0f})"


def position(robot, q, tool_z=0.0, extra=""):
    """(X,Y,Z,A,B,C)(FL1,FL2) of the arm at readings `q`."""
    flange_from_tool = np.eye(4)
    flange_from_tool[2, 3] = tool_z
    pose = robot.flange_chain.pose(robot.joints_from_readings(np.atleast_2d(q))) @ flange_from_tool
    values = ABC.from_poses(pose, np.zeros((1, 6)))[0]
    return f"({','.join(f'{value:+.3f}' for value in values)}{extra}){flags(robot, q)}"


Q = np.deg2rad([[10, 20, 80, 5, 70, 15], [-20, 30, 85, 10, 60, -15], [15, 10, 95, -20, 75, 200]])
SAMPLE = """\
1 ' Mov P1 is a remark
2 Ovrd 50 ' Mvs P9
3 Tool (0,0,95.5,0,0,0)
4 Mov JHOME
5 Mvs P1
6 C1$ = "Mov P2"
7 Cnt 1,100,100
8 Mvs P2 Wth M_Out(1)=1
9 Mvr P2,P3,P4
10 Cnt 0
11 Mov P10(2) Type 1,0
12 Rem Mov P1
13 End
JHOME=({home})
P1={p1}
P2={p2}
P3={p3}
P4={p4}
P10(2)={p5}
"""


@pytest.fixture(scope="module")
def sample(robot):
    path = Q[0] + np.deg2rad(2.0) * np.arange(5)[:, None]
    poses = {f"p{k + 1}": position(robot, q, 0.0955) for k, q in enumerate(path)}
    poses["p2"] = position(robot, path[1], 0.0955, ",+0.00,+0.00")
    return SAMPLE.format(home=",".join(f"{q:.2f}" for q in np.rad2deg(Q[0])), **poses)


def test_every_variable_of_the_sample_is_corrected(robot, sample):
    result = rewritten(MELFA, sample, robot, by=SHIFT)
    assert reasons(result) == []
    assert names_changed(result) == ["JHOME", "P1", "P2", "P3", "P4", "P10(2)"]
    again = says(MELFA, result.contents[0], robot)
    assert np.abs(again - result.nominal - SHIFT).max() < 1e-5


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_numbers_alone_are_changed(robot, sample, ending):
    text = sample.replace("a remark", "f\u00fcr 1.0").replace("\n", ending).encode("latin-1")
    result = rewritten(MELFA, text, robot, by=SHIFT)
    assert result.contents[0] != text
    assert skeleton(result.contents[0]) == skeleton(text)
    at = text.index(b"JHOME=")
    assert result.contents[0][:at] == text[:at]
    assert b",+0.00,+0.00)" in result.contents[0]
    assert result.contents[0].count(b"+") == text.count(b"+")


def test_motions_blending_and_tool(robot, sample):
    program = read(MELFA, sample, robot)
    kinds = [Motion(int(kind)).name for kind in program.moves.motion]
    assert kinds == ["JOINT", "LINEAR", "LINEAR", "LINEAR", "VIA", "CIRCULAR", "JOINT"]
    assert program.moves.blended.tolist() == [False, False, True, True, True, True, False]
    assert program.environments[0].tool.true[2, 3] == 0.0955


LISTED = {
    "Mvs ,-100": "it is a relative move",
    "Mov P9": "its target is not a constant of this file",
    "Mov P_Curr": "its target is not a constant of this file",
    "Mov P1+P2+P1": "its target is computed when the program runs",
    "EMvs P1": "EMvs is not followed: the tool stands still, or it is a relative move",
    "Mov P1,M1": "its distance from the target is computed when the program runs",
}


@pytest.mark.parametrize("statement", LISTED)
def test_motions_that_are_not_certain_are_listed(robot, statement):
    text = f"1 Tool P_NTool\n2 {statement}\nP1={position(robot, Q[0])}\n"
    result = rewritten(MELFA, text, robot, by=SHIFT)
    assert LISTED[statement] in [reason for _, _, reason in reasons(result)]
    assert not result.changed.any()


def test_a_number_that_is_too_large_is_none(robot):
    place = position(robot, Q[0])
    text = f"1 Tool (0,0,0,0,0,0)\n2 Mvs P1\n3 Mvs P2\nP1=(1E400,{place.partition(',')[2]}\nP2={place}\n"
    result = rewritten(MELFA, text, robot, by=SHIFT)
    assert names_changed(result) == ["P2"]
    assert [name for _, name, _ in reasons(result)] == ["P1"]


@pytest.mark.parametrize("branch", ["If M1=1 Then Tool (0,0,200,0,0,0)", "If M1=1 Then M_Tool=2"])
def test_a_tool_that_a_branch_of_a_line_may_set_is_not_known_behind_it(robot, branch):
    places = f"P1={position(robot, Q[0], 0.1)}\nP2={position(robot, Q[1], 0.1)}\n"
    text = f"1 Tool (0,0,100,0,0,0)\n2 Mvs P1\n3 {branch}\n4 Mvs P2\n{places}"
    result = rewritten(MELFA, text, robot, by=SHIFT)
    assert names_changed(result) == ["P1"]
    assert len(reasons(result)) == 1


def _uncertain(robot):
    whole = position(robot, Q[0])
    return {
        whole.replace(")(", ",+100.0,+0.0)("): "an additional axis, L1 or L2, is not at zero",
        whole.partition(")(")[0] + ")": (
            "it states no structure flags, and their default depends on the model of the arm"
        ),
        whole.replace("(7,0)", "(7,&H100000)"): "a number in it is computed or not decimal",
    }


def test_positions_that_are_not_certain_are_listed(robot):
    for text, reason in _uncertain(robot).items():
        result = rewritten(MELFA, f"1 Tool P_NTool\n2 Mov P1\nP1={text}\n", robot, by=SHIFT)
        assert [found for _, _, found in reasons(result)] == [reason]


def test_variables_that_are_computed_with(robot):
    whole = position(robot, Q[0])
    code = f"1 Tool P_NTool\n2 P2.Z=P1.Z+50\n3 Mov P1\n4 Mov P2\n5 P3={whole}\n6 Mov P3\n"
    text = code + f"P1={whole}\nP2={whole}\nP3={whole}\n"
    result = rewritten(MELFA, text, robot, by=SHIFT)
    found = {name: reason for _, name, reason in reasons(result)}
    assert found["P1"] == "it is also used in line 2 for something else than a motion"
    assert found["P2"] == "it is also used in line 2 for something else than a motion"
    assert found["P3"] == "it is assigned more than once"
    assert not result.changed.any()


def test_offsets_that_are_constant_are_known(robot):
    q = Q[0]
    text = (
        f"1 Tool P_NTool\n2 Mov P1,-50\n3 Mvs P2*POFF\n4 Mvs P3+PUP\nP1={position(robot, q, 0.05)}\n"
        f"P2={position(robot, q)}\nP3={position(robot, q)}\nPOFF=(0,0,10,0,0,90)(0,0)\nPUP=(0,0,10,0,0,0)\n"
    )
    program = read(MELFA, text, robot)
    assert [e.after[2, 3] for e in program.environments] == [-0.05, 0.01, 0.0]
    assert [e.before[2, 3] for e in program.environments] == [0.0, 0.0, 0.01]
    result = rewritten(MELFA, text, robot, by=SHIFT)
    assert names_changed(result) == ["P1", "P2", "P3"]
    assert np.abs(result.nominal[0] - q).max() < 1e-4
    both = text.replace("4 Mvs", "4 Mov P1\n5 Mvs")
    assert "as it stands and with offsets" in reasons(rewritten(MELFA, both, robot))[0][2]


def test_base_and_tool_parameters_come_from_the_frames_file(robot):
    text = f"1 M_Tool=2\n2 Base 1\n3 Mov P1\nP1={position(robot, Q[0], 0.1)}\n"
    assert 'tool "2" is not in the program' in reasons(rewritten(MELFA, text, robot))[0][2]
    frames = '[tool.2]\nxyz = [0, 0, 100]\n[object."base 1"]\nxyz = [0, 0, 0]\n'
    result = rewritten(MELFA, text, robot, by=SHIFT, frames=frames)
    assert np.abs(result.nominal[0] - Q[0]).max() < 1e-4
    assert result.changed.all()


def test_branches_make_tool_and_predecessor_uncertain(robot):
    whole = position(robot, Q[0])
    text = (
        f"1 Tool P_NTool\n2 Mov P1\n3 *LOOP\n4 Mov P2\n5 Tool (0,0,50,0,0,0)\n6 Mov P3\n"
        f"7 If M1=1 Then Mov P4 Else GoTo *LOOP\nP1={whole}\nP2={whole}\nP3={whole}\nP4={whole}\n"
    )
    program = read(MELFA, text, robot)
    unknown = [bool(program.environments[int(n)].tool.unknown) for n in program.moves.environment]
    assert unknown == [False, True, False, False]
    assert program.moves.follows.tolist() == [False, False, True, False]


def test_five_axes_keep_an_empty_slot(five_axes):
    text = (
        "1 Mov J1\n2 Mov J2\n3 Mov J3\nJ1=(10.00,20.00,-30.00,,40.00,50.00)\n"
        "J2=(10.00,20.00,-30.00,0.00,40.00,50.00)\nJ3=(1,2,3,4,5)\n"
    )
    shift = np.deg2rad([0.1, -0.1, 0.2, 0.3, -0.4])
    result = rewritten(MELFA, text, five_axes, by=shift)
    changed = result.contents[0].decode().splitlines()
    assert changed[3] == "J1=(10.1000,19.9000,-29.8000,,40.3000,49.6000)"
    assert changed[4] == "J2=(10.1000,19.9000,-29.8000,0.00,40.3000,49.6000)"
    assert reasons(result) == [(6, "J3", "it has 5 numbers, not one for each of six slots")]


def test_flags_of_the_manual(robot):
    assert flags(robot, np.deg2rad([0, 0, 90, 0, 90, 0])) == "(7,0)"
    assert flags(robot, np.deg2rad([0, 0, 90, 0, -90, 0])) == "(6,0)"
    assert flags(robot, np.deg2rad([0, 0, 90, 0, 90, 200])) == "(7,1048576)"
    assert flags(robot, np.deg2rad([0, 0, 90, 0, 90, -200])) == "(7,15728640)"
    assert flags(robot, np.deg2rad([200, 0, 90, -190, 90, 0])) == f"(7,{1 + (15 << 12)})"


def near_edges(low, high):
    """Angles close to where signs and turn numbers change, deg."""
    edges = [edge for edge in (-180.0, -90.0, 0.0, 90.0, 180.0) if low < edge - 0.2 and edge + 0.2 < high]
    return st.sampled_from(edges).flatmap(lambda edge: st.floats(edge - 0.2, edge + 0.2))


WITHIN = [(-235, 235), (-60, 60), (30, 150), (-195, 195), (-115, 115), (-355, 355)]
ANGLES = [st.one_of(st.floats(*span), near_edges(*span)) for span in WITHIN]


@settings(max_examples=120)
@given(st.tuples(*ANGLES))
def test_written_again_it_is_never_a_turn_away(robot, degrees):
    q = np.deg2rad(degrees)
    branches = Branches.of(robot)
    near = abs(branches.reach(q[None])[0]) < 0.05 or abs(branches.elbow(q[None])[0]) < 0.1
    if abs(degrees[4]) < 3 or near:
        return
    q = np.where(turns(q) == ON_THE_EDGE, q + 1e-3, q)
    joints = ",".join(f"{x:.3f}" for x in np.rad2deg(q))
    text = f"1 Tool P_NTool\n2 Mov J1\n3 Mov P1\nJ1=({joints})\nP1={position(robot, q)}\n"
    result = rewritten(MELFA, text, robot, by=SHIFT)
    if result.changed.all():
        again = rewritten(MELFA, result.contents[0], robot)
        off = np.abs(again.nominal - result.nominal - SHIFT).max()
        assert off < 3e-4 or [reason for *_, reason in reasons(again)] == [AMBIGUOUS]
    else:
        assert len(result.listed) == 1


@settings(max_examples=60)
@given(st.data())
def test_mutilated_programs_end_in_a_listing_or_an_error(robot, sample, data):
    start = data.draw(st.integers(0, len(sample)))
    end = data.draw(st.integers(start, min(len(sample), start + 60)))
    put = data.draw(st.text(st.sampled_from("()=,;'\" \n0.5-*+PJMov&H"), max_size=12))
    assert survives(MELFA, sample[:start] + put + sample[end:], robot)


def test_the_mark_keeps_line_numbers(robot, sample):
    text = "compensated by truearm 1.2.3"
    marked = rewritten(MELFA, sample, robot, by=SHIFT, mark=text).contents[0].decode()
    assert marked.splitlines()[0] == f"1 ' Mov P1 is a remark ' {text}"
    with pytest.raises(WorkError, match="compensated already"):
        rewritten(MELFA, marked, robot)
    later = sample.replace("1 ' Mov P1 is a remark\n", "")
    marked = rewritten(MELFA, later, robot, by=SHIFT, mark=text).contents[0].decode()
    assert marked.splitlines()[:2] == [f"1 ' {text}", "2 Ovrd 50 ' Mvs P9"]
    plain = f"Tool P_NTool\nMov P1\nP1={position(robot, Q[0])}\n"
    assert rewritten(MELFA, plain, robot, mark=text).contents[0].decode().startswith(f"' {text}\nTool")


def test_the_mark_makes_no_line_too_long(robot):
    text, long = mark_text("0.1.0", "0" * 64), f"1 ' {'*' * 80}"
    lines = [long, "2 Tool P_NTool", "3 Mov P1", f"P1={position(robot, Q[0])}", ""]
    marked = rewritten(MELFA, "\n".join(lines), robot, mark=text).contents[0].decode().splitlines()
    assert marked[:3] == [long, f"2 Tool P_NTool ' {text}", "3 Mov P1"]
    assert max(map(len, marked)) <= 127


def test_variables_are_named_as_they_are_written_behind_a_line_number(robot):
    value = position(robot, Q[0])
    lines = [f"10 P12={value}", f"20   Pa( 2 ) ={value}", "30 Mov P12", "40 P12.Z=0", "50 Mov PA(2)", ""]
    result = rewritten(MELFA, "\n".join(lines), robot, by=SHIFT, frames=FLANGE)
    assert [one.name for one in result.listed] == ["P12"]
    assert [(one.line, one.column) for one in result.listed] == [(1, 4)]
    assert names_changed(result) == ["Pa( 2 )"]


FINE_STEPS = Spacing.of(0.05, 20.0)
FLANGE = "[tool.tool]\nxyz = [0, 0, 0]\n"
LONG = np.deg2rad([[-30, 20, 80, 5, 70, 15], [30, 20, 80, 5, 70, 15]])


def long_line(robot, lines):
    ends = [position(robot, q) for q in LONG]
    return "\n".join([*lines, f"P1={ends[0]} ' start", f"P3={ends[1]}", ""])


def motions(content):
    return [line for line in content.decode("latin-1").splitlines() if "Mvs" in line]


def line_numbers(content):
    return [int(line.split()[0]) for line in content.decode("latin-1").splitlines() if line[0].isdigit()]


@pytest.mark.parametrize("step", [1, 10, 1000])
def test_waypoints_are_motions_to_variables_of_their_own(robot, step):
    lines = ["Mov P1", "  Mvs P3 ' slowly", "*L1", "GoTo *L1", "End"]
    text = long_line(robot, [f"{step * (n + 1)} {line}" for n, line in enumerate(lines)]).rstrip("\n")
    plain = rewritten(MELFA, text, robot, by=Bend(), frames=FLANGE)
    done = rewritten(MELFA, text, robot, by=Bend(), frames=FLANGE, spacing=FINE_STEPS)
    assert done.inserted >= 2
    assert done.notices == ()
    names = [line.split()[2] for line in motions(done.contents[0])]
    assert names == ["P2", *(f"P{number + 3}" for number in range(1, done.inserted)), "P3"]
    numbers = line_numbers(done.contents[0])
    assert numbers == sorted(set(numbers))
    assert len(numbers) == len(lines) + done.inserted
    assert numbers[0] == line_numbers(plain.contents[0])[0]
    again = read(MELFA, done.contents[0], robot, FLANGE)
    said = says(MELFA, done.contents[0], robot, FLANGE)[again.moves.target]
    assert (np.diff(said[:, 0]) > 0.0).all(), "in the order of the way"
    assert reasons(rewritten(MELFA, done.contents[0], robot, frames=FLANGE)) == []
    assert b"Mvs P3 ' slowly" in done.contents[0]


def test_lines_keep_their_numbers_where_there_is_room(robot):
    text = long_line(robot, ["100 Mov P1", "200 Mvs P3", "210 GoTo 100", "220 End"])
    done = rewritten(MELFA, text, robot, by=Bend(), frames=FLANGE, spacing=FINE_STEPS)
    numbers = line_numbers(done.contents[0])
    assert numbers[0] == 100
    assert numbers[-3:] == [200, 210, 220]
    assert done.inserted == len(numbers) - 4 > 0


def test_lines_that_are_jumped_to_by_number_are_not_numbered_anew(robot):
    text = long_line(robot, ["1 Mov P1", "2 Mvs P3", "3 If M1=1 Then 1 Else 4", "4 End"])
    done = rewritten(MELFA, text, robot, by=Bend(), frames=FLANGE, spacing=FINE_STEPS)
    assert done.inserted == 0
    assert line_numbers(done.contents[0]) == [1, 2, 3, 4]
    assert [notice.kind for notice in done.notices] == ["deviation"]


def test_lines_without_numbers_get_none(robot):
    text = long_line(robot, ["Mov P1", "Mvs P3", "End"])
    done = rewritten(MELFA, text, robot, by=Bend(), frames=FLANGE, spacing=FINE_STEPS)
    assert motions(done.contents[0])[0] == "Mvs P2"
    assert line_numbers(done.contents[0]) == []
    assert done.inserted >= 2


@pytest.mark.parametrize("name", ["J2", "HOME"])
def test_waypoints_before_joints_are_joints_in_joint_variables(robot, name):
    joints = ",".join(f"{angle:.2f}" for angle in np.rad2deg(LONG[1]))
    lines = ["Def Jnt HOME", "Mov P1", f"Mvs {name}", "Mvs P1", "End", f"{name}=({joints})"]
    text = long_line(robot, [*lines, "J5=(0,0,90,0,90,0)"])
    done = rewritten(MELFA, text, robot, by=Bend(), frames=FLANGE, spacing=FINE_STEPS)
    again = read(MELFA, done.contents[0], robot, FLANGE)
    names = [again.targets.names[target] for target in again.moves.target.tolist()]
    way = names[1 : names.index(name)]
    assert way[:2] == (["J1", "J3"] if name == "J2" else ["J1", "J2"])
    assert "J5" not in way
    assert names[names.index(name) + 1 :][:2] == ["P2", "P4"]
    said = says(MELFA, done.contents[0], robot, FLANGE)[again.moves.target]
    assert (np.diff(said[: len(way) + 2, 0]) > 0.0).all(), "in the order of the way"


def test_angles_of_waypoints_lie_within_half_a_turn(robot):
    text = long_line(robot, ["Mov P1", "Mvs P3", "Mvs P1", "End"])
    turned = re.sub(r"([+-][\d.]+)\)\(", lambda c: f"{float(c.group(1)) + 360.0:+.3f})(", text)
    plain, done = (
        rewritten(MELFA, one, robot, by=Bend(), frames=FLANGE, spacing=FINE_STEPS) for one in (text, turned)
    )
    assert done.inserted == plain.inserted >= 4
    angles = {
        name: float(angle)
        for name, angle in re.findall(r"(P\d+)=\(.*,([+-]?[\d.]+)\)\(", done.contents[0].decode())
    }
    assert min(abs(angles.pop(name)) for name in ("P1", "P3")) > 180.0, "targets keep their notation"
    assert max(abs(angle) for angle in angles.values()) <= 180.0
    said = says(MELFA, done.contents[0], robot, FLANGE)
    np.testing.assert_allclose(said, says(MELFA, plain.contents[0], robot, FLANGE), atol=1e-5)


def test_numbers_out_of_order_stay(robot):
    text = long_line(robot, ["20 Mov P1", "10 Ovrd 50", "Mvs P3", "End"])
    done = rewritten(MELFA, text, robot, by=Bend(), frames=FLANGE, spacing=FINE_STEPS)
    assert done.inserted >= 2
    assert line_numbers(done.contents[0]) == [20, 10]


@pytest.mark.parametrize("motion", ["Mvs P3 Wth M_Out(1)=1", "Mvs P3 Type 0,0", "*L1:Mvs P3"])
def test_a_motion_that_does_more_gets_no_waypoints(robot, motion):
    text = long_line(robot, ["Mov P1", motion, "End"])
    done = rewritten(MELFA, text, robot, by=Bend(), frames=FLANGE, spacing=FINE_STEPS)
    assert done.inserted == 0


@settings(max_examples=25)
@given(st.data())
def test_waypoints_of_mutilated_programs_end_in_a_listing_or_an_error(robot, data):
    text = long_line(robot, ["1 Mov P1", "2 Mvs P3", "*L1", "3 End"])
    start = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(start, min(len(text), start + 20)))
    put = data.draw(st.text(st.sampled_from("()=,;'\" \n0.5-*+PJMov&H"), max_size=12))
    mutilated = text[:start] + put + text[end:]
    assert survives(MELFA, mutilated, robot, FLANGE, by=Bend(), spacing=FINE_STEPS)
