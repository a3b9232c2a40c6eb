"""Whether measurements can be of a given robot: units, limits, poses that tell something."""

from dataclasses import replace
from typing import Final

import numpy as np

from truearm.doubts.mixed_units import check_mixed_units
from truearm.doubts.nominal_misfit import FEWEST_ROWS, NominalArm, Seen, relative_misfit
from truearm.doubts.stated_in_degrees import check_angles, check_degrees, otherwise_notices, outside_limits
from truearm.doubts.turning_sense import FIT, MISFIT
from truearm.doubts.unit_change import check_one_unit
from truearm.errors import InputError, Notice, list_names
from truearm.measurements import Measurements
from truearm.registration import spread_m
from truearm.robot import Robot
from truearm.rows.evenly import some_rows
from truearm.rows.used_distances import holds_distances
from truearm.rows.visits import pose_numbers
from truearm.tables.same_tables import copied_rows
from truearm.types import Mask
from truearm.units import FULL_TURN, MM_PER_INCH, MM_PER_METRE, RADIANS_PER_DEGREE

ALIKE_RAD_OR_M: Final = 1e-4
MOST: Final = 0.5
"""Part of the poses that have to be repeated."""
SPREAD_FACTOR: Final = 30.0
"""Between the factor that a long tool may stretch the poses by and the 1000 of a wrong unit."""
TOOL_ALLOWANCE_M: Final = 0.1
FAR_FACTOR: Final = 8.0
"""Spreads that differ by more are worth a fit that asks whether points are in inches."""
INCHES: Final = (
    (
        MM_PER_INCH,
        "The positions look like inches that are stated as millimetres",
        "Convert them to millimetres: multiply by 25.4",
    ),
    (
        MM_PER_INCH / MM_PER_METRE,
        "The positions look like inches that are stated as metres",
        "Convert them to millimetres: multiply by 25.4, and give --length-unit mm",
    ),
    (
        1.0 / MM_PER_INCH,
        "The positions look like millimetres that were multiplied by 25.4 as if they were inches",
        "Convert them to millimetres: divide by 25.4",
    ),
)
"""Factors that bring points to metres where inches were mistaken, what they were taken for, what to do."""
SLIDES_IN_M: Final = "Prismatic joints are in metres unless their columns say so"
FIT_BETTER: Final = 5.0
"""Times nearer to the points that an arm is whose slides were read in the right unit."""
APART_M: Final = 0.01
"""No arm comes back to the same readings so far from where it was."""
NO_LENGTH_M: Final = 1e9
"""In no unit that is mistaken for metres points lie so far apart."""
NO_TURN_RAD: Final = 1e6
"""In no unit that is mistaken for radians a joint turns so far."""
NO_REACH_M: Final = 2e3
"""Points that lie so far apart in metres are no gross errors of an instrument: it wrote something else."""
SHORTEST_M: Final = 0.005
"""No bar or wire that tells distances is as short as this; a metre read as a millimetre is shorter."""


def check_against(measurements: Measurements, robot: Robot) -> list[Notice]:
    """Check that measurements can be of `robot`.

    Returns:
        What the user should know: joints outside their limits, rows that are there twice, equal readings at
        points that lie apart.

    Raises:
        InputError: If there are no rows, the number or kind of joints differs, degrees were read as radians
            or the other way round, millimetres as metres or the other way round, inches as either, all poses
            are alike, or only one row of a pair is there.
    """
    outside = check_readings(measurements, robot)
    _check_whole_pairs(measurements)
    _check_alike(measurements)
    check_points(measurements, robot)
    return [
        *measurements.notices,
        *outside,
        *_repetitions(measurements),
        *_copies(measurements),
        *_apart_at_equal(measurements),
    ]


