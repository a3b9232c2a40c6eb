"""Via points of arcs, where controllers turn the tool from start to end, and arcs that deviate."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from tests.program_tools import Bend, Shift, read, reasons, rewritten
from tests.programs_rig import ABB, KUKA
from tests.test_programs_krl import pose_text as krl_pose
from tests.test_programs_melfa import MELFA, flags
from tests.test_programs_tp import TP, pose, program
from tests.test_programs_urscript import UR, pose_text
from truearm.controller import Controller
from truearm.inverse import Inverse
from truearm.programs.arcs import Arc
from truearm.programs.densify import Spacing
from truearm.programs.following import UNFOLLOWED
from truearm.programs.krl import KRL
from truearm.programs.program import numbers_of
from truearm.programs.rapid import RAPID
from truearm.programs.rewriting import Choices, Models, rewrite
from truearm.programs.tables import Motion
from truearm.programs.vias import ENDS_UNKNOWN, NO_ARC, PASSED
from truearm.robot import Robot

BY = 3e-3 * np.array([1.0, -1.0, 0.5, 1.0, -1.0, 2.0])
"""What the true arm's joints are off by: it is where the nominal arm is with so much less."""
TOOL = np.eye(4)
TOOL[:3, 3] = [0.08, 0.05, 0.15]
RADIUS, AT_VIA, AT_END = 0.06, np.deg2rad(40.0), np.deg2rad(110.0)
TILT = Rotation.from_euler("x", 25, degrees=True).as_matrix()
UNIVERSAL, FANUC = Robot.load("ur10e"), Robot.load("fanuc-lr-mate-200id")
MITSUBISHI = Robot.load("mitsubishi-rv-4fl")


def flange(robot, q):
    return robot.flange_chain.pose(robot.joints_from_readings(np.atleast_2d(q)))


def near(robot, tools, q):
    """Readings (n, N) near `q` with the tool at poses (n, 4, 4)."""
    back = np.linalg.inv(TOOL)
    return np.stack([Inverse(robot).near((one @ back)[None], q[None])[0] for one in tools])


def on_circle(first, angle_rad, turn_deg=0.0):
    """A pose of the tool at an angle along an arc about the base's z axis, turned about it."""
    found = np.array(first)
    found[:2, 3] += RADIUS * (np.array([np.cos(angle_rad), np.sin(angle_rad)]) - [1.0, 0.0])
    found[:3, :3] = Rotation.from_euler("z", turn_deg, degrees=True).as_matrix() @ first[:3, :3]
    return found


def arc_of(robot, start, tilt=TILT, turn_deg=30.0):
    """Poses of the tool at start, via point and end, how the arc passes it, and readings of all three."""
    first = (flange(robot, start) @ TOOL)[0]
    passed = on_circle(first, AT_VIA, turn_deg * AT_VIA / AT_END)
    via = np.array(passed)
    via[:3, :3] = via[:3, :3] @ tilt
    tools = np.stack([first, via, on_circle(first, AT_END, turn_deg)])
    return SimpleNamespace(tools=tools, passed=passed, q=near(robot, tools, start), robot=robot)


def of_ur(arc, motion="movec({1}, {2}, a=1.2, v=0.25)", via=None):
    lines = [f"p[{pose_text(UNIVERSAL, q, tool=TOOL[:3, 3])}]" for q in arc.q]
    places = [lines[0], via or lines[1], lines[2]]
    tool = ", ".join(f"{value}" for value in TOOL[:3, 3])
    begin = f"movej([{', '.join(f'{value:.9f}' for value in arc.q[0])}])"
    body = [f"set_tcp(p[{tool}, 0, 0, 0])", begin, f"movel({lines[0]})", motion.format(*places)]
    return "def a():\n" + "".join(f"  {line}\n" for line in body) + "end\n"


def of_krl(arc, motion="CIRC {1},{2}"):
    places = [krl_pose(np.rad2deg(q), inner=TOOL, decimals=6).replace(",E1 0.0,E2 0.0", "") for q in arc.q]
    tool = "$TOOL={X 80,Y 50,Z 150,A 0,B 0,C 0}"
    return "\n".join(
        ["DEF a()", tool, "$BASE=$NULLFRAME", f"PTP {places[0]}", motion.format(*places), "END", ""]
    )


