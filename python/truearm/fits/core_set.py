"""What of the measurements is used, and its arrays as the core reads them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from truearm._core import MeasurementSet, Setup
from truearm.defaults import FIRST_TARGET
from truearm.errors import Notice, UsageError, count_of
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.rotations import matrix_from_quaternion
from truearm.rows.own_sigmas import sigmas_of_axes, sigmas_of_turns
from truearm.rows.used_distances import holds_distances
from truearm.types import AXES, Floats, Rows

Use = Literal["position", "pose", "targets"]

POSITION: Final = "position"
DISTANCE: Final = "distance"
USES: Final = get_args(Use)


@dataclass(frozen=True)
class Selection:
    """What takes part in a fit, and where errors are judged.

    Attributes:
        targets: Measured points that are fitted, indices from 0; none with distances.
        orientation: Whether the measured orientation is fitted.
        distances: Whether distances stand in place of points.
        judge: Measured point at which errors are judged, index from 0.
    """

    targets: tuple[int, ...]
    orientation: bool = False
    distances: bool = False
    judge: int = 0

    @property
    def errors_of(self) -> str:
        """What errors in mm are of: "position", whose lengths they are, or "distance"."""
        return DISTANCE if self.distances else POSITION

    @property
    def judges_another(self) -> bool:
        """Whether errors are judged at a point that takes no part in the fit."""
        return not self.distances and self.judge not in self.targets


def select(data: Measurements, use: Use | None, judge_target: int = FIRST_TARGET) -> Selection:
    """What to use of `data`: with None targets, else pose, else position, as far as was measured.

    Columns without a point or an orientation count for nothing. A target other than the first that was
    measured, at which errors are judged, takes no part in the fit.

    Raises:
        UsageError: If what is asked for was not measured.
        InputError: If only some rows hold distances.
    """
    if holds_distances(data):
        if use is not None or judge_target != FIRST_TARGET:
            raise UsageError("distances were measured, not points", where=", ".join(data.files))
        return Selection((), distances=True)
    _check_asked(data, use, judge_target)
    first, *further = _measured_targets(data)
    judge = first if judge_target == FIRST_TARGET else judge_target - 1
    others = tuple(target for target in further if target != judge)
    if use is None:
        use = "targets" if others else "pose" if data.oriented.any() else "position"
    return Selection((first, *(others if use == "targets" else ())), orientation=use == "pose", judge=judge)


def select_fitted(
    data: Measurements, use: Use | None, fitted: Selection, judge_target: int = FIRST_TARGET
) -> tuple[Selection, list[Notice]]:
    """What to use of `data` where a calibration has to know it from its fit.

    Targets and orientations that took no part are left out beside those that did, unless they are asked for.

    Raises:
        UsageError: If orientations are asked for that took no part.
        InputError: If only some rows hold distances.
    """
    selection = select(data, use, judge_target)
    known = tuple(target for target in selection.targets if target in fitted.targets)
    if use is None and 0 < len(known) < len(selection.targets):
        turned = fitted.orientation and bool(data.oriented.any())
        left_out = [target for target in selection.targets if target not in known]
        return replace(selection, targets=known, orientation=turned), [_left_out(left_out)]
    if not selection.orientation or fitted.orientation:
        return selection, []
    if use is not None:
        raise UsageError(
            "orientations took no part in the calibration",
            where=", ".join(data.files),
            rule="It knows neither how the target is turned on the tool nor how far they may scatter",
            way_out="Leave --use pose out, or calibrate with orientations",
        )
    text = "Orientations are left out: they took no part in the calibration, which does not know them."
    return select(data, "position", judge_target), [Notice("orientations_left_out", text)]


def _left_out(targets: Sequence[int]) -> Notice:
    """That targets, from 0, are left out which took no part in a calibration."""
    named = ", ".join(f"target {target + 1}" for target in targets)
    return Notice("targets_left_out", f"Not used: {named}, which took no part in the calibration.")


def first_measured(data: Measurements, selection: Selection) -> Rows:
    """Which of the fitted targets, by its place among them, is the first that was measured in each row (n,).

    It is where the row's error is told; 0 where none was measured.
    """
    return np.asarray(data.seen(selection.targets).argmax(axis=1))


def core_set(
    robot: Robot,
    data: Measurements,
    selection: Selection,
    groups: Sequence[str],
    weight: Floats | None = None,
) -> MeasurementSet:
    """The rows of `data` as the core reads them.

    Args:
        robot: Turns readings into joint values.
        data: The rows, n of them; empty rows of points and orientations count as not measured.
        selection: What of them is used.
        groups: Names of the set-ups, in the order of their numbers.
        weight: Weights (n,); one each by default.
    """
    count = len(data)
    number = {name: k for k, name in enumerate(groups)}
    return MeasurementSet(
        {
            "joints": robot.joints_from_readings(data.readings),
            "group": np.array([number[name] for name in data.group], dtype=np.int64),
            "targets": np.ascontiguousarray(data.targets[:, list(selection.targets)]),
            "rotations": rotations(data) if selection.orientation else None,
            "sigma": np.column_stack([sigmas_of_axes(data), sigmas_of_turns(data)]),
            "weight": np.ones(count) if weight is None else weight,
            "distances": _distances(data) if selection.distances else [],
        }
    )


def measured_points(
    values: Floats,
    points: Floats,
    turned: Floats | None = None,
    *,
    group: int = 0,
    sigma_m: Floats | None = None,
) -> MeasurementSet:
    """Points measured at joint values as the core reads them.

    Args:
        values: Joint values (n, N).
        points: (n, T, 3), or (n, 3) of one target.
        turned: world_from_target rotations (n, 3, 3); None where orientation is not measured.
        group: Number of the set-up.
        sigma_m: Their own sigma (n,), NaN where there is none; None for none at all.
    """
    count = len(values)
    own = np.zeros(count) if sigma_m is None else np.nan_to_num(sigma_m, nan=0.0)
    return MeasurementSet(
        {
            "joints": np.ascontiguousarray(values),
            "group": np.full(count, group, dtype=np.int64),
            "targets": np.ascontiguousarray(points.reshape(count, -1, 3)),
            "rotations": None if turned is None else np.ascontiguousarray(turned),
            "sigma": np.column_stack([*AXES * [own], np.zeros(count)]),
            "weight": np.ones(count),
            "distances": [],
        }
    )


def known_setup(point_in_flange: Floats) -> Setup:
    """The set-up of a device in whose frame the base's place is known, measuring a known point (3,)."""
    return Setup(np.eye(4)[None], point_in_flange[None, None], np.eye(3)[None], np.zeros((0, 3)))


