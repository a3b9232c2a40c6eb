"""Distances to a fixed point that are all off by one length: the zero of a wire is unknown."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from truearm._core import CoreError, Setup, fit_constant
from truearm.doubts.zeros_together import counted_parts, found_together
from truearm.errors import Notice, count_of, list_names
from truearm.fits.core_set import anchor_names, core_set
from truearm.fits.fitting import Task, fit_options
from truearm.fits.models import ArmModel
from truearm.measurements import Measurements
from truearm.types import Floats, Mask
from truearm.units import MM_PER_METRE

DISTANCE_ZERO: Final = "distance_zero"
EXPLAINED: Final = 0.7
"""A length that leaves a smaller part of what is missed is no chance."""
SURE: Final = 5.0
"""Standard errors that such a length has to be."""
CONFIRMED: Final = 2.0
"""Standard errors that it has to be where constants, which may look like it, are found beside it."""
UNKNOWNS: Final = 7
"""Where the fixed point and the target are, and the length."""
FIRST_M: Final = 1e-3
"""First length that is tried, one way or the other."""
ENOUGH_M: Final = 1e-6
MOST_STEPS: Final = 30
FEWEST: Final = 3 * UNKNOWNS
"""Distances to one fixed point, at the least."""


@dataclass(frozen=True)
class Zero:
    """How much longer distances to a fixed point are than they can be.

    Attributes:
        length_m: By how much.
        std_m: Standard error of that.
        before_m: What is missed as they are, root mean square.
        after_m: What is missed once that is subtracted.
    """

    length_m: float
    std_m: float
    before_m: float
    after_m: float

    @property
    def is_sure(self) -> bool:
        """Whether distances with this length taken out surely fit the arm better."""
        return self.after_m < EXPLAINED * self.before_m and abs(self.length_m) > SURE * self.std_m

    @property
    def is_confirmed(self) -> bool:
        """Whether a length that surely fits is none that constants explain as well."""
        return abs(self.length_m) > CONFIRMED * self.std_m


@dataclass(frozen=True, eq=False)
class Wire:
    """Distances of one set-up to one anchor, with the length they are off by if all others are right.

    Attributes:
        anchor: Its name.
        rows: Which rows hold them (n,).
        zero: That length; None where none makes them fit.
    """

    anchor: str
    rows: Mask
    zero: Zero | None

    @property
    def sure(self) -> Zero | None:
        """That length, where there surely is one."""
        return self.zero if self.zero is not None and self.zero.is_sure else None


def zero_notices(
    task: Task, data: Measurements, models: Sequence[ArmModel], determined: Sequence[str]
) -> list[Notice]:
    """Warnings where distances to an anchor fit the arm once one length is subtracted.

    Whether there is one is asked of each anchor for itself, by that of the models that it fits best. Lengths
    bend models, and what others are told with them: how long they are is found for all in one fit.

    Args:
        task: What was fitted.
        data: Its rows.
        models: What was fitted to them.
        determined: Names of the constants that they determine.
    """
    if data.anchor is None or data.distance_m is None or not task.selection.distances:
        return []
    wires = list[Wire]()
    for number, anchor in enumerate(anchor_names(data)):
        for index, group in enumerate(task.groups):
            rows = (data.anchor == anchor) & (data.group == group) & np.isfinite(data.distance_m)
            if rows.sum() >= FEWEST:
                zeros = (_zero(task, data.select(rows), model, (index, number)) for model in models)
                known = (zero for zero in zeros if zero is not None)
                wires.append(Wire(anchor, rows, min(known, key=lambda each: each.after_m, default=None)))
    return _notices(task, data, wires, determined)


def _notices(
    task: Task, data: Measurements, wires: Sequence[Wire], determined: Sequence[str]
) -> list[Notice]:
    """One of all wires that are off by the same length, or one of each that is off."""
    sure = [number for number, wire in enumerate(wires) if wire.sure is not None]
    if not sure:
        return []
    first = np.array([0.0 if wire.sure is None else wire.sure.length_m for wire in wires])
    found = found_together(task, data, [wire.rows for wire in wires], first, determined)
    off = [wires[number] for number in sure]
    if found is None:
        return [_notice([wire], wire.sure) for wire in off if wire.sure is not None]
    found = found.of(sure)
    before = np.array([wire.sure.before_m for wire in off if wire.sure is not None])
    if found.common is not None:
        counts = [wire.rows.sum() for wire in off]
        missed = (float(np.sqrt(np.average(each**2, weights=counts))) for each in (before, found.left_m))
        return [_notice(off, Zero(*found.common, *missed))]
    parts = zip(found.length_m, np.sqrt(np.diag(found.covariance)), before, found.left_m, strict=True)
    zeros = [Zero(*map(float, each)) for each in parts]
    return [_notice([wire], zero) for wire, zero in zip(off, zeros, strict=True) if zero.is_confirmed]


def _zero(task: Task, rows: Measurements, model: ArmModel, place: tuple[int, int]) -> Zero | None:
    """That of rows of one set-up, by its number, with distances to one anchor, by its number.

    Residuals, weighed as rows are in the fit, add up to nothing where the length is right: with the fixed
    point and the target found anew for each length, their sum is half of what the sum of squares falls by it.
    The secant method finds it.

    Returns:
        None where no length that is shorter than all distances does.
    """
    group, anchor = place
    own, setup = replace(task, groups=rows.groups), model.setup
    options = fit_options(task.threads, parameters=model.constants)
    frame, targets, turned = (part[[group]] for part in (setup.frames, setup.targets, setup.rotations))
    options["start"] = Setup(frame, targets, turned, setup.anchors[[anchor]])

    def left(length_m: float) -> tuple[Floats, Floats]:
        shorter = replace(rows, distance_m=np.asarray(rows.distance_m) - length_m)
        problem = own.problem(core_set(own.arm.robot, shorter, own.selection, own.groups), [])
        fit = fit_constant(problem, options)
        options["start"] = fit.setup
        residuals = np.asarray(fit.residuals).ravel()
        return residuals, counted_parts(fit.noise[0], rows.stated_sigma_m)

    shortest = float(np.asarray(rows.distance_m).min())
    try:
        without = left(0.0)
        now, length, step = without, 0.0, float(np.copysign(FIRST_M, _sum(without)))
        for _ in range(MOST_STEPS):
            step = min(step, 0.5 * (shortest - length))
            length, before, now = length + step, now, left(length + step)
            counted = (_sum(before) - _sum(now)) / step if step else 0.0
            # Far from where it is right the sum hardly changes: on in larger steps.
            step = _sum(now) / counted if counted > 0.0 else 2.0 * step
            if counted > 0.0 and abs(step) < ENOUGH_M:
                break
        else:
            return None
    except CoreError:
        return None
    parts = now[1]
    before_m, after_m = (float(np.sqrt((parts * np.square(each)).mean())) for each, _ in (without, now))
    noise = after_m * np.sqrt(len(rows) / (len(rows) - UNKNOWNS))
    return Zero(length, float(noise / np.sqrt(counted)), before_m, after_m)


def _sum(left: tuple[Floats, Floats]) -> float:
    """The sum of residuals (n,) with weights (n,)."""
    return float(left[0] @ left[1])


def _notice(wires: Sequence[Wire], zero: Zero) -> Notice:
    """The warning of the distances of some wires."""
    count, anchors = int(sum(wire.rows.sum() for wire in wires)), [wire.anchor for wire in wires]
    before, after, std = (MM_PER_METRE * each for each in (zero.before_m, zero.after_m, zero.std_m))
    length = f"{MM_PER_METRE * abs(zero.length_m):.4g} mm"
    too, how = ("long", f"Subtract {length} from") if zero.length_m > 0.0 else ("short", f"Add {length} to")
    text = (
        f"The {count_of(count, 'distance')} to {list_names(anchors)} seem to be {length} too {too}, give or "
        f"take {std:.2g} mm: without that they miss the arm by {after:.3g} mm in place of {before:.3g} mm, "
        "root mean square. A wire has to be counted from the point that it leads to, not from where it was "
        f"switched on. {how} these distances and calibrate again."
    )
    return Notice(DISTANCE_ZERO, text)
