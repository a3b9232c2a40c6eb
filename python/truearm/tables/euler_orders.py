"""Orientations made from Euler angles or rotation vectors that were taken for those of another kind."""

from collections.abc import Iterator
from itertools import product
from typing import TYPE_CHECKING, Final

import numpy as np

from truearm.rotations import euler_from_rotation, quaternion_from_euler, quaternion_from_rotation_vector
from truearm.types import Floats
from truearm.units import FULL_TURN

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


USUAL: Final = ("XYZ", "ZYX", "ZYZ", "ZXZ")
ORDERS: Final = tuple("".join(axes) for axes in product("XYZ", repeat=3) if axes[0] != axes[1] != axes[2])
MOVING: Final = tuple(dict.fromkeys([*USUAL, *ORDERS]))
FIXED: Final = tuple(order.lower() for order in MOVING)
VECTOR: Final = "rotation vector"
LEAST_TURN: Final = 1e-12


def otherwise_read(quaternions: Floats) -> Iterator[tuple[list[str], str, Floats]]:
    """Orientations (n, 4), w first, as they are if the numbers that they were made from mean something else.

    About fixed axes the same turns have their angles in the opposite order (`twin`), so that moving axes
    stand for both in what the numbers were taken for, the usual ones first. Several numbers give one turn:
    both sets of Euler angles are tried, each for all orientations, and rotation vectors beyond half a turn.

    Yields:
        What they were taken for, k kinds, and what they are then: "XYZ" about moving axes, "xyz" about fixed
        ones, or "rotation vector"; and the quaternions (k, n, 4), w first.
    """
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - seldom needed, and slow to import

    rotation = Rotation.from_quat(quaternions[:, [1, 2, 3, 0]])
    read = [(taken, numbers) for taken in (*MOVING, VECTOR) for numbers in _numbers(rotation, taken)]
    for meant in (*FIXED, *MOVING):
        others = [(taken, numbers) for taken, numbers in read if taken != meant]
        angles = np.concatenate([numbers for _, numbers in others])
        yield _kinds(others), meant, _apart(quaternion_from_euler(angles, meant), len(others))
    others = [(taken, numbers) for taken, numbers in read if taken != VECTOR]
    others += [(twin(taken), numbers[:, ::-1]) for taken, numbers in others]
    vectors = np.concatenate([numbers for _, numbers in others])
    yield _kinds(others), VECTOR, _apart(quaternion_from_rotation_vector(vectors), len(others))


def usual_first(kinds: tuple[str, str]) -> tuple[int, int]:
    """A key to sort by: what numbers were taken for, then what they are; the usual kinds first."""
    taken, meant = kinds
    return (*MOVING, *FIXED, VECTOR).index(taken), (*FIXED, *MOVING, VECTOR).index(meant)


def _kinds(read: list[tuple[str, Floats]]) -> list[str]:
    return [taken for taken, _ in read]


def _apart(quaternions: Floats, count: int) -> Floats:
    """The quaternions (k, n, 4) of each of the k sets of numbers."""
    return quaternions.reshape(count, -1, 4)


def with_twin(taken: str, meant: str) -> list[tuple[str, str]]:
    """A way to read numbers otherwise, and the one that is the same for numbers in the opposite order."""
    if VECTOR in (taken, meant):
        return [(taken, meant)]
    return [(taken, meant), (twin(taken), twin(meant))]


def twin(order: str) -> str:
    """The order of Euler angles that makes the same of the same numbers in the opposite order."""
    return order[::-1].swapcase()


def _numbers(rotation: "Rotation", kind: str) -> tuple[Floats, Floats]:
    """Three numbers (n, 3), rad, that make the orientations, and three others."""
    if kind == VECTOR:
        vectors = rotation.as_rotvec()
        angle = np.linalg.norm(vectors, axis=1, keepdims=True)
        # What is not turned has no axis: a whole turn may be about any.
        turned = angle > LEAST_TURN
        axes = np.where(turned, vectors, [1.0, 0.0, 0.0]) / np.where(turned, angle, 1.0)
        return vectors, (angle - FULL_TURN) * axes
    first, middle, last = euler_from_rotation(rotation, kind).T
    other = -middle if kind[0] == kind[2] else np.pi - middle
    return (
        np.column_stack([first, middle, last]),
        np.column_stack([first + np.pi, other, last + np.pi]),
    )
