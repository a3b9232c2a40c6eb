"""Rotations and rigid transforms between the notations of files.

Quaternions are w x y z and of unit length, matrices act on column vectors, all batches come first.
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from truearm.errors import UsageError

UNIT_TOLERANCE: Final = 1e-3


def matrix_from_quaternion(quaternion_wxyz: ArrayLike) -> NDArray[np.float64]:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4), w first."""
    q = np.asarray(quaternion_wxyz, dtype=np.float64)
    flat = q.reshape(-1, 4)[:, [1, 2, 3, 0]]
    return Rotation.from_quat(flat).as_matrix().reshape(*q.shape[:-1], 3, 3)


def quaternion_from_matrix(matrix: ArrayLike) -> NDArray[np.float64]:
    """Quaternions (..., 4), w first and w >= 0, of rotation matrices (..., 3, 3)."""
    m = np.asarray(matrix, dtype=np.float64)
    return _wxyz(Rotation.from_matrix(m.reshape(-1, 3, 3))).reshape(*m.shape[:-2], 4)


def rotation_onto(direction: ArrayLike) -> NDArray[np.float64]:
    """A rotation matrix (3, 3) whose z axis is a unit vector (3,)."""
    return np.asarray(Rotation.align_vectors(np.asarray(direction), [0.0, 0.0, 1.0])[0].as_matrix())


def rigid_motion(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Change (n, 3, 6) of points (n, 3) with a translation and a rotation vector about the origin."""
    jacobian = np.zeros((len(points), 3, 6))
    jacobian[:, :, :3] = np.eye(3)
    x, y, z = points.T
    jacobian[:, 0, 4], jacobian[:, 0, 5] = z, -y
    jacobian[:, 1, 3], jacobian[:, 1, 5] = -z, x
    jacobian[:, 2, 3], jacobian[:, 2, 4] = y, -x
    return jacobian


def quaternion_from_euler(angles: ArrayLike, sequence: str) -> NDArray[np.float64]:
    """Quaternions (n, 4), w first, of Euler angles (n, 3) in rad.

    Args:
        angles: One angle per letter of `sequence`, in its order.
        sequence: Three axes; capitals turn about the moving axes ("XYZ", intrinsic), small letters
            about the fixed ones ("xyz", extrinsic).

    Raises:
        UsageError: If the sequence is not three axes in one case, or repeats an axis next to itself.
    """
    check_euler_sequence(sequence)
    return _wxyz(Rotation.from_euler(sequence, np.asarray(angles, dtype=np.float64)))


def check_euler_sequence(sequence: str) -> None:
    """Raise UsageError unless `sequence` names three axes as quaternion_from_euler expects them."""
    one_case = sequence in (sequence.upper(), sequence.lower())
    known = len(sequence) == 3 and set(sequence.lower()) <= set("xyz")
    if not (one_case and known and sequence[0] != sequence[1] != sequence[2]):
        raise UsageError(
            f'"{sequence}" is no order of Euler angles',
            rule="Three axes, no axis twice in a row: capitals for moving axes (XYZ, intrinsic), "
            "small letters for fixed axes (xyz, extrinsic)",
        )


def quaternion_from_rotation_vector(vectors: ArrayLike) -> NDArray[np.float64]:
    """Quaternions (n, 4), w first, of rotation vectors (n, 3) in rad."""
    return _wxyz(Rotation.from_rotvec(np.asarray(vectors, dtype=np.float64)))


def transform_from_parts(xyz: ArrayLike, quaternion_wxyz: ArrayLike) -> NDArray[np.float64]:
    """Transform (4, 4) of a translation (3,) in m and a unit quaternion (4,), w first."""
    transform = np.eye(4)
    transform[:3, :3] = matrix_from_quaternion(quaternion_wxyz)
    transform[:3, 3] = xyz
    return transform


def rigid_inverse(transform: ArrayLike) -> NDArray[np.float64]:
    """tool_from_base (4, 4) of a rigid base_from_tool (4, 4)."""
    given = np.asarray(transform, dtype=np.float64)
    inverse = np.eye(4)
    inverse[:3, :3] = given[:3, :3].T
    inverse[:3, 3] = -given[:3, :3].T @ given[:3, 3]
    return inverse


def _wxyz(rotation: Rotation) -> NDArray[np.float64]:
    q = np.atleast_2d(rotation.as_quat())[:, [3, 0, 1, 2]]
    return np.where(q[:, :1] < 0.0, -q, q)
