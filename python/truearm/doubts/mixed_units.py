"""Single rows in another unit than all others: what was typed by hand, or read with a switched instrument."""

from typing import Final

import numpy as np

from truearm.errors import InputError
from truearm.measurements import Measurements
from truearm.registration import register
from truearm.robot import Robot
from truearm.types import Floats, Mask
from truearm.units import FULL_TURN, MM_PER_METRE, RADIANS_PER_DEGREE

FAR: Final = 100.0
"""Lengths that are so many times larger or smaller than most are no others of the same unit."""
NEARER: Final = 3.0
"""Rows in another unit are so many times nearer to the nominal arm once they are converted."""
ALIKE: Final = 1.5
"""Nor are they then so many times farther from it than the farthest other row."""
FEWEST: Final = 5
"""Other rows at the least."""
ONE_UNIT: Final = "All rows of a column have one unit"


def check_mixed_units(measurements: Measurements, robot: Robot) -> None:
    """Raise InputError where single rows hold mm among m, or radians among degrees, or the other way."""
    for group in measurements.groups if measurements.target_count else []:
        own = measurements.select(measurements.group == group)
        _check_points(own, robot)
        _check_readings(own, robot)
    _check_distances(measurements)


def _check_points(own: Measurements, robot: Robot) -> None:
    points = own.targets[:, own.most_held()]
    far = np.linalg.norm(points, axis=1)
    factors = _factors(far)
    odd = factors != 1.0
    if not odd.any() or np.isfinite(far[~odd]).sum() < FEWEST:
        return
    nominal = robot.position(own.readings)
    found = _fit_when_converted(points, points * factors[:, None], nominal, nominal, odd)
    _refuse(own, far, factors, found, "points", "lie {} m from the origin")


def _check_distances(measurements: Measurements) -> None:
    far = measurements.distance_m
    if far is None:
        return
    factors = _factors(far)
    odd = factors != 1.0
    if not odd.any() or np.isfinite(far[~odd]).sum() < FEWEST:
        return
    converted = far * factors
    low, high = np.nanmin(far[~odd]) / ALIKE, np.nanmax(far[~odd]) * ALIKE
    _refuse(
        measurements, far, factors, odd & (low <= converted) & (converted <= high), "distances", "are {} m"
    )


def _factors(far: Floats) -> Floats:
    """What lengths (n,) may have to be multiplied by to be in the unit of most; one where in none."""
    if not np.isfinite(far).any() or np.nanmedian(far) <= 0.0:
        return np.ones(len(far))
    share = np.nan_to_num(far / np.nanmedian(far), nan=1.0)
    small = (share > 0.0) & (share < 1.0 / FAR)
    return np.where(share > FAR, 1.0 / MM_PER_METRE, np.where(small, MM_PER_METRE, 1.0))


def _refuse(own: Measurements, far: Floats, factors: Floats, found: Mask, what: str, size: str) -> None:
    if not found.any():
        return
    large = found & (factors < 1.0)
    rows = large if large.any() else found
    unit, others, how = ("mm", "m", "divide") if large.any() else ("m", "mm", "multiply")
    found_size = size.format(f"{np.median(far[rows]):.4g}")
    raise _mixed(
        own,
        f"the {what} in {own.row_names(rows)} {found_size}, those of the other "
        f"rows {np.nanmedian(far[factors == 1.0]):.4g} m: they look like {unit} among rows in {others}",
        f"{how} by {MM_PER_METRE:g}",
    )


def _mixed(own: Measurements, what: str, how: str) -> InputError:
    """The error of rows in another unit, and how to convert them."""
    return InputError(
        what, where=", ".join(own.files), rule=ONE_UNIT, way_out=f"Convert these rows ({how}), or remove them"
    )


def _check_readings(own: Measurements, robot: Robot) -> None:
    """Rows in radians, as no other is, where the columns of joints are stated to be in degrees."""
    degrees = np.array(own.joint_units) == "deg"
    written = own.readings / RADIANS_PER_DEGREE
    odd = degrees.any() & (np.abs(written[:, degrees]) <= FULL_TURN).all(axis=1)
    points = own.targets[:, own.most_held()]
    if not odd.any() or np.isfinite(points[~odd, 0]).sum() < FEWEST or odd.mean() >= 0.5:
        return
    as_radians = np.where(degrees, written, own.readings)
    given, converted = robot.position(own.readings), robot.position(as_radians)
    found = _fit_when_converted(points, points, given, converted, odd)
    if not found.any():
        return
    most, others = (np.abs(written[rows][:, degrees]).max() for rows in (found, ~odd))
    raise _mixed(
        own,
        f"the joint readings in {own.row_names(found)} are {most:.3g} deg at the most, those of the other "
        f"rows {others:.4g} deg: they look like radians among rows in degrees",
        f"multiply by {1.0 / RADIANS_PER_DEGREE:.4f}",
    )


def _fit_when_converted(
    given: Floats, converted: Floats, nominal: Floats, nominal_converted: Floats, odd: Mask
) -> Mask:
    """Those of `odd` rows (n,) whose points (n, 3) are where the nominal arm has them only once converted.

    The frame is that of the other rows; what the target is away from the flange stays in what they miss by.
    """
    others = ~odd & np.isfinite(given).all(axis=1)
    none = np.empty((0, 3, 3))
    frame = register(nominal[others], given[others], none, none, 1.0)

    def misses(points: Floats, in_base: Floats) -> Floats:
        missed: Floats = np.linalg.norm(points - in_base @ frame[:3, :3].T - frame[:3, 3], axis=1)
        return missed

    now, then = misses(given, nominal), misses(converted, nominal_converted)
    found: Mask = odd & (then * NEARER < now) & (then <= ALIKE * now[others].max())
    return found
