"""The constant part as a URDF."""

import re
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np

from truearm.description.urdf_names import UrdfNames
from truearm.errors import InputError
from truearm.exporting.losses import as_comments, is_directed
from truearm.exporting.new_urdf import default_names, new_urdf
from truearm.exporting.parity import checked, flange_poses, largest_difference
from truearm.exporting.patched_urdf import patched_urdf
from truearm.files import read_text
from truearm.robot import Robot

NOMINAL_WITHIN_M: Final = 1e-4


def comment(text: str) -> str:
    """A text as XML allows it in a comment: no two hyphens side by side, none at the end."""
    return re.sub("-(?=-|$)", "- ", text)


def urdf_text(
    robot: Robot, nominal: Robot, original: str | None, notes: list[str]
) -> tuple[str, float, UrdfNames]:
    """Text of a URDF, how far its forward kinematics are from the robot's, m, and the arm's names in it.

    Args:
        robot: The calibrated arm.
        nominal: The same arm before.
        original: A URDF to correct, FILE.urdf or FILE.urdf#TIP or FILE.urdf#BASE,TIP; None for a new one.
        notes: What the file cannot hold; goes into a comment.

    Raises:
        InputError: If the original cannot be read, or is not the nominal arm.
        WorkError: If the original cannot hold the correction, or the text read again is not the robot.
    """
    if original is None:
        names = _names(robot)
        root = new_urdf(robot, names)
    else:
        names = _checked_names(original, nominal)
        root = patched_urdf(read_text(Path(original.partition("#")[0])), names, robot)
    if notes:
        root.insert(0, ET.Comment(f"\n{comment(as_comments(notes, ''))}"))
    if original is None:
        ET.indent(root)
    text = f'<?xml version="1.0"?>\n{ET.tostring(root, encoding="unicode")}\n'
    again = Robot.from_urdf_text(text, names.base_link, names.tip_link, where="the URDF")
    to_urdf = np.eye(robot.joint_count) if is_directed(robot) else robot.coupling
    difference = checked(
        robot, lambda q: again.flange_chain.pose(np.ascontiguousarray(q @ to_urdf.T)), "the URDF"
    )
    return text, difference, names


def _names(robot: Robot) -> UrdfNames:
    names = robot.urdf_names
    if names is None:
        return default_names(robot)
    if names.links[-1] != names.tip_link:
        return names
    return UrdfNames(
        names.base_link, names.joints, (*names.links[:-1], f"{names.tip_link}_axis"), names.tip_link
    )


def _checked_names(original: str, nominal: Robot) -> UrdfNames:
    arm = Robot.load(original)
    if arm.urdf_names is None:
        raise InputError("this is no URDF", where=original, rule="--urdf names the URDF to correct")
    if arm.joints != nominal.joints:
        raise InputError(
            f"its chain has {arm.joint_count} joints that move, {nominal.name} has {nominal.joint_count}",
            where=original,
            way_out="Name the chain: FILE.urdf#TIP or FILE.urdf#BASE,TIP",
        )
    apart = largest_difference(nominal, lambda q: flange_poses(nominal, q), lambda q: flange_poses(arm, q))
    if apart > NOMINAL_WITHIN_M:
        raise InputError(
            f"its chain from {arm.urdf_names.base_link} to {arm.urdf_names.tip_link} differs from "
            f"{nominal.name} by {apart:.2g} m or rad",
            where=original,
            rule="It must be the nominal arm of the calibration, with the same base and flange",
            way_out="Name the chain: FILE.urdf#TIP or FILE.urdf#BASE,TIP",
        )
    return arm.urdf_names