def robtarget(q):
    at = (flange(ABB, q) @ TOOL)[0]
    quaternion = Rotation.from_matrix(at[:3, :3]).as_quat(scalar_first=True)
    quarters = np.floor(np.rad2deg(q[[0, 3, 5]]) / 90.0).astype(int)
    parts = [1e3 * at[:3, 3], quaternion, [*quarters, int(q[4] < 0.0)]]
    shown = ["[" + ",".join(f"{number:.9g}" for number in part) + "]" for part in parts]
    return f"[{','.join(shown)},[9E9,9E9,9E9,9E9,9E9,9E9]]"


GO = "v100,fine,tG;"


def of_rapid(arc, body=(f"MoveJ p1,{GO}", f"MoveC p2,p3,{GO}")):
    data = [f"CONST robtarget p{number}:={robtarget(q)};" for number, q in enumerate(arc.q, 1)]
    tool = "PERS tooldata tG:=[TRUE,[[80,50,150],[1,0,0,0]],[1,[0,0,50],[1,0,0,0],0,0,0]];"
    return "\n".join(["MODULE a", tool, *data, "PROC main()", *body, "ENDPROC", "ENDMODULE", ""])


def of_melfa(arc, motions=("Mov P1", "Mvr P1,P2,P3")):
    places: list[str] = []
    for q in arc.q:
        at = (flange(MITSUBISHI, q) @ TOOL)[0]
        c, b, a = Rotation.from_matrix(at[:3, :3]).as_euler("ZYX", degrees=True)
        numbers = ",".join(f"{value:.6f}" for value in (*(1e3 * at[:3, 3]), a, b, c))
        places.append(f"P{len(places) + 1}=({numbers}){flags(MITSUBISHI, q)}")
    return "\n".join(["Tool (80,50,150,0,0,0)", *motions, "End", *places, ""])


DIALECTS = {
    "UR": (UR, UNIVERSAL, of_ur, [0.1, -1.5, 1.6, -1.7, -1.55, 0.2]),
    "KRL": (KRL(), KUKA, of_krl, np.deg2rad([5, -70, 80, 10, 60, 20])),
    "RAPID": (RAPID(), ABB, of_rapid, np.deg2rad([5, 20, 10, 8, 45, 8])),
    "MELFA": (MELFA, MITSUBISHI, of_melfa, np.deg2rad([10, 20, 80, 5, 70, 15])),
}


@pytest.fixture(params=DIALECTS)
def dialect(request):
    language, robot, write, start = DIALECTS[request.param]
    return SimpleNamespace(
        language=language, robot=robot, write=write, start=np.array(start), name=request.param
    )


def said(language, content, robot):
    """Poses of the tool that a program says at start, via point and end of its only arc."""
    found = read(language, content, robot)
    moves = found.moves
    end = int(np.flatnonzero(moves.motion == Motion.CIRCULAR)[0])
    poses = []
    for target in (moves.before[end - 1], moves.target[end - 1], moves.target[end]):
        layout = found.layouts[found.targets.layout[target]]
        numbers = numbers_of(found, np.array([target]), layout)
        poses.append(layout.to_poses(numbers[:, : layout.width - layout.configuration])[0])
    return np.stack(poses)


def true_via(tools, arc):
    """Where the true tool is when a controller that only turns from start to end is at the via point."""
    share = share_at_via(tools[:, :3, 3])
    ends = Rotation.from_matrix(tools[[0, 2], :3, :3])
    commanded = np.array(tools[1])
    commanded[:3, :3] = Slerp([0.0, 1.0], ends)([share]).as_matrix()[0]
    return (flange(arc.robot, near(arc.robot, commanded[None], arc.q[0]) - BY) @ TOOL)[0, :3, 3]


def share_at_via(points):
    """The share of an arc at its second point, by the angles over its chords (inscribed angles)."""

    def seen_from(corner, one, other):
        a, b = points[one] - points[corner], points[other] - points[corner]
        return np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))

    before, behind = seen_from(2, 0, 1), seen_from(0, 1, 2)
    return before / (before + behind)


