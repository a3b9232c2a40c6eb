"""The NumPy peer of the kinematics: one expression for all poses, standard Denavit-Hartenberg links.

Coordinates come first, (3, n), so that every operation runs over whole columns of poses.
"""

import numpy as np


def poses(table, end, q, out):
    """base_from_end (n, 4, 4) of joint values q (n, L) for the table (L, 5); written to `out`."""
    axes, origin, _ = walk(table, q)
    for column in range(3):
        out[:, :3, column] = sum(end[k, column] * axes[k] for k in range(3)).T
    out[:, :3, 3] = shifted(axes, origin, end[:3, 3]).T
    out[:, 3] = [0.0, 0.0, 0.0, 1.0]
    return out


def jacobian(table, end, q, out):
    """Derivative (n, 3, 5 L) of the end's position with respect to all parameters; written to `out`."""
    axes, origin, pivots = walk(table, q)
    tip = shifted(axes, origin, end[:3, 3])
    for link, (z, x, y, before, after) in enumerate(pivots):
        columns = (cross(z, tip - before), z, x, cross(x, tip - after), cross(y, tip - after))
        for k, column in enumerate(columns):
            out[:, :, 5 * link + k] = column.T
    return out


def walk(table, q):
    """Axes and origin of the last link's frame, and of each link what its parameters turn about."""
    axes = list(np.repeat(np.eye(3)[:, :, None], len(q), 2))
    origin = np.zeros((3, len(q)))
    pivots = []
    for (theta, d, a, alpha, beta), joint in zip(table, q.T, strict=True):
        x, y, z = axes
        ct, st = np.cos(theta + joint), np.sin(theta + joint)
        ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
        before = origin
        x, y = ct * x + st * y, ct * y - st * x
        origin = origin + d * z + a * x
        y_turned, z_turned = ca * y + sa * z, ca * z - sa * y
        pivots.append((z, x, y_turned, before, origin))
        axes = [x, y_turned, z_turned]
        if beta:
            axes = [cb * x - sb * z_turned, y_turned, sb * x + cb * z_turned]
    return axes, origin, pivots


def shifted(axes, origin, point):
    return origin + sum(point[k] * axes[k] for k in range(3))


def cross(u, v):
    return np.stack([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])
