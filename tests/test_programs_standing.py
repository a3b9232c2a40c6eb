"""Where the arm stands before a move: behind seeds, arcs and circles, and what is drawn from there."""

import numpy as np
import pytest

from tests.program_tools import Bend, read, rewritten, says
from tests.programs_rig import ABB, KUKA, models
from tests.programs_rig import read as read_file
from tests.programs_rig import rewritten as rewritten_file
from tests.test_programs_krl import ALREADY
from tests.test_programs_krl import pose_text as krl_pose
from tests.test_programs_melfa import FINE_STEPS, FLANGE, MELFA, position
from tests.test_programs_rapid import module, points
from tests.test_programs_tp import TP, off, pose, program
from tests.test_programs_tp import joints as fanuc_joints
from tests.test_programs_urscript import UR, pose_text
from truearm.programs.csv_path import CsvPath
from truearm.programs.solving import UNKNOWN_BEFORE
from truearm.programs.tables import NOWHERE
from truearm.robot import Robot

PLACES = np.deg2rad([[-30, 20, 80, 5, 70, 15], [-20, 20, 80, 5, 70, 15], [-25, 40, 80, 5, 50, 15]])
FAR = np.deg2rad([30, 20, 80, 5, 70, 15])
HOME, FIRST, LAST = np.deg2rad(
    [[0, -90, 90, -90, -90, 0], [-30, -80, 100, -100, -90, 0], [30, -80, 100, -100, -90, 0]]
)


@pytest.fixture(scope="module")
def mitsubishi():
    return Robot.load("mitsubishi-rv-4fl")


@pytest.fixture(scope="module")
def universal():
    return Robot.load("ur10e")


def melfa(robot, *lines):
    """A program with P1, P2 and P3 not far from each other, and P4 far away."""
    places = [position(robot, q) for q in (*PLACES, FAR)]
    return "\n".join([*lines, "End", *(f"P{n}={place}" for n, place in enumerate(places, 1)), ""])


def joints(q):
    return f"[{', '.join(f'{value:.9f}' for value in q)}]"


def before(program):
    """Names of the targets that the arm stands at before each move."""
    names = program.targets.names
    return [names.get(int(target), int(target)) for target in program.moves.before]


def stops(language, content, robot, frames=""):
    """Where the flange is behind each move, m."""
    moves = read(language, content, robot, frames).moves
    q = says(language, content, robot, frames)[moves.target[moves.moving]]
    return robot.flange_chain.pose(robot.joints_from_readings(q))[:, :3, 3]


@pytest.mark.parametrize(("arc", "end"), [("Mvr2 P1,P2,P3", 1), ("Mvr P1,P3,P2", 1), ("Mvc P1,P2,P3", 0)])
@pytest.mark.parametrize("first", ["Mov P4", "Mov P1"])
def test_a_line_behind_an_arc_begins_where_the_arc_ends(mitsubishi, arc, end, first):
    text = melfa(mitsubishi, first, "Mov P1", arc, "Mvs P4")
    done = rewritten(MELFA, text, mitsubishi, by=Bend(), frames=FLANGE, spacing=FINE_STEPS)
    assert done.inserted >= 2
    points = stops(MELFA, done.contents[0], mitsubishi, FLANGE)
    q = np.stack([PLACES[end], FAR])
    ends = mitsubishi.flange_chain.pose(mitsubishi.joints_from_readings(q))[:, :3, 3]
    assert off(points[-1 - done.inserted :], ends) < 0.004
    along = (points[-2 - done.inserted :] - ends[0]) @ (ends[1] - ends[0])
    assert (np.diff(along) > 0.0).all()


def test_places_of_melfa_arcs(mitsubishi):
    text = melfa(mitsubishi, "Mov P4", "Mvc P1,P2,P3", "Mvr3 P3,P2,P1", "Mvs P4")
    standing = before(read(MELFA, text, mitsubishi, FLANGE))
    assert standing == [NOWHERE, "P4", "P1", "P2", "P3", "P1", "P3", "P3", "P2"]
    for arc in ("Mvr3 P1,P9,P2", "Mvr2 P1,P9,P2", "Mvr P1,P2,P9", "Mvc P9,P1,P2", "Mvr3 P1", "Mxt 1,1,50"):
        text = melfa(mitsubishi, "Mov P4", arc, "Mvs P4")
        assert before(read(MELFA, text, mitsubishi, FLANGE))[-1] == NOWHERE, arc


