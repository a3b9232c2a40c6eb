"""How far an arm of a fleet has moved away from its last calibration, and how surely that is seen."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.nests import a_target_a_row
from tests.remastered import remastered
from truearm.fleet.drift import MOST_POSES, check_comparable, drift_of
from truearm.fleet.task import ArmTask, calibrate_arm
from truearm.simulation import VirtualArm

SHIFT_DEG = (0.0, 0.2, 0.0, 0.0)
CLEARLY = 0.9


@pytest.fixture(scope="module")
def scara():
    """A SCARA, its calibration, and those after joint 2 was mastered anew and after nothing happened."""
    arm = VirtualArm(ta.Robot.load("adept-cobra-600"), seed=5)
    data = [
        arm.measure(arm.poses(100), seed=1),
        remastered(arm, arm.poses(80, seed=3), SHIFT_DEG, seed=3),
        arm.measure(arm.poses(80, seed=4), seed=4),
    ]
    return [ta.calibrate(arm.robot, rows) for rows in data], data


def test_a_scara_whose_joint_was_mastered_anew_has_drifted_and_another_has_not(scara):
    (previous, moved, same), (_, rows, others) = scara
    assert drift_of(previous, moved, rows)["share_beyond"] > CLEARLY
    assert drift_of(previous, same, others)["share_beyond"] < 1.0 - CLEARLY


@pytest.mark.parametrize("moved", [False, True])
def test_where_an_update_knew_base_and_flange_and_the_new_calibration_does_not_nothing_has_drifted(moved):
    """A first joint that a kept frame told stands for a turn of the base where the frame is another."""
    arm = VirtualArm(ta.Robot.load("rv-m2"), seed=2)
    first = ta.calibrate(arm.robot, arm.measure(arm.poses(40)), model="constant")
    shift = np.array([0.3, 0.0, 0.0, 0.0, 0.2])
    new = remastered(arm, arm.poses(15, seed=9), shift, seed=9)
    previous = ta.update(first, new, keep_frame=True, keep_tool=True).calibration
    arm.world_from_base = lifted(0.5) @ arm.world_from_base
    rows = remastered(arm, arm.poses(40, seed=4), [0.3, 0.3 * moved, 0.0, 0.0, 0.2], seed=4)
    now = ta.calibrate(arm.robot, rows, model="constant")
    assert {"theta1", "theta5"} <= set(previous.constant.names) - set(now.constant.names)
    found = drift_of(previous, now, rows)
    assert (found["mean_mm"] > 0.8) == moved
    assert (found["share_beyond"] > 0.5) == moved
    assert bool(found["moved"]) == moved


def lifted(z_m):
    """A turned transform (4, 4) that lifts."""
    turned = np.eye(4)
    turned[:3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    turned[2, 3] = z_m
    return turned


def test_another_tool_flange_or_base_in_the_robot_file_is_no_drift(scara):
    (previous, _, same), (_, _, rows) = scara
    exact = drift_of(previous, same, rows)
    tool = {"tool": lifted(0.15)}
    shifted = previous.robot.flange @ lifted(0.1)
    flange = {"flange": shifted, "tool": np.linalg.inv(lifted(0.1)) @ previous.robot.tool}
    for changes in (tool, flange, {"base": lifted(0.5) @ previous.robot.base, "base_row": None}):
        other = replace(same, robot=replace(same.robot, **changes))
        found = drift_of(previous, other, rows)
        assert found["mean_mm"] == pytest.approx(exact["mean_mm"], rel=0.0 if "base" in changes else 0.5)
        assert found["share_beyond"] < 1.0 - CLEARLY


@pytest.mark.parametrize(
    ("frame", "mirrored", "words"),
    [
        ("world", False, r'made with frame "free".*with "world".*frame = "free", or leave its previous out'),
        ("free", True, "whose joints turn or are coupled otherwise"),
    ],
)
def test_calibrations_that_mean_something_else_are_not_compared(scara, frame, mirrored, words):
    previous = scara[0][0]
    robot = replace(previous.robot, coupling=(-1.0 if mirrored else 1.0) * previous.robot.coupling)
    check_comparable(previous, previous.robot, "free", "previous.calib")
    with pytest.raises(ta.InputError, match=words):
        check_comparable(previous, robot, frame, "previous.calib")


def test_without_measurements_the_bounds_of_the_standard_deviation_serve(scara):
    (previous, moved, _), (_, rows, _) = scara
    exact, stripped = (drift_of(one, moved, rows) for one in (previous, previous.without_rows()))
    assert stripped["std_mm"] > 1.1 * exact["std_mm"]
    assert stripped["mean_mm"] == pytest.approx(exact["mean_mm"])


def test_standard_deviations_are_asked_for_at_some_of_many_poses(scara, monkeypatch):
    (previous, _, _), (first, _, _) = scara
    many = first.select(np.arange(6 * MOST_POSES) % len(first))
    asked, exact = [], ta.Calibration.position_std

    def position_std(self, q, **more):
        asked.append(len(q))
        return exact(self, q, **more)

    monkeypatch.setattr(ta.Calibration, "position_std", position_std)
    assert drift_of(previous, previous, many)["poses"] == len(many)
    assert asked == [MOST_POSES, MOST_POSES]


def test_nests_in_rows_of_their_own_are_one_pose_of_the_drift(scara):
    (previous, _, _), (rows, _, _) = scara
    wide = replace(rows, targets=np.repeat(rows.targets, 3, axis=1))
    task = ArmTask(
        robot=previous.robot.to_dict(),
        data=a_target_a_row(wide),
        options=ta.CalibrationOptions(model="constant"),
        previous=previous.to_bytes(),
        previous_name="previous.calib",
        strip=True,
        with_report=False,
    )
    drift = calibrate_arm(task).drift
    assert drift is not None
    assert drift["poses"] == len(rows)
