"""Which model the controller computes with: declared wherever it may be another than the nominal one."""

import re
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.controller import Controller
from truearm.errors import InputError, UsageError, WorkError
from truearm.one_turn import one_turn
from truearm.programs.program import Language, Program
from truearm.robot import Robot
from truearm.units import MM_PER_METRE

Floats = NDArray[np.float64]

UNIVERSAL: Final = (
    "Controllers of Universal Robots compute with the factory kinematics of the very arm (calibration.conf)"
)
UR_MODEL: Final = re.compile(r"\bur-?\d{1,2}e?\b")
MAKERS: Final = re.compile(r"\b(abb|fanuc|kuka)\b")
"""Makers whose controllers can hold the kinematics of the very arm, an option."""
LARGEST_MM: Final = 20.0
LARGEST_DEG: Final = 3.0
"""What a controller's own model of an arm may differ by from the nominal one, at the flange.

Factory kinematics of a UR5, a UR5e and a UR10 differ by 2 to 6 mm and 0.3 to 0.6 deg at most, and their maker
says centimetres; the most alike of the arms that truearm knows, UR3 and UR3e, by 29 mm.
"""
COMPARED: Final = 200


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


def refuse_another_arm(controller: Controller, robot: Robot) -> None:
    """Refuse a controller whose model is no model of an arm, by the poses of its flange.

    Parameters of the same arm may differ by metres where axes are nearly parallel; poses do not.

    Args:
        controller: What was declared.
        robot: The nominal arm that was calibrated, with as many joints.

    Raises:
        InputError: If a flange is further than LARGEST_MM or LARGEST_DEG from that of the nominal arm.
    """
    apart_mm, apart_deg = _apart(controller.robot, robot)
    if apart_mm <= LARGEST_MM and apart_deg <= LARGEST_DEG:
        return
    raise InputError(
        f"at the same joints its flange is up to {apart_mm:.0f} mm and {apart_deg:.1f} deg away from that of "
        f"{robot.name}, which was calibrated",
        where=controller.source or controller.robot.name,
        rule="A controller's own model of an arm is millimetres from the nominal one: "
        f"{LARGEST_MM:g} mm and {LARGEST_DEG:g} deg are allowed",
        way_out="Declare the model of this very arm, from its base to its flange, or take the calibration of "
        "the arm that the model is of",
    )


def _apart(one: Robot, other: Robot) -> tuple[float, float]:
    """How far flanges of two arms are from each other at most, mm and deg, at readings within limits."""
    low, high = one_turn(other)
    readings = low + (high - low) * np.random.default_rng(0).random((COMPARED, other.joint_count))
    first, second = (
        robot.flange_chain.pose(np.ascontiguousarray(robot.joints_from_readings(readings)))
        for robot in (one, other)
    )
    apart = np.linalg.norm((first - second)[:, :3, 3], axis=1).max()
    chord = np.linalg.norm((first - second)[:, :3, :3], axis=(1, 2)).max() / np.sqrt(8.0)
    return float(MM_PER_METRE * apart), float(np.degrees(2.0 * np.arcsin(min(chord, 1.0))))


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
