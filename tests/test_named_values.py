"""Tables in memory whose numbers are taken by place: names that say another order or unit are not ignored."""

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from truearm.planning import AboveFloor, accessible
from truearm.simulation import VirtualArm
from truearm.streaming import CorrectionStream

READING = np.radians([[10.0, -80.0, 90.0, -90.0, -80.0, 5.0]])
NAMES = [f"q{number}" for number in range(1, 7)]
IN_DEGREES = pd.DataFrame(np.degrees(READING), columns=[f"{name}_deg" for name in NAMES])
IN_ORDER = pd.DataFrame(READING, columns=NAMES)
ROWS = [[0.0, 0.3, 0.0, -1.57], [0.0, 0.0, 0.3, 0.0]]


@pytest.fixture(scope="module")
def robot():
    return ta.Robot.load("ur10")


@pytest.mark.parametrize(
    "given",
    [
        IN_DEGREES,
        IN_ORDER[["q2", "q1", *NAMES[2:]]],
        IN_ORDER.rename(columns={"q3": "q3_deg"}),
        IN_ORDER.rename(columns={"q6": "q7"}),
        IN_ORDER.set_axis([f"Q{number}_mm" for number in range(1, 7)], axis=1),
        IN_ORDER.iloc[0, ::-1],
    ],
)
def test_readings_whose_names_say_another_order_or_unit_are_refused(robot, given):
    rule = r"They are taken by place, as q1 to q6 in rad and m\. .*from_dataframe.*to_numpy"
    with pytest.raises(ta.UsageError, match=f'columns of joint readings of UR10 are "[qQ].*{rule}'):
        robot.position(given)


@pytest.mark.parametrize(
    "given",
    [
        IN_ORDER,
        IN_ORDER.iloc[0],
        IN_ORDER.set_axis([f"q{number}_rad" for number in range(1, 7)], axis=1),
        IN_ORDER.set_axis(range(6), axis=1),
        IN_ORDER.set_axis(["pan", "lift", "elbow", "w1", "w2", "w3"], axis=1),
        IN_ORDER.to_numpy().tolist(),
        pd.Series(READING[0]),
    ],
)
def test_readings_in_order_or_without_names_of_joints_are_taken(robot, given):
    expected = robot.position(READING if np.ndim(given) == 2 else READING[0])
    np.testing.assert_array_equal(robot.position(given), expected)


def test_all_that_take_readings_look_at_their_names(robot):
    arm = VirtualArm(robot, seed=2)
    found = ta.calibrate(robot, arm.measure(arm.poses(40)), model="constant")
    compensator = ta.Compensator(found)
    target = robot.pose(READING)
    for call in (
        lambda: found.position(IN_DEGREES),
        lambda: found.solve(target, IN_DEGREES),
        lambda: compensator.joints(IN_DEGREES),
        lambda: compensator.correct(IN_DEGREES.iloc[0]),
        lambda: CorrectionStream(compensator).step(IN_DEGREES.iloc[0], 0.001),
        lambda: arm.measure(IN_DEGREES),
        lambda: accessible(robot, IN_DEGREES, [AboveFloor(0.0)]),
    ):
        with pytest.raises(ta.UsageError, match=r'"q1_deg", .*taken by place'):
            call()


@pytest.mark.parametrize(
    "names",
    [["a", "alpha", "d", "theta"], ["theta_deg", "d", "a", "alpha_deg"], ["theta", "d_mm", "a", "alpha"]],
)
def test_tables_of_links_whose_names_say_another_order_or_unit_are_refused(names):
    with pytest.raises(ta.UsageError, match=r"taken by place, as theta, d, a, alpha in rad and m\. Convert"):
        ta.Robot.from_table("bench", pd.DataFrame(ROWS, columns=names))


@pytest.mark.parametrize(
    "names", [["theta", "d", "a", "alpha"], ["Theta", "d_m", "a_m", "alpha_rad"], range(4)]
)
def test_tables_of_links_in_order_are_taken(names):
    named = ta.Robot.from_table("bench", pd.DataFrame(ROWS, columns=names))
    assert named == ta.Robot.from_table("bench", ROWS)
