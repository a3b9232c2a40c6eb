"""Which rows are shots of one visit to a pose: read one after the other while the arm stood still."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truearm._core import same_poses
from truearm.measurements import Measurements
from truearm.rows.used_distances import holds_distances
from truearm.types import Floats, Rows


def pose_numbers(readings: Floats, kin: NDArray[np.str_]) -> Rows:
    """First row of each row's pose (n,): rows that were read at the same pose are shots of it.

    Args:
        readings: (n, N), rad or m.
        kin: File or set-up of each row (n,); a pose is of one of them.
    """
    _, names = np.unique(kin, return_inverse=True)
    found = same_poses(np.ascontiguousarray(readings), names.reshape(-1).astype(np.int64))
    return np.asarray(found, dtype=np.int64)


def pose_count(data: Measurements) -> int:
    """How many poses the rows are of: shots of a pose in a set-up count once."""
    return len(np.unique(pose_numbers(data.readings, data.group)))


def pose_counts(data: Measurements) -> tuple[int, ...]:
    """How many poses the rows of each file are of."""
    return tuple(pose_count(data.select(data.sources == file)) for file in data.files)


def visit_numbers(readings: Floats, kin: NDArray[np.str_]) -> Rows:
    """Number of each row's visit to a pose (n,), rows in the order of measuring.

    Rows after one another that were read at the same pose are one visit.

    Args:
        readings: (n, N), rad or m.
        kin: File or set-up of each row (n,); a visit is within one.
    """
    return visits_of(pose_numbers(readings, kin))


def visits_of(poses: Rows) -> Rows:
    """Number of each row's visit (n,), from the numbers of the rows' poses (n,) in the order of measuring."""
    return np.asarray(np.cumsum(np.diff(poses, prepend=-1) != 0) - 1, dtype=np.int64)


def means(values: Floats, visits: Rows, weight: Floats | None = None) -> Floats:
    """Weighted mean of the values (n, ...) of each visit's rows, all alike without `weight` (n,)."""
    given = np.ones(len(visits)) if weight is None else weight
    sums = np.zeros((visits.max() + 1, *values.shape[1:]))
    np.add.at(sums, visits, (values.T * given).T)
    return np.asarray((sums.T / np.bincount(visits, given)).T)


def one_row_a_visit(data: Measurements) -> Measurements:
    """The mean of each visit's rows, with the number of its first one; rows with distances stay as they are.

    Visits whose rows do not hold the same points stay as they are as well.
    """
    visits = visit_numbers(data.readings, np.char.add(np.char.add(data.sources, "\n"), data.group))
    seen = _seen(data)
    _, first = np.unique(visits, return_index=True)
    if holds_distances(data) or not (seen == seen[first][visits]).all():
        return data
    return _one_row_each(data, visits)


def one_row_a_pose(data: Measurements) -> Measurements:
    """The mean of the rows of each pose that hold the same points, whenever they were measured."""
    alike = np.column_stack([pose_numbers(data.readings, data.group), _seen(data)])
    _, number = np.unique(alike, axis=0, return_inverse=True)
    return _one_row_each(data, number.reshape(-1).astype(np.int64))


def _seen(data: Measurements) -> NDArray[np.bool_]:
    """Which targets each row holds, and last whether an orientation, if there are any."""
    return data.seen() if data.orientations is None else np.column_stack([data.seen(), data.oriented])


def _one_row_each(data: Measurements, numbers: Rows) -> Measurements:
    """The mean of the rows of each number (n,) from 0, which hold the same points; else the first of them."""
    _, first = np.unique(numbers, return_index=True)
    if len(first) == len(data):
        return data
    orientations = data.orientations
    if orientations is not None:
        sign = np.where((orientations * orientations[first][numbers]).sum(axis=1) < 0.0, -1.0, 1.0)
        mean = means(orientations * sign[:, None], numbers)
        orientations = mean / np.linalg.norm(mean, axis=1)[:, None]
    sigma = data.sigma_m
    if sigma is not None:
        sigma = np.sqrt(means(np.square(sigma), numbers) / np.bincount(numbers))
    shown = data.select(first)
    return replace(
        shown,
        readings=means(data.readings, numbers),
        targets=means(data.targets, numbers),
        orientations=orientations,
        sigma_m=sigma,
    )