def check_readings(measurements: Measurements, robot: Robot) -> list[Notice]:
    """Check that readings can be of `robot`.

    Returns:
        What the user should know: joints outside their limits.

    Raises:
        InputError: If there are no rows, the number or kind of joints differs, a reading is none that a joint
            can have, degrees were read as radians, or millimetres of a prismatic joint as metres.
    """
    if len(measurements) == 0:
        raise InputError("the measurements have no rows", rule="What is measured is at least one pose")
    measurements.require_joint_count(robot.joint_count)
    _check_far_readings(measurements, robot)
    _check_kinds(measurements, robot)
    check_degrees(measurements, robot)
    _check_strokes(measurements, robot)
    return [*otherwise_notices(measurements, robot), *_limit_notices(measurements, robot)]


def check_points(measurements: Measurements, robot: Robot) -> None:
    """Raise InputError where points lie too far apart, too close together, in inches, or in two units.

    Neither may angles be in another unit than points tell.
    """
    _check_far(measurements, NO_LENGTH_M)
    check_one_unit(measurements, robot)
    _check_slides(measurements, robot)
    check_mixed_units(measurements, robot)
    for group in measurements.groups if measurements.target_count else []:
        _check_spread(measurements.select(measurements.group == group), robot, group)
    check_angles(measurements, robot)
    _check_far(measurements, NO_REACH_M)
    _check_distances(measurements, robot)


def _check_whole_pairs(measurements: Measurements) -> None:
    """Raise InputError where distances are used and the other row of a pair was left behind."""
    if measurements.pair is None or not holds_distances(measurements):
        return
    _, index, count = np.unique(measurements.pair, return_inverse=True, return_counts=True)
    alone = (measurements.pair != "") & (count[index.reshape(-1)] < 2)
    if alone.any():
        raise InputError(
            f"the other row of the pair is not there in {measurements.row_names(alone)}",
            where=", ".join(measurements.files),
            rule="The distance of a pair takes both of its rows",
            way_out="Select both rows of a pair, or neither",
        )


def _check_far(measurements: Measurements, most: float) -> None:
    """Raise InputError where a point lies more than `most` (m) from the middle of those of its set-up."""
    far = np.zeros(len(measurements), dtype=bool)
    for group in measurements.groups if measurements.target_count else []:
        rows = measurements.group == group
        points = measurements.targets[rows]
        seen = points[np.isfinite(points).all(axis=2)]
        if len(seen) > 0:
            far[rows] = (np.abs(points - np.median(seen, axis=0)) > most).any(axis=(1, 2))
    if not far.any():
        return
    away = np.nanmax(np.abs(measurements.targets[far]))
    raise InputError(
        f"coordinates up to {away:.4g} m in {measurements.row_names(far)}, over {most:g} m from the others",
        where=", ".join(measurements.files),
        rule="No arm reaches so far: the instrument may have written such a number where it saw nothing",
        way_out="Leave the cells empty where nothing was measured, or leave these rows out",
    )


def _check_far_readings(measurements: Measurements, robot: Robot) -> None:
    """Raise InputError where a joint is said to have turned or slid as far as none does, in whatever unit."""
    most = np.array([NO_LENGTH_M if kind == "prismatic" else NO_TURN_RAD for kind in robot.joints])
    far = np.abs(measurements.readings) > most
    if not far.any():
        return
    joint = int(np.argmax(far.any(axis=0)))
    unit = "m" if robot.joints[joint] == "prismatic" else "rad"
    value = np.abs(measurements.readings[:, joint]).max()
    raise InputError(
        f"joint {joint + 1} reads up to {value:.4g} {unit} in {measurements.row_names(far[:, joint])}",
        where=", ".join(measurements.files),
        rule=f"No joint goes beyond {most[joint]:g} {unit}: such a number may have been written where the "
        "robot knew none",
        way_out="Leave these rows out",
    )


def _check_kinds(measurements: Measurements, robot: Robot) -> None:
    for number, (unit, kind) in enumerate(zip(measurements.joint_units, robot.joints, strict=True), start=1):
        if unit and (unit in ("m", "mm")) != (kind == "prismatic"):
            raise InputError(
                f"joint {number} is given in {unit}",
                where=", ".join(measurements.files),
                rule=f"Joint {number} of {robot.name} is {kind}",
                way_out="Name the column with the unit it has, or the robot that was measured",
            )


