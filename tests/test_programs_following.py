"""Lines on which the wrist turns far beside its singularity: the arm arrives in the posture it came in."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.program_tools import Bend, rewritten
from tests.programs_rig import ABB, KUKA, models, read
from tests.programs_rig import rewritten as rewrite_with
from tests.test_programs_rapid import numbers
from truearm.inverse import Inverse
from truearm.programs.densify import ELSEWHERE, Spacing
from truearm.programs.following import UNFOLLOWED, Arrived, Follower, Line, Way
from truearm.programs.solving import CONTRADICTS
from truearm.programs.urscript import UrScript
from truearm.robot import Robot
from truearm.turns import NearestTurns

UR10 = Robot.load("ur10")
STARTS = {
    ABB: np.deg2rad([10, 20, 10, -60, 25, 30]),
    KUKA: np.deg2rad([10, -70, 100, -60, 25, 30]),
    UR10: np.array([-0.765230, -0.897508, 1.844444, 0.402831, 0.496989, 0.520211]),
}
GO = "v100,fine,tG;"


def pose(robot, q):
    return robot.pose(np.atleast_2d(q))[0]


def on_line(start, end, share):
    found = np.array(start)
    found[:3, 3] += share * (end[:3, 3] - start[:3, 3])
    turn = Rotation.from_matrix(start[:3, :3].T @ end[:3, :3]).as_rotvec()
    found[:3, :3] = start[:3, :3] @ Rotation.from_rotvec(share * turn).as_matrix()
    return found


def arrives(robot, q, end, steps=100):
    """The readings at the end of a line of the tool, from small step to small step."""
    start, back, inverse = pose(robot, q), np.linalg.inv(robot.tool), Inverse(robot)
    for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
        found = inverse.near(on_line(start, end, share) @ back, q)
        assert np.abs(found - q).max() < 0.3
        q = found
    return q


@cache
def swung(robot):
    """Readings before and behind a line on which axis 4 turns by over 90 deg and axis 5 keeps its sign."""
    q = STARTS[robot]
    turned = np.array(q)
    turned[3] += np.deg2rad(113.0)
    turned[5] -= np.deg2rad(110.0)
    end = pose(robot, turned)
    end[:3, 3] += 0.02
    last = arrives(robot, q, end)
    assert np.abs(last - q).max() > np.pi / 2.0
    assert last[4] * q[4] > 0.0
    found = Inverse(robot).solutions(end @ np.linalg.inv(robot.tool), turns=True)
    assert np.abs(found - q).max(axis=1).min() < 0.8 * np.abs(last - q).max(), "another posture is nearer"
    return q, last


def flipped(q):
    """The same pose of a spherical wrist in its other posture."""
    turned = q + np.array([0.0, 0.0, 0.0, -np.pi, 0.0, np.pi])
    turned[4] = -q[4]
    return turned


def rapid(before, after, conf, stated=None):
    there = numbers(np.rad2deg(after), placed=np.eye(4))
    if stated is not None:
        told = numbers(np.rad2deg(stated), placed=np.eye(4))
        there = "],[".join([*there.split("],[")[:2], *told.split("],[")[2:]])
    joints = ",".join(f"{angle:.6f}" for angle in np.rad2deg(before))
    return (
        "MODULE M\nPERS tooldata tG:=[TRUE,[[0,0,120],[1,0,0,0]],[1,[0,0,50],[1,0,0,0],0,0,0]];\n"
        f"PROC main()\n{conf};\nMoveAbsJ [[{joints}],[9E9,9E9,9E9,9E9,9E9,9E9]],{GO}\n"
        f"MoveL {there},{GO}\nENDPROC\nENDMODULE\n"
    )


def krl(before, after, stated=None):
    place = pose(KUKA, after)
    turns = Rotation.from_matrix(place[:3, :3]).as_euler("ZYX", degrees=True)
    values = zip("XYZABC", (*(1e3 * place[:3, 3]), *turns), strict=True)
    told = ""
    if stated is not None:
        turn = int(((stated < 0.0) * 2 ** np.arange(6)).sum())
        told = f",S {2 + 4 * int(stated[4] < 0.0)},T {turn}"
    joints = ",".join(f"A{axis} {angle:.6f}" for axis, angle in enumerate(np.rad2deg(before), 1))
    words = ",".join(f"{name} {value:.6f}" for name, value in values)
    return f"DEF P()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nPTP {{{joints}}}\nLIN {{{words}{told}}}\nEND\n"


def vector_of(q):
    place = pose(UR10, q)
    return [*place[:3, 3], *Rotation.from_matrix(place[:3, :3]).as_rotvec()]


def urscript(before, last):
    return f"def p():\n  set_tcp(p[0,0,0,0,0,0])\n  movej({list(map(float, before))})\n  movel({last})\nend\n"


def p_of(q):
    return "p[" + ", ".join(f"{value:.9f}" for value in vector_of(q)) + "]"


def csv(before, after):
    rows = [",".join(f"{value:.9f}" for value in [*before, *vector_of(before)]), ",,,,,"]
    rows[1] += "," + ",".join(f"{value:.9f}" for value in vector_of(after))
    return "\n".join(["q1,q2,q3,q4,q5,q6,x,y,z,rx,ry,rz", *rows, ""])


def taken(name, text, robot):
    """The readings that the last target is taken for, or why it is left."""
    done = rewrite_with(read(name, text, robot), models(robot))
    return done.nominal[-1] if done.changed[-1] else done.listed[-1].reason


@pytest.mark.parametrize(
    ("robot", "name", "text"),
    [
        (ABB, "a.mod", lambda before, after: rapid(before, after, "ConfL\\Off")),
        (ABB, "a.mod", lambda before, after: rapid(before, after, "ConfL\\On", after)),
        (KUKA, "a.src", krl),
        (KUKA, "a.src", lambda before, after: krl(before, after, after)),
        (UR10, "a.script", lambda before, after: urscript(before, p_of(after))),
        (UR10, "a.csv", csv),
    ],
)
def test_a_line_arrives_in_the_posture_that_it_came_in_though_another_is_nearer(robot, name, text):
    before, after = swung(robot)
    found = taken(name, text(before, after), robot)
    assert not isinstance(found, str), found
    assert np.abs(found - after).max() < 1e-4


@pytest.mark.parametrize(
    ("robot", "name", "text"),
    [
        (ABB, "a.mod", lambda before, after: rapid(before, after, "ConfL\\On", flipped(after))),
        (KUKA, "a.src", lambda before, after: krl(before, after, flipped(after))),
    ],
)
def test_data_of_the_nearer_posture_that_no_line_arrives_in_is_not_followed(robot, name, text):
    before, after = swung(robot)
    assert taken(name, text(before, after), robot) == CONTRADICTS


@pytest.mark.parametrize("aside_rad", [0.0, 1e-3])
def test_a_line_that_leads_past_the_singularity_is_listed(aside_rad):
    before = np.deg2rad([10.0, 20, 10, 0, 30, 0])
    before[3] = aside_rad
    over = np.deg2rad([10.0, 20, 10, 0, -30, 0])
    found = taken("a.mod", rapid(before, over, "ConfL\\Off"), ABB)
    assert isinstance(found, str)
    assert found == UNFOLLOWED
    stated = taken("a.mod", rapid(before, over, "ConfL\\On", over), ABB)
    assert np.abs(stated - over).max() < 1e-4


def test_an_arc_keeps_the_posture_where_its_wrist_turns_by_less_than_half_a_turn():
    before, after = swung(ABB)
    inverse, place = Inverse(ABB), pose(ABB, after)
    branches = inverse.solutions(place)
    turned = NearestTurns(ABB)(branches, before)
    found = Follower(ABB, inverse).arrived(before, Way(np.eye(4), place, arc=True), branches, turned)
    assert isinstance(found, Arrived)
    assert np.abs(found.q - after).max() < 1e-6


def test_the_wrist_is_followed_from_step_to_step_where_it_turns_fast():
    before, after = swung(ABB)
    line = Line(pose(ABB, before), pose(ABB, after))
    follower, shares = Follower(ABB, Inverse(ABB)), np.linspace(0.0, 1.0, 4)
    found = follower.along(line, np.eye(4), shares, before, flipped(after))
    assert found is not None
    assert np.abs(found[0] - before).max() < 1e-6
    assert np.abs(found[-1] - after).max() < 1e-6
    assert np.abs(ABB.pose(found) - line.poses(shares)).max() < 1e-6


def test_a_line_to_joints_of_another_posture_has_no_waypoints_and_says_why():
    before, after = swung(UR10)
    other = next(
        one
        for one in Inverse(UR10).solutions(pose(UR10, after))
        if one[4] * after[4] < 0.0 and np.abs(one[:2] - after[:2]).max() < 0.5
    )
    text = urscript(before, list(map(float, other)))
    done = rewritten(UrScript(), text, UR10, by=Bend(), spacing=Spacing.of(1e-3, 1.0))
    assert [one.listed.reason for one in done.deviating] == [ELSEWHERE]
