"""Visits to poses: what a model leaves of each, and how far noise lets them scatter, each and together."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.calibration import Calibration
from truearm.certainty.uncertainty import VariableSpread
from truearm.doubts.row_order import FEWEST_VISITS
from truearm.fits.fitted_rows import FittedRows
from truearm.fits.measured_parts import held_parts
from truearm.rows.evenly import some_rows
from truearm.rows.own_sigmas import of_all_targets, own_covariances
from truearm.rows.shots import Scatter
from truearm.rows.visits import fitted_poses, means, pose_numbers, visits_of
from truearm.types import AXES, Floats, Mask, Rows

MOST_VALUES: Final = 900
"""Coordinates at the most that are looked at: they tell enough, and their covariance is quick."""
MOST_TARGETS: Final = MOST_VALUES // (AXES * FEWEST_VISITS)
"""Targets at the most, those that most rows hold, so that enough visits are looked at."""
LEAST_APART: Final = 1e-6
"""Part of a shot's variance that visits to a pose differ by at the least: rows may be copies of others."""
SAME: Final = 1e-9
"""Part of two products below which what joints do not repeat looks as noise does."""


@dataclass(frozen=True, eq=False)
class Visits:
    """Visits to poses, v of them, each with the mean of its shots.

    Rows of one pose and set-up, whenever they were measured, took part in the fit as their mean: they share
    what the fit takes for noise of the pose. Of a pose whose rows hold different points those are looked at
    that hold as many as any, and the same.

    Attributes:
        rows: Place of the first row of each among the fitted rows (v,).
        pose: Place of the first row of its pose (v,).
        residual: Mean residual of its shots (v, m), m; zero where not measured.
        held: What was measured (v, m), of all visits to a pose the same.
        count: How many shots it has (v,).
        of_pose: How many its pose has (v,).
        weight: Weight of its rows in the fit (v,).
        stated: Covariance that rows of its pose state, their mean (v, m, m), base frame, m^2.
        own: Variance that the fit took each shot to have of its own beside, m^2.
        targets: Which of the fitted targets are looked at (t,), m = 3 t.
    """

    rows: Rows
    pose: Rows
    residual: Floats
    held: Mask
    count: Floats
    of_pose: Floats
    weight: Floats
    stated: Floats
    own: float
    targets: Rows

    @classmethod
    def of(cls, found: Calibration, fitted: FittedRows, progress: Floats, trusted: Mask) -> "Visits":
        """Those of `trusted` rows (n,), some where they are many, set-up after set-up."""
        parts = held_parts(fitted.data, found.selection)[:, :-1]
        targets = np.sort(np.argsort(-parts[trusted].sum(axis=0), kind="stable")[:MOST_TARGETS])
        held = np.repeat(parts[:, targets], AXES, axis=1)
        left = np.where(held, fitted.residual[:, columns_of(targets)], 0.0)
        pose = _poses(found, fitted)
        frames = found.models[found.model_name].setup.frames
        stated = means(own_covariances(fitted.data, found.groups, frames), pose)[pose]
        _, group = np.unique(fitted.data.group, return_inverse=True)
        order = np.lexsort((progress, group.reshape(-1)))
        order = order[(trusted & held.any(axis=1) & _fullest(held, pose))[order]]
        visits = visits_of(pose[order])
        _, first = np.unique(visits, return_index=True)
        some = some_rows(np.arange(len(first)), max(MOST_VALUES // held.shape[1], 1))
        rows = order[first[some]]
        return cls(
            rows,
            pose[rows],
            means(left[order], visits)[some],
            held[rows],
            np.bincount(visits)[some].astype(np.float64),
            np.bincount(pose[order])[pose[rows]].astype(np.float64),
            fitted.weight[rows],
            of_all_targets(stated[rows], len(targets)),
            _own(found, np.where(held, left, np.nan)[order], pose[order], stated[order]),
            targets,
        )

    def noise(self, of_row: Floats, joints: Floats) -> tuple[Floats, Floats]:
        """Covariance (v m, v m) of the means of shots, ones where not measured, and the variance (v, m) of a
        single shot.

        The mean of a pose's n shots has the covariance V that the fit took for it: shots share what the arm
        did not repeat and what no model holds. Visits of n_a shots differ by what they are seen to, D / n_a:
        two of one pose have `V - D / n` in common. No prediction tells visits to a pose apart, so that
        whatever D is, as much is left as the fit leaves.

        Args:
            of_row: Covariance of a row of each pose (v, m, m) beside what it states, as the fit took it.
            joints: Derivatives by the joint values (v, m, N).
        """
        size = of_row.shape[1]
        unit = np.eye(size)
        own = np.minimum(self.own, np.linalg.eigvalsh(of_row)[:, 0])[:, None, None] * unit + self.stated
        whole = of_row + self.stated
        apart, shots = self._apart(whole, joints), self.of_pose[:, None, None]
        in_common = whole - own * (1.0 - 1.0 / shots) - apart / shots
        each = np.arange(len(whole))
        noise = np.where(self._same[:, None, :, None], in_common[:, :, None], 0.0)
        noise[each, :, each] += apart / self.count[:, None, None]
        held = self.held.ravel()
        noise = np.where(held[:, None] & held, noise.reshape(held.size, held.size), np.eye(held.size))
        return noise, np.diagonal(whole, axis1=1, axis2=2)

    @property
    def _same(self) -> Mask:
        """Which visits (v, v) are to the same pose."""
        return np.asarray(self.pose[:, None] == self.pose)

    def _apart(self, whole: Floats, joints: Floats) -> Floats:
        """Covariance (v, m, m) of what visits of one shot are seen to differ by from others to their pose.

        It is a part of that of a single shot (v, m, m), and of what joints do not repeat, each as far as the
        others, carried to the targets; both parts by moments.
        """
        _, number, visits = np.unique(self.pose, return_inverse=True, return_counts=True)
        number = number.reshape(-1)
        counted = self.weight * (1.0 - 1.0 / visits[number])
        if not counted.any():
            return whole
        off = self.residual - means(self.residual, number, self.count)[number]
        both = self.held[:, :, None] & self.held[:, None]
        root = np.linalg.cholesky(np.where(both, whole, np.eye(whole.shape[1])))
        off = np.asarray(np.linalg.solve(root, off[:, :, None])[:, :, 0], dtype=np.float64)
        by = np.linalg.solve(root, joints)
        squares = self.weight * self.count @ np.square(off).sum(axis=1)
        of_joints = self.weight * self.count @ np.square(np.einsum("vm,vmj->vj", off, by)).sum(axis=1)
        values, turned = counted @ self.held.sum(axis=1), counted @ np.square(by).sum(axis=(1, 2))
        twice = counted @ np.square(by.transpose(0, 2, 1) @ by).sum(axis=(1, 2))
        of_shot, of_joint = _two_parts((values, turned, twice), (squares, of_joints))
        return of_shot * whole + of_joint * (joints @ joints.transpose(0, 2, 1))


def _two_parts(by: tuple[float, float, float], seen: tuple[float, float]) -> tuple[float, float]:
    """Factors a and b, none below zero, of `seen = (n a + t b, t a + u b)` with (n, t, u) given in `by`."""
    values, turned, twice = by
    left = values * twice - turned**2
    of_joint = max((values * seen[1] - turned * seen[0]) / left, 0.0) if left > SAME * values * twice else 0.0
    of_shot = (seen[0] - turned * of_joint) / values
    if of_shot < LEAST_APART:
        return LEAST_APART, max(seen[0] - values * LEAST_APART, 0.0) / turned if turned > 0.0 else 0.0
    return of_shot, of_joint


def columns_of(targets: Rows) -> Rows:
    """Columns of residuals, three a fitted target, of some of these (t,)."""
    return np.asarray((AXES * targets[:, None] + np.arange(AXES)).ravel())


def _poses(found: Calibration, fitted: FittedRows) -> Rows:
    """Place of the first row of each row's pose (n,), of those rows that the fit took for shots of it.

    Constants are fitted to each row: those of one pose are its shots.
    """
    if isinstance(found.spread, VariableSpread):
        return fitted_poses(found.spread.posterior, fitted.residual)
    return pose_numbers(fitted.data.readings, fitted.data.group)


def _fullest(held: Mask, pose: Rows) -> Mask:
    """Which rows (n,) hold (n, m) what the first of those does that hold most of their `pose` (n,)."""
    fullest_first = np.lexsort((-held.sum(axis=1), pose))
    _, place = np.unique(pose[fullest_first], return_index=True)
    _, number = np.unique(pose, return_inverse=True)
    return np.asarray((held == held[fullest_first[place]][number.reshape(-1)]).all(axis=1))


def _own(found: Calibration, left: Floats, pose: Rows, stated: Floats) -> float:
    """Variance, m^2, that shots have of their own beside what they state (n, 3, 3): what the fit took for it;
    of constants, what is seen in what is left (n, m) of each.
    """
    if isinstance(found.spread, VariableSpread):
        return float(found.spread.posterior.shot_variance[0])
    further = np.bincount(pose)[pose] - 1.0
    own = Scatter.of(left, pose).own
    stated_alike = np.trace(stated, axis1=1, axis2=2) / AXES
    return max(own - float(np.average(stated_alike, weights=further)), 0.0) if further.any() else 0.0