def test_the_true_tool_is_on_the_arc_at_its_via_point_however_that_is_turned(dialect):
    arc = arc_of(dialect.robot, dialect.start)
    text = dialect.write(arc)
    done = rewritten(dialect.language, text, dialect.robot, by=BY)
    assert reasons(done) == []
    before, after = (said(dialect.language, one, dialect.robot) for one in (text, done.contents[0]))
    wanted = arc.passed[:3, 3]
    assert np.linalg.norm(true_via(before, arc) - wanted) > 5e-4
    assert np.linalg.norm(true_via(after, arc) - wanted) < 3e-6
    assert (after[1, :3, :3] == before[1, :3, :3]).all(), "how it is turned is not heeded, and stays"


def test_numbers_of_a_via_point_that_do_not_count_stay_as_they_are():
    arc = arc_of(UNIVERSAL, np.array(DIALECTS["UR"][3]))
    x, y, z = arc.passed[:3, 3]
    text = of_ur(arc, via=f"p[{x:.9f}, {y:.9f}, {z:.9f}, 0, 0, 0.0]")
    done = rewritten(UR, text, UNIVERSAL, by=BY)
    assert reasons(done) == [], (
        "zeros as in the maker's manual are no singularity, and none behind them either"
    )
    assert ", 0, 0, 0.0], p[" in done.contents[0].decode()
    assert np.linalg.norm(true_via(said(UR, done.contents[0], UNIVERSAL), arc) - arc.passed[:3, 3]) < 3e-6


def test_a_via_point_in_joints_says_the_position_of_its_correction():
    arc = arc_of(UNIVERSAL, np.array(DIALECTS["UR"][3]))
    joints = f"[{', '.join(f'{value:.12f}' for value in arc.q[1])}]"
    done = rewritten(UR, of_ur(arc, via=joints), UNIVERSAL, by=BY)
    assert reasons(done) == []
    found = read(UR, done.contents[0], UNIVERSAL)
    (via,) = found.moves.target[found.moves.motion == Motion.VIA]
    written = found.targets.values[found.targets.first[via] :][:6]
    tool = (flange(UNIVERSAL, written) @ TOOL)[0]
    np.testing.assert_allclose(tool[:3, :3], arc.tools[1, :3, :3], atol=1e-9)
    posed = said(UR, rewritten(UR, of_ur(arc), UNIVERSAL, by=BY).contents[0], UNIVERSAL)
    np.testing.assert_allclose(tool[:3, 3], posed[1, :3, 3], atol=1e-8)


def test_a_program_of_joints_alone_keeps_its_numbers_and_how_its_via_point_is_turned():
    arc = arc_of(UNIVERSAL, np.array(DIALECTS["UR"][3]))
    start, via, end = (f"[{', '.join(f'{value:.12f}' for value in q)}]" for q in arc.q)
    text = (
        f"def a():\n  set_tcp(p[0.08, 0.05, 0.15, 0, 0, 0])\n  movej({start})\n  movec({via}, {end})\nend\n"
    )
    found = read(UR, text, UNIVERSAL)
    stated = np.array(found.targets.values)
    kept, done = with_choices(found, UNIVERSAL, 0.0), with_choices(found, UNIVERSAL, BY)
    np.testing.assert_array_equal(found.targets.values, stated)
    unmoved = read(UR, kept.contents[0], UNIVERSAL).targets.values
    np.testing.assert_allclose(unmoved, stated, atol=1e-9, err_msg="nothing to correct, nothing changes")
    tools = flange(UNIVERSAL, read(UR, done.contents[0], UNIVERSAL).targets.values.reshape(3, 6)) @ TOOL
    np.testing.assert_allclose(tools[1, :3, :3], arc.tools[1, :3, :3], atol=1e-9, err_msg="turned as before")
    assert np.linalg.norm(true_via(tools, arc) - arc.passed[:3, 3]) < 3e-6


