"""`truearm robots`: the library of arms, and a robot's table as people read it."""

from typing import Annotated

import typer

from truearm.cli.arguments import ROBOT_HELP, AsJson, robots_like
from truearm.cli.console import print_json, print_table, suggest
from truearm.description.library import library_names
from truearm.errors import typed


def command(
    robot: Annotated[
        str | None,
        typer.Argument(metavar="[NAME|FILE]", help=ROBOT_HELP, autocompletion=robots_like),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """List the library of arms, or show and check one robot.

    Examples:
      truearm robots
      truearm robots ur10
      truearm robots arm.toml
      truearm robots arm.urdf#tool0
    """
    if robot is None:
        _list(as_json=as_json)
        return
    from truearm.cli.robot_tables import show_robot
    from truearm.robot import Robot

    show_robot(Robot.load(robot), as_json=as_json)
    if not as_json:
        suggest(
            f"truearm plan {typed(robot)} -n 60 -o poses.csv",
            f"truearm calibrate {typed(robot)} measurements.csv -o result",
        )


def _list(*, as_json: bool) -> None:
    from truearm.cli.robot_tables import LETTER
    from truearm.robot import Robot

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
    suggest("truearm robots NAME", when="Show one:")
