"""Updates that measure less than the calibration knows: what was not measured stays with the tool."""

import numpy as np
import pytest

import truearm as ta
from tests.remastered import remastered_table
from tests.test_update_targets import with_targets
from truearm.rotations import matrix_from_quaternion
from truearm.simulation import VirtualArm

SHIFT_DEG = np.array([0.0, 0.3, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def arm():
    return VirtualArm(ta.Robot.load("rv-m2"), seed=4)


def calibrated(arm, model):
    return ta.calibrate(arm.robot, arm.measure(arm.poses(30, seed=1), orientation=True), model=model)


@pytest.fixture(scope="module")
def known(arm):
    return calibrated(arm, "constant")


def moved(arm, seed, *, orientation=False, tool_mm=(0.0, 0.0, 0.0)):
    """Rows after joint 2 was re-mastered."""
    table = remastered_table(arm, arm.poses(15, seed=seed), SHIFT_DEG, seed=seed, tool_mm=tool_mm)
    if orientation:
        turned = arm.measure_table(
            arm.poses(15, seed=seed) + np.radians(SHIFT_DEG), seed=seed, orientation=True
        )
        table[["qw", "qx", "qy", "qz"]] = turned[["qw", "qx", "qy", "qz"]]
    return ta.Measurements.from_dataframe(table)


def of_kind(found, kind="not_measured"):
    return [notice.message for notice in found.notices if notice.kind == kind]


@pytest.mark.parametrize("model", ["constant", pytest.param("variable", marks=pytest.mark.slow)])
def test_positions_alone_leave_the_orientation_of_the_target_known(model, arm, known):
    calibration = known if model == "constant" else calibrated(arm, model)
    found = ta.update(calibration, moved(arm, 21))
    assert of_kind(found) == [
        'Not measured now: the orientation of the target. In "data" it is taken to be as it was.'
    ]
    once = ta.Calibration.from_bytes(found.calibration.to_bytes(), where="once")
    q = arm.poses(3, seed=3)
    ratios = once.pose_std(q, target=1)[:, 3:] / calibration.pose_std(q, target=1)[:, 3:]
    assert 0.8 < ratios.min() < ratios.max() < 3.0
    true = arm.measure_table(q + np.radians(SHIFT_DEG), orientation=True, seed=5)
    turned = matrix_from_quaternion(true[["qw", "qx", "qy", "qz"]].to_numpy())
    assert np.abs(once.pose(q, group="data", target=1)[:, :3, :3] - turned).max() < 2e-3


def test_orientations_count_again_in_the_next_update(arm, known):
    turned = moved(arm, 22, orientation=True)
    second = ta.update(ta.update(known, moved(arm, 21)).calibration, turned, use="pose")
    direct = ta.update(known, turned)
    assert not of_kind(second)
    assert second.verdict == "holds"
    assert second.calibration.measured.orientations.tolist() == [15]
    q = arm.poses(5, seed=3)
    again, alone = (found.calibration.pose_std(q, target=1) for found in (second, direct))
    np.testing.assert_allclose(again, alone, rtol=0.1)


def test_a_tool_that_is_new_or_moved_takes_its_orientation_with_it(arm, known):
    for found in (
        ta.update(known, moved(arm, 21), new_tool=True),
        ta.update(known, moved(arm, 21, tool_mm=(3.0, 0.0, 0.0))),
    ):
        assert "it is no longer known" in of_kind(found)[0]
        with pytest.raises(ta.WorkError, match="orientation of the target"):
            found.calibration.pose(arm.poses(1), group="data", target=1)
        again = ta.update(found.calibration, moved(arm, 22, orientation=True))
        assert again.calibration.measured.orientations.tolist() == [15]


def test_one_target_of_three_leaves_the_others_where_they_were():
    arm = VirtualArm(ta.Robot.load("rv-m2"), seed=3)
    calibration = ta.calibrate(arm.robot, with_targets(arm, 40, 1), model="constant")
    arm.target_in_flange = np.array([-0.06, 0.01, 0.08])
    table = arm.measure_table(arm.poses(15, seed=9), seed=9)
    second = ta.Measurements.from_dataframe(
        table.rename(columns={"x": "x2", "y": "y2", "z": "z2"}).assign(x=np.nan, y=np.nan, z=np.nan)
    )
    found = ta.update(calibration, second)
    assert of_kind(found)[0].startswith("Not measured now: target 1, target 3.")
    assert found.calibration.measured.targets.tolist() == [[40, 15, 40]]
    q = arm.poses(4, seed=3)
    for target in (1, 2, 3):
        apart = found.calibration.position(q, target=target) - calibration.position(q, target=target)
        assert np.abs(apart).max() < 1e-3
    whole = ta.update(found.calibration, with_targets(arm, 12, 11))
    assert whole.verdict == "holds"
    assert whole.calibration.measured.targets.tolist() == [[12, 12, 12]]
