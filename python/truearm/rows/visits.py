"""Which rows are shots of one visit to a pose: read one after the other while the arm stood still."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truearm._core import Posterior, same_poses
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
    """Weighted mean of each value (n, ...) over those of a visit's rows that hold it, NaN where none does.

    All rows count alike without `weight` (n,).
    """
    given = np.ones(len(visits)) if weight is None else weight
    held = np.isfinite(values)
    sums, counts = np.zeros((2, visits.max() + 1, *values.shape[1:]))
    np.add.at(sums, visits, (np.where(held, values, 0.0).T * given).T)
    np.add.at(counts, visits, (held.T * given).T)
    return np.asarray(np.divide(sums, counts, out=np.full_like(sums, np.nan), where=counts > 0.0))


def one_row_a_visit(data: Measurements) -> Measurements:
    """The mean of each visit's rows, with the number of its first one; distances stay in rows as they are."""
    if holds_distances(data):
        return data
    return _one_row_each(
        data, visit_numbers(data.readings, np.char.add(np.char.add(data.sources, "\n"), data.group))
    )


def one_row_a_pose(data: Measurements) -> Measurements:
    """The mean of the rows of each pose, whenever they were measured."""
    _, number = np.unique(pose_numbers(data.readings, data.group), return_inverse=True)
    return _one_row_each(data, number.reshape(-1).astype(np.int64))


def _one_row_each(data: Measurements, numbers: Rows) -> Measurements:
    """The mean of the rows of each number (n,) from 0; else the first of them.

    A point is the mean of the rows that hold it. Where all rows state sigmas, each counts by its own.
    """
    _, first = np.unique(numbers, return_index=True)
    if len(first) == len(data):
        return data
    sigma, weight = data.sigma_m, None
    if sigma is not None:
        weight = 1.0 / np.square(sigma) if (sigma > 0.0).all() else np.ones(len(data))
    return replace(
        data.select(first),
        readings=means(data.readings, numbers),
        targets=means(data.targets, numbers, weight),
        orientations=_mean_orientations(data, numbers),
        sigma_m=_of_means(sigma, numbers, weight),
        sigma_axes_m=_of_means(data.sigma_axes_m, numbers, weight),
        sigma_rad=_of_means(data.sigma_rad, numbers),
    )


def _of_means(sigma: Floats | None, numbers: Rows, weight: Floats | None = None) -> Floats | None:
    """Standard deviations of the weighted means of each number's rows, from those of the rows (n, ...)."""
    if sigma is None:
        return None
    given = np.ones(len(numbers)) if weight is None else weight
    squares = np.zeros((numbers.max() + 1, *sigma.shape[1:]))
    np.add.at(squares, numbers, np.square((sigma.T * given).T))
    return np.asarray((np.sqrt(squares).T / np.bincount(numbers, given)).T)


def _mean_orientations(data: Measurements, numbers: Rows) -> Floats | None:
    """Mean of the orientations of each number's rows (n,), NaN where none holds one."""
    if data.orientations is None:
        return None
    oriented_first = np.argsort(~data.oriented, kind="stable")
    _, place = np.unique(numbers[oriented_first], return_index=True)
    like = data.orientations[oriented_first[place]][numbers]
    sign = np.where((data.orientations * like).sum(axis=1) < 0.0, -1.0, 1.0)
    mean = means(data.orientations * sign[:, None], numbers)
    return np.asarray(mean / np.linalg.norm(mean, axis=1)[:, None])


def fitted_poses(posterior: Posterior, residuals: Floats) -> Rows:
    """Place of the first row of each row's pose (n,), of those that a fit took for shots of it.

    Args:
        posterior: The fit's.
        residuals: What it leaves of its rows (n, m).
    """
    first = posterior.first_shots(residuals.size).reshape(residuals.shape)
    return np.asarray(first.min(axis=1) // residuals.shape[1], dtype=np.int64)
