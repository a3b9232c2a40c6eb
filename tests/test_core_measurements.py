"""What the core does with measurements that no reader of files lets through."""

from typing import Any

import numpy as np
import pytest

from truearm._core import (
    Chain,
    CoreError,
    MeasurementSet,
    Problem,
    Setup,
    fit_constant,
    fit_field,
    identifiability,
)

LINKS = np.array(
    [
        [0.0, 0.4, 0.025, -np.pi / 2, 0.0],
        [0.0, 0.0, 0.455, 0.0, 0.0],
        [0.0, 0.0, 0.035, -np.pi / 2, 0.0],
        [0.0, 0.42, 0.0, np.pi / 2, 0.0],
        [0.0, 0.0, 0.0, -np.pi / 2, 0.0],
        [0.0, 0.08, 0.0, 0.0, 0.0],
    ]
)
COLUMNS = [k for k in range(30) if k % 5 != 4]
TARGET = np.array([0.05, 0.02, 0.1])
CHAIN = Chain("standard", ["revolute"] * 6, LINKS, np.eye(4), np.eye(4))
PRIOR = (2e-3, 2e-3, True)


def measured(q, **more):
    """A set of points at readings `q` (n, 6), or of what `more` says."""
    pose = CHAIN.pose(np.ascontiguousarray(q), LINKS + 2e-4)
    count = len(q)
    points = pose[:, :3, :3] @ TARGET + pose[:, :3, 3]
    points += np.random.default_rng(1).normal(scale=1e-5, size=points.shape)
    content: Any = {
        "joints": np.ascontiguousarray(q),
        "group": np.zeros(count, dtype=np.int64),
        "targets": points[:, None],
        "rotations": None,
        "sigma": np.zeros((count, 4)),
        "weight": np.ones(count),
        "distances": [],
    }
    return MeasurementSet(content | more)


def drawn(count):
    return np.random.default_rng(0).uniform(-2.0, 2.0, (count, 6))


def constants(problem):
    options: Any = {
        "prior": PRIOR,
        "noise": None,
        "robust": None,
        "start": None,
        "parameters": None,
        "threads": None,
    }
    return fit_constant(problem, options)


def field(problem, count, **more):
    options: Any = {
        "determined": list(range(len(COLUMNS))),
        "driven": list(range(len(COLUMNS))),
        "features": np.zeros((count, 0)),
        "feature_ranges": [],
        "payloads": [],
        "coupling": np.eye(len(LINKS)),
        "degree": 3,
        "prior": PRIOR,
        "hyper": None,
        "near": None,
        "contested": False,
        "rough": False,
        "threads": None,
    }
    return fit_field(problem, constants(problem), options | more)


@pytest.mark.parametrize("part", [np.zeros((3, 3)), 2.0 * np.eye(3), np.diag([1.0, 1.0, -1.0])])
def test_a_rotation_that_is_none_is_refused(part):
    q = drawn(40)
    with pytest.raises(CoreError, match="not rigid"):
        measured(q, rotations=np.tile(part, (40, 1, 1)))


def test_a_negative_distance_is_refused():
    q = drawn(40)
    with pytest.raises(CoreError, match="zero or more"):
        measured(q, targets=np.zeros((40, 0, 3)), distances=[(k, True, 0, -0.5) for k in range(40)])


def test_poses_that_hold_nothing_are_refused():
    with pytest.raises(CoreError, match="a target or more, or its orientation"):
        measured(drawn(6), targets=np.zeros((6, 0, 3)))


def test_a_distance_whose_other_end_is_left_out_takes_no_part():
    q, weight = drawn(80), np.ones(80)
    weight[60:] = 0.0
    reached = CHAIN.pose(q, LINKS)[:, :3, :3] @ TARGET + CHAIN.pose(q, LINKS)[:, :3, 3]

    def found(ends, off):
        distances = [(k, False, m, np.linalg.norm(reached[k] - reached[m]) + off(m)) for k, m in ends]
        more = {"targets": np.zeros((80, 0, 3)), "distances": distances, "weight": weight}
        return constants(Problem(CHAIN, measured(q, **more), COLUMNS)).parameters

    kept = [(k, (7 * k + 11) % 60) for k in range(60)]
    spoilt = found(kept + [(k, 60 + k % 20) for k in range(60)], lambda m: 0.05 * (m >= 60))
    np.testing.assert_allclose(spoilt, found(kept, lambda m: 0.0), atol=1e-12)


