"""Orientations that are noted in another way than stated: order and sense of quaternions, kinds of angles."""

from dataclasses import replace
from itertools import cycle, permutations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

import truearm as ta
from truearm.cli.calibrate import print_determined, suggest_next
from truearm.doubts.turning_sense import check_turns
from truearm.reporting.advice import advise
from truearm.reporting.facts import Facts
from truearm.rotations import quaternion_from_euler
from truearm.simulation import VirtualArm
from truearm.tables.euler_orders import VECTOR, otherwise_read, twin

QUATERNION = ["qw", "qx", "qy", "qz"]


def posed(seed=4, count=60):
    arm = VirtualArm(ta.Robot.load("ur10"), seed=seed)
    table = arm.measure_table(arm.poses(count), orientation=True)
    return arm.robot, table


def with_quaternions(table, quaternions):
    columns = dict(zip(QUATERNION, quaternions.T, strict=True))
    return ta.Measurements.from_dataframe(table.assign(**columns))


@pytest.mark.parametrize(
    ("order", "sense", "words"),
    [
        ([1, 2, 3, 0], 1.0, "qw qx qy qz hold x y z w"),
        ([3, 0, 1, 2], 1.0, "qw qx qy qz hold z w x y"),
        ([2, 3, 0, 1], -1.0, "hold y z w x, and they turn the other way"),
        ([0, 1, 2, 3], -1.0, "turn the other way: target_from_world"),
        ([1, 2, 3, 0], -1.0, "hold x y z w, and they turn the other way"),
    ],
)
def test_quaternions_in_another_order_or_sense_are_refused(order, sense, words):
    robot, table = posed()
    good = ta.Measurements.from_dataframe(table)
    ta.calibrate(robot, good, model="constant")
    found = table[QUATERNION].to_numpy() * [1.0, sense, sense, sense]
    wrong = with_quaternions(table, found[:, order])
    with pytest.raises(ta.InputError, match=f"{words}.*--use position"):
        ta.calibrate(robot, wrong, model="constant")
    calibration = ta.calibrate(robot, wrong, model="constant", use="position")
    assert calibration.validation.holdout["constant"].position.mean < 1.0
    with pytest.raises(ta.InputError, match=words):
        ta.evaluate(ta.calibrate(robot, good, model="constant"), wrong)


def test_every_order_of_a_quaternion_is_recognised():
    robot, table = posed()
    found = table[QUATERNION].to_numpy()
    check_turns(with_quaternions(table, found), robot)
    for order, sense in zip(permutations(range(4)), cycle((-1.0, 1.0)), strict=False):
        wrong = with_quaternions(table, (found * [1.0, sense, sense, sense])[:, order])
        said = " ".join("wxyz"[part] for part in order)
        told = "if they turn" if order == (0, 1, 2, 3) else f"hold {said}"
        with pytest.raises(ta.InputError, match=told) as caught:
            check_turns(wrong, robot)
        assert ("turn the other way" in str(caught.value)) == (sense < 0.0)
        assert ("the other sign of qx, qy and qz turns them" in str(caught.value)) == (sense < 0.0)
        assert ("truearm import --rotation" in str(caught.value)) == (order != (0, 1, 2, 3))


@pytest.mark.parametrize(
    ("meant", "taken"),
    [
        ("xyz", "XYZ"),
        ("XYZ", "xyz"),
        ("ZYX", "XYZ"),
        ("xyz", "zyx"),
        ("ZYZ", "ZYX"),
        ("XYZ", "rotation vector"),
        ("rotation vector", "XYZ"),
        ("rotation vector", "zyx"),
    ],
)
def test_angles_of_another_kind_are_recognised(meant, taken):
    """Numbers that a file has of one kind, imported as those of another; without large second numbers."""
    robot, table = posed(count=400)
    rotation = Rotation.from_quat(np.roll(table[QUATERNION].to_numpy(), -1, axis=1))
    numbers = rotation.as_rotvec() if meant == VECTOR else rotation.as_euler(meant)
    few = (np.abs(numbers[:, 1]) < np.pi / 2) & (np.linalg.norm(numbers, axis=1) < np.pi)
    made = Rotation.from_rotvec(numbers) if taken == VECTOR else Rotation.from_euler(taken, numbers)
    wrong = with_quaternions(table[few], np.roll(made.as_quat(), 1, axis=1)[few])
    named = rf"for ([\w ]+ are [\w ]+, or those for )*{taken} are {meant}\b"
    with pytest.raises(ta.InputError, match=named):
        check_turns(wrong, robot)


@pytest.mark.parametrize("order", ["XYZ", "zyx", "ZXZ"])
def test_angles_in_the_opposite_order_are_those_of_the_twin(order):
    angles = np.random.default_rng(2).uniform(-1.0, 1.0, (5, 3))
    twins = quaternion_from_euler(angles[:, ::-1], twin(order))
    assert quaternion_from_euler(angles, order) == pytest.approx(twins)


