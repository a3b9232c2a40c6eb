"""Errors of a model on measured rows, and their statistics."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm._core import Problem, Setup, residuals
from truearm.arrays import HoldsReadOnly, hold_read_only
from truearm.errors import InputError, count_of
from truearm.fits.core_set import Selection, core_set, first_measured
from truearm.fits.details import DriftDetails
from truearm.fits.identified import IdentifiedArm
from truearm.lengths import length_mm
from truearm.measurements import Measurements
from truearm.types import Floats

MILLI = 1e-3
FEW_HELD = 30
STATISTICS: Final = ("mean", "rms", "p95", "p99", "max")
HEADINGS: Final = ("mean", "RMS", "95 %", "99 %", "max")
"""What tables call them."""
MEAN_LENGTH: Final = math.sqrt(8.0 / math.pi)
"""Mean length of a vector of three normal coordinates of deviation one: the Maxwell distribution's."""
MEAN_SIZE: Final = math.sqrt(2.0 / math.pi)
"""Mean absolute value of one such coordinate, as of distances."""


@dataclass(frozen=True)
class Statistics:
    """Of errors in mm or mrad.

    `truearm.calibrate` and `truearm.evaluate` make one of each model and what was measured.

    Attributes:
        mean: Arithmetic mean.
        rms: Root mean square.
        p95: Quantile of 95 %.
        p99: Quantile of 99 %.
        max: The largest.
    """

    mean: float
    rms: float
    p95: float
    p99: float
    max: float

    @classmethod
    def of(cls, errors: Floats) -> "Statistics":
        """Statistics of errors (n,) in m or rad; there must be one."""
        scaled = errors / MILLI
        p95, p99 = np.quantile(scaled, [0.95, 0.99])
        rms = np.sqrt(np.square(scaled).mean())
        return cls(*map(float, (scaled.mean(), rms, p95, p99, scaled.max())))


@dataclass(frozen=True)
class Errors:
    """Errors of one model.

    `truearm.calibrate` makes one, as values of `calibration.validation.holdout`; so does `truearm.evaluate`.

    Attributes:
        position: Of the judged target, of several fitted ones of the first that a row holds (or of the
            distances), mm.
        orientation: Of the tool, mrad; None where it was not measured.
    """

    position: Statistics
    orientation: Statistics | None = None

    def to_dict(self) -> dict[str, float]:
        """mean_mm, rms_mm, p95_mm, p99_mm, max_mm, and the same in mrad if orientation was measured."""
        content = {f"{key}_mm": value for key, value in asdict(self.position).items()}
        if self.orientation is not None:
            content |= {f"{key}_mrad": value for key, value in asdict(self.orientation).items()}
        return content

    @classmethod
    def from_dict(cls, content: Mapping[str, float]) -> "Errors":
        """The errors that `to_dict` described."""

        def unit(name: str) -> Statistics:
            return Statistics(*(content[f"{key}_{name}"] for key in ("mean", "rms", "p95", "p99", "max")))

        return cls(unit("mm"), unit("mrad") if "mean_mrad" in content else None)