@pytest.mark.parametrize(("tilt", "changed"), [(np.eye(3), True), (TILT, False)])
@pytest.mark.parametrize("name", ["p2", "Offs(p2,0,0,0.5)"])
def test_a_via_point_that_a_motion_ends_at_too_suits_both_only_as_the_arc_passes_it(tilt, changed, name):
    arc = arc_of(ABB, DIALECTS["RAPID"][3], tilt)
    program = of_rapid(arc, (f"MoveJ p1,{GO}", f"MoveC p2,p3,{GO}", f"MoveJ {name},{GO}"))
    found = read(RAPID(), program, ABB)
    done = rewritten(RAPID(), program, ABB, by=BY) if name == "p2" else with_offsets(found)
    assert [one for _, one, _ in reasons(done)] == ([] if changed else ["p2"])
    if not changed:
        (reason,) = [why for *_, why in reasons(done)]
        assert reason == (
            f"{PASSED}, 25.0 deg from what it states itself, and another motion ends there: no change suits "
            "both, a target of its own does"
        )


def test_an_arc_that_is_used_again_with_an_offset_is_changed_for_both():
    arc = arc_of(ABB, DIALECTS["RAPID"][3])
    lower = [f"MoveJ p1,{GO}", f"MoveC p2,p3,{GO}"]
    upper = [f"MoveJ Offs(p1,0,0,20),{GO}", f"MoveC Offs(p2,0,0,20),Offs(p3,0,0,20),{GO}"]
    done = with_offsets(read(RAPID(), of_rapid(arc, [*lower, *upper]), ABB))
    assert reasons(done) == []
    assert (done.offset_mm < 0.1).all()
    assert done.offset_mrad[1] == 0.0, "how a via point is turned does not count"
    raised = arc_of(ABB, DIALECTS["RAPID"][3])
    raised.tools[:, 2, 3] += 0.02
    written = said(RAPID(), done.contents[0], ABB)
    written[:, 2, 3] += 0.02
    passed = SimpleNamespace(robot=ABB, q=near(ABB, raised.tools, arc.q[0]))
    off = true_via(written, passed) - arc.passed[:3, 3] - [0.0, 0.0, 0.02]
    assert 1e3 * np.linalg.norm(off) == pytest.approx(done.offset_mm[1], abs=0.005)


@pytest.mark.parametrize(("tilt", "offset_mm"), [(np.eye(3), 20.0), (TILT, 20.0), (TILT, 1.0)])
def test_how_far_a_via_point_is_off_with_an_offset_is_told_as_it_is_written(tilt, offset_mm):
    """An offset along the tool goes where the via point states that the tool points, not where it does."""
    arc = arc_of(ABB, DIALECTS["RAPID"][3], tilt)
    names = [f"RelTool(p{number},0,0,{-offset_mm})" for number in (1, 2, 3)]
    upper = [f"MoveJ {names[0]},{GO}", f"MoveC {names[1]},{names[2]},{GO}"]
    body = [f"MoveJ p1,{GO}", f"MoveC p2,p3,{GO}", *upper]
    done = with_offsets(read(RAPID(), of_rapid(arc, body), ABB))
    assert reasons(done) == []
    along = np.eye(4)
    along[2, 3] = -1e-3 * offset_mm
    raised, written = arc.tools @ along, said(RAPID(), done.contents[0], ABB) @ along
    reached = true_via(written, SimpleNamespace(robot=ABB, q=near(ABB, raised, arc.q[0])))
    off_mm = 1e3 * np.linalg.norm(reached - raised[1, :3, 3])
    assert off_mm == pytest.approx(done.offset_mm[1], abs=0.005)
    elsewhere = "[tool.tG]\nxyz = [90.0, 45.0, 158.0]\n"
    moved = with_offsets(read(RAPID(), of_rapid(arc, body), ABB, elsewhere))
    assert moved.offset_mm[1] == pytest.approx(done.offset_mm[1]), "a tool turned alike is off alike"


def with_offsets(found, offsets_mm=0.5):
    return with_choices(found, ABB, BY, offsets_mm=offsets_mm)


def with_choices(found, robot, by, **choices):
    controller = Controller.nominal(robot)
    return rewrite(found, Models(robot, controller.inverse, controller, Shift(by)), Choices(**choices))


