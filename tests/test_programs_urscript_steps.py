"""Waypoints in URScript: where a straight move deviates, with blend radii that overlap nowhere."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.program_tools import read, reasons
from tests.test_programs_rewriting import Wavy
from truearm.controller import Controller
from truearm.programs.densify import Spacing
from truearm.programs.report import report_of
from truearm.programs.rewriting import Choices, Models, rewrite
from truearm.programs.urscript import UrScript
from truearm.programs.urscript_steps import blends
from truearm.robot import Robot

UR = UrScript()
ROBOT = Robot.load("ur10e")
TCP = "set_tcp(p[0, 0, 0.1, 0, 0, 0])\n"
HOME = [-0.7, -1.6, 2.0, -2.0, -1.57, 0.0]
AWAY = [0.7, -1.6, 2.0, -2.0, -1.57, 0.0]


def pose_text(q):
    """p[...] of the TCP at readings q, 9 digits."""
    pose = ROBOT.flange_chain.pose(ROBOT.joints_from_readings(np.atleast_2d(q)))[0]
    vector = Rotation.from_matrix(pose[:3, :3]).as_rotvec()
    point = pose[:3, 3] + 0.1 * pose[:3, 2]
    return "p[" + ", ".join(f"{value:.9f}" for value in (*point, *vector)) + "]"


def densified(lines, deviation_mm=0.1, least_mm=10.0):
    """The result of rewriting motions that follow a set_tcp, with a correction that varies along the way."""
    controller = Controller.nominal(ROBOT)
    models = Models(ROBOT, controller.inverse, controller, Wavy(np.zeros(6)))
    program = read(UR, TCP + lines + "\n", ROBOT)
    return rewrite(program, models, Choices(spacing=Spacing.of(deviation_mm, least_mm)))


def in_degrees(target):
    """A target whose angles are degrees within d2r( )."""
    opening, _, numbers = target.partition("[")
    values = [float(value) for value in numbers.rstrip("]").split(",")]
    lengths = 3 if opening else 0
    angles = [f"d2r({np.rad2deg(value):.7f})" for value in values[lengths:]]
    return f"{opening}[{', '.join([*map(str, values[:lengths]), *angles])}]"


def motions_of(content):
    """Point and blend radius of each motion of a text, (n, 3) and (n,), in m; joints as poses of the TCP."""
    program = read(UR, content, ROBOT)
    targets, moves = program.targets, program.moves
    points = []
    for target in moves.target:
        places = slice(6 * target, 6 * target + 6)
        values = targets.values[places] * targets.factors[places]
        if targets.layout[target] == 0:
            pose = ROBOT.flange_chain.pose(ROBOT.joints_from_readings(values[None]))[0]
            values = pose[:3, 3] + 0.1 * pose[:3, 2]
        points.append(values[:3])
    radii = np.array([blends(program, move) for move in range(1, len(moves))], dtype=float)
    return np.array(points), np.concatenate([radii[:1, 0], radii[:, 1]])


ROOMY = [
    ("movej({home})", "movel({away})"),
    ("movej({home}, r=0.05)", "movel({away}, a=1.2, v=0.25, r=0.15)"),
    ("movej({home}, 1.4, 1.05, 0, 0.05)", "movel({away}, 1.2, 0.25, 0, 0.02) # there"),
    ("movel({home}, r=0.2)", "movel({away}, r=0)"),
]


@pytest.mark.parametrize(("first", "second"), ROOMY)
def test_no_blend_reaches_another_and_the_arm_stops_at_no_waypoint(first, second):
    lines = f"{first.format(home=HOME)}\n{second.format(away=pose_text(AWAY))}\nmovej({HOME})"
    done = densified(lines)
    before, before_radii = motions_of((TCP + lines + "\n").encode())
    points, radii = motions_of(done.contents[0])
    assert done.inserted == len(points) - len(before) >= 3
    assert radii[[0, -2]].tolist() == before_radii[:2].tolist(), "the motions keep their own"
    assert (radii[1:-2] >= 1e-3).all()
    ways = np.linalg.norm(np.diff(points[:-1], axis=0), axis=1)
    assert (radii[:-2] + radii[1:-1] < ways).all()
    assert reasons(done) == []


def test_points_lie_on_the_line_as_densely_as_without_blending_where_it_is_not_blended():
    plain = densified(f"movej({HOME})\nmovel({pose_text(AWAY)})")
    blended = densified(f"movej({HOME}, r=0.1)\nmovel({pose_text(AWAY)}, r=0.1)")
    found = [motions_of(done.contents[0])[0] for done in (plain, blended)]
    inside = [
        int((np.linalg.norm(points[1:-1] - points[end], axis=1) > 0.12).sum())
        for points in found
        for end in (0, -1)
    ]
    assert inside[2] >= inside[0] - 1
    assert inside[3] >= inside[1] - 1


@pytest.mark.parametrize(
    ("first", "second", "reason"),
    [
        ("r=0.6", "r=0.6", "what blends it with its neighbours leaves no room for waypoints"),
        ("r=far", "r=0", "how far it is blended with its neighbours is not written as a number"),
        ("r=0", "r=far", "how far it is blended with its neighbours is not written as a number"),
        ("r=0", "t=3", "its statement is not a plain one, or belongs to others"),
    ],
)
def test_a_move_that_can_get_no_waypoints_is_named(first, second, reason):
    done = densified(f"far = 0.01\nmovej({HOME}, {first})\nmovel({pose_text(AWAY)}, {second})")
    assert done.inserted == 0
    (one,) = report_of(done)["deviating"]
    assert (one["line"], one["reason"]) == (4, reason)


def test_a_straight_move_to_joints_gets_joints():
    done = densified(f"movej({HOME})\nmovel({AWAY})")
    lines = [line for line in done.contents[0].decode().splitlines() if line.startswith("movel(")]
    assert len(lines) == done.inserted + 1 > 2
    assert all(line.startswith("movel([") for line in lines)


@pytest.mark.parametrize("written", ["{}", "there = {}"])
@pytest.mark.parametrize("away", [str(AWAY), pose_text(AWAY)])
def test_waypoints_before_a_target_in_degrees_are_in_degrees(written, away):
    def lines(away):
        name = written.format("").partition(" ")[0]
        declared = f"{written.format(away)}\n" if name else ""
        return f"{declared}movej({HOME})\nmovel({name or away})"

    radians, degrees = densified(lines(away)), densified(lines(in_degrees(away)))
    assert degrees.inserted == radians.inserted >= 3
    points = [motions_of(done.contents[0])[0] for done in (radians, degrees)]
    assert np.abs(points[0] - points[1]).max() < 3e-6
    text = degrees.contents[0].decode()
    assert text.count("d2r(") == in_degrees(away).count("d2r(") * (1 + degrees.inserted)


def test_a_move_that_is_straight_enough_is_not_asked_for_its_blending():
    done = densified(f"far = 0.01\nmovej({HOME})\nmovel({pose_text(AWAY)}, r=far)", deviation_mm=1000.0)
    assert (done.inserted, report_of(done)["deviating"]) == (0, [])
