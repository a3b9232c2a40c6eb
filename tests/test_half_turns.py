"""Poses half a turn from their seeds: no search stands still there, and limits say which way round."""

import numpy as np
import pytest

import truearm as ta
from truearm import Robot
from truearm._core import Solver
from truearm.solving import core_options, plain_model

COUNT = 100
# Of a hundred: some ways of redundant arms end where position and orientation hold each other up.
HELD_UP = 5


def solved(name, task, joint, turned):
    """How many poses are refused whose seeds are their solutions with one joint turned back."""
    robot = Robot.load(name)
    low, high = robot.finite_limits(1.0)
    seeds = low + (high - low) * np.random.default_rng(0).uniform(0.3, 0.7, (COUNT, robot.joint_count))
    goals = seeds.copy()
    goals[:, joint] += turned
    poses = robot.flange_chain.pose(np.ascontiguousarray(robot.joints_from_readings(goals)))
    options = core_options(robot, task, None, ta.Limits(joint_limits=False))
    solver = Solver(plain_model(robot), np.eye(4), options)
    found, _, refused = solver.solve(poses, seeds, [])
    good = np.isfinite(found).all(axis=1)
    reached = robot.flange_chain.pose(np.ascontiguousarray(robot.joints_from_readings(found[good])))
    met = [2, 3] if task == "axis" else [0, 1, 2, 3]
    assert np.abs(reached - poses[good])[:, :, met].max(initial=0.0) < 1e-6
    return len(refused), found[good] - seeds[good]


@pytest.mark.parametrize("turned", [np.pi, np.pi - 1e-3, 3.0])
@pytest.mark.parametrize(
    ("name", "task", "joint"),
    [
        ("adept-cobra-600", "pose", 3),
        ("rv-m2", "pose", 3),
        ("rv-m2", "pose", 4),
        ("rv-m2", "axis", 3),
        ("kuka-iiwa-7", "pose", 6),
        ("franka-panda", "pose", 6),
    ],
)
def test_searches_leave_half_a_turn_behind(name, task, joint, turned):
    refused, _ = solved(name, task, joint, turned)
    assert refused <= (HELD_UP if name == "kuka-iiwa-7" else 0)


def test_half_a_turn_goes_the_same_way_whatever_rounding_says():
    _, moved = solved("adept-cobra-600", "pose", 3, np.pi)
    # An arm that is nearly stretched may fold the other way.
    assert (np.sign(moved[:, 3]) == np.sign(moved[0, 3])).all()
    assert np.median(np.abs(moved[:, 3])) == pytest.approx(np.pi)


@pytest.mark.parametrize("begin", [-1.6, -0.4, 0.4, 1.6])
def test_half_a_turn_goes_the_way_that_limits_leave(begin):
    """The last joint of this arm turns by half a turn either way."""
    robot = Robot.load("rv-m2")
    seed = np.array([0.1, 0.5, -1.2, 0.3, begin])
    poses = robot.flange_chain.pose(np.array([seed, [*seed[:4], begin + np.pi]]))
    solver = Solver(plain_model(robot), np.eye(4), core_options(robot, "pose", None, ta.Limits()))
    wanted = begin - np.copysign(np.pi, begin)
    for seeds in (seed, np.array([seed, seed])):
        found, _, refused = solver.solve(poses, seeds, [])
        assert refused == []
        assert found[:, 4] == pytest.approx([begin, wanted])