def test_orientations_in_an_unknown_convention_are_doubted(capsys):
    """They do not spoil the positions."""
    robot, table = posed()
    random = np.random.default_rng(1).normal(size=(len(table), 4))
    random /= np.linalg.norm(random, axis=1, keepdims=True)
    found = ta.calibrate(robot, with_quaternions(table, random))
    assert "convention of Euler angles" in str(
        next(notice for notice in found.notices if notice.kind == "orientation_misfit")
    )
    suggest_next(found, Path("found.calib"))
    suggested = capsys.readouterr().out
    assert "truearm report found.calib" in suggested
    assert "compensate" not in suggested
    alone = ta.calibrate(robot, ta.Measurements.from_dataframe(table), use="position")
    both = (calibration.validation.holdout["variable"].position.mean for calibration in (found, alone))
    assert next(both) < 1.2 * next(both)


@pytest.mark.parametrize("seed", range(12))
def test_an_arm_that_turns_about_one_axis_is_believed_wherever_it_stands(seed):
    rng = np.random.default_rng(seed)
    arm = VirtualArm(ta.Robot.load("adept-cobra-600"), seed=seed)
    table = arm.measure_table(arm.poses(40), orientation=True)
    station = Rotation.random(random_state=seed)
    turned = station * Rotation.from_quat(np.roll(table[QUATERNION].to_numpy(), -1, axis=1))
    points = station.apply(table[["x", "y", "z"]].to_numpy(copy=True)) + rng.normal(size=3)
    quaternions = np.roll(turned.as_quat(), 1, axis=1)
    elsewhere = table.assign(**dict(zip("xyz", points.T, strict=True)))
    check_turns(with_quaternions(elsewhere, quaternions), arm.robot)
    with pytest.raises(ta.InputError, match="do not turn as"):
        check_turns(with_quaternions(elsewhere, quaternions[:, [1, 2, 3, 0]]), arm.robot)


def test_an_arm_that_does_not_turn_its_tool_gives_no_frame_to_doubt():
    rng = np.random.default_rng(3)
    links = "".join(
        f'[[link]]\njoint = "prismatic"\nalpha = {alpha}\ntheta = {theta}\nd = 0.0\na = 0.0\n'
        for alpha, theta in ((-90.0, 0.0), (90.0, 90.0), (0.0, 0.0))
    )
    head = 'name = "gantry"\nconvention = "standard"\nlength_unit = "m"\nangle_unit = "deg"\n'
    gantry = ta.Robot.from_toml(head + links)
    q = rng.uniform(0.0, 1.0, (30, 3))
    station = Rotation.from_euler("xyz", [0.4, -0.7, 1.1])
    poses = station.as_matrix() @ gantry.pose(q)[:, :3, :3]
    quaternions = np.roll(Rotation.from_matrix(poses).as_quat(), 1, axis=1)
    columns = dict(zip(["q1", "q2", "q3"], q.T, strict=True))
    columns |= dict(zip("xyz", station.apply(gantry.position(q)).T, strict=True))
    table = pd.DataFrame(columns | dict(zip(QUATERNION, quaternions.T, strict=True)))
    check_turns(ta.Measurements.from_dataframe(table), gantry)


def test_orientations_that_no_instrument_measured_are_refused():
    robot, table = posed()
    for constant in ([1.0, 0.0, 0.0, 0.0], [0.5, -0.5, 0.5, 0.5]):
        wrong = with_quaternions(table, np.tile(constant, (len(table), 1)))
        with pytest.raises(ta.InputError, match=r"all 60 orientations are the same, while.*--use position"):
            ta.calibrate(robot, wrong, model="constant")


def test_what_is_not_turned_can_be_read_otherwise():
    still = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1))
    for _, _, other in otherwise_read(still):
        np.testing.assert_allclose(np.linalg.norm(other, axis=-1), 1.0)


def test_orientations_beside_several_targets_are_told_to_be_left_out():
    robot, table = posed(count=40)
    arm = VirtualArm(robot, seed=4)
    arm.target_in_flange = arm.target_in_flange + np.array([0.05, 0.08, -0.03])
    other = arm.measure_table(arm.poses(40), seed=1)
    both = ta.Measurements.from_dataframe(table.assign(**{f"{axis}2": other[axis] for axis in "xyz"}))

    def told(**more):
        found = ta.calibrate(robot, both, model="constant", **more)
        return [n.message for n in found.notices if n.kind == "orientations_left_out"]

    (message,) = told()
    assert message.startswith("Orientations of 40 rows are left out")
    assert told(use="targets") == told(use="pose") == []


def test_orientations_that_are_not_used_are_not_said_to_be_unmeasured(tmp_path, capsys):
    robot, table = posed()
    data = ta.Measurements.from_dataframe(table)
    found = ta.calibrate(robot, data, model="constant", use="position")
    found.save(tmp_path / "arm.calib")
    for calibration in (found, ta.Calibration.load(tmp_path / "arm.calib")):
        print_determined(calibration)
        assert "Orientation was not used (--use pose uses it): the tool's" in capsys.readouterr().out
        assert "orientation_not_used" in [advice.kind for advice in advise(Facts(calibration), None)]
    print_determined(ta.calibrate(robot, replace(data, orientations=None), model="constant"))
    assert "Orientation was not measured: " in capsys.readouterr().out