def _check_strokes(measurements: Measurements, robot: Robot) -> None:
    unstated: Mask = ~robot.revolute & np.isin(np.array(measurements.joint_units), ("", "m"))
    readings = measurements.readings
    outside: Mask = np.asarray((outside_limits(readings, robot.limits) & unstated).any(axis=1))
    as_millimetres = np.where(unstated, readings / MM_PER_METRE, readings)
    if outside.mean() > 0.5 and not (outside_limits(as_millimetres, robot.limits) & unstated).any():
        columns = ", ".join(f"q{joint + 1}_mm" for joint in np.flatnonzero(unstated))
        raise InputError(
            f"joint readings up to {np.abs(readings[:, unstated]).max():.4g} m in "
            f"{measurements.row_names(outside)}, beyond what {robot.name} can reach",
            where=", ".join(measurements.files),
            rule=f"{SLIDES_IN_M} (q3_mm)",
            way_out=f"If these are millimetres, give --length-unit mm, or name the columns: {columns}; if "
            "truearm import took them for degrees, bring them in with their unit: --map q3=COLUMN:mm",
        )


def _check_slides(measurements: Measurements, robot: Robot) -> None:
    """Raise InputError where readings of slides, a thousandth of their range, fit the points if they are m.

    Slides that hardly moved are as short: the nominal arm tells which of both they are.
    """
    slides = ~robot.revolute
    readings, (low, high) = measurements.readings, robot.limits.T
    span, times = np.ptp(readings, axis=0), np.where(slides, MM_PER_METRE, 1.0)
    short = slides & np.isfinite(high - low) & (span > 0.0) & (span * SPREAD_FACTOR < high - low)
    if not short.any() or outside_limits(readings * times, robot.limits)[:, short].any():
        return
    found = np.flatnonzero(short)
    converted = replace(measurements, readings=readings * np.where(short, MM_PER_METRE, 1.0))
    if not _fits_much_better(converted, measurements, robot):
        return
    joints = ", ".join(f"joint {joint + 1}" for joint in found)
    moved, could = (MM_PER_METRE * float(each[found[0]]) for each in (span, high - low))
    raise InputError(
        f"the readings of {joints} span {moved:.3g} mm of a range of {could:.4g} mm; "
        f"times {MM_PER_METRE:g} they fit the measured points",
        where=", ".join(measurements.files),
        rule=f"{SLIDES_IN_M} (q3_mm)",
        way_out="If these are metres, name the columns "
        + ", ".join(f"q{joint + 1}_m" for joint in found)
        + ", or give --length-unit m where their names say nothing",
    )


def _fits_much_better(converted: Measurements, given: Measurements, robot: Robot) -> bool:
    """Whether the nominal arm fits points of the first set-up far better with other readings."""
    arm, seen, read = NominalArm.of(robot), Seen.first(given), Seen.first(converted)
    if seen is None or read is None:
        return False
    now, then = arm.misfit_m(seen), arm.misfit_m(read)
    return then * FIT_BETTER < now


def _check_alike(measurements: Measurements) -> None:
    if len(measurements) < 2:
        return
    where, way_out = ", ".join(measurements.files), "Measure poses all over the workspace"
    if (np.ptp(measurements.readings, axis=0) < ALIKE_RAD_OR_M).all():
        raise InputError(
            f"all {len(measurements)} poses are alike", where=where, rule="Joints must vary", way_out=way_out
        )
    points = measurements.targets.reshape(len(measurements), -1)
    measured = points[:, np.isfinite(points).sum(axis=0) > 1]
    if measured.size and (np.nanmax(measured, axis=0) == np.nanmin(measured, axis=0)).all():
        raise InputError(
            f"all {len(measurements)} measured positions are equal though the joints vary",
            where=where,
            rule="Points that move with the arm tell where it is",
            way_out="The device may have repeated one reading: measure again. Where a ball sat in a "
            "socket, touch several and give how far apart they are in columns `pair` and `distance`",
        )