@dataclass(frozen=True, eq=False)
class RowErrors(HoldsReadOnly):
    """Errors of one model, row by row, measured minus predicted in the base frame; NaN where not measured.

    `truearm.evaluate` makes one, as values of `evaluation.rows.errors`.

    Attributes:
        position: At the judged target (n, 3), m, of several fitted ones at the first that a row holds; of
            distances (d, 1), or (n, 1) at the first of a pair's rows.
        orientation: Rotation vectors (n, 3), rad; None where orientation took no part.
    """

    position: Floats
    orientation: Floats | None = None

    def __post_init__(self) -> None:
        hold_read_only(self, "position", "orientation")

    @property
    def distance_m(self) -> Floats:
        """Lengths of the position errors (n,)."""
        return np.asarray(np.linalg.norm(self.position, axis=1))

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Which rows (n,) hold the judged target; of distances (d,) all."""
        return np.asarray(np.isfinite(self.position).all(axis=1))

    @property
    def turn_rad(self) -> Floats:
        """Angles of the orientation errors (n,); NaN where orientation took no part."""
        if self.orientation is None:
            return np.full(len(self.position), np.nan)
        return np.asarray(np.linalg.norm(self.orientation, axis=1))

    def at_rows(self, rows: NDArray[np.int64], count: int) -> "RowErrors":
        """Those of distances (d, 1) as of `count` rows, each at one of `rows` (d,), NaN at the others."""
        position = np.full((count, 1), np.nan)
        position[rows] = self.position
        return RowErrors(position)

    def statistics(self) -> Errors:
        """Statistics over the rows that were measured; there must be one."""
        position = Statistics.of(_measured(self.position))
        if self.orientation is None:
            return Errors(position)
        turned = _measured(self.orientation)
        return Errors(position, Statistics.of(turned) if len(turned) else None)


def means_in_words(models: Mapping[str, Errors]) -> str:
    """Mean position errors of models by name: "nominal 1.61 mm, constant 0.0931 mm in the mean"."""
    means = [f"{name} {length_mm(found.position.mean, 3)}" for name, found in models.items()]
    return f"{', '.join(means)} in the mean"


def _measured(errors: Floats) -> Floats:
    """Lengths of the errors (n, k) that are known."""
    return np.asarray(np.linalg.norm(errors[np.isfinite(errors).all(axis=1)], axis=1))


@dataclass(frozen=True)
class Validation:
    """Errors on rows that took no part in the fits they judge, and on those that trained.

    `truearm.calibrate` makes one, `calibration.validation`.

    Attributes:
        n_train: Rows that trained.
        n_train_poses: How many poses they are of: shots of the same pose count once.
        n_holdout: Rows that were held out, or left out in turn, and hold what is judged.
        n_holdout_poses: How many poses those are of.
        holdout: Errors of "nominal", "constant" and, if fitted, "variable" on these rows.
        train: The same on training rows.
        coverage_95: Share of the held-out coordinates that lie within the 95 % intervals of the variable
            model; None where there is none, or they hold nothing that was fitted.
        left_out: Whether each row was judged by what the other poses gave, as after an update; else the rows
            were held out of one fit.
        n_planned: How many of them were held out because they were planned to validate.
        drift: What was taken out of all measurements, those that were held out too; None where nothing was.
        n_holdout_distances: How many distances were judged, of which a pair of rows has one; None where
            points were, and of files of earlier versions without their rows.
    """

    n_train: int
    n_train_poses: int
    n_holdout: int
    n_holdout_poses: int
    holdout: Mapping[str, Errors]
    train: Mapping[str, Errors]
    coverage_95: float | None = None
    left_out: bool = False
    n_planned: int = 0
    drift: DriftDetails | None = None
    n_holdout_distances: int | None = None

    def __post_init__(self) -> None:
        hold_read_only(self, "holdout", "train")

    def __repr__(self) -> str:
        trained = f"{self.poses_trained}, " if self.n_train else ""
        return f"<Validation: {trained}{self.poses_judged}; {means_in_words(self.holdout)}>"

    @property
    def n_rows(self) -> int:
        """How many rows trained or were judged: those that were left out in turn did both."""
        return self.n_holdout if self.left_out else self.n_train + self.n_holdout

    @property
    def judged(self) -> str:
        """What the rows that were judged are called: "held-out" or "left-out"."""
        return "left-out" if self.left_out else "held-out"

    @property
    def poses_trained(self) -> str:
        """How many trained: "400 training poses", or "140 training poses (420 rows)"."""
        return _poses("training", self.n_train_poses, self.n_train)

    @property
    def poses_judged(self) -> str:
        """How many were judged: "832 held-out poses", "70 held-out poses (210 rows)", and of distances "36
        held-out distances", "27 held-out distances at 9 poses".
        """
        distances, poses = self.n_holdout_distances, self.n_holdout_poses
        if distances is None:
            return _poses(self.judged, poses, self.n_holdout)
        several = f" at {count_of(poses, 'pose')}" if poses < distances else ""
        return count_of(distances, f"{self.judged} distance") + several

    @property
    def few(self) -> str:
        """What is said where so few were judged that others would give other errors; empty elsewhere."""
        distances = self.n_holdout_distances
        apart = self.n_holdout_poses if distances is None else min(distances, self.n_holdout_poses)
        if apart >= FEW_HELD:
            return ""
        if self.left_out:
            poses = count_of(self.n_holdout_poses, "pose")
            return f"The errors above come from {poses}: truearm evaluate judges it on others."
        return f"The errors above come from {self.poses_judged}: another split would give others."

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {
            "n_train": self.n_train,
            "n_train_poses": self.n_train_poses,
            "n_holdout": self.n_holdout,
            "n_holdout_poses": self.n_holdout_poses,
            "n_holdout_distances": self.n_holdout_distances,
            "holdout": {name: errors.to_dict() for name, errors in self.holdout.items()},
            "train": {name: errors.to_dict() for name, errors in self.train.items()},
            "coverage_95": self.coverage_95,
            "left_out": self.left_out,
            "n_planned": self.n_planned,
            "drift": None if self.drift is None else self.drift.to_dict(),
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "Validation":
        """The validation that `to_dict` described."""
        sides = {
            side: {name: Errors.from_dict(errors) for name, errors in content[side].items()}
            for side in ("holdout", "train")
        }
        return cls(
            n_train=content["n_train"],
            n_train_poses=content.get("n_train_poses", content["n_train"]),
            n_holdout=content["n_holdout"],
            n_holdout_poses=content.get("n_holdout_poses", content["n_holdout"]),
            holdout=sides["holdout"],
            train=sides["train"],
            coverage_95=content["coverage_95"],
            left_out=content.get("left_out", False),
            n_planned=content.get("n_planned", 0),
            drift=DriftDetails.from_dict(content["drift"]) if content.get("drift") else None,
            n_holdout_distances=content.get("n_holdout_distances"),
        )


def _poses(which: str, poses: int, rows: int) -> str:
    shots = "" if rows == poses else f" ({count_of(rows, 'row')})"
    return count_of(poses, f"{which} pose") + shots


def mean_distance(std: float, *, distances: bool) -> float:
    """Mean error of points, or of distances, whose coordinates have a standard deviation."""
    return (MEAN_SIZE if distances else MEAN_LENGTH) * std


def row_errors(
    arm: IdentifiedArm,
    data: Measurements,
    selection: Selection,
    groups: Sequence[str],
    parameters: Floats,
    setup: Setup,
) -> RowErrors:
    """Errors of a model at the first target that each row holds and, if selected, of the orientation.

    Args:
        arm: The arm.
        data: Rows to judge, n of them.
        selection: What was fitted; the first of its targets that was measured in a row is judged there.
        groups: Names of the set-ups, in the order of `setup`.
        parameters: Parameters (L, 5), or (n, L, 5) of each row.
        setup: Frames and targets of the groups.

    Raises:
        InputError: If no row holds a target.
    """
    problem = Problem(arm.flange_chain, core_set(arm.robot, data, selection, groups), [], arm.world_is_known)
    left = residuals(problem, np.ascontiguousarray(parameters), setup)
    if selection.distances:
        return RowErrors(at_first_measured(left, data, selection))
    seen = data.seen(selection.targets)
    if not seen.any():
        listed = " or ".join(str(target + 1) for target in selection.targets)
        raise InputError(
            f"target {listed} was measured in none of {len(data)} rows to judge",
            where=", ".join(data.files),
            way_out="Judge at another target, or measure it at more poses",
        )
    position = _where_seen(np.asarray(seen.any(axis=1)), at_first_measured(left, data, selection))
    if not selection.orientation or data.orientations is None:
        return RowErrors(position)
    return RowErrors(position, _where_seen(data.oriented, left[:, -3:]))


def at_first_measured(residuals: Floats, data: Measurements, selection: Selection) -> Floats:
    """Of residuals (n, m), three columns a fitted target, those of the first that each row holds (n, 3).

    Of distances (n, 1) the whole.
    """
    if selection.distances:
        return residuals[:, :1].copy()
    points = residuals[:, : 3 * len(selection.targets)].reshape(len(data), -1, 3)
    return points[np.arange(len(data)), first_measured(data, selection)]


def _where_seen(seen: NDArray[np.bool_], errors: Floats) -> Floats:
    """Errors (n, 3), NaN in rows that were not seen."""
    return np.asarray(np.where(seen[:, None], errors, np.nan))
