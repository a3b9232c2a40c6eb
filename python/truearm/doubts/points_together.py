"""Rows that hold different targets of one pose are one row: the arm stood still while they were measured."""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.errors import Notice
from truearm.measurements import Measurements
from truearm.rows.used_distances import holds_distances
from truearm.rows.visits import means, visit_numbers
from truearm.types import Mask, Rows

KIND: Final = "points_together"


def points_together(data: Measurements) -> tuple[Measurements, list[Notice]]:
    """Rows after one another at the same readings, with different targets, as one row with all of these.

    What an arm misses anew at each pose all its targets share. As rows of their own they would vouch for one
    another, and the field would follow what the arm does not repeat. The row has the number, the further
    columns and the set-up of the first one, and the mean of the readings. Rows with distances, rows whose
    sigma differs, and all but one of those with an orientation stay rows of their own. A notice says so.

    Raises:
        InputError: If only some rows hold distances.
    """
    if data.target_count < 2 or holds_distances(data):
        return data, []
    number = _numbers(data)
    first = np.flatnonzero(np.diff(number, prepend=-1))
    if len(first) == len(data):
        return data, []
    words = (
        f"{len(data)} rows are {len(first)} poses: rows after one another that hold different targets at the "
        "same readings are taken together, and go by the number of the first."
    )
    joined = replace(
        data.select(first),
        readings=means(data.readings, number),
        targets=_gathered(data.targets, number),
        orientations=None if data.orientations is None else _gathered(data.orientations, number),
    )
    return joined, [Notice(KIND, words)]


def _numbers(data: Measurements) -> Rows:
    """Number of the joined row that each row becomes a part of (n,), in order."""
    kin = np.array(["\n".join(words) for words in zip(*_words(data), strict=True)])
    visits = visit_numbers(data.readings, kin)
    seen = _seen(data)
    goes_on = np.zeros(len(data), dtype=np.bool_)
    held = seen[0].copy()
    for row in range(1, len(data)):
        alike = visits[row] == visits[row - 1] and not (held & seen[row]).any() and held[:-1].any()
        goes_on[row] = alike and bool(seen[row, :-1].any())
        held = held | seen[row] if goes_on[row] else seen[row].copy()
    return np.cumsum(~goes_on) - 1


def _words(data: Measurements) -> list[list[str]]:
    """What rows that are taken together have alike, in words."""
    given = [data.sources, data.group]
    if data.purpose is not None:
        given.append(data.purpose)
    columns = [words.tolist() for words in given]
    stated = [sigma for sigma in (data.sigma_m, data.sigma_axes_m, data.sigma_rad) if sigma is not None]
    columns.extend([repr(sigma) for sigma in sigmas.tolist()] for sigmas in stated)
    return columns


def _seen(data: Measurements) -> Mask:
    """Which targets each row holds, and whether an orientation (n, T + 1)."""
    return np.column_stack([data.seen(), data.oriented])


def _gathered(values: NDArray[np.float64], number: Rows) -> NDArray[np.float64]:
    """Values (n, ...), of which the rows of one number hold each place once, as one row for each number."""
    gathered = np.full((number[-1] + 1, *values.shape[1:]), np.nan)
    held = np.isfinite(values)
    places = np.nonzero(held)
    gathered[(number[places[0]], *places[1:])] = values[held]
    return gathered
