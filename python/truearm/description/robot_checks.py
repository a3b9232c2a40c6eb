"""Whether a robot's numbers can be those of an arm: mostly, whether their units can be right."""

from typing import Final

import numpy as np

from truearm.description.robot_data import RobotData
from truearm.errors import InputError, Notice, list_rows
from truearm.units import FULL_TURN, MM_PER_METRE, RADIANS_PER_DEGREE

MAX_LENGTH_M: Final = 50.0
NO_LONGER: Final = f"No link is longer than {MAX_LENGTH_M:g} m"
SHORTEST_ARM_M: Final = 0.02
MAX_ANGLE_RAD: Final = FULL_TURN + 1e-6
MAX_LIMIT_RAD: Final = 40.0 * np.pi
STRANGE_LIMIT_RAD: Final = 4.0 * np.pi
"""Beyond two turns either way a limit that is a whole number of radians was meant in degrees."""
RIGHT_ANGLE_TOLERANCE: Final = 1e-3
WHOLE_TOLERANCE: Final = 1e-9
ANGLES: Final = {0: "theta", 3: "alpha", 4: "beta"}
LENGTHS: Final = {1: "d", 2: "a"}


def check_sizes(robot: RobotData) -> None:
    """Raise InputError if an angle or a length can only come from a wrong unit."""
    for column, name in ANGLES.items():
        _refuse_large(robot, column, name, MAX_ANGLE_RAD, ("rad", "angle_unit"))
    for column, name in LENGTHS.items():
        _refuse_large(robot, column, name, MAX_LENGTH_M, ("m", "length_unit"))
    for index, (kind, limits) in enumerate(zip(robot.joints, robot.limits, strict=True), start=1):
        largest = np.abs(limits[np.isfinite(limits)]).max(initial=0.0)
        bound, unit = (MAX_LIMIT_RAD, "rad") if kind == "revolute" else (MAX_LENGTH_M, "m")
        if largest > bound:
            raise InputError(
                f"a limit of {largest:.6g} {unit}",
                where=f"link {index}, limits",
                way_out="Check length_unit and angle_unit",
            )


def robot_notices(robot: RobotData) -> list[Notice]:
    """What is allowed and still strange: no limits at all, radians as degrees, metres as millimetres."""
    notices = []
    if np.isinf(robot.limits).all():
        text = "No joint has limits, so readings in a wrong unit may go unnoticed."
        notices.append(Notice("no_limits", text))
    written = robot.table[:, [0, 3]] / RADIANS_PER_DEGREE
    quarters = np.round(written / (np.pi / 2))
    strange = (quarters != 0.0) & (np.abs(written - quarters * np.pi / 2) < RIGHT_ANGLE_TOLERANCE)
    reach = np.abs(robot.table[:, list(LENGTHS)]).sum()
    if 0.0 < reach < SHORTEST_ARM_M and "prismatic" not in robot.joints:
        text = f"All links together are {MM_PER_METRE * reach:.3g} mm long: check length_unit."
        notices.append(Notice("tiny", text))
    if strange.any():
        links = (np.flatnonzero(strange.any(axis=1)) + 1).tolist()
        value = written[strange][0]
        text = f"{value:.6g} deg in {list_rows(links, 'link')} looks like radians: check angle_unit."
        notices.append(Notice("radians_as_degrees", text, tuple(links)))
    return notices + _limits_in_degrees(robot)


def _limits_in_degrees(robot: RobotData) -> list[Notice]:
    """A notice of revolute joints whose limits, in rad, are whole numbers beyond two turns."""
    limits = np.where(np.isfinite(robot.limits), np.abs(robot.limits), 0.0)
    whole = np.abs(limits - np.round(limits)) < WHOLE_TOLERANCE
    strange = robot.revolute & ((limits > STRANGE_LIMIT_RAD) & whole).any(axis=1)
    if not strange.any():
        return []
    links = (np.flatnonzero(strange) + 1).tolist()
    most = float(limits[strange].max())
    text = (
        f"A limit of {most:g} rad, {most / FULL_TURN:.1f} turns, in {list_rows(links, 'link')} looks "
        "like degrees: the arm may be asked for readings that it cannot reach."
    )
    return [Notice("limits_as_radians", text, tuple(links))]


def _refuse_large(robot: RobotData, column: int, name: str, bound: float, unit: tuple[str, str]) -> None:
    values = np.abs(robot.table[:, column])
    if values.max() > bound:
        link = int(values.argmax())
        raise InputError(
            f"{robot.table[link, column]:.6g} {unit[0]}",
            where=f"link {link + 1}, {name}",
            rule="No angle is beyond one turn" if unit[0] == "rad" else NO_LONGER,
            way_out=f"Check {unit[1]}",
        )
