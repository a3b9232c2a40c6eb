"""What each set-up measured of what was fitted: what it did not is a guess, and no part of what is known."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm.arrays import HoldsReadOnly, hold_read_only
from truearm.errors import InputError
from truearm.fits.core_set import Selection
from truearm.measurements import Measurements
from truearm.types import Floats, Mask

Counts = NDArray[np.int64]

LEAST_LEFT_M: Final = 1e-9
"""No row is known better than this."""
SAME_WORTH: Final = 1e-6
"""Part of what rows are worth below which sums in another order, and searches, differ."""


@dataclass(frozen=True, eq=False)
class MeasuredParts(HoldsReadOnly):
    """How many rows of each of G set-ups hold what was fitted.

    Attributes:
        rows: Rows with a fitted target (G,), or with a distance.
        targets: Rows with each of the t fitted targets (G, t); of distances (G, 1).
        orientations: Rows with an orientation (G,); zero where it took no part.
        worth: Weights of the rows with each target added up, in rows as sure as the surest one (G, t).
    """

    rows: Counts
    targets: Counts
    orientations: Counts
    worth: Floats

    def __post_init__(self) -> None:
        hold_read_only(self, "rows", "targets", "orientations", "worth")

    @classmethod
    def of(
        cls, data: Measurements, selection: Selection, groups: Sequence[str], sureness: Floats | None = None
    ) -> "MeasuredParts":
        """Those of the rows that were fitted; without `sureness` (n,) all of them are as sure."""
        sure = np.ones(len(data)) if sureness is None else sureness
        held = held_parts(data, selection)
        points = np.ones((len(data), 1), dtype=np.bool_) if selection.distances else held[:, :-1]
        own = [data.group == group for group in groups]
        return cls(
            np.array([points[rows].any(axis=1).sum() for rows in own], dtype=np.int64),
            np.array([points[rows].sum(axis=0) for rows in own], dtype=np.int64),
            np.array([held[rows, -1].sum() for rows in own], dtype=np.int64),
            np.array([sure[rows] @ points[rows] for rows in own]),
        )

    @classmethod
    def whole(cls, selection: Selection, groups: int) -> "MeasuredParts":
        """Those of a file that does not say: all set-ups are taken to have measured everything."""
        targets = np.ones((groups, max(len(selection.targets), 1)), dtype=np.int64)
        turned = targets[:, 0] * selection.orientation
        return cls(targets[:, 0], targets, turned, targets.astype(np.float64))

    @property
    def values(self) -> int:
        """How many numbers were measured of what was fitted."""
        return 3 * int(self.targets.sum() + self.orientations.sum())

    def first(self, group: int) -> int:
        """Place of the first target that a set-up measured; 0 where it measured none."""
        return int((self.targets[group] > 0).argmax())

    def selection(self, group: int, fitted: Selection) -> Selection:
        """What a set-up measured of what was fitted; the first target where it measured none."""
        held = [target for target, count in zip(fitted.targets, self.targets[group], strict=True) if count]
        targets = tuple(held) or fitted.targets[:1]
        return replace(fitted, targets=targets, orientation=bool(self.orientations[group]))

    def surest(self, groups: Sequence[str]) -> int:
        """Number of the set-up whose rows are worth most, of equal ones the first by name."""
        return _first_of_most(self.worth.sum(axis=1), groups)

    def most_turned(self, groups: Sequence[str]) -> int:
        """Number of the set-up with most orientations, of equal ones the surest; without any the surest."""
        most = self.orientations == self.orientations.max()
        return _first_of_most(np.where(most, self.worth.sum(axis=1), -1.0), groups)

    def points(self, targets: Floats) -> Floats:
        """Of points (G, t, 3) on the flange those that were measured (k, 3)."""
        return np.asarray(targets[self.targets > 0])

    def held(self, places: Sequence[int]) -> Mask:
        """Which targets, by their places, and last whether orientations, each set-up measured (G, k + 1)."""
        return np.column_stack([self.targets[:, list(places)], self.orientations]) > 0

    def shares(self, group: int) -> Floats:
        """Parts (t,) of one for which the middle of a set-up's targets is known best; zeros without rows."""
        worth = self.worth[group]
        return np.asarray(worth / worth.sum()) if worth.any() else worth

    def pack(self) -> dict[str, Any]:
        """JSON values."""
        return {name: getattr(self, name).tolist() for name in ("rows", "targets", "orientations", "worth")}

    @classmethod
    def unpack(cls, content: Mapping[str, Any], selection: Selection, groups: int) -> "MeasuredParts":
        """Those that `pack` described; where it does not say what rows are worth all count the same.

        Raises:
            InputError: If they are of other set-ups or targets.
        """
        expected = cls.whole(selection, groups)
        content = {"worth": content["targets"], **content}
        for name, counts in content.items():
            shape = getattr(expected, name).shape
            if np.shape(counts) != shape:
                raise InputError(
                    f"'measured.{name}' has shape {np.shape(counts)}", rule=f"It must be {shape}"
                )
        kept = {name: np.array(content[name], dtype=np.int64) for name in ("rows", "targets", "orientations")}
        return cls(**kept, worth=np.array(content["worth"], dtype=np.float64))


def _first_of_most(worth: Floats, groups: Sequence[str]) -> int:
    """Number of the set-up that is worth most, of those that are worth the same the first by name."""
    alike = np.flatnonzero(worth >= (1.0 - SAME_WORTH) * worth.max()).tolist()
    return int(min(alike, key=lambda number: groups[number]))


def sureness(own_m: Floats, left_m: float, weight: Floats) -> Floats:
    """Weights of rows (n,) in parts of that of the surest one.

    Args:
        own_m: The sigma that each row states (n,), m; zero where it states none.
        left_m: What the model leaves of a coordinate beside it, m.
        weight: Weights of outliers (n,).
    """
    deviation = np.hypot(max(left_m, LEAST_LEFT_M), own_m)
    return np.asarray(weight * (deviation.min() / deviation) ** 2)


def held_parts(data: Measurements, selection: Selection) -> Mask:
    """Which of the fitted targets each row holds, and whether an orientation that was fitted (n, t + 1)."""
    return np.column_stack([data.seen(selection.targets), data.oriented & selection.orientation])