def test_a_point_beside_an_arc_may_be_out_of_reach(mitsubishi):
    text = melfa(mitsubishi, "Mov P2", "Mvr2 P2,P4,P1", "Mvs P3")
    text = text.replace(f"P1={position(mitsubishi, PLACES[0])}", "P1=(0,0,5000,0,0,0)(7,0)")
    done = rewritten(MELFA, text, mitsubishi, by=1e-3, frames=FLANGE)
    assert done.changed.tolist() == [False, True, True, True]
    assert done.listed == ()


@pytest.mark.parametrize("start", ["movej(home)\n", ""])
def test_a_line_to_a_seeded_target_begins_where_the_arm_stands(universal, start):
    last = f"p[{pose_text(universal, LAST, tool=(0, 0, 0))}]"
    text = f"set_tcp(p[0,0,0,0,0,0])\nhome={joints(HOME)}\n{start}movej({joints(FIRST)})\n"
    text += f"movel(get_inverse_kin({last}, home))\n"
    done = rewritten(UR, text, universal, by=Bend(), spacing=FINE_STEPS)
    assert done.inserted >= 2
    points = stops(UR, done.contents[0], universal)
    ends = universal.flange_chain.pose(universal.joints_from_readings(np.stack([FIRST, LAST])))[:, :3, 3]
    assert off(points[-2 - done.inserted :], ends) < 0.004


def test_places_of_urscript(universal):
    first, last = (f"p[{pose_text(universal, q, tool=(0, 0, 0))}]" for q in (FIRST, LAST))
    text = f"movej({joints(FIRST)})\nmovel(get_inverse_kin({last}, {joints(HOME)}))\nmovel({first})\n"
    moves = read(UR, f"set_tcp(p[0,0,0,0,0,0])\n{text}", universal).moves
    assert moves.before.tolist() == [NOWHERE, 0, 0, moves.target[2]]
    assert moves.near.tolist() == [NOWHERE, 0, moves.target[1], moves.target[2]]
    assert moves.moving.tolist() == [True, False, True, True]
    for unknown in (f"movec({last}, somewhere)", "speedl([0,0,0.1,0,0,0],0.5,1)", f"optimovel({last})"):
        moves = read(UR, f"{text}{unknown}\nmovel({first})\n", universal).moves
        assert moves.before[-1] == NOWHERE, unknown


def test_a_seed_behind_a_jump_tells_the_solution_and_not_the_place(universal):
    pose = f"p[{pose_text(universal, LAST, tool=(0, 0, 0))}]"
    text = f"movej({joints(FIRST)})\nwhile True:\n  movel(get_inverse_kin({pose}, {joints(HOME)}))\nend\n"
    moves = read(UR, text, universal).moves
    assert moves.before.tolist() == [NOWHERE] * 3
    assert moves.near.tolist() == [NOWHERE, NOWHERE, moves.target[1]]


@pytest.mark.parametrize(
    "lines",
    [
        "while True:\n  {}\nend",
        "if get_standard_digital_in(0):\n  halt\nelse:\n  {}\nend",
        "go()\n{}",
        "movej(get_target_joint_positions())\n{}",
    ],
)
def test_a_pose_behind_a_place_that_is_not_known_says_so(universal, lines):
    pose = f"movel(p[{pose_text(universal, LAST, tool=(0, 0, 0))}])"
    head = f"set_tcp(p[0,0,0,0,0,0])\ndef go():\n  movej({joints(HOME)})\nend\nmovej({joints(FIRST)})\n"
    done = rewritten(UR, head + lines.format(pose), universal, by=1e-3)
    assert done.listed[-1].reason == UNKNOWN_BEFORE
    assert "a loop, a branch, a call" in UNKNOWN_BEFORE
    assert rewritten(UR, f"{head}{pose}\n", universal, by=1e-3).listed == ()


def test_an_arc_with_an_angle_ends_elsewhere():
    via, end, far = (krl_pose([a, -90, 100, 0, 45, 0], decimals=5) for a in (-10, 0, 30))
    for angle, known in (("", True), (",CA 270", False), (", ca -90 C_DIS", False)):
        text = f"{ALREADY}PTP {far}\nCIRC {via},{end}{angle}\nLIN {far}\nEND\n"
        moves = read_file("a.src", text, KUKA).moves
        assert moves.before[:3].tolist() == [NOWHERE, 0, 1]
        assert (moves.before[3] == 2) == known


