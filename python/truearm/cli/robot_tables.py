"""A robot's table and checks as people read them."""

import numpy as np

from truearm.cli.console import print_json, print_table, say, say_wrapped, warn
from truearm.description.robot_checks import robot_notices
from truearm.errors import Notice, count_of, in_json
from truearm.robot import Robot
from truearm.units import MM_PER_METRE

LETTER = {"revolute": "R", "prismatic": "P"}
DECIMALS = 4


def show_robot(robot: Robot, *, as_json: bool) -> None:
    """Print the table of an arm, its fixed transforms and what its checks say."""
    notices = robot_notices(robot)
    if as_json:
        content = {**robot.to_dict(), "units": {"length": "m", "angle": "rad"}}
        print_json({**content, "notices": in_json(notices)})
        return
    say(f"{robot.name}, {count_of(robot.joint_count, 'joint')}, {robot.convention} Denavit-Hartenberg")
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
    columns = ["joint", "theta deg", "d mm", "a mm", "alpha deg"]
    columns += (["beta deg"] if with_beta else []) + ["limits deg (mm)"]
    rows = []
    for index, (theta, d, a, alpha, beta) in enumerate(robot.table):
        angles, lengths = np.degrees([theta, alpha, beta]), MM_PER_METRE * np.array([d, a])
        values = [angles[0], *lengths, *(angles[1:] if with_beta else angles[1:2])]
        cells = [_number(value) for value in values]
        rows.append([f"{index + 1} {LETTER[robot.joints[index]]}", *cells, _limits(robot, index)])
    print_table(columns, rows)


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
    if not robot.is_coupled:
        return
    say("coupling: joint values from readings, directions included")
    for row in robot.coupling:
        say("  " + " ".join(f"{value + 0.0:5g}" for value in row))


def _print_verdict(robot: Robot, notices: list[Notice]) -> None:
    x, y, z = MM_PER_METRE * robot.position(np.clip(0.0, robot.limits[:, 0], robot.limits[:, 1]))
    place = ", ".join(_number(value) for value in (x, y, z))
    say_wrapped(f"Tool at zero readings, or at the nearest limit: {place} mm")
    warn(notices)
    say("The file is in order." if not notices else "The file can be used; see the warnings.")


def _number(value: float) -> str:
    """Up to DECIMALS decimals, no trailing zeros, no minus zero."""
    text = f"{value:.{DECIMALS}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
