"""The peer of the constant calibration: the same model in vectorised NumPy, for SciPy to minimise.

Coordinates come first, (3, n), so that every operation runs over whole columns of poses.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation


@dataclass(frozen=True)
class Model:
    """world_from_base . A1 ... AN . point, with some of the links' parameters unknown."""

    joints: np.ndarray  # (n, N) Denavit-Hartenberg values
    measured: np.ndarray  # (n, 3)
    table: np.ndarray  # (N, 5) nominal
    columns: list[int]  # unknown parameters, 5 * link + (theta, d, a, alpha, beta)
    world_from_base: np.ndarray  # (4, 4) to start from
    point: np.ndarray  # (3,) to start from

    def start(self):
        """Unknowns: parameters, translation, rotation vector added from the left, point."""
        translation = self.world_from_base[:3, 3]
        return np.concatenate([self.table.ravel()[self.columns], translation, np.zeros(3), self.point])

    def residuals(self, unknowns):
        return self._run(unknowns, None)

    def jacobian(self, unknowns):
        jacobian = np.empty((len(unknowns), 3, len(self.joints)))
        self._run(unknowns, jacobian)
        return jacobian.reshape(len(unknowns), -1).T

    def minimise(self):
        """SciPy's Levenberg-Marquardt (MINPACK) with the analytic Jacobian."""
        return least_squares(self.residuals, self.start(), self.jacobian, method="lm", x_scale="jac")

    def _run(self, unknowns, jacobian):
        arm = len(self.columns)
        table = self.table.ravel().copy()
        table[self.columns] = unknowns[:arm]
        translation, turn, point = np.split(unknowns[arm:], 3)
        rotation = Rotation.from_rotvec(turn).as_matrix() @ self.world_from_base[:3, :3]
        axes = [np.repeat(column[:, None], len(self.joints), 1) for column in rotation.T]
        pivots = []
        origin = translation[:, None]
        for link, row in enumerate(table.reshape(-1, 5)):
            axes, origin, pivot = _step(axes, origin, row, self.joints[:, link])
            pivots.append(pivot)
        tip = origin + axes[0] * point[0] + axes[1] * point[1] + axes[2] * point[2]
        if jacobian is not None:
            self._columns(jacobian, pivots, tip, axes)
            jacobian[arm : arm + 3] = np.eye(3)[:, :, None]
            arms = tip - translation[:, None]
            for k, axis in enumerate(_left_jacobian(turn).T):
                jacobian[arm + 3 + k] = _cross(axis[:, None], arms)
            jacobian[arm + 6 :] = axes
        return (tip - self.measured.T).ravel()

    def _columns(self, jacobian, pivots, tip, axes):
        for k, column in enumerate(self.columns):
            link, kind = divmod(column, 5)
            z, x, y, before, after = pivots[link]
            if kind == 0:
                jacobian[k] = _cross(z, tip - before)
            elif kind in (1, 2):
                jacobian[k] = z if kind == 1 else x
            else:
                jacobian[k] = _cross(x if kind == 3 else y, tip - after)


def _step(axes, origin, row, joint):
    """Axes and origin behind a link, and what its columns turn about and shift along."""
    theta, d, a, alpha, beta = row
    x, y, z = axes
    ct, st = np.cos(theta + joint), np.sin(theta + joint)
    x, y = ct * x + st * y, ct * y - st * x
    after = origin + d * z + a * x
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    turned_y, turned_z = ca * y + sa * z, ca * z - sa * y
    pivot = (z, x, turned_y, origin, after)
    if sb == 0.0:
        return [x, turned_y, turned_z], after, pivot
    return [cb * x - sb * turned_z, turned_y, sb * x + cb * turned_z], after, pivot


def _cross(u, v):
    return np.stack([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])


def _left_jacobian(turn):
    """What a change of a rotation vector turns the world about (3, 3)."""
    angle = np.linalg.norm(turn)
    cross = np.array([[0, -turn[2], turn[1]], [turn[2], 0, -turn[0]], [-turn[1], turn[0], 0]])
    if angle < 1e-6:
        return np.eye(3) + cross / 2.0
    first = (1.0 - np.cos(angle)) / angle**2
    return np.eye(3) + first * cross + (angle - np.sin(angle)) / angle**3 * cross @ cross