def rotations(data: Measurements) -> Floats:
    """world_from_target rotations (n, 3, 3); NaN where not measured."""
    found = np.full((len(data), 3, 3), np.nan)
    if data.orientations is not None:
        measured = data.oriented
        found[measured] = matrix_from_quaternion(data.orientations[measured])
    return found


def anchor_names(data: Measurements) -> list[str]:
    """Names of the fixed points that distances lead to, in the order of their numbers."""
    return sorted(set(data.anchor.tolist()) - {""}) if data.anchor is not None else []


def distance_count(data: Measurements) -> int:
    """How many distances were measured; that of a pair counts once."""
    return len(_distances(data))


def distance_ends(data: Measurements) -> Rows:
    """The rows (d, 2) of each distance, in the core's order; of one to a fixed point the same twice."""
    ends = [(row, row if to_anchor else other) for row, to_anchor, other, _ in _distances(data)]
    return np.array(ends, dtype=np.int64).reshape(-1, 2)


def distances_apart(data: Measurements, poses: Rows) -> tuple[Rows, Rows]:
    """The row that holds each distance (d,), in the core's order, and a number (d,) that its shots share.

    Args:
        data: The rows, n of them.
        poses: Number of each row's pose (n,), not negative.
    """
    found = _distances(data)
    ends = [
        (poses[row], -1 - other) if to_anchor else tuple(sorted((poses[row], poses[other])))
        for row, to_anchor, other, _ in found
    ]
    _, number = np.unique(np.array(ends, dtype=np.int64).reshape(-1, 2), axis=0, return_inverse=True)
    return np.array([row for row, *_ in found], dtype=np.int64), number.reshape(-1).astype(np.int64)


def _distances(data: Measurements) -> list[tuple[int, bool, int, float]]:
    """(row, whether to an anchor, anchor or other row, distance in m); each pair once."""
    number = {name: k for k, name in enumerate(anchor_names(data))}
    anchors, pairs = _words(data.anchor, len(data)), _words(data.pair, len(data))
    entries, waiting = [], dict[str, int]()
    for row, value in enumerate(_numbers(data.distance_m, len(data))):
        if np.isnan(value):
            continue
        if anchors[row]:
            entries.append((row, True, number[anchors[row]], value))
        elif pairs[row] in waiting:
            entries.append((waiting.pop(pairs[row]), False, row, value))
        else:
            waiting[pairs[row]] = row
    return entries


def _words(given: NDArray[np.str_] | None, count: int) -> list[str]:
    return [""] * count if given is None else [str(word) for word in given]


def _numbers(given: Floats | None, count: int) -> list[float]:
    return [np.nan] * count if given is None else [float(number) for number in given]


def _check_asked(data: Measurements, use: Use | None, judge_target: int) -> None:
    where = ", ".join(data.files)
    if use is not None and use not in USES:
        raise UsageError(f'"{use}" is not known', where="use", rule="Either position, pose or targets")
    if use == "pose" and not data.oriented.any():
        raise UsageError(
            "no orientation was measured", where=where, rule="A pose needs the columns qw qx qy qz"
        )
    if use == "targets" and len(_measured_targets(data)) < 2:
        raise UsageError(
            "one point was measured", where=where, rule="Further targets are columns x2 y2 z2, x3 y3 z3, ..."
        )
    if not 1 <= judge_target <= data.target_count:
        raise UsageError(
            f"there is no target {judge_target} to judge at",
            where=where,
            rule=f"There {'is' if data.target_count == 1 else 'are'} {count_of(data.target_count, 'target')}",
        )


def _measured_targets(data: Measurements) -> list[int]:
    """The points that some row holds, indices from 0."""
    return [int(point) for point in np.flatnonzero(data.seen().any(axis=0))]
