"""What a fit has taken of its rows, where these leave frame and target open."""

import re
from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.xyzc import xyzc
from truearm.certainty.uncertainty import VariableSpread
from truearm.doubts.at_once import JOINT, STEP_KINDS, TARGET_SLIPPED, Left, Shape, likeliest_step
from truearm.doubts.slips import main_slips
from truearm.doubts.whitened import Whitened
from truearm.simulation import Imperfections, VirtualArm

ROWS = 60


def scara(_):
    return ta.Robot.load("adept-cobra-600")


def held(_):
    return ta.Robot.load("ur10")


def poses_of(arm, seed):
    """Those of an arm, of one with a wrist those that hold the tool vertical."""
    readings = arm.poses(ROWS, seed=seed)
    if arm.robot.joint_count == 6:
        readings[:, 3] = -np.pi / 2 - readings[:, 1] - readings[:, 2]
        readings[:, 4] = -np.pi / 2
    return readings


@pytest.mark.parametrize("robot", [scara, xyzc, held])
def test_no_more_is_taken_of_rows_than_there_is_of_them(robot, tmp_path):
    """Where rows leave frame and target open, the posterior is as wide as its prior."""
    arm = VirtualArm(robot(tmp_path), seed=1)
    found = ta.calibrate(arm.robot, arm.measure(poses_of(arm, 1)), refit=False, holdout=0.1)
    assert found.rows is not None
    seen = Whitened.of(found, found.rows, np.linspace(0.0, 1.0, len(found.rows.weight)))
    assert seen is not None
    assert np.linalg.eigvalsh(seen.taken).max() < 1.0 + 1e-6
    assert not set(STEP_KINDS) & {notice.kind for notice in found.notices}


@pytest.fixture(scope="module")
def ur10():
    return VirtualArm(ta.Robot.load("ur10"), seed=4, imperfections=Imperfections(share=0.0, noise_mm=0.02))


def there_and_back(poses):
    return np.concatenate([poses[:30], poses[29::-1]])


def twice(poses):
    return np.concatenate([poses[:30], poses[:30]])


def a_few_again(poses):
    return np.concatenate([poses, poses[::8]])


def looked_at(arm, readings, seed, sigma_mm=None, slips_from=None):
    """The largest eigenvalue of what a fit takes of rows, and its notices by their kinds; the target slips by
    0.5 mm from a row on.
    """
    data = arm.measure(readings, seed=seed)
    if slips_from is not None:
        slip = arm.true_pose(readings)[:, :3, :3] @ [0.4e-3, 0.0, 0.3e-3] @ arm.world_from_base[:3, :3].T
        slip[:slips_from] = 0.0
        data = replace(data, targets=data.targets + slip[:, None])
    sigma = None if sigma_mm is None else np.full(len(data), 1e-3 * sigma_mm)
    found = ta.calibrate(arm.robot, replace(data, sigma_m=sigma), refit=False, holdout=0.1)
    assert found.rows is not None
    seen = Whitened.of(found, found.rows, found.rows.data.rows / len(data))
    assert seen is not None
    return np.linalg.eigvalsh(seen.taken).max(), {notice.kind: str(notice) for notice in found.notices}, found


def rows_beside(said, first):
    """Whether a step is told to be where it is, between rows that took part in the fit."""
    before, behind = (int(number) for number in re.findall(r"row (\d+)", said))
    return before <= first < behind <= before + 2


@pytest.mark.parametrize("share", [0.0, 0.2])
@pytest.mark.parametrize("again", [there_and_back, a_few_again])
def test_poses_that_repeat_are_the_same_noise_as_in_the_fit(again, share):
    """Rows of a pose are fitted by their mean, whenever they were measured."""
    for seed in (1, 4, 5, 6):
        imperfections = Imperfections(share=share, noise_mm=0.02)
        arm = VirtualArm(ta.Robot.load("ur10"), seed=seed, imperfections=imperfections)
        most, notices, _ = looked_at(arm, again(arm.poses(40, seed=seed)), seed)
        assert most < 1.0 + 1e-6
        assert not set(STEP_KINDS) & set(notices)


def test_what_rows_state_is_on_the_scale_of_the_posterior():
    imperfections = Imperfections(share=0.5, noise_mm=0.03)
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1, imperfections=imperfections)
    most, notices, found = looked_at(arm, arm.poses(40, seed=1), 1, sigma_mm=0.02)
    assert found.variable is not None
    assert found.variable.inflation > 1.1
    assert most < 1.0 + 1e-6
    assert not set(STEP_KINDS) & set(notices)


@pytest.mark.parametrize("sigma_mm", [None, 0.02])
@pytest.mark.parametrize(("again", "first"), [(there_and_back, 42), (twice, 30), (a_few_again, 25)])
def test_a_slip_is_found_where_poses_repeat(ur10, again, first, sigma_mm):
    """Also exactly between two passes over the same poses."""
    _, notices, _ = looked_at(ur10, again(ur10.poses(40, seed=4)), 4, sigma_mm, slips_from=first)
    said = notices[TARGET_SLIPPED]
    assert rows_beside(said, first)
    how_far = re.search(r"by ([\d.]+) mm", said)
    assert how_far is not None
    assert float(how_far[1]) == pytest.approx(0.5, abs=0.1)


def test_rows_that_were_left_out_count_in_full_where_a_slip_is_looked_for(ur10):
    """The fit held the rows before the slip for outliers: what it made of the rest has to tell of them."""
    poses = there_and_back(ur10.poses(40, seed=5))
    _, notices, found = looked_at(ur10, poses, 5, slips_from=12)
    assert len(found.rows.outliers()) >= 5
    assert rows_beside(notices[TARGET_SLIPPED], 12)


def test_nothing_is_told_where_more_was_taken_than_there_is(ur10, monkeypatch):
    readings = ur10.poses(40, seed=4)
    _, _, found = looked_at(ur10, readings, 4)
    joint = VariableSpread.joint
    monkeypatch.setattr(VariableSpread, "joint", lambda *given: 2.0 * joint(*given))
    assert Whitened.of(found, found.rows, found.rows.data.rows / 40.0) is None
    assert main_slips(found, found.rows, found.rows.data.rows / 40.0) == []


def test_where_nothing_is_left_there_is_no_step():
    rng = np.random.default_rng(1)
    nothing = Left(np.zeros(60), np.eye(60), np.eye(60), np.repeat(np.arange(20), 3), 0.0, 50.0)
    with np.errstate(all="raise"):
        found = likeliest_step(nothing, rng.normal(size=(60, 2)), [Shape(JOINT, (0,), (0,))])
    assert found is None or found.chance == 1.0