def test_two_arcs_that_pass_a_via_point_turned_otherwise_leave_it():
    arc = arc_of(ABB, DIALECTS["RAPID"][3])
    turned = arc_of(ABB, DIALECTS["RAPID"][3], turn_deg=-30.0)
    arc.q = np.concatenate([arc.q, turned.q[2:]])
    body = [f"MoveJ p1,{GO}", f"MoveC p2,p3,{GO}", f"MoveJ p1,{GO}", f"MoveC p2,p4,{GO}"]
    done = rewritten(RAPID(), of_rapid(arc, body), ABB, by=BY)
    ((_, name, reason),) = reasons(done)
    assert name == "p2"
    assert "21.8 deg open: on some controllers, or in the arcs that it is used in" in reason


@pytest.mark.parametrize(("tilt", "changed"), [(np.eye(3), True), (TILT, False)])
@pytest.mark.parametrize(
    ("name", "motion"),
    [("KRL", "SCIRC {1},{2}"), ("RAPID", ["CirPathMode\\CirPointOri;"]), ("TP", "")],
)
def test_where_a_controller_may_heed_how_a_via_point_is_turned_it_has_to_agree(name, motion, tilt, changed):
    if name == "TP":
        start = np.deg2rad([5, 20, -10, 5, -70, 15])
        arc = arc_of(FANUC, start, tilt)
        positions = [pose(FANUC, number, q) for number, q in enumerate(near_flange(FANUC, arc), 1)]
        text = program(["J P[1] 10% FINE", "C P[2] P[3] 100mm/sec FINE"], positions)
        done = rewritten(TP, text, FANUC, by=BY)
    else:
        language, robot, write, first = DIALECTS[name]
        arc = arc_of(robot, np.array(first), tilt)
        lines = [*motion, f"MoveJ p1,{GO}", f"MoveC p2,p3,{GO}"] if name == "RAPID" else motion
        done = rewritten(language, write(arc, lines), robot, by=BY)
    found = [reason for *_, reason in reasons(done)]
    assert len(found) == (0 if changed else 1)
    if not changed:
        assert found[0].startswith(PASSED)
        assert (
            "deg from what it states itself, and whether the controller heeds that is not known" in found[0]
        )


def near_flange(robot, arc):
    """Readings with the flange on an arc like that of the tool: positions are of no tool."""
    flanges = np.array(arc.tools)
    flanges[:, :3, 3] += (flange(robot, arc.q[0])[0] - arc.tools[0])[:3, 3]
    return np.stack([Inverse(robot).near(one[None], arc.q[0][None])[0] for one in flanges])


def half_circle(robot, start):
    """Half a circle on which the tool turns with the path, by half a turn."""
    first = (flange(robot, start) @ TOOL)[0]
    degrees = [0.0, 72.0, 180.0]
    tools = np.stack([on_circle(first, np.deg2rad(angle), angle) for angle in degrees])
    q, found = np.array(start), []
    for angle in np.arange(0.0, 181.0, 4.0):
        (q,) = near(robot, on_circle(first, np.deg2rad(angle), angle)[None], q)
        found += [q] if angle in degrees else []
    return SimpleNamespace(tools=tools, passed=tools[1], q=np.stack(found), robot=robot)


def test_which_way_round_a_tool_turns_by_half_a_turn_is_told_by_a_path_that_it_turns_with():
    turning = half_circle(UNIVERSAL, np.array(DIALECTS["UR"][3]))
    via, end = reasons(rewritten(UR, of_ur(turning), UNIVERSAL, by=BY))
    assert "which leaves 144.0 deg open" in via[2]
    assert end[2] == UNFOLLOWED
    turning = half_circle(ABB, DIALECTS["RAPID"][3])
    done = rewritten(RAPID(), of_rapid(turning), ABB, by=BY)
    assert reasons(done) == []
    np.testing.assert_allclose((flange(ABB, done.nominal) @ TOOL)[1], turning.passed, atol=1e-5)


def test_how_far_an_arc_with_an_angle_turns_is_left_open():
    start = np.array(DIALECTS["KRL"][3])
    turning = rewritten(KRL(), of_krl(arc_of(KUKA, start), "CIRC {1},{2},CA 90"), KUKA, by=BY)
    ((_, _, reason),) = reasons(turning)
    assert "which leaves 30.0 deg open" in reason
    held = rewritten(KRL(), of_krl(arc_of(KUKA, start, turn_deg=0.0), "CIRC {1},{2},CA 90"), KUKA, by=BY)
    assert reasons(held) == []


