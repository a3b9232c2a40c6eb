"""Where the base stands in the sensor's frame, from the first contacts, and whether that can be."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.cell.cell_file import Cell
from truearm.cell.line_sensor import LineSensor
from truearm.errors import WorkError
from truearm.registration import register, spread_m
from truearm.rotations import rigid_inverse, rotation_vector_from_matrix
from truearm.types import Floats
from truearm.units import MM_PER_INCH, MM_PER_METRE, STATED_LENGTH_UNITS

LEAST_POSES: Final = 4
LEAST_SPREAD_M: Final = 0.03
# The guess of the cell file is a standard deviation, so to speak.
UNLIKELY: Final = 4.0
UNITS_MM: Final = {"mm": 1.0, "cm": 10.0, "in": MM_PER_INCH, "ft": 12.0 * MM_PER_INCH, "m": MM_PER_METRE}
ALIKE: Final = 1.2
"""Within this factor an uncalibrated arm knows how far apart contacts are."""
NEW_SESSION: Final = "then delete the session file and start again"
WAY_OUT: Final = (
    f"Check the robot, the tool and [target], [world] and the panel's axes in the cell file; {NEW_SESSION}"
)


@dataclass(frozen=True, eq=False)
class Registration:
    """The found frame.

    Attributes:
        world_from_base: Where the base stands (4, 4), m.
        residual_m: Root of the mean squared distance that is left.
        poses: How many contacts it comes from.
    """

    world_from_base: Floats
    residual_m: float
    poses: int


def register_cell(cell: Cell, joints: Floats, points: Floats) -> Registration:
    """Register from joints (n, N) and the points (n, 3) that were measured there.

    Raises:
        WorkError: If there are too few or they are too much alike, if they are in another unit, if the
            residual is larger than an uncalibrated arm explains, or if the frame is far from the guess of the
            cell file.
    """
    _check_number(points)
    in_base = cell.targets_in_base(joints)
    _check_unit(cell, points, in_base)
    _check_spread(points)
    nothing = np.empty((0, 3, 3))
    frame = register(in_base, points, nothing, nothing, 0.0)
    apart = in_base @ frame[:3, :3].T + frame[:3, 3] - points
    residual_m = float(np.sqrt(np.square(apart).sum(axis=1).mean()))
    found = Registration(frame, residual_m, len(points))
    _check_residual(cell, found, apart)
    _check_against_guess(cell, found)
    return found


def _check_number(points: Floats) -> None:
    if len(points) < LEAST_POSES:
        raise WorkError(
            f"{len(points)} contacts for the frame succeeded",
            where="registration",
            rule=f"{LEAST_POSES} are needed at least",
            way_out="truearm session show tells why the others failed. Put that right, then the same command "
            "measures them again. With other poses name a new session with -o",
        )


def _check_unit(cell: Cell, points: Floats, in_base: Floats) -> None:
    """Raise if points are as much farther apart than the nominal arm has them as two units differ."""
    settings = cell.sensor_settings
    stated = settings.length_unit if isinstance(settings, LineSensor.Settings) else "m"
    apart, nominal = spread_m(points), spread_m(in_base)
    if min(apart, nominal) <= 0.0:
        return
    off = {unit: abs(np.log(apart / nominal * size / UNITS_MM[stated])) for unit, size in UNITS_MM.items()}
    told = min(off, key=off.__getitem__)
    if told == stated or off[told] > np.log(ALIKE):
        return
    rule, way_out = "Points of a sensor are in m", "Mend its driver, or its file"
    if isinstance(settings, LineSensor.Settings):
        mend = (
            f'State length_unit = "{told}" in [sensor]' if told in STATED_LENGTH_UNITS else "Have it say mm"
        )
        rule = "length_unit of [sensor] is the unit in which the instrument tells its points"
        way_out = f"{mend}; {NEW_SESSION}"
    raise WorkError(
        f"the contacts lie {apart / nominal:.3g} times as far apart as the nominal arm has them: they look "
        f"like {told}, and are read as {stated}",
        where="registration",
        rule=rule,
        way_out=way_out,
    )


def _check_spread(points: Floats) -> None:
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) / np.sqrt(len(points))
    if spread[1] < LEAST_SPREAD_M:
        raise WorkError(
            f"the contacts lie within {MM_PER_METRE * spread[1]:.0f} mm of a line",
            where="registration",
            rule="A frame can be told from points in a plane or in space only",
            way_out="Give poses that are farther apart",
        )


def _check_residual(cell: Cell, found: Registration, apart: Floats) -> None:
    limit = cell.file.process.registration_mm
    residual_mm = MM_PER_METRE * found.residual_m
    if residual_mm > limit:
        worst = MM_PER_METRE * float(np.linalg.norm(apart, axis=1).max())
        raise WorkError(
            f"the frame leaves {residual_mm:.2f} mm RMS, {worst:.2f} mm at the worst contact: implausible",
            where="registration",
            rule=f"An uncalibrated arm explains {limit:g} mm at most (registration_mm)",
            way_out=WAY_OUT,
        )


def _check_against_guess(cell: Cell, found: Registration) -> None:
    world = cell.file.world
    if world is None:
        return
    off = rigid_inverse(world.transform()) @ found.world_from_base
    shift_mm = MM_PER_METRE * float(np.linalg.norm(off[:3, 3]))
    turn_deg = float(np.degrees(np.linalg.norm(rotation_vector_from_matrix(off[:3, :3]))))
    if shift_mm > UNLIKELY * world.uncertain_mm or turn_deg > UNLIKELY * world.uncertain_deg:
        raise WorkError(
            f"the frame is {shift_mm:.1f} mm and {turn_deg:.2f} deg from the cell file's: implausible",
            where="registration",
            rule=f"[world] is said to be known to {world.uncertain_mm:g} mm, {world.uncertain_deg:g} deg",
            way_out=WAY_OUT,
        )
