"""`truearm robots`: the library of arms, and a robot's table as people read it."""

from typing import Annotated

import numpy as np
import typer

from truearm.cli.console import print_json, print_table, say, say_wrapped, warn
from truearm.errors import Notice
from truearm.library import library_names
from truearm.robot import Robot
from truearm.robot_checks import robot_notices
from truearm.units import MM_PER_METRE

LETTER = {"revolute": "R", "prismatic": "P"}


def command(
    robot: Annotated[
        str | None,
        typer.Argument(metavar="[NAME|FILE]", help="A library name, a TOML file or a URDF (FILE.urdf#TIP)."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on stdout and nothing else.")] = False,
) -> None:
    """List the library of arms, or show and check one robot."""
    if robot is None:
        _list(as_json=as_json)
    else:
        _show(Robot.load(robot), as_json=as_json)


def _list(*, as_json: bool) -> None:
    robots = [(name, Robot.load(name)) for name in library_names()]
    if as_json:
        print_json(
            [
                {"name": name, "robot": robot.name, "joints": list(robot.joints), "source": robot.source}
                for name, robot in robots
            ]
        )
        return
    rows = [(name, robot.name, "".join(LETTER[joint] for joint in robot.joints)) for name, robot in robots]
    print_table(["name", "arm", "joints"], rows, left=(0, 1, 2))
    say("Show one with: truearm robots NAME")


def _show(robot: Robot, *, as_json: bool) -> None:
    notices = robot_notices(robot)
    if as_json:
        content = {**robot.to_dict(), "units": {"length": "m", "angle": "rad"}}
        print_json({**content, "notices": [str(notice) for notice in notices]})
        return
    say(f"{robot.name}, {robot.joint_count} joints, {robot.convention} Denavit-Hartenberg")
    say_wrapped(f"Source: {robot.source or 'not stated'}")
    _print_links(robot)
    for label, transform in (("base", robot.base), ("flange", robot.flange), ("tool", robot.tool)):
        if not np.allclose(transform, np.eye(4), rtol=0.0, atol=1e-15):
            _print_transform(label, transform)
    _print_coupling(robot)
    if robot.payload is not None:
        say(f"Payload: {robot.payload.mass_kg:g} kg")
    _print_verdict(robot, notices)


def _print_links(robot: Robot) -> None:
    with_beta = bool(robot.table[:, 4].any())
    columns = ["joint", "kind", "theta deg", "d mm", "a mm", "alpha deg"]
    columns += (["beta deg"] if with_beta else []) + ["limits deg (mm)"]
    rows = []
    for index, (theta, d, a, alpha, beta) in enumerate(robot.table):
        angles, lengths = np.degrees([theta, alpha, beta]), MM_PER_METRE * np.array([d, a])
        cells = [_number(angles[0]), _number(lengths[0]), _number(lengths[1]), _number(angles[1])]
        cells += [_number(angles[2])] if with_beta else []
        rows.append([str(index + 1), robot.joints[index], *cells, _limits(robot, index)])
    print_table(columns, rows, left=(0, 1))


def _limits(robot: Robot, index: int) -> str:
    low, high = robot.limits[index]
    if np.isinf(low) and np.isinf(high):
        return "none"
    if robot.joints[index] == "prismatic":
        return f"({_number(low * MM_PER_METRE)} to {_number(high * MM_PER_METRE)})"
    return f"{_number(np.degrees(low))} to {_number(np.degrees(high))}"


def _print_transform(label: str, transform: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> None:
    say(f"{label}: rotation, and translation in mm")
    for row in transform[:3]:
        say("  " + " ".join(f"{value:9.6f}" for value in row[:3]) + f"  {row[3] * MM_PER_METRE:11.4f}")


def _print_coupling(robot: Robot) -> None:
    if np.array_equal(robot.coupling, np.eye(robot.joint_count)):
        return
    say("coupling: joint values from readings, directions included")
    for row in robot.coupling:
        say("  " + " ".join(f"{value:5g}" for value in row))


def _print_verdict(robot: Robot, notices: list[Notice]) -> None:
    x, y, z = MM_PER_METRE * robot.position(np.clip(0.0, robot.limits[:, 0], robot.limits[:, 1]))
    say(f"Tool at zero readings, or at the nearest limit: {_number(x)}, {_number(y)}, {_number(z)} mm")
    warn(notices)
    say("The file is in order." if not notices else "The file can be used; see the warnings.")


def _number(value: float) -> str:
    """Up to six decimals, no trailing zeros, no minus zero."""
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