def wide_arc():
    """An arc on which the tool is turned from start to end about another axis than that of the path."""
    arc = arc_of(KUKA, DIALECTS["KRL"][3], tilt=np.eye(3), turn_deg=0.0)
    arc.tools[2, :3, :3] = Rotation.from_euler("x", 40, degrees=True).as_matrix() @ arc.tools[0, :3, :3]
    arc.q = near(KUKA, arc.tools, arc.q[0])
    return arc


@pytest.mark.parametrize(
    ("said", "behind", "listed"),
    [
        ("$CIRC_TYPE=#PATH", "", True),
        ("$circ_type = KIND", "", True),
        ("$CIRC_TYPE=#BASE", "", False),
        (";$CIRC_TYPE=#PATH", "", False),
        ("$CIRC_TYPE=SCIRC_TYP(LC)", "", True),
        ("", "DEF b()\nLDAT_ACT={VEL 2.0,ORI_TYP #VAR,CIRC_TYP #PATH}\nEND\n", True),
        ("", "DEF b()\nLDAT_ACT={VEL 2.0,ORI_TYP #VAR,CIRC_TYP #BASE}\nEND\n", False),
    ],
)
def test_where_a_krl_program_may_turn_tools_as_seen_from_the_path_both_ways_have_to_agree(
    said, behind, listed
):
    arc = wide_arc()
    way = Arc.through(arc.tools[0], [arc.tools[1]], arc.tools[2])
    assert way is not None
    share = way.share_of(arc.tools[1, :3, 3])
    apart = Rotation.from_matrix(way.turned(share).T @ way.turned_on_path(share)).magnitude()
    found = reasons(rewritten(KRL(), f"{of_krl(arc)}{behind}".replace("PTP", f"{said}\nPTP", 1), KUKA, by=BY))
    assert [f"which leaves {np.rad2deg(apart):.1f} deg open" in reason for *_, reason in found] == (
        [True] if listed else []
    )


@pytest.mark.parametrize("motion", ["CIRC {1},{2}", "SCIRC {1},{2}", "CIRC {1},{2},CA 90"])
def test_a_via_point_that_the_wrist_passes_axis_by_axis_is_listed_and_its_end_is_not(motion):
    text = of_krl(arc_of(KUKA, DIALECTS["KRL"][3], tilt=np.eye(3), turn_deg=0.0), motion)
    assert reasons(rewritten(KRL(), text, KUKA, by=BY)) == []
    for said in ("$ORI_TYPE=#JOINT", "IF $IN[1] THEN\n$ORI_TYPE=#JOINT\nENDIF"):
        ((_, _, reason),) = reasons(rewritten(KRL(), text.replace("PTP", f"{said}\nPTP", 1), KUKA, by=BY))
        assert reason.startswith("the arc turns the axes of the wrist evenly, and not the tool")


def test_a_via_point_behind_what_is_not_known_is_left():
    arc = arc_of(ABB, DIALECTS["RAPID"][3])
    done = rewritten(
        RAPID(), of_rapid(arc, [f"MoveJ p1,{GO}", "Elsewhere;", f"MoveC p2,p3,{GO}"]), ABB, by=BY
    )
    assert {name: reason for _, name, reason in reasons(done)} == {"p2": ENDS_UNKNOWN}


def test_points_in_line_make_no_arc():
    arc = arc_of(ABB, DIALECTS["RAPID"][3])
    arc.tools[1, :3, 3] = arc.tools[[0, 2], :3, 3].mean(axis=0)
    arc.q = near(ABB, arc.tools, arc.q[0])
    done = rewritten(RAPID(), of_rapid(arc), ABB, by=BY)
    assert {name: reason for _, name, reason in reasons(done)} == {"p2": NO_ARC}


def test_an_arc_from_a_target_that_cannot_be_changed_still_passes_its_via_point_as_it_says():
    arc = arc_of(ABB, DIALECTS["RAPID"][3])
    body = [f"MoveJ Offs(p1,0,0,40),{GO}", f"MoveL p1,{GO}", f"MoveC p2,p3,{GO}"]
    done = rewritten(RAPID(), of_rapid(arc, body), ABB, by=BY)
    assert [name for _, name, _ in reasons(done)] == ["p1"]
    direct = rewritten(RAPID(), of_rapid(arc), ABB, by=BY)
    np.testing.assert_allclose(done.corrected[1:], direct.corrected[1:], atol=1e-9)


