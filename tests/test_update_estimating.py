"""What an update finds when poses are left out, against the others alone; and from rows without noise."""

import numpy as np
import pytest

import truearm as ta
from truearm._core import Setup
from truearm.errors import WorkError
from truearm.simulation import Imperfections, VirtualArm
from truearm.updating.estimating import (
    MOST_PARTS,
    Estimate,
    folds,
    left_out,
    posterior,
    solved,
    unexplained,
)
from truearm.updating.scattering import Scatter
from truearm.updating.scene import Linear, State
from truearm.updating.unsupported import LINEAR, surprise, unsupported

POSES = MOST_PARTS + 7
UNKNOWNS = 5
NOWHERE = Setup(np.eye(4)[None], np.zeros((1, 1, 3)), np.eye(3)[None], np.zeros((0, 3)))


def linear_of(residual, jacobian, departure, pose):
    """Values of poses that were visited once."""
    return Linear(residual, jacobian, departure, pose, pose, np.arange(len(pose)))


@pytest.fixture(scope="module")
def scene():
    """Random rows of poses with two or three values each, one of five unknowns kept."""
    rng = np.random.default_rng(7)
    pose = np.repeat(np.arange(POSES), rng.integers(2, 4, POSES))
    root = rng.normal(size=(len(pose), len(pose) + 5))
    residual, jacobian = rng.normal(size=len(pose)), rng.normal(size=(len(pose), UNKNOWNS))
    linear = linear_of(residual, jacobian, rng.normal(size=UNKNOWNS), pose)
    return linear, root @ root.T / len(pose), rng.uniform(0.5, 2.0, UNKNOWNS), np.arange(UNKNOWNS) != 2


def estimated(linear, covariance, std, free):
    scatter = Scatter(covariance)
    return Estimate(State(np.zeros(0), NOWHERE), linear, posterior(linear, scatter, std, free), scatter)


def of_rows(linear, chosen):
    return linear_of(linear.residual[chosen], linear.jacobian[chosen], linear.departure, linear.pose[chosen])


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
    poses, squares = surprise(*unexplained(estimated(*scene), std, free), linear.pose)
    assert poses.tolist() == list(range(POSES))
    scaled = linear.jacobian[:, free] * std[free]
    whole = covariance + scaled @ scaled.T
    value = linear.residual + linear.jacobian[:, free] @ linear.departure[free]
    for pose in range(POSES):
        own, rest = linear.pose == pose, linear.pose != pose
        gain = np.linalg.solve(whole[np.ix_(rest, rest)], whole[np.ix_(rest, own)]).T
        missed = value[own] - gain @ value[rest]
        spread = whole[np.ix_(own, own)] - gain @ whole[np.ix_(rest, own)]
        assert squares[pose] == pytest.approx(missed @ np.linalg.solve(spread, missed), rel=1e-8)


def spoilt(scene, reach):
    """The scene with values of four poses off, two of which hide each other, and unknowns of such a reach."""
    linear, covariance, std, free = scene
    residual = linear.residual.copy()
    for pose, off in ((3, 40.0), (11, -60.0), (12, 25.0), (30, 90.0)):
        residual[linear.pose == pose] += off
    spoilt = linear_of(residual, linear.jacobian / reach, np.zeros(UNKNOWNS), linear.pose)
    return spoilt, covariance, std, free


def taken_out_one_by_one(linear, covariance, std, free):
    """Poses that no other supports, all others estimated again without each."""
    out = list[int]()
    while True:
        rest = ~np.isin(linear.pose, out)
        found = estimated(of_rows(linear, rest), covariance[np.ix_(rest, rest)], std, free)
        alone = unsupported(found, std, free, 1)
        if not alone:
            return out
        out += alone


def test_poses_that_no_other_supports_are_those_found_by_estimating_without_each(scene):
    linear, covariance, std, free = spoilt(scene, 1e-3 * LINEAR)
    found = estimated(linear, covariance, std, free)
    one_by_one = taken_out_one_by_one(linear, covariance, std, free)
    assert {3, 11, 12, 30} <= set(one_by_one)
    assert unsupported(found, std, free, POSES) == one_by_one
    assert unsupported(found, std, free, 2) == one_by_one[:2]


def test_where_an_estimate_moves_far_it_is_made_again_before_others_are_judged(scene, monkeypatch):
    linear, covariance, std, free = spoilt(scene, 1.0)
    found = estimated(linear, covariance, std, free)
    (first,) = unsupported(found, std, free, POSES)
    rest = linear.pose != first
    alone = solved(of_rows(linear, rest), Scatter(covariance[np.ix_(rest, rest)]), std, free)
    moved = np.abs(alone - solved(linear, Scatter(covariance), std, free)).max()
    for share, count in ((0.999, 1), (1.001, 2)):
        monkeypatch.setattr("truearm.updating.unsupported.LINEAR", share * moved)
        assert len(unsupported(found, std, free, 2)) == count


def test_a_covariance_that_is_none_is_refused_with_the_way_out():
    with pytest.raises(WorkError, match="not positive definite") as refused:
        _ = Scatter(-np.eye(3)).precision
    assert "measured several times without noise" in str(refused.value)


def test_rows_without_noise_leave_the_prior_what_they_do_not_tell():
    exact, std, free = 1e-11, np.array([1.0, 1.0]), np.array([True, True])
    linear = linear_of(np.full(4, 2.0), np.ones((4, 2)), np.array([0.5, -0.5]), np.arange(4))
    scatter = Scatter(exact**2 * np.eye(4))
    found = posterior(linear, scatter, std, free)
    np.testing.assert_allclose(found, 0.5 * np.array([[1.0, -1.0], [-1.0, 1.0]]), atol=1e-9)
    np.testing.assert_allclose(solved(linear, scatter, std, free), [0.5, 1.5], atol=1e-9)


def test_computed_orientations_are_updated():
    computed = Imperfections(share=0.0, noise_mm=0.01, noise_mrad=0.0)
    arm = VirtualArm(ta.Robot.load("ur10"), seed=2, imperfections=computed)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(30), orientation=True), model="constant")
    shift = np.array([0.0, 0.1, 0.0, 0.0, 0.0, 0.0])
    table = arm.measure_table(arm.poses(15, seed=9) + np.radians(shift), seed=9, orientation=True)
    for joint, column in enumerate(arm.poses(15, seed=9).T, start=1):
        table[f"q{joint}"] = column
    found = ta.update(calibration, ta.Measurements.from_dataframe(table))
    assert found.verdict == "moved"
    assert found.offsets[1].change == pytest.approx(0.1, abs=1e-3)
    assert all(np.isfinite(offset.std) for offset in found.offsets if offset.std is not None)
