"""Rotations between the notations of files."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from truearm.rotations import (
    euler_from_matrix,
    matrix_from_euler,
    matrix_from_quaternion,
    matrix_from_rotation_vector,
    quaternion_from_euler,
    quaternion_from_matrix,
    quaternion_from_rotation_vector,
    rotation_vector_from_matrix,
)
from truearm.types import Floats

COMPONENT = st.floats(-1.0, 1.0).map(lambda value: round(value, 6))
QUATERNIONS = arrays(np.float64, (3, 4), elements=COMPONENT).filter(
    lambda q: bool((np.linalg.norm(q, axis=1) > 0.1).all())
)
VECTORS = arrays(np.float64, (3, 3), elements=COMPONENT)


@given(QUATERNIONS)
def test_a_quaternion_turns_vectors_as_its_product_does(quaternions: Floats) -> None:
    vector = np.array([0.3, -0.7, 1.1])
    for q, matrix in zip(quaternions, matrix_from_quaternion(quaternions), strict=True):
        unit = q / np.linalg.norm(q)
        w, axis = unit[0], unit[1:]
        across = 2.0 * np.cross(axis, vector)
        np.testing.assert_allclose(matrix @ vector, vector + w * across + np.cross(axis, across), atol=1e-14)
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(matrix) == pytest.approx(1.0)


@given(QUATERNIONS)
def test_quaternions_come_back_from_matrices_with_w_first_and_positive(quaternions: Floats) -> None:
    back = quaternion_from_matrix(matrix_from_quaternion(quaternions))
    assert (back[:, 0] >= 0.0).all()
    unit = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    np.testing.assert_allclose(np.abs(np.sum(back * unit, axis=1)), 1.0, atol=1e-14)


@given(VECTORS)
def test_rotation_vectors_and_euler_angles_come_back(vectors: Floats) -> None:
    matrices = matrix_from_rotation_vector(vectors)
    np.testing.assert_allclose(rotation_vector_from_matrix(matrices), vectors, atol=1e-12)
    np.testing.assert_allclose(
        matrix_from_quaternion(quaternion_from_rotation_vector(vectors)), matrices, atol=1e-14
    )
    for sequence in ("ZYX", "xyz", "ZYZ"):
        angles = euler_from_matrix(matrices, sequence)
        np.testing.assert_allclose(matrix_from_euler(angles, sequence), matrices, atol=1e-12)
        np.testing.assert_allclose(
            matrix_from_quaternion(quaternion_from_euler(angles, sequence)), matrices, atol=1e-12
        )


def test_shapes_are_kept() -> None:
    many = np.tile([0.6, 0.0, 0.0, 0.8], (2, 5, 1))
    assert matrix_from_quaternion(many).shape == (2, 5, 3, 3)
    assert quaternion_from_matrix(matrix_from_quaternion(many)).shape == (2, 5, 4)
    assert matrix_from_quaternion(many[0, 0]).shape == (3, 3)


def test_arrays_that_may_not_be_written_to_are_taken() -> None:
    angles = np.array([[0.1, -0.2, 0.3]])
    matrices = matrix_from_euler(angles, "xyz")
    for values in (angles, matrices):
        values.flags.writeable = False
    turned = matrix_from_quaternion(quaternion_from_euler(angles, "xyz"))
    np.testing.assert_allclose(turned, matrices, atol=1e-14)
    np.testing.assert_allclose(matrix_from_quaternion(quaternion_from_matrix(matrices)), matrices, atol=1e-14)
    np.testing.assert_allclose(euler_from_matrix(matrices, "xyz"), angles, atol=1e-14)
    vectors = rotation_vector_from_matrix(matrices)
    vectors.flags.writeable = False
    np.testing.assert_allclose(matrix_from_rotation_vector(vectors), matrices, atol=1e-14)
    turned = matrix_from_quaternion(quaternion_from_rotation_vector(vectors))
    np.testing.assert_allclose(turned, matrices, atol=1e-14)