def test_a_whole_circle_keeps_the_tool_turned_as_at_its_start():
    arc = arc_of(MITSUBISHI, DIALECTS["MELFA"][3])
    done = rewritten(MELFA, of_melfa(arc, ("Mov P1", "Mvc P1,P2,P3")), MITSUBISHI, by=BY)
    assert reasons(done) == []
    turned = (flange(MITSUBISHI, done.nominal) @ TOOL)[:, :3, :3]
    np.testing.assert_allclose(turned[1:], turned[[0, 0]], atol=1e-5)


@pytest.mark.parametrize("motion", ["Mvr P1,P2,P3", "Mvc P1,P2,P3"])
@pytest.mark.parametrize("given", ["1", "1,0", "0,1", "0, 2", "M1,0"])
def test_via_points_that_the_tool_does_not_pass_evenly_turned_the_short_way_are_left(motion, given):
    arc = arc_of(MITSUBISHI, DIALECTS["MELFA"][3], np.eye(3))
    text = of_melfa(arc, ("Mov P1", f"{motion} Type {given} Wth M_Out(1)=0"))
    done = rewritten(MELFA, text, MITSUBISHI, by=BY)
    reason = (
        f"it is a via point in line 3 with Type {given}, where the tool turns the long way round or as axes "
        "4 to 6 take it, which is not followed: to have it corrected, use Type 0,0"
    )
    vias = ["P2"] if motion.startswith("Mvr") else ["P2", "P3"]
    assert [(name, why) for _, name, why in reasons(done)] == [(name, reason) for name in vias]


@pytest.mark.parametrize("given", ["0", "0,0", "0 , 0 Wth M_Out(1)=0"])
def test_via_points_that_the_tool_passes_evenly_turned_the_short_way_are_changed(given):
    arc = arc_of(MITSUBISHI, DIALECTS["MELFA"][3])
    done = rewritten(MELFA, of_melfa(arc, ("Mov P1", f"Mvr P1,P2,P3 Type {given}")), MITSUBISHI, by=BY)
    assert reasons(done) == []
    written = said(MELFA, done.contents[0], MITSUBISHI)
    assert np.linalg.norm(true_via(written, arc) - arc.passed[:3, 3]) < 3e-6


def test_arcs_on_which_the_tool_turns_otherwise_may_deviate():
    arc = arc_of(MITSUBISHI, DIALECTS["MELFA"][3], np.eye(3))
    text = of_melfa(arc, ("Mov P1", "Mvr P1,P2,P3 Type 0,1"))
    (one,) = rewritten(MELFA, text, MITSUBISHI, by=Bend(), spacing=Spacing.of(0.001, 5.0)).deviating
    assert one.deviation_mm is None


@pytest.mark.parametrize("angle_deg", [60.0, 180.0, 230.0])
def test_a_tool_that_is_held_still_does_not_spin_on_a_path(angle_deg):
    start = np.eye(4)
    via, end = (on_circle(start, np.deg2rad(angle_deg) * share) for share in (0.4, 1.0))
    arc = Arc.through(start, [via], end)
    assert arc is not None
    assert arc.share_of(via[:3, 3]) == pytest.approx(0.4)
    np.testing.assert_allclose(arc.turned_on_path(0.4), np.eye(3), atol=1e-12)


def test_a_tool_that_tilts_on_a_path_does_so_evenly_as_seen_from_the_path():
    start = np.eye(4)
    via, end = (on_circle(start, np.deg2rad(60.0) * share) for share in (0.4, 1.0))
    end[:3, :3] = Rotation.from_euler("ZX", [60.0, 10.0], degrees=True).as_matrix()
    wanted = Rotation.from_euler("ZX", [0.4 * 60.0, 0.4 * 10.0], degrees=True).as_matrix()
    arc = Arc.through(start, [via], end)
    assert arc is not None
    np.testing.assert_allclose(arc.turned_on_path(0.4), wanted, atol=1e-12)
