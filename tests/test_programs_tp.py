"""FANUC listings: positions and their frames, CONFIG, and what is left as it is."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

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
from truearm.controller import Controller
from truearm.errors import InputError, WorkError
from truearm.programs.densify import Spacing
from truearm.programs.layouts import EulerPose
from truearm.programs.solving import AMBIGUOUS
from truearm.programs.tables import Motion
from truearm.programs.tp import FanucTp
from truearm.programs.tp_configuration import LETTERS, ORDERS
from truearm.programs.turning import ON_THE_EDGE, turns
from truearm.robot import Robot
from truearm.rotations import rigid_inverse

TP = FanucTp()
SHIFT = np.deg2rad([0.05, -0.04, 0.03, 0.06, -0.05, 0.08])
WPR = EulerPose(columns=(2, 1, 0))
FRAMES = """\
[tool.2]
xyz = [10, -5, 120]
euler_zyx_deg = [30, 0, 10]
payload_kg = 1.5
[object.1]
xyz = [300, 50, -20]
euler_zyx_deg = [45, 5, 0]
"""
HEAD = '/PROG  TEST\n/ATTR\nOWNER\t\t= MNEDITOR;\nCOMMENT\t\t= "J P[1] {x}";\nDEFAULT_GROUP\t= 1,*,*,*,*;\n'
POSE = (
    "P[{number}]{{\n   GP1:\n\tUF : {uf}, UT : {ut},\t\tCONFIG : '{config}',\n"
    "\tX ={:10.3f}  mm,\tY ={:10.3f}  mm,\tZ ={:10.3f}  mm,\n"
    "\tW ={:10.3f} deg,\tP ={:10.3f} deg,\tR ={:10.3f} deg\n}};\n"
)
JOINTS = (
    "P[{number}]{{\n   GP1:\n\tUF : {uf}, UT : {ut},\t\n"
    "\tJ1={:10.3f} deg,\tJ2={:10.3f} deg,\tJ3={:10.3f} deg,\n"
    "\tJ4={:10.3f} deg,\tJ5={:10.3f} deg,\tJ6={:10.3f} deg\n}};\n"
)


@pytest.fixture(scope="module")
def robot():
    return Robot.load("fanuc-lr-mate-200id")


def program(main, positions):
    lines = "".join(f"{number:4d}:{line} ;\n" for number, line in enumerate(main, 1))
    return f"{HEAD}/MN\n{lines}/POS\n{''.join(positions)}/END\n"


def joints(number, q, uf=1, ut=2):
    return JOINTS.format(*np.rad2deg(q), number=number, uf=uf, ut=ut)


def configuration(robot):
    text = program(
        ["J P[1] 10% FINE"],
        [POSE.format(300, 0, 200, 180, 0, 0, number=1, uf=0, ut=0, config="N U T, 0, 0, 0")],
    )
    return read(TP, text, robot).configuration


def config_text(robot, q, order=ORDERS[0]):
    digits = configuration(robot).digits(np.atleast_2d(q))[0]
    letters = " ".join(known[digit] for known, digit in zip(LETTERS, digits, strict=False))
    found = dict(zip((0, 3, 4, 5), digits[3:7], strict=True))
    return f"{letters}, {', '.join(str(found[joint]) for joint in order)}"


def pose(robot, number, q, frames=("0", "0"), order=ORDERS[0]):
    """A position where the arm is at readings `q`."""
    from truearm.programs.frames import Frames

    known = Frames.parse(FRAMES)
    flange = robot.flange_chain.pose(robot.joints_from_readings(np.atleast_2d(q)))[0]
    base_from_object = np.eye(4) if frames[0] == "0" else known.work_object(frames[0]).true
    flange_from_tool = np.eye(4) if frames[1] == "0" else known.tool(frames[1]).true
    stored = rigid_inverse(base_from_object) @ flange @ flange_from_tool
    values = WPR.from_poses(stored[None], np.zeros((1, 6)))[0]
    return POSE.format(
        *values, number=number, uf=frames[0], ut=frames[1], config=config_text(robot, q, order)
    )


Q = np.deg2rad([[10, 20, -10, 5, -80, 15], [-20, 30, -5, 10, -70, -15], [15, 10, 5, -20, -60, 30]])
MAIN = [
    "  !J P[1] 100% FINE",
    "  UFRAME_NUM=1",
    "  UTOOL_NUM=2",
    "  PAYLOAD[1]",
    "J P[1:HOME] 100% FINE   ",
    "L P[2] 500mm/sec CNT50 ACC80   ",
    "C P[3]    \n    :  P[4] 150mm/sec CNT20   ",
    "  //L P[5] 100mm/sec FINE",
    "  MESSAGE[L P[5] 100mm/sec FINE]",
    "L P[5] WELD_SPEED FINE\n    :  Arc Start[6]   ",
]


@pytest.fixture(scope="module")
def sample(robot):
    near = Q[0] + np.deg2rad(2.0) * np.arange(4)[:, None]
    positions = [
        joints(1, Q[0]),
        pose(robot, 2, near[1], ("1", "2")),
        pose(robot, 3, near[2], ("1", "2")).replace(
            "\n};", "\n   GP2:\n\tUF : 1, UT : 1,\t\n\tJ1=   -95.104  mm\n};"
        ),
        pose(robot, 4, near[3], ("1", "2")),
        pose(robot, 5, near[3], ("0", "0")).replace("P[5]", 'P[5:"Naht \u00e4 X= 1.0"]'),
    ]
    return program([line for line in MAIN if "MESSAGE" not in line], positions)


def test_every_position_of_the_sample_is_corrected(robot, sample):
    result = rewritten(TP, sample, robot, by=SHIFT, frames=FRAMES)
    assert reasons(result) == []
    assert names_changed(result) == [f"P[{n}]" for n in range(1, 6)]
    assert np.abs(result.nominal[0] - Q[0]).max() < 1e-5
    again = says(TP, result.contents[0], robot, FRAMES)
    assert np.abs(again - result.nominal - SHIFT).max() < 1e-5


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_numbers_alone_are_changed(robot, sample, ending):
    text = sample.replace("\n", ending).encode("latin-1")
    result = rewritten(TP, text, robot, by=SHIFT, frames=FRAMES)
    assert result.contents[0] != text
    assert skeleton(result.contents[0]) == skeleton(text)
    at = text.index(b"/POS")
    assert result.contents[0][:at] == text[:at]
    assert b"-95.104  mm" in result.contents[0]


def test_motions_and_blending(robot, sample):
    moves = read(TP, sample, robot, FRAMES).moves
    assert [Motion(int(kind)).name for kind in moves.motion] == [
        "JOINT",
        "LINEAR",
        "VIA",
        "CIRCULAR",
        "LINEAR",
    ]
    assert moves.blended.tolist() == [False, True, True, True, False]
    environments = read(TP, sample, robot, FRAMES).environments
    assert {environment.payload_kg for environment in environments} == {1.5, None}


OPTIONS = {
    "L P[1] 100mm/sec FINE INC": "it is a relative move (INC)",
    "L P[1] 100mm/sec FINE Offset,PR[1]": "an offset known at run time is added",
    "L P[1] 100mm/sec CNT50 Tool_Offset,PR[3]": "an offset known at run time is added",
    "L P[1] 100mm/sec FINE RTCP": "the tool stands still and the arm holds the part (RTCP)",
    "L P[1] 100mm/sec FINE COORD": "it is coordinated with another motion group (COORD)",
    "L PR[1] 100mm/sec FINE": "a position register is set at run time",
    "L P[R[1]] 100mm/sec FINE": "which position it is, is computed at run time",
    "L P[9] 100mm/sec FINE": "there is no such position in /POS",
}


@pytest.mark.parametrize("line", OPTIONS)
def test_motions_that_are_not_certain_are_listed(robot, line):
    text = program([line], [pose(robot, 1, Q[0])])
    result = rewritten(TP, text, robot, by=SHIFT)
    assert OPTIONS[line] in [reason for _, _, reason in reasons(result)]
    assert not result.changed.any()
    assert result.contents[0].decode() == text


def _broken(text):
    return {
        text.replace("deg\n}", "deg,\n\tE1=   900.000  mm\n}"): "external axis E1 moves with the arm",
        text.replace(
            "N U T,", "N L U T,"
        ): "its CONFIG is not three letters N/F U/D T/B and three turn numbers of at most 99",
        text.replace("R =", "Q ="): "it does not state R",
        text.replace("GP1:", "GP2:"): "it has no motion group 1 (GP1), whose arm is corrected",
    }


def test_positions_that_are_not_certain_are_listed(robot):
    whole = pose(robot, 1, Q[0])
    for text, reason in _broken(whole).items():
        result = rewritten(TP, program(["J P[1] 10% FINE"], [text]), robot, by=SHIFT)
        assert [found for _, _, found in reasons(result)] == [reason]
    untaught = joints(1, Q[0]).replace(f"J2={np.rad2deg(Q[0, 1]):10.3f}", "J2=  ********")
    assert reasons(rewritten(TP, program(["J P[1] 10% FINE"], [untaught]), robot))[0][2] == "it is not taught"


def test_frames_that_nobody_knows(robot):
    text = program(["L P[1] 10mm/sec FINE"], [pose(robot, 1, Q[0], ("1", "2"))])
    assert 'tool "2" is not in the program' in reasons(rewritten(TP, text, robot))[0][2]
    redefined = text.replace("   1:L", "   1:  UFRAME[1]=PR[1] ;\n   2:L")
    found = reasons(rewritten(TP, redefined, robot, frames=FRAMES))[0][2]
    assert found == "UFRAME[1] is set in line 7 when the program runs"
    current = text.replace("UF : 1", "UF : F")
    found = reasons(rewritten(TP, current, robot, frames=FRAMES))[0][2]
    assert found == "UFRAME_NUM is not one number throughout the program"
    known = current.replace("   1:L", "   1:  UFRAME_NUM=1 ;\n   2:L")
    assert rewritten(TP, known, robot, by=SHIFT, frames=FRAMES).changed.all()


def test_the_current_frame_is_certain_only_where_every_motion_has_it(robot):
    position = pose(robot, 1, Q[0], ("1", "2")).replace("UF : 1, UT : 2", "UF : F, UT : F")
    move, frame, tool = "L P[1] 10mm/sec FINE", "  UFRAME_NUM=1", "  UTOOL_NUM=2"

    def why(*lines):
        result = rewritten(TP, program(lines, [position]), robot, by=SHIFT, frames=FRAMES)
        return "" if result.changed.all() else reasons(result)[0][2]

    assert not why(frame, tool, move)
    assert "UFRAME_NUM is set in line 9, behind motions or branches" in why(tool, move, frame, move)
    assert "behind motions" in why(frame, "  IF R[1]=1,JMP LBL[1]", tool, "  LBL[1]", move)
    assert "line 9 may call a program or macro that sets" in why(frame, tool, "  CALL GRIP", move)
    assert "not one number" in why(frame, tool, "  IF (DI[1]=ON),UFRAME_NUM=(3)", move)


def test_a_position_that_is_computed_with_is_listed(robot):
    text = program(["  PR[1]=P[1]", "J P[1] 10% FINE"], [joints(1, Q[0])])
    result = rewritten(TP, text, robot, by=SHIFT)
    assert reasons(result)[0][2] == "it is also used in line 7 for something else than a motion"


def test_the_order_of_turn_numbers_follows_from_limits(robot):
    q = np.deg2rad([10, 20, -10, 185, -80, 15])
    for order in ORDERS:
        text = program(["J P[1] 10% FINE"], [pose(robot, 1, q, order=order)])
        found = read(TP, text, robot).configuration
        assert found.orders == (order,)
        result = rewritten(TP, text, robot, by=SHIFT)
        assert np.abs(result.nominal[0] - q).max() < 1e-4
        assert np.abs(says(TP, result.contents[0], robot)[0] - q - SHIFT).max() < 1e-4


@pytest.mark.parametrize(("j2", "j3"), [(50, -75), (50, -85), (140, -135), (-95, 275), (-60, 225), (0, 0)])
def test_an_elbow_that_is_read_against_the_horizontal_is_not_a_turn_away(robot, j2, j3):
    """J3 and J3 + 360 deg both lie within -140 and 280 deg; the forearm cannot pass the upper arm."""
    q = np.deg2rad([20, j2, j3, 10, -40, 30])
    result = rewritten(TP, program(["J P[1] 100% FINE"], [pose(robot, 1, q)]), robot, by=SHIFT)
    assert reasons(result) == []
    assert np.abs(result.nominal[0] - q).max() < 1e-4
    assert np.abs(says(TP, result.contents[0], robot)[0] - q - SHIFT).max() < 1e-4


@pytest.fixture(scope="module")
def turning_arm(robot):
    """The same arm with joints that can all make a turn."""
    limits = np.array(robot.limits)
    limits[[0, 4]] = [-2 * np.pi, 2 * np.pi]
    return dataclasses.replace(robot, limits=limits)


def test_the_order_follows_from_a_pair(turning_arm):
    q = np.deg2rad([10, 20, -10, 185, -80, 15])
    for order in ORDERS:
        alone = program(["J P[1] 10% FINE"], [pose(turning_arm, 1, q, order=order)])
        result = rewritten(TP, alone, turning_arm, by=SHIFT)
        assert "turn numbers mean different joints" in reasons(result)[0][2]
        pair = program(
            ["J P[1] 10% FINE", "J P[2] 10% FINE"], [pose(turning_arm, 1, q, order=order), joints(2, q, 0, 0)]
        )
        assert read(TP, pair, turning_arm).configuration.orders == (order,)
        result = rewritten(TP, pair, turning_arm, by=SHIFT)
        assert np.abs(says(TP, result.contents[0], turning_arm) - q - SHIFT).max() < 1e-4


def test_a_turn_that_cannot_be_said_is_listed(turning_arm):
    q = np.deg2rad([10, 20, -10, 179.98, -80, 15])
    text = program(["J P[1] 10% FINE"], [pose(turning_arm, 1, q)])
    result = rewritten(TP, text, turning_arm, by=SHIFT)
    assert not result.changed.any()
    assert "no configuration data says" in reasons(result)[0][2]


def test_zero_is_up_in_front_and_a_tool_that_points_down_is_no_flip(robot):
    assert config_text(robot, np.deg2rad([0, 0, 0, 0, -90, 0])) == "N U T, 0, 0, 0"
    assert config_text(robot, np.deg2rad([0, 0, 0, 180.1, 90, -200])) == "F U T, 0, 1, -1"
    assert config_text(robot, np.deg2rad([0, -90, 100, 0, -90, 0]))[4] == "B"


def near_edges(low, high):
    """Angles close to where signs and turn numbers change, deg."""
    edges = [edge for edge in (-180.0, -90.0, 0.0, 90.0, 180.0) if low < edge - 0.2 and edge + 0.2 < high]
    return st.sampled_from(edges).flatmap(lambda edge: st.floats(edge - 0.2, edge + 0.2))


WITHIN = [(-165, 165), (-60, 100), (-60, 120), (-185, 185), (-120, 120), (-355, 355)]
ANGLES = [st.one_of(st.floats(*span), near_edges(*span)) for span in WITHIN]


@settings(max_examples=120)
@given(st.tuples(*ANGLES))
def test_written_again_it_is_never_a_turn_away(robot, degrees):
    q = np.deg2rad(degrees)
    singular = abs(degrees[4]) < 3 or abs(configuration(robot).branches.reach(q[None])[0]) < 0.05
    if singular or abs(configuration(robot).branches.elbow(q[None])[0]) < 0.1:
        return
    text = program(["J P[1] 10% FINE"], [pose(robot, 1, np.where(turns(q) == ON_THE_EDGE, q + 1e-3, q))])
    result = rewritten(TP, text, robot, by=SHIFT)
    if result.changed[0]:
        again = rewritten(TP, result.contents[0], robot)
        off = np.abs(again.nominal[0] - result.nominal[0] - SHIFT).max()
        assert off < 3e-4 or [reason for *_, reason in reasons(again)] == [AMBIGUOUS]
    else:
        assert len(result.listed) == 1


@settings(max_examples=60)
@given(st.data())
def test_mutilated_programs_end_in_a_listing_or_an_error(robot, sample, data):
    start = data.draw(st.integers(0, len(sample)))
    end = data.draw(st.integers(start, min(len(sample), start + 80)))
    put = data.draw(st.text(st.sampled_from("/POSMNJLP[]{}:;,='\n 0.5-*UFTN"), max_size=12))
    assert survives(TP, sample[:start] + put + sample[end:], robot, FRAMES)


def test_what_is_no_listing_is_an_error_with_its_place(robot):
    with pytest.raises(InputError, match=r"line 1, column 1.*no section /MN"):
        read(TP, "movej([1,2,3,4,5,6])\n", robot)
    with pytest.raises(InputError, match=r"line 4, column 1.*P\[3\] is not closed"):
        read(TP, "/PROG X\n/MN\n/POS\nP[3]{\n GP1:\n", robot)


def test_the_mark_is_remarks_that_are_not_too_long(robot, sample):
    text = "compensated by truearm 1.2.3, calibration 0123456789ab: do not compensate it again"
    marked = rewritten(TP, sample, robot, by=SHIFT, frames=FRAMES, mark=text).contents[0].decode("latin-1")
    remarks = [line for line in marked.splitlines() if line.startswith("    :  !")]
    assert " ".join(line[8:-2] for line in remarks) == text
    assert max(len(line) - 10 for line in remarks) <= 32
    with pytest.raises(WorkError, match="compensated already"):
        rewritten(TP, marked, robot, frames=FRAMES)


FINE_STEPS = Spacing.of(0.05, 20.0)
LONG = np.deg2rad([[-30, 20, -10, 5, -80, 15], [30, 20, -10, 5, -80, 15]])


def long_line(robot, motion, second=lambda text: text):
    """A listing with one long straight line, whose end is P[4]."""
    positions = [pose(robot, 2, LONG[0]), second(pose(robot, 4, LONG[1]).replace("[4]", '[4:"END"]'))]
    return program(["J P[2] 100% FINE", motion, "R[1]=P[9,1]"], positions)


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_waypoints_are_lines_and_positions_of_their_own(robot, ending):
    text = long_line(robot, "L P[4:END] 250mm/sec FINE ACC50    ").replace("\n", ending)
    plain = rewritten(TP, text, robot, by=Bend())
    done = rewritten(TP, text, robot, by=Bend(), spacing=FINE_STEPS)
    content = done.contents[0].decode("latin-1")
    assert done.inserted >= 2
    assert done.notices == ()
    again = read(TP, content, robot)
    numbers = [int(again.targets.names[int(target)][2:-1]) for target in again.moves.target]
    free = [number for number in range(1, done.inserted + 5) if number not in (1, 2, 4, 9)]
    assert numbers == [2, *free[: done.inserted], 4]
    lines = content.split(ending)
    inserted = [line for line in lines if "CNT100" in line]
    assert inserted == [f"    :L P[{number}] 250mm/sec CNT100 ACC50     ;" for number in numbers[1:-1]]
    kept = [line for line in lines if line not in inserted]
    whole = ending.join(kept)
    assert whole.startswith(plain.contents[0].decode("latin-1").removesuffix(f"/END{ending}"))
    said = says(TP, content, robot)[again.moves.target]
    assert (np.diff(said[:, 0]) > 0.0).all(), "in the order of the way"
    assert reasons(rewritten(TP, content, robot)) == []


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_the_count_of_lines_counts_remarks_and_waypoints(robot, ending):
    """Not the positions, each a line or more of /POS."""
    text = long_line(robot, "L P[4:END] 250mm/sec FINE").replace("/ATTR\n", "/ATTR\nLINE_COUNT\t= 9;\n")
    text = text.replace("\n", ending)
    plain = rewritten(TP, text, robot, by=Bend()).contents[0]
    assert b"LINE_COUNT\t= 9;" in plain
    done = rewritten(TP, text, robot, by=Bend(), spacing=FINE_STEPS, mark="compensated by somebody")
    lines = [one.partition(b"/MN")[2].partition(b"/POS")[0].count(b"\n") for one in (plain, done.contents[0])]
    assert lines[1] - lines[0] == done.inserted + 1
    assert f"LINE_COUNT\t= {9 + done.inserted + 1};{ending}OWNER".encode() in done.contents[0]


def off(points, corners):
    """How far points are from straight lines between corners, at the most."""
    starts, ways = corners[:-1], np.diff(corners, axis=0)
    share = ((points[:, None] - starts) * ways).sum(axis=2) / (ways**2).sum(axis=1)
    nearest = starts + np.clip(share, 0.0, 1.0)[:, :, None] * ways
    return np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1).max()


def test_waypoints_keep_the_line_straight(robot):
    text = long_line(robot, "L P[4] 250mm/sec CNT50")
    done = rewritten(TP, text, robot, by=Bend(), spacing=FINE_STEPS)
    assert b"mm/sec CNT50 ;" in done.contents[0]
    again = read(TP, done.contents[0], robot)
    stored = says(TP, done.contents[0], robot)[again.moves.target]
    places = robot.flange_chain.pose(robot.joints_from_readings(stored))[:, :3, 3]
    ends = robot.flange_chain.pose(robot.joints_from_readings(LONG))
    along = np.linspace(0.0, 1.0, 400)
    line = np.tile(ends[0], (400, 1, 1))
    line[:, :3, 3] += along[:, None] * (ends[1] - ends[0])[:3, 3]
    line[:, :3, :3] = Slerp([0.0, 1.0], Rotation.from_matrix(ends[:, :3, :3]))(along).as_matrix()
    seeds = LONG[0] + along[:, None] * (LONG[1] - LONG[0])
    q = Controller.nominal(robot).inverse.near_or_nan(line, seeds) + Bend()
    wanted = robot.flange_chain.pose(robot.joints_from_readings(q))[:, :3, 3]
    assert off(wanted, places[[0, -1]]) > 2.0 * FINE_STEPS.deviation_m
    assert off(wanted, places) < 1.1 * FINE_STEPS.deviation_m


@pytest.mark.parametrize(
    "motion",
    ["L P[4] 2.5sec FINE", "L P[4] 250mm/sec FINE TB .5sec,CALL GRIP", "L P[4] R[2]sec CNT50",
     "L P[4] 250mm/sec CNT R[1]", "L P[4]\n    :  250mm/sec FINE", "A P[4] 250mm/sec FINE"],
)  # fmt: skip
def test_a_motion_that_cannot_be_repeated_gets_no_waypoints(robot, motion):
    done = rewritten(TP, long_line(robot, motion), robot, by=Bend(), spacing=FINE_STEPS)
    assert done.inserted == 0
    assert done.contents[0].count(b"P[") == long_line(robot, motion).count("P[")


def test_a_position_of_two_groups_gets_no_waypoints(robot):
    def grouped(text):
        return text.replace("\n};", "\n   GP2:\n\tUF : 0, UT : 0,\n\tJ1=     1.000 deg\n};")

    done = rewritten(
        TP, long_line(robot, "L P[4] 250mm/sec FINE", grouped), robot, by=Bend(), spacing=FINE_STEPS
    )
    assert done.inserted == 0
    assert [notice.kind for notice in done.notices] == ["deviation"]


@settings(max_examples=25)
@given(st.data())
def test_waypoints_of_mutilated_programs_end_in_a_listing_or_an_error(robot, data):
    text = long_line(robot, "L P[4:END] 250mm/sec FINE")
    start = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(start, min(len(text), start + 20)))
    put = data.draw(st.text(st.sampled_from("/POSMNJLP[]{}:;,='\n 0.5-*UFTN"), max_size=12))
    mutilated = text[:start] + put + text[end:]
    assert survives(TP, mutilated, robot, by=Bend(), spacing=FINE_STEPS)
