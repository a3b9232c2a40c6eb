"""Rows that a model was judged on and took no part in, each with its errors."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm.arrays import HoldsReadOnly, hold_read_only
from truearm.errors import count_of, list_names
from truearm.judgement.validation import RowErrors
from truearm.measurements import Measurements
from truearm.rows.visits import means, pose_numbers
from truearm.types import Floats, Rows
from truearm.units import MM_PER_METRE, MRAD_PER_RAD

Arrays = dict[str, NDArray[Any]]

FEWEST_POSES: Final = 2
"""That tell how much poses differ."""


@dataclass(frozen=True, eq=False)
class HeldRows(HoldsReadOnly):
    """n rows and what each model missed there. The error of a pair's distance is at the first of its rows.

    `truearm.calibrate` makes one, `calibration.held`; `truearm.evaluate` another, `evaluation.rows`.

    Attributes:
        readings: Joint readings (n, N), rad or m.
        rows: Number of each row in its file (n,), the first data row being 1.
        sources: File of each row (n,).
        errors: Errors by name of the model, as it was before it saw these rows.
    """

    readings: Floats
    rows: NDArray[np.int64]
    sources: NDArray[np.str_]
    errors: Mapping[str, RowErrors]

    def __post_init__(self) -> None:
        hold_read_only(self, "readings", "rows", "sources", "errors")

    def __repr__(self) -> str:
        return f"<HeldRows: {count_of(len(self), 'row')}, errors of {list_names(self.errors)}>"

    def __len__(self) -> int:
        return len(self.readings)

    @classmethod
    def of(cls, data: Measurements, errors: Mapping[str, RowErrors]) -> "HeldRows":
        """Internal: those of judged rows."""
        return cls(data.readings, data.rows, data.sources, errors)

    def without(self, outliers: Sequence[Mapping[str, Any]]) -> NDArray[np.bool_]:
        """Internal: which rows are none of the outliers, given with file and row, (n,)."""
        named = {(entry["file"], entry["row"]) for entry in outliers}
        own = zip(self.sources.tolist(), self.rows.tolist(), strict=True)
        return np.array([row not in named for row in own], dtype=bool)

    @cached_property
    def poses(self) -> Rows:
        """Internal: number of each row's pose (n,), from 0; shots of a pose have one."""
        _, number = np.unique(pose_numbers(self.readings, self.sources), return_inverse=True)
        return number

    def by_pose(self, values: Floats) -> Floats:
        """Internal: mean of values (n, ...) over the rows of each pose (p, ...), NaN where none is known."""
        return means(values, self.poses)

    def sigmas_mm(self, data: Measurements) -> Floats:
        """Internal: what each of these rows states as its sigma (n,), mm; zero where it states none."""
        names = zip(data.sources.tolist(), data.rows.tolist(), strict=True)
        stated = dict(zip(names, (MM_PER_METRE * data.stated_sigma_m).tolist(), strict=True))
        own = zip(self.sources.tolist(), self.rows.tolist(), strict=True)
        return np.array([stated.get(row, 0.0) for row in own])

    def among(self, outliers: Sequence[Mapping[str, Any]], model: str) -> list[Mapping[str, Any]]:
        """Internal: those of the outliers, given with file and row, that are among these rows.

        Their distance_mm and turn_mrad are what the model missed there before it saw them, where that is
        known.
        """
        rows = zip(self.sources.tolist(), self.rows.tolist(), strict=True)
        known = {
            "distance_mm": MM_PER_METRE * self.errors[model].distance_m,
            "turn_mrad": MRAD_PER_RAD * self.errors[model].turn_rad,
        }
        place = {row: k for k, row in enumerate(rows)}
        found = [(entry, place.get((entry["file"], entry["row"]))) for entry in outliers]
        return [
            {**entry, **{name: float(each[k]) for name, each in known.items() if np.isfinite(each[k])}}
            for entry, k in found
            if k is not None
        ]

    def median_mm(self, model: str) -> float:
        """Median position error of a model, mm: single rows may be far off."""
        return float(MM_PER_METRE * np.nanmedian(self.errors[model].distance_m))

    def means_without_mm(self, outliers: Sequence[Mapping[str, Any]]) -> dict[str, float]:
        """Mean position error of each model at the other rows, mm; empty without an outlier here."""
        kept = self.without(outliers)
        if kept.all() or not kept.any():
            return {}
        return {
            name: float(MM_PER_METRE * np.nanmean(found.distance_m[kept]))
            for name, found in self.errors.items()
        }

    def turns_without_mrad(self, outliers: Sequence[Mapping[str, Any]]) -> dict[str, float]:
        """Mean orientation error of each model at the other rows, mrad; empty where none was measured there,
        or without an outlier here.
        """
        kept = self.without(outliers)
        turns = {name: MRAD_PER_RAD * found.turn_rad[kept] for name, found in self.errors.items()}
        if kept.all() or not all(np.isfinite(each).any() for each in turns.values()):
            return {}
        return {name: float(np.nanmean(each)) for name, each in turns.items()}

    def lead_mm(self, ahead: str, behind: str, outliers: Sequence[Mapping[str, Any]]) -> tuple[float, float]:
        """How much smaller the errors of the model `ahead` are, mm: the mean over poses, its standard error.

        Outliers, given with file and row, are left out; shots of a pose count once. Nothing is told by less
        than two poses: the standard error is infinite then.
        """
        near, far = (MM_PER_METRE * self.errors[name].distance_m for name in (ahead, behind))
        apart = self.by_pose(np.where(self.without(outliers), far - near, np.nan))
        apart = apart[np.isfinite(apart)]
        if len(apart) < FEWEST_POSES:
            return 0.0, math.inf
        return float(apart.mean()), float(apart.std(ddof=1) / math.sqrt(len(apart)))

    def pack(self, arrays: Arrays) -> dict[str, Any]:
        """Internal: JSON values; arrays are added to `arrays`."""
        known, index = np.unique(self.sources, return_inverse=True)
        arrays |= {"held.readings": self.readings, "held.rows": self.rows}
        arrays["held.sources"] = index.astype(np.int64)
        for name, found in self.errors.items():
            arrays[f"held.{name}.position"] = found.position
            if found.orientation is not None:
                arrays[f"held.{name}.orientation"] = found.orientation
        return {"sources": known.tolist(), "models": list(self.errors)}

    @classmethod
    def unpack(cls, content: Mapping[str, Any], arrays: Arrays) -> "HeldRows":
        """Internal: the rows that `pack` described.

        Raises:
            KeyError: If an array or a key is missing.
        """
        sources = np.array(content["sources"], dtype=np.str_)[arrays["held.sources"]]
        errors = {
            name: RowErrors(arrays[f"held.{name}.position"], arrays.get(f"held.{name}.orientation"))
            for name in content["models"]
        }
        return cls(arrays["held.readings"], arrays["held.rows"], sources, errors)
