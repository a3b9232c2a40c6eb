"""Which model the controller computes with: declared wherever it may be another than the nominal one."""

import re
from typing import Final

from truearm.controller import Controller
from truearm.errors import UsageError, WorkError
from truearm.programs.program import Language, Program
from truearm.robot import Robot

UNIVERSAL: Final = (
    "Controllers of Universal Robots compute with the factory kinematics of the very arm (calibration.conf)"
)
UR_MODEL: Final = re.compile(r"\bur-?\d{1,2}e?\b")
MAKERS: Final = re.compile(r"\b(abb|fanuc|kuka)\b")
"""Makers whose controllers can hold the kinematics of the very arm, an option."""


def declared_controller(declaration: str | None, language: Language, robot: Robot) -> Controller:
    """The controller that was declared.

    Raises:
        UsageError: If none was, and controllers of such arms may compute with another model.
        InputError: If the file is no model of this arm.
    """
    if declaration is not None:
        return Controller.declared(declaration, robot)
    differs = UNIVERSAL if _is_universal(robot) else language.controller_differs
    if differs:
        raise UsageError(
            f"which model the controller of {robot.name} computes with was not declared",
            rule=differs,
            way_out="Give --controller FILE with the arm's own kinematics, or --controller nominal "
            "if it has none",
        )
    return Controller.nominal(robot)


def may_differ(robot: Robot) -> bool:
    """Whether controllers of arms of this name may compute with another model than the nominal one."""
    return _is_universal(robot) or MAKERS.search(robot.name.lower()) is not None


def refuse_contradiction(program: Program, controller: Controller, *, force: bool) -> None:
    """Refuse a nominal controller where the program says that it was taught with an accurate one.

    Raises:
        WorkError: If so, unless forced.
    """
    if program.accurate and controller.kind == "nominal" and not force:
        raise WorkError(
            f"the controller was declared nominal, but {program.accurate}",
            where=str(program.sources[0].path),
            rule="A controller that corrects by itself would correct twice",
            way_out="Switch that off, or give its model with --controller FILE; --force goes on",
        )


def _is_universal(robot: Robot) -> bool:
    name = robot.name.lower()
    return "universal robots" in name or UR_MODEL.search(name) is not None