def test_configurations_go_together_beyond_the_data():
    q = 0.15 * drawn(40)
    problem = Problem(CHAIN, measured(q), COLUMNS)
    fitted = field(problem, 40).hyper
    lengths = {name: [0.4] * len(found) for name, found in fitted.items() if "length" in name}
    hyper = fitted | lengths | {"smooth": [3e-4] * 3, "own": [3e-4]}
    posterior = field(problem, 40, hyper=hyper).posterior
    far = q[0] + 2.0 * np.eye(6)[0]
    near = far + 0.05 * np.eye(6)[0]
    asked = np.array([far, far, near, q[0]])
    rows = np.tile(np.random.default_rng(0).normal(size=(3, len(COLUMNS))), (4, 1, 1))
    whole = posterior.joint_covariance(asked, rows).reshape(4, 3, 4, 3)
    each = posterior.covariance(asked, rows)
    np.testing.assert_allclose(whole[0, :, 1], each[0], rtol=1e-9)
    np.testing.assert_allclose(whole[0, :, 0], each[0], rtol=1e-9)
    alike = np.trace(whole[0, :, 2]) / np.trace(each[0])
    assert 0.9 < alike < 1.0
    np.testing.assert_allclose(
        posterior.cross_covariance(1, asked, rows), whole[0].reshape(3, 12)[:, 3:], rtol=1e-9
    )
    assert np.linalg.eigvalsh(whole.reshape(12, 12)).min() > -1e-9 * np.trace(each[0])


def test_arrays_of_another_shape_are_refused_whatever_their_length():
    q = drawn(40)
    posterior = field(Problem(CHAIN, measured(q), COLUMNS), 40).posterior
    rows = np.ones((6, 3, len(COLUMNS)))
    for shape in ((3, 12), (12, 3)):
        with pytest.raises(CoreError, match="inputs has shape"):
            posterior.covariance(q[:6].reshape(shape), rows)
    with pytest.raises(CoreError, match="jacobian has shape"):
        posterior.prior(q[:6], rows.reshape(6, len(COLUMNS), 3))


def test_a_field_is_not_fitted_to_distances():
    q = drawn(40)
    distances = [(k, True, 0, 1.0) for k in range(40)]
    problem = Problem(CHAIN, measured(q, targets=np.zeros((40, 0, 3)), distances=distances), COLUMNS)
    with pytest.raises(CoreError, match="points are needed"):
        field(problem, 40)


@pytest.mark.parametrize("shape", [(5, 5), (6, 7), (0, 0)])
def test_a_coupling_of_another_arm_is_refused(shape):
    problem = Problem(CHAIN, measured(drawn(40)), COLUMNS)
    with pytest.raises(CoreError, match=rf"shape \({shape[0]}, {shape[1]}\), it must be \(6, 6\)"):
        field(problem, 40, coupling=np.ones(shape))


def test_a_field_of_poses_that_nobody_trusts_is_fitted_all_the_same():
    problem = Problem(CHAIN, measured(drawn(80), weight=np.full(80, 1e-3)), COLUMNS)
    assert np.isfinite(field(problem, 80).evidence)


def test_poses_without_weight_determine_nothing():
    q = drawn(40)
    q[:12, 1:] = q[0, 1:]
    weight = np.zeros(40)
    weight[:12] = 1.0
    setup = Setup(np.eye(4)[None], TARGET[None, None], np.eye(3)[None], np.zeros((0, 3)))
    found = identifiability(Problem(CHAIN, measured(q, weight=weight), COLUMNS), LINKS, setup)
    alone = identifiability(Problem(CHAIN, measured(q[:12]), COLUMNS), LINKS, setup)
    assert found[0] == alone[0]
    assert found[2] == alone[2]