def _check_spread(group: Measurements, robot: Robot, name: str) -> None:
    """Compare how far the measured points lie apart with how far the nominal arm takes its flange.

    Where the points are in world does not matter, and medians forgive single gross errors.
    """
    points = group.targets[:, group.most_held()]
    seen = np.isfinite(points).all(axis=1)
    if seen.sum() < 2:
        return
    nominal, measured = spread_m(robot.position(group.readings[seen])), spread_m(points[seen])
    where = f"{', '.join(group.files)}, group {name}"
    found = (
        f"half of the measured points lie more than {measured:.4g} m from their middle, "
        f"and {robot.name} takes its tool {nominal:.3g} m there"
    )
    if max(measured, nominal) > FAR_FACTOR * min(measured, nominal):
        _check_inches(group.select(seen), robot, found, where)
    if measured > SPREAD_FACTOR * (nominal + TOOL_ALLOWANCE_M):
        raise InputError(
            found,
            where=where,
            rule="Positions are in metres unless their columns say so (x_mm)",
            way_out=_way_out_of_large(measured, nominal),
        )
    if _could_be_radians(group) and measured > 3.0 * nominal + TOOL_ALLOWANCE_M:
        raise InputError(
            found,
            where=where,
            rule="The joint readings, stated in degrees, look like radians",
            way_out="Name the columns q1, q2, ..., or, if their names say nothing, give --angle-unit rad",
        )
    by_spread = nominal > TOOL_ALLOWANCE_M
    if measured < nominal / SPREAD_FACTOR and (by_spread or _fit_in_metres(group.select(seen), robot)):
        raise InputError(
            found,
            where=where,
            rule="The positions are far too close together for these poses",
            way_out="If they are in metres, name the columns x, y, z, or, if their names say nothing, give "
            "--length-unit m; if they are not, check that the columns belong together",
        )


def _check_inches(rows: Measurements, robot: Robot, found: str, where: str) -> None:
    """Raise InputError where points fit the nominal arm once they are taken for inches, and as stated do not.

    Points that lie close together do not tell a unit: a tool whose point stands still while the arm turns
    about it does so as well, and fits as stated.
    """
    if len(rows) < FEWEST_ROWS:
        return
    rows = rows.select(some_rows(np.arange(len(rows))))
    if _misfit(rows, robot, 1.0) < MISFIT:
        return
    for factor, rule, way_out in INCHES:
        if _misfit(rows, robot, factor) < FIT:
            raise InputError(
                f"{found}; times {factor:.4g} they fit it", where=where, rule=rule, way_out=way_out
            )


def _fit_in_metres(rows: Measurements, robot: Robot) -> bool:
    """Whether points fit the nominal arm once they are a thousand times as large."""
    return len(rows) >= FEWEST_ROWS and _misfit(rows, robot, MM_PER_METRE) < FIT


def _misfit(rows: Measurements, robot: Robot, factor: float) -> float:
    """How far points times `factor` are from those of the nominal arm, over their spread."""
    seen = Seen.of(rows, rows.most_held())
    return relative_misfit(robot, replace(seen, points=factor * seen.points))


def _check_distances(measurements: Measurements, robot: Robot) -> None:
    """Compare the measured distances with how far the nominal arm takes its flange."""
    given = measurements.distance_m
    if given is None or not np.isfinite(given).any():
        return
    measured = float(np.nanmedian(given))
    nominal = spread_m(robot.position(measurements.readings))
    found = (
        f"the median of the measured distances is {measured:.4g} m, and half of the poses take the tool of "
        f"{robot.name} more than {nominal:.3g} m from their middle"
    )
    where = ", ".join(measurements.files)
    if measured > SPREAD_FACTOR * (nominal + TOOL_ALLOWANCE_M):
        raise InputError(
            found,
            where=where,
            rule="Distances are in metres unless their column says so (distance_mm)",
            way_out=_way_out_of_large(measured, nominal, "distance_mm"),
        )
    if nominal > TOOL_ALLOWANCE_M and measured < SHORTEST_M:
        raise InputError(
            found,
            where=where,
            rule="The distances are far too short for these poses",
            way_out="If they are in metres, give --length-unit m, or name the column distance",
        )


