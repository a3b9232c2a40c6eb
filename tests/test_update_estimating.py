"""What an update finds when poses are left out, against the same found from the other poses alone."""

import numpy as np
import pytest

from truearm._core import Setup
from truearm.errors import WorkError
from truearm.updating.estimating import MOST_PARTS, Estimate, folds, left_out, posterior, solved, surprise
from truearm.updating.scattering import Scatter
from truearm.updating.scene import Linear, State

POSES = MOST_PARTS + 7
UNKNOWNS = 5
NOWHERE = Setup(np.eye(4)[None], np.zeros((1, 1, 3)), np.eye(3)[None], np.zeros((0, 3)))


@pytest.fixture(scope="module")
def scene():
    """Random rows of poses with two or three values each, one of five unknowns kept."""
    rng = np.random.default_rng(7)
    pose = np.repeat(np.arange(POSES), rng.integers(2, 4, POSES))
    root = rng.normal(size=(len(pose), len(pose) + 5))
    linear = Linear(
        rng.normal(size=len(pose)), rng.normal(size=(len(pose), UNKNOWNS)), rng.normal(size=UNKNOWNS), pose
    )
    return linear, root @ root.T / len(pose), rng.uniform(0.5, 2.0, UNKNOWNS), np.arange(UNKNOWNS) != 2


def estimated(linear, covariance, std, free):
    scatter = Scatter(covariance)
    return Estimate(State(np.zeros(0), NOWHERE), linear, posterior(linear, scatter, std, free), scatter)


def of_rows(linear, chosen):
    return Linear(linear.residual[chosen], linear.jacobian[chosen], linear.departure, linear.pose[chosen])


def test_steps_of_folds_are_those_of_the_other_poses_alone(scene):
    linear, covariance, std, free = scene
    seen = []
    for poses, step in folds(estimated(*scene), std, free):
        rest = ~np.isin(linear.pose, poses)
        alone = solved(of_rows(linear, rest), Scatter(covariance[np.ix_(rest, rest)]), std, free)
        np.testing.assert_allclose(step, alone, rtol=1e-9, atol=1e-12)
        assert step[~free] == 0.0
        seen += poses.tolist()
    assert sorted(seen) == list(range(POSES))


def test_left_out_residuals_are_predicted_by_their_folds(scene):
    linear, _, std, free = scene
    found = estimated(*scene)
    left = left_out(found, std, free)
    for poses, step in folds(found, std, free):
        out = np.isin(linear.pose, poses)
        np.testing.assert_allclose(left[out] + linear.jacobian[out] @ step, linear.residual[out])


def test_surprise_is_the_squared_distance_from_what_all_other_poses_predict(scene):
    linear, covariance, std, free = scene
    squares, freedom = surprise(estimated(*scene), std, free)
    scaled = linear.jacobian[:, free] * std[free]
    whole = covariance + scaled @ scaled.T
    value = linear.residual + linear.jacobian[:, free] @ linear.departure[free]
    for pose in range(POSES):
        own, rest = linear.pose == pose, linear.pose != pose
        gain = np.linalg.solve(whole[np.ix_(rest, rest)], whole[np.ix_(rest, own)]).T
        missed = value[own] - gain @ value[rest]
        spread = whole[np.ix_(own, own)] - gain @ whole[np.ix_(rest, own)]
        assert squares[pose] == pytest.approx(missed @ np.linalg.solve(spread, missed), rel=1e-8)
        assert freedom[pose] == own.sum()


def test_a_covariance_that_is_none_is_refused_with_the_way_out():
    with pytest.raises(WorkError, match="not positive definite") as refused:
        _ = Scatter(-np.eye(3)).precision
    assert "measured several times without noise" in str(refused.value)