def test_a_circle_of_a_listing_ends_at_its_second_position():
    robot = Robot.load("fanuc-lr-mate-200id")
    places = [pose(robot, n, np.deg2rad([10 * n, 20, -10, 5, -80, 15])) for n in (1, 2, 3)]
    lines = ["J P[1] 100% FINE", "C P[2] :  P[3] 100mm/sec FINE", "L P[1] 100mm/sec FINE"]
    assert read(TP, program(lines, places), robot).moves.before.tolist() == [NOWHERE, 0, 1, 2]
    lines[1] = "C P[2] :  PR[3] 100mm/sec FINE"
    assert read(TP, program(lines, places), robot).moves.before.tolist() == [NOWHERE, 0, NOWHERE]


def test_joints_beside_the_poses_of_a_path_are_no_places(universal):
    rows = [f"{joints(q)[1:-1]}, {pose_text(universal, q)}" for q in (FIRST, HOME, LAST)]
    header = "q1,q2,q3,q4,q5,q6,x,y,z,rx,ry,rz"
    moves = read(CsvPath(), "\n".join([header, *rows, ""]), universal).moves
    assert moves.before.tolist() == [NOWHERE, NOWHERE, 1, 1, 3, 3]
    assert moves.near[moves.moving].tolist() == [0, 2, 4]


@pytest.mark.parametrize(
    ("more", "known"),
    [
        ("", True),
        ("IF HOME.A1 > 0 THEN\nENDIF", True),
        ("SPEED=ABS(HOME.A1)", True),
        ("$H_POS=HOME", True),
        ("TEACH(HOME)", False),
        ("HOME.A1=5", False),
    ],
)
def test_a_place_that_a_program_only_reads_tells_where_the_arm_stands(more, known):
    line = krl_pose([14, -76, 98, 20, 57, -27], state=False, decimals=5)
    home = "HOME={A1 10,A2 -80,A3 95,A4 20,A5 60,A6 -30}"
    text = f"{ALREADY}DECL E6AXIS HOME\n{home}\nPTP HOME\nLIN {line}\n{more}\nEND\n"
    done = rewritten_file(read_file("a.src", text, KUKA), models(KUKA))
    assert done.changed[-1] == known


@pytest.mark.parametrize(
    ("more", "known"),
    [
        ("x:=jHome.robax.rax_1;", True),
        ("jNext:=CalcJointT(CalcRobT(jHome,tG),tG);", True),
        ("Teach jHome;", False),
        ("jHome:=CJointT();", False),
    ],
)
def test_a_joint_target_of_rapid_that_is_only_read_is_a_place(more, known):
    found = read_file("a.mod", module(f"MoveAbsJ jHome,v100,fine,tG;\n{more}", points()), ABB)
    home = next(number for number, name in found.targets.names.items() if name == "jhome")
    assert home in found.fixed
    assert (home not in found.unsure) == known


@pytest.mark.parametrize(
    ("more", "known"),
    [("If J1.J1 > 0 Then *L", True), ("J2=J1", True), ("J1=J_Curr", False), ('CallP "T",J1', False)],
)
def test_joints_of_melfa_that_are_only_read_are_a_place(more, known, mitsubishi):
    text = f"Mov J1\n{more}\n*L\nEnd\nJ1=(0.00,20.00,80.00,5.00,70.00,15.00)\n"
    found = read(MELFA, text, mitsubishi, FLANGE)
    assert (0 in found.fixed, 0 not in found.unsure) == (True, known)


@pytest.mark.parametrize(
    ("more", "known"),
    [("PR[1]=P[1]", True), ("PR[1]=P[R[2]]", True), ("P[1]=LPOS", False), ("P[R[2]]=JPOS", False)],
)
def test_positions_of_a_listing_that_are_only_read_are_a_place(more, known):
    robot = Robot.load("fanuc-lr-mate-200id")
    text = program(["J P[1] 100% FINE", more], [fanuc_joints(1, np.deg2rad([10, 20, -10, 5, -80, 15]))])
    found = read(TP, text, robot)
    assert (0 in found.fixed, 0 not in found.unsure) == (True, known)
