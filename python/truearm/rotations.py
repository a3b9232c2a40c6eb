"""Rotations and rigid transforms between the notations of files.

Quaternions are w x y z and of unit length, matrices act on column vectors, all batches come first.
"""

import warnings
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truearm.errors import UsageError

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

UNIT_TOLERANCE: Final = 1e-3
UNIT_QUATERNIONS: Final = "Orientations are unit quaternions, w first"


def matrix_from_quaternion(quaternion_wxyz: ArrayLike) -> NDArray[np.float64]:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4), w first, of any length but zero."""
    given = np.asarray(quaternion_wxyz, dtype=np.float64)
    w, x, y, z = np.moveaxis(given / np.linalg.norm(given, axis=-1, keepdims=True), -1, 0)
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_from_matrix(matrix: ArrayLike) -> NDArray[np.float64]:
    """Quaternions (..., 4), w first and w >= 0, of rotation matrices (..., 3, 3)."""
    m = _own(matrix)
    return _wxyz(_rotation().from_matrix(m.reshape(-1, 3, 3))).reshape(*m.shape[:-2], 4)


def rotation_onto(direction: ArrayLike) -> NDArray[np.float64]:
    """A rotation matrix (3, 3) whose z axis is a unit vector (3,)."""
    return np.asarray(_rotation().align_vectors(np.asarray(direction), [0.0, 0.0, 1.0])[0].as_matrix())


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
    return _wxyz(_rotation().from_euler(sequence, _own(angles)))


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


def matrix_from_euler(angles: ArrayLike, sequence: str) -> NDArray[np.float64]:
    """Rotation matrices (3, 3) or (n, 3, 3) of Euler angles (3,) or (n, 3), as in quaternion_from_euler."""
    return np.asarray(_rotation().from_euler(sequence, _own(angles)).as_matrix())


def matrix_from_rotation_vector(vectors: ArrayLike) -> NDArray[np.float64]:
    """Rotation matrices (3, 3) or (n, 3, 3) of rotation vectors (3,) or (n, 3) in rad."""
    return np.asarray(_rotation().from_rotvec(_own(vectors)).as_matrix())


def rotation_vector_from_matrix(matrix: ArrayLike) -> NDArray[np.float64]:
    """Rotation vectors (3,) or (n, 3), rad, half a turn at the most, of matrices (3, 3) or (n, 3, 3)."""
    return np.asarray(_rotation().from_matrix(_own(matrix)).as_rotvec())


def euler_from_matrix(matrices: NDArray[np.float64], sequence: str) -> NDArray[np.float64]:
    """Euler angles (n, 3) in rad of rotation matrices (n, 3, 3), the middle one in its first half turn.

    Where the first and the third axis are parallel, which leaves one of their angles open, the third is zero.
    """
    return euler_from_rotation(_rotation().from_matrix(_own(matrices)), sequence)


def euler_from_rotation(rotation: "Rotation", sequence: str) -> NDArray[np.float64]:
    """As euler_from_matrix, of SciPy's rotations."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # parallel axes
        return np.asarray(rotation.as_euler(sequence))  # type: ignore[call-overload]  # a sequence by its letters


def quaternion_from_rotation_vector(vectors: ArrayLike) -> NDArray[np.float64]:
    """Quaternions (n, 4), w first, of rotation vectors (n, 3) in rad."""
    return _wxyz(_rotation().from_rotvec(_own(vectors)))


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


def _rotation() -> "type[Rotation]":
    """SciPy's rotations, which most commands do without."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - slow to import

    return Rotation


def _own(values: ArrayLike) -> NDArray[np.float64]:
    """A copy: SciPy before 1.18 takes no array that may not be written to, as the frames of robots are."""
    return np.array(values, dtype=np.float64)


def _wxyz(rotation: "Rotation") -> NDArray[np.float64]:
    q = np.atleast_2d(rotation.as_quat())[:, [3, 0, 1, 2]]
    return np.where(q[:, :1] < 0.0, -q, q)
