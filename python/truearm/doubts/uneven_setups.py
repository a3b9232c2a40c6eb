"""Set-ups whose rows scatter differently, as of two instruments, where no sigma tells the fit so."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from truearm.calibration import Calibration
from truearm.doubts.scattering import (
    ERROR_OF_MEDIAN,
    LEAST_KEPT,
    LITTLE,
    MRAD,
    Scattering,
    deviation_of,
    leaves,
    or_else,
    single_shot,
)
from truearm.doubts.whitened import Whitened
from truearm.errors import Notice
from truearm.fits.fitted_rows import FittedRows
from truearm.rows.own_sigmas import sigmas_of_turns
from truearm.rows.visits import pose_count
from truearm.types import AXES, Mask
from truearm.units import MM_PER_METRE, MRAD_PER_RAD

UNEVEN_SETUPS: Final = "uneven_setups"
UNEVEN_TURNS: Final = "uneven_turns"
OWN_TURNS: Final = 2
"""Orientations that what a set-up finds of its own takes up: how it and its target are turned."""


def uneven_setups(found: Calibration, fitted: FittedRows, seen: Whitened) -> list[Notice]:
    """A warning where rows of a set-up that state no sigma scatter far more than those of another.

    Args:
        found: The calibration.
        fitted: The rows that it was fitted to.
        seen: What it leaves of them.
    """
    names = fitted.data.group[seen.rows]
    every = [_scattering(fitted, seen, name, names == name) for name in found.groups if name in names]
    return _told(found, every, UNEVEN_SETUPS, "set-ups that scatter differently", "sigma_mm")


def uneven_turns(found: Calibration, fitted: FittedRows) -> list[Notice]:
    """The same of orientations."""
    if not found.selection.orientation:
        return []
    every = [_turning(fitted, found.constant.noise_rad, name) for name in found.groups]
    known = [each for each in every if each is not None]
    what = "orientations of set-ups that scatter differently"
    return _told(found, known, UNEVEN_TURNS, what, "sigma_mrad")


def _told(found: Calibration, every: Sequence[Scattering], kind: str, what: str, column: str) -> list[Notice]:
    if len(every) < 2:
        return []
    best = min(every, key=lambda each: each.size)
    worse = [each for each in every if each.is_worse(best) and not each.says_so]
    if not worse:
        return []
    text = (
        f"{leaves(found)} {what}, as those of different instruments do: "
        f"{'; '.join(each.times(best) for each in worse)}. Where rows do not state how far they may be off "
        f"all count the same, and the good ones are spoilt. Give a column {column}: "
        f"{', '.join(f'{each.beyond(best)} in the rows of {each.name}' for each in worse)}, in the others "
        f"what their instrument's data sheet says, or little ({LITTLE:g} {best.unit}), since what all rows "
        f"have in common is found beside it.{or_else(found)}"
    )
    return [Notice(kind, text)]


def _scattering(fitted: FittedRows, seen: Whitened, name: str, own: Mask) -> Scattering:
    """That of the visits (v,) of a set-up."""
    held = seen.held[own]
    kept = np.maximum(seen.kept[own][held], LEAST_KEPT)
    deviation = deviation_of(seen.left[own][held] / np.sqrt(kept))
    of_visit, shots, single = (
        float(np.median(each[own][held])) for each in (seen.variance, seen.shots, seen.single)
    )
    error = ERROR_OF_MEDIAN / np.sqrt(AXES * len(held))
    data = fitted.data.select(seen.rows[own])
    stated = float(np.median(data.stated_sigma_m))
    size = single_shot(deviation, of_visit, shots, single)
    return Scattering(name, deviation, MM_PER_METRE * size, float(error), MM_PER_METRE * stated)


def _turning(fitted: FittedRows, noise_rad: float, name: str) -> Scattering | None:
    """That of the orientations of a set-up beside a noise; None where it tells of too few poses."""
    rows = fitted.data.oriented & (fitted.data.group == name)
    poses = pose_count(fitted.data.select(rows)) if rows.any() else 0
    if poses <= OWN_TURNS:
        return None
    stated = sigmas_of_turns(fitted.data)[rows]
    expected = np.sqrt(max(1.0 - OWN_TURNS / poses, LEAST_KEPT)) * np.hypot(noise_rad, stated)
    left = fitted.residual[rows, -AXES:]
    deviation = deviation_of(left / expected[:, None])
    size = deviation_of(left) * float(np.median(np.hypot(noise_rad, stated) / expected))
    error = float(ERROR_OF_MEDIAN / np.sqrt(AXES * poses))
    usual = MRAD_PER_RAD * float(np.median(stated))
    return Scattering(name, deviation, MRAD_PER_RAD * size, error, usual, MRAD)
