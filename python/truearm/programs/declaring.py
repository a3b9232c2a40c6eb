"""Which model the controller computes with: declared wherever it may be another than the nominal one."""

import re
from typing import Final

import numpy as np

from truearm.controller import Controller
from truearm.description.one_turn import one_turn
from truearm.errors import InputError, UsageError, WorkError
from truearm.programs.program import Language, Program
from truearm.robot import Robot
from truearm.units import MM_PER_METRE

UNIVERSAL: Final = (
    "Controllers of Universal Robots compute with the factory kinematics of the very arm (calibration.conf)"
)
IN_GENERAL: Final = (
    "Give --controller FILE with the arm's own kinematics, or --controller nominal if it has none"
)
OF_UNIVERSAL: Final = (
    "Give --controller FILE: calibration.conf out of the folder .urcontrol of the arm's controller, or the "
    "kinematics YAML that its ROS driver's ur_calibration reads from it. Only a simulated arm is nominal: "
    "--controller nominal"
)
UR_MODEL: Final = re.compile(r"(?<![a-z0-9])ur-?\d{1,2}e?(?![a-z0-9])")
UNIVERSAL_ROBOTS: Final = "universal robots"
WITH_OPTION: Final = ("abb", "fanuc", "kuka")
"""Makers whose controllers can hold the kinematics of the very arm, an option."""
OTHERS: Final = (
    "adept", "comau", "denso", "epson", "franka", "kawasaki", "mitsubishi", "motoman", "nachi", "omron",
    "staubli", "stäubli", "unimation", "yaskawa",
)  # fmt: skip
MAKERS: Final = re.compile(rf"(?<![a-z])({'|'.join(WITH_OPTION + OTHERS)})(?![a-z])")
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
    is_universal = UNIVERSAL_ROBOTS in (maker_of(robot), language.maker.lower())
    differs = UNIVERSAL if is_universal else language.controller_differs
    if differs:
        raise UsageError(
            f"which model the controller of {robot.name} computes with was not declared",
            rule=differs,
            way_out=OF_UNIVERSAL if is_universal else IN_GENERAL,
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
    return maker_of(robot) in (UNIVERSAL_ROBOTS, *WITH_OPTION)


def maker_of(robot: Robot) -> str:
    """The maker of an arm by its name, in small letters; empty where that names none."""
    name = robot.name.lower()
    if UNIVERSAL_ROBOTS in name or UR_MODEL.search(name) is not None:
        return UNIVERSAL_ROBOTS
    found = MAKERS.search(name)
    return "" if found is None else found[0]


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