def _way_out_of_large(measured: float, nominal: float, columns: str = "x_mm, y_mm, z_mm") -> str:
    if measured / MM_PER_METRE < SPREAD_FACTOR * (nominal + TOOL_ALLOWANCE_M):
        column = "columns" if "," in columns else "column"
        return f"If these are millimetres, give --length-unit mm, or name the {column} {columns}"
    return "Check the columns and their unit"


def _could_be_radians(group: Measurements) -> bool:
    degrees = np.array(group.joint_units) == "deg"
    values = group.readings[:, degrees] / RADIANS_PER_DEGREE
    return bool(degrees.any()) and bool((np.abs(values) <= FULL_TURN).all())


def _limit_notices(measurements: Measurements, robot: Robot) -> list[Notice]:
    notices = []
    outside = outside_limits(measurements.readings, robot.limits)
    for joint in np.flatnonzero(outside.any(axis=0)):
        rows = outside[:, joint]
        values = measurements.readings[rows, joint]
        low, high = robot.limits[joint]
        beyond = np.maximum(low - values, values - high)
        revolute = robot.joints[joint] == "revolute"
        factor, unit = (1.0 / RADIANS_PER_DEGREE, "deg") if revolute else (MM_PER_METRE, "mm")
        message = (
            f"Joint {joint + 1} is outside its limits ({low * factor:g} to {high * factor:g} {unit}) in "
            f"{measurements.row_names(rows)}, up to {values[beyond.argmax()] * factor:.4g} {unit}."
        )
        notices.append(Notice("limits", message, tuple(measurements.rows[rows].tolist())))
    return notices


def _apart_at_equal(measurements: Measurements) -> list[Notice]:
    """A warning where most rows at equal readings hold points that lie apart, as of several targets."""
    if measurements.target_count == 0:
        return []
    points = measurements.targets[:, measurements.most_held()]
    rows = np.flatnonzero(np.isfinite(points).all(axis=1))
    poses = pose_numbers(measurements.readings[rows], measurements.group[rows])
    _, first, number, counts = np.unique(poses, return_index=True, return_inverse=True, return_counts=True)
    away = np.linalg.norm(points[rows] - points[rows[first]][number], axis=1)
    others = np.delete(away, first)
    if len(others) == 0 or (counts > 1).mean() < MOST or np.median(others) < APART_M:
        return []
    second = int(np.setdiff1d(np.arange(len(rows)), first)[0])
    pair = np.zeros(len(measurements), dtype=bool)
    pair[rows[[first[number[second]], second]]] = True
    message = (
        "Rows at equal readings hold points that lie apart, half of them by more than "
        f"{MM_PER_METRE * np.median(others):.3g} mm, such as {measurements.row_names(pair)}: no arm comes "
        "back so badly. If a row holds one of several targets on the tool, say which: truearm import --map "
        "target=COLUMN, where COLUMN counts them from 1. Else readings and points do not belong together."
    )
    return [Notice("apart_at_equal_readings", message)]


def _repetitions(measurements: Measurements) -> list[Notice]:
    repeated = measurements.identical_rows()
    if not repeated.any():
        return []
    message = f"Identical to an earlier row in everything, counted once: {measurements.row_names(repeated)}."
    return [Notice("identical_rows", message, tuple(measurements.rows[repeated].tolist()))]


def _copies(measurements: Measurements) -> list[Notice]:
    copied = copied_rows(measurements)
    if not copied.any():
        return []
    names = list_names(measurements.select(copied).groups)
    message = (
        f"Set-up {names} holds rows that another one holds as well, with all their digits, and that count "
        f"twice: {measurements.row_names(copied)}. What was measured once tells no more under two names, and "
        "standard errors are too small by it: leave one of the files out, or the rows that both hold."
    )
    return [Notice("copied_rows", message, tuple(measurements.rows[copied].tolist()))]
