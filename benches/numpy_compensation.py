"""The NumPy peer of compensation: Newton on all waypoints at once, standard Denavit-Hartenberg links."""

import numpy as np

from benches import numpy_kinematics

STEPS = 3


def joints(nominal, table, end, q):
    """Joints (n, 6) at which `table` puts the end where `nominal` puts it at q (n, 6)."""
    target = numpy_kinematics.poses(nominal, end, q, np.zeros((len(q), 4, 4)))
    wanted, place = [target[:, :3, k].T for k in range(3)], target[:, :3, 3].T
    corrected = q.copy()
    for _ in range(STEPS):
        rotation, tip, jacobian = _linearised(table, end, corrected)
        turn = 0.5 * sum(numpy_kinematics.cross(rotation[k], wanted[k]) for k in range(3))
        error = np.concatenate([place - tip, turn]).T
        corrected += np.linalg.solve(jacobian, error[:, :, None])[:, :, 0]
    return corrected


def _linearised(table, end, q):
    """Axes and origin of the end, and its motion by the joints (n, 6, 6)."""
    axes, origin, pivots = numpy_kinematics.walk(table, q)
    tip = numpy_kinematics.shifted(axes, origin, end[:3, 3])
    rotation = [sum(end[k, column] * axes[k] for k in range(3)) for column in range(3)]
    jacobian = np.empty((len(q), 6, len(table)))
    for link, (z, _, _, before, _) in enumerate(pivots):
        jacobian[:, :3, link] = numpy_kinematics.cross(z, tip - before).T
        jacobian[:, 3:, link] = z.T
    return rotation, tip, jacobian
