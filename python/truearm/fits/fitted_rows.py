"""The rows that a calibration was fitted to, and what became of each."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm._core import Problem, residuals
from truearm.arrays import HoldsReadOnly, hold_read_only
from truearm.errors import Notice, count_of
from truearm.fits.core_set import Selection, core_set, distance_ends
from truearm.fits.fitting import Fits, Task, constant_variances
from truearm.fits.models import ArmModel
from truearm.measurements import Measurements
from truearm.rows.splitting import Split
from truearm.types import Floats, Mask
from truearm.units import MM_PER_METRE, MRAD_PER_RAD

if TYPE_CHECKING:
    from truearm.calibration import Calibration


UNUSED: Final = 0
TRAINED: Final = 1
HELD_OUT: Final = 2
ODDS_OF_CHANCE: Final = 1e-6
"""A row is an outlier where the model makes errors as large as its own less likely than this."""


@dataclass(frozen=True, eq=False)
class FittedRows(HoldsReadOnly):
    """n rows in the order they were fitted in.

    `truearm.calibrate` makes one, `calibration.rows`.

    Attributes:
        data: What was measured.
        side: For each row (n,) whether it was UNUSED, TRAINED or HELD_OUT when the errors were judged.
        weight: Weights in the final fit (n,).
        residual: Measured minus predicted (n, m), base frame: three a target in m, then three of the
            orientation in rad; zero where not measured. For distances (d, 1), in the order of the rows, a
            pair once.
        score: Squared standardised residuals over their limit (n,); above one is an outlier. Of variable
            models they are what the model leaves of a row that it was not fitted to (leave-one-out), of the
            paper's schemes what their constants leave: a scheme follows rows that it was fitted to.
        distance_m: How far the farthest target of each row is from where the model has it (n,). Of variable
            models it is how far its first target is from where the model without the row has it, if that is
            more: of rows of full weight it mostly is, of outliers, which the model hardly follows, both are
            the same. A distance is off by so much in its row, in both of a pair. That of a scheme's
            outliers is from where its constants have them. Distances of a calibration,
            and points that bend its constants, are judged by constants that rows far off do not bend, as are
            their scores.
        moved: Drift in world that was taken out of each row (n, 3), m; None where nothing was. `residual` and
            `distance_m` are without it, `data` is as it was measured.
        progress: When each row was measured, from 0 for the first of its set-up to 1 for the last (n,); None
            where no drift was taken out.
        orientation: Whether orientation was fitted, so that `residual` ends with it.
        turned: `turn_rad` (n,) where it is not what `residual` says, rad; None where it is.
    """

    data: Measurements
    side: NDArray[np.int64]
    weight: Floats
    residual: Floats
    score: Floats
    distance_m: Floats
    moved: Floats | None = None
    progress: Floats | None = None
    orientation: bool = False
    turned: Floats | None = None

    def __post_init__(self) -> None:
        hold_read_only(self, "side", "weight", "residual", "score", "distance_m")
        hold_read_only(self, "moved", "progress", "turned")

    def __repr__(self) -> str:
        return f"<FittedRows: {count_of(len(self.side), 'row')}, {count_of(len(self.outliers()), 'outlier')}>"

    @classmethod
    def of(cls, task: Task, fits: Fits, side: NDArray[np.int64]) -> "FittedRows":
        """Internal: the rows of a fit; `side` (n,) in their order."""
        if fits.variable is None:
            return cls._of_constants(task, fits, side)
        selection, variable = task.selection, fits.variable
        distance = np.maximum(variable.distances, farthest_m(variable.residuals, selection))
        found = cls(fits.data, side, variable.weights, variable.residuals, variable.scores, distance)
        return replace(found, orientation=selection.orientation)

    @classmethod
    def _of_constants(cls, task: Task, fits: Fits, side: NDArray[np.int64]) -> "FittedRows":
        """Those of constants, or of a scheme beside them."""
        selection, data = task.selection, fits.data
        width = 1 if selection.distances else fits.constant.residuals.size // len(data)
        residual = fits.constant.residuals.reshape(-1, width)
        if selection.distances:
            distance = at_rows(np.abs(residual[:, 0]), data)
        else:
            distance = farthest_m(residual, selection)
        score = scores_of_constants(fits, residual, selection)
        found = cls(data, side, fits.constant.weights, residual, score, distance)
        found = replace(found, orientation=selection.orientation)
        if fits.scheme is None:
            return found
        residual = _residuals(task, fits.models(task.arm)[fits.scheme_name], data)
        own = replace(found, residual=residual, distance_m=farthest_m(residual, selection))
        return own.apart_as(found, score > 1.0)

    def apart_as(self, others: "FittedRows", which: Mask) -> "FittedRows":
        """Internal: the same rows, `which` (n,) of them as far off and as turned as `others` say."""
        distance = np.where(which, others.distance_m, self.distance_m)
        turned = np.where(which, others.turn_rad, self.turn_rad) if self.orientation else None
        return replace(self, distance_m=distance, turned=turned)

    @property
    def turn_rad(self) -> Floats:
        """How far each row (n,) is turned from how the model has it, rad; NaN where its orientation was not
        fitted.

        It is what `residual` says, never leave-one-out, which of outliers is the same. That of a scheme's
        outliers is, as `distance_m`, from how its constants have them, and so is that of rows that bend
        constants from how those have them that they do not bend.
        """
        if self.turned is not None:
            return self.turned
        if not self.orientation or self.data.orientations is None:
            return np.full(len(self.side), np.nan)
        return np.where(self.data.oriented, np.linalg.norm(self.residual[:, -3:], axis=1), np.nan)

    @property
    def fitted(self) -> Measurements:
        """The rows as they were fitted: without the drift."""
        return without_drift(self.data, self.moved)

    def among(self, data: Measurements) -> NDArray[np.bool_]:
        """Which rows (n,) of other measurements are among these: by readings and first point."""
        known = set(_marks(self.data))
        return np.array([mark in known for mark in _marks(data)], dtype=np.bool_)

    def outliers(self) -> list[dict[str, Any]]:
        """File, row, score and distance_mm of each outlier, the worst first; turn_mrad where orientation was
        fitted.
        """
        found, turn_mrad = np.flatnonzero(self.score > 1.0), MRAD_PER_RAD * self.turn_rad
        return [
            {
                "file": str(self.data.sources[k]),
                "row": int(self.data.rows[k]),
                "score": float(self.score[k]),
                "distance_mm": float(self.distance_m[k] * MM_PER_METRE),
                **({"turn_mrad": float(turn_mrad[k])} if np.isfinite(turn_mrad[k]) else {}),
            }
            for k in found[np.argsort(-self.score[found], kind="stable")]
        ]


def _residuals(task: Task, model: ArmModel, data: Measurements) -> Floats:
    """Measured minus predicted (n, m) of a model that varies with the joints alone, base frame."""
    arm = task.arm
    measured = core_set(arm.robot, data, task.selection, task.groups)
    problem = Problem(arm.flange_chain, measured, [], arm.world_is_known)
    parameters = model.parameters(arm.robot.joints_from_readings(data.readings))
    return residuals(problem, np.ascontiguousarray(parameters), model.setup)


def without_drift(data: Measurements, moved: Floats | None) -> Measurements:
    """The rows as if their set-ups had not been `moved` in world (n, 3), m; themselves with None."""
    return data if moved is None else replace(data, targets=data.targets - moved[:, None])


def known_rows(calibration: "Calibration", data: Measurements) -> list[Notice]:
    """A notice of rows that the calibration was fitted to: what it says of them, it knows from them.

    Rows of its updates count, as far as files keep them.
    """
    known = np.zeros(len(data), dtype=np.bool_)
    for fitted in _all_rows(calibration):
        known |= fitted.among(data)
    if not known.any():
        return []
    named = "All rows" if known.all() else f"{data.row_names(known)[:1].upper()}{data.row_names(known)[1:]}"
    text = (
        f"{named} took part in the fit of this calibration: how good it is where it was not measured, they "
        "do not say."
    )
    return [Notice("known_rows", text, tuple(data.rows[known].tolist()))]


def _all_rows(calibration: "Calibration") -> Iterator[FittedRows]:
    """The rows of a calibration and of those that it was updated from."""
    before: Calibration | None = calibration
    while before is not None:
        if before.rows is not None:
            yield before.rows
        is_kept = before.revision is not None and before.revision.file is not None
        before = before.predecessor if is_kept else None


def _marks(data: Measurements) -> list[bytes]:
    """What tells each row (n,) from others: its readings and its points, up to the last that it holds."""
    points = data.targets.reshape(len(data), -1)
    counts = (np.isfinite(points) * np.arange(1, points.shape[1] + 1)).max(axis=1, initial=0)
    rows = zip(data.readings, points, counts.tolist(), strict=True)
    return [readings.tobytes() + own[:count].tobytes() for readings, own, count in rows]


def overwhelming(freedom: NDArray[np.int64]) -> Floats:
    """Sums (n,) that so many squares (n,), in units of their variances, surpass with ODDS_OF_CHANCE odds."""
    from scipy.special import gammainccinv  # noqa: PLC0415 - slow to import

    return np.asarray(2.0 * gammainccinv(freedom / 2.0, ODDS_OF_CHANCE))


def sides(count: int, split: Split) -> NDArray[np.int64]:
    """For each of `count` rows on which side of the split it stands."""
    side = np.full(count, UNUSED, dtype=np.int64)
    side[split.train] = TRAINED
    side[split.holdout] = HELD_OUT
    return side


def farthest_m(residual: Floats, selection: Selection) -> Floats:
    """How far the farthest target of each row (n,) is from where the model has it, m."""
    count = len(selection.targets)
    return np.asarray(np.linalg.norm(residual[:, : 3 * count].reshape(-1, count, 3), axis=2).max(axis=1))


def scores_of_constants(fits: Fits, residual: Floats, selection: Selection) -> Floats:
    """Score (n,) of each row by what the constants leave of it (n, m), of distances (d, 1)."""
    variances = constant_variances(fits, selection)
    if selection.distances:
        variances = variances[distance_ends(fits.data)[:, 0]]
    squares = (residual**2 / variances).sum(axis=1)
    freedom = np.maximum((residual != 0.0).sum(axis=1), 1)
    score = np.asarray(squares / overwhelming(freedom))
    return at_rows(score, fits.data) if selection.distances else score


def at_rows(values: Floats, data: Measurements) -> Floats:
    """Values (d,) of distances at their rows (n,), in both of a pair; zero in rows without one."""
    found = np.zeros(len(data))
    found[distance_ends(data)] = values[:, None]
    return found
