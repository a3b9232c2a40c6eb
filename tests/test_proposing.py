"""Poses that a calibration proposes: those that teach it most, and those that check it best."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.remastered import remastered
from truearm._core import CoreError, choose_informative
from truearm.proposing import Candidates, acceptance_poses, expected_by_update, next_poses
from truearm.proposing.acceptance import standard_errors
from truearm.simulation import VirtualArm
from truearm.updating import UpdateOptions


@pytest.fixture(scope="module")
def known():
    arm = VirtualArm.paper(seed=2)
    poses = arm.poses(40)
    poses[:, 0] = 0.3 * poses[:, 0]
    return arm, ta.calibrate(arm.robot, arm.measure(poses))


@pytest.fixture(scope="module")
def proposed(known):
    arm, calibration = known
    candidates, workspace = Candidates(calibration, arm.poses(80, seed=2)), arm.poses(40, seed=3)
    return candidates, workspace, next_poses(candidates, workspace, 6)


def test_the_expected_error_falls_with_each(proposed):
    candidates, _, found = proposed
    assert len(found.rows) == len(set(found.rows.tolist())) == 6
    assert len(found.expected_mm) == 7
    assert (np.diff(found.expected_mm) < 0.0).all()
    turned = np.abs(candidates.readings[found.rows, 0])
    measured = np.abs(candidates.calibration.rows.data.readings[:, 0]).max()
    assert turned[0] > measured


def test_the_first_is_the_best_single_one(proposed):
    candidates, workspace, found = proposed
    alone = [
        next_poses(Candidates(candidates.calibration, candidates.readings[k : k + 1]), workspace, 1)
        for k in range(0, len(candidates), 4)
    ]
    assert min(each.expected_mm[1] for each in alone) >= found.expected_mm[1] * (1.0 - 1e-9)


def test_the_expected_error_is_that_of_one_gaussian_update(proposed):
    """One Gaussian update of the joint covariance, written out."""
    candidates, workspace, found = proposed
    calibration, row = candidates.calibration, int(found.rows[0])
    joint = candidates.covariance(Candidates(calibration, workspace))
    size = 3 * len(candidates)
    own = joint[3 * row : 3 * row + 3, 3 * row : 3 * row + 3] + candidates.noise[row]
    cross = joint[size:, 3 * row : 3 * row + 3]
    left = joint[size:, size:] - cross @ np.linalg.solve(own, cross.T)
    wanted = 1e3 * np.sqrt(np.trace(left) / len(workspace))
    np.testing.assert_allclose(found.expected_mm[1], wanted, rtol=1e-9)


def test_a_workspace_of_one_pose_may_be_its_readings(known, proposed):
    calibration = known[1]
    candidates, workspace, _ = proposed
    alone, one = next_poses(candidates, workspace[0], 2), next_poses(candidates, workspace[:1], 2)
    np.testing.assert_array_equal(alone.expected_mm, one.expected_mm)
    group = calibration.groups[0]
    std = calibration.position_std(workspace[0], group=group)
    assert alone.expected_mm[0] == pytest.approx(1e3 * np.linalg.norm(std), rel=1e-6)


def test_what_is_expected_of_an_update_comes_true(known):
    arm, _ = known
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(40), orientation=True), model="constant")
    candidates, workspace = Candidates(calibration, arm.poses(10, seed=2)), arm.poses(20, seed=3)
    before, after = expected_by_update(candidates, workspace, calibration)
    assert before == pytest.approx(next_poses(candidates, workspace, 1).expected_mm[0])
    found = ta.update(calibration, arm.measure(candidates.readings, orientation=True, seed=4))
    then = replace(candidates, readings=workspace, calibration=found.calibration)
    assert after == pytest.approx(expected_by_update(then, workspace, calibration)[0], rel=0.02)
    few = replace(candidates, readings=candidates.readings[:2])
    assert len(expected_by_update(few, workspace, calibration)) == 1
    rows = arm.measure(arm.poses(10, seed=5), orientation=True, seed=5)
    assert len(expected_by_update(few, workspace, calibration, [rows])) == 2


def test_proposed_poses_teach_more_than_as_many_random_ones(known, proposed):
    calibration = known[1]
    candidates, workspace, found = proposed
    rng = np.random.default_rng(1)
    for _ in range(3):
        drawn = candidates.readings[rng.permutation(len(candidates))[:6]]
        expected = next_poses(Candidates(calibration, drawn), workspace, 6).expected_mm[-1]
        assert found.expected_mm[-1] < expected


def test_acceptance_poses_lie_apart_and_notice_small_changes(known):
    arm, calibration = known
    candidates = Candidates(calibration, arm.poses(120, seed=2))
    found = acceptance_poses(candidates, 10)
    assert len(set(found.rows.tolist())) == 10
    assert (np.diff(found.information) > 0.0).all()
    points = candidates.points[found.rows]
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)[np.triu_indices(10, 1)]
    drawn = acceptance_poses(Candidates(calibration, candidates.readings[:10]), 10)
    assert apart.min() > 0.05
    assert found.information[-1] > drawn.information[-1]
    assert set(found.noticed) >= {"joint2", "joint3", "joint4"}
    shift = np.zeros(5)
    shift[2] = 1.5 * found.noticed["joint3"]
    told = ta.update(calibration, remastered(arm, candidates.readings[found.rows], shift, seed=8))
    assert told.offsets[2].moved


def test_a_change_of_the_tool_is_noticed_from_what_is_told_on():
    """The last joint of a target on its axis is not told, and takes nothing from what is told of the tool."""
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(80)), model="constant")
    candidates = Candidates(calibration, arm.poses(60, seed=2))
    found = acceptance_poses(candidates, 12)
    update = ta.update(calibration, arm.measure(candidates.readings[found.rows], seed=4))
    std_mm = max(update.tools[0].shift_std_mm[0])
    assert 1.0 < found.noticed["tool"] / std_mm < 12.0


@pytest.mark.parametrize("freedom", [1, 4, 9])
def test_a_change_of_so_many_standard_errors_is_noticed_in_95_of_100_cases(freedom):
    random, known = np.random.default_rng(0), 20
    drawn, scale = random.normal(size=(40_000, freedom)), random.chisquare(known, 40_000) / known
    limit = np.quantile(np.square(drawn).sum(axis=1) / scale, 0.99)
    drawn[:, 0] += standard_errors(freedom, 0.01, known)
    assert abs((np.square(drawn).sum(axis=1) / scale > limit).mean() - 0.95) < 0.01
    assert standard_errors(freedom, 0.96, known) == 0.0


def test_what_is_noticed_hardly_depends_on_how_far_things_may_have_moved(known):
    candidates = Candidates(known[1], known[0].poses(60, seed=2))
    usual = acceptance_poses(candidates, 12)
    loose = acceptance_poses(candidates, 12, UpdateOptions(offset_deg=4.0, tool_mm=20.0))
    for name in ("joint2", "joint3"):
        assert 0.8 < loose.noticed[name] / usual.noticed[name] < 1.5


def test_a_model_of_constants_proposes_as_well(known):
    arm, _ = known
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(30), orientation=True), model="constant")
    candidates = Candidates(calibration, arm.poses(30, seed=2))
    assert candidates.noise.shape == (30, 6, 6)
    found = next_poses(candidates, arm.poses(20, seed=3), 3)
    assert (np.diff(found.expected_mm) < 0.0).all()
    assert len(acceptance_poses(candidates, 4).rows) == 4


def test_poses_show_what_their_set_up_shows(known):
    """Another set-up's orientations, and targets, are none of its own."""
    arm, _ = known
    turned = arm.measure_table(arm.poses(40), orientation=True).assign(group="A")
    plain = arm.measure_table(arm.poses(40, seed=3), seed=3).assign(group="B")
    tables = [ta.Measurements.from_dataframe(table, name=table.group[0]) for table in (turned, plain)]
    both = ta.calibrate(arm.robot, tables, model="constant")
    in_a, in_b = (Candidates(both, arm.poses(60, seed=2), group=group) for group in "AB")
    assert (in_a.shown, in_b.shown) == ("1 target with orientation", "1 target without orientation")
    assert (in_a.noise.shape[1], in_b.noise.shape[1]) == (6, 3)
    found = acceptance_poses(in_b, 12)
    after = next_poses(in_b, arm.poses(20, seed=3), 3)
    assert (np.diff(after.expected_mm) < 0.0).all()
    measured = arm.measure_table(in_b.readings[found.rows], seed=4).assign(group="B")
    update = ta.update(both, ta.Measurements.from_dataframe(measured))
    told = {f"joint{offset.joint}": offset.std for offset in update.offsets if offset.told}
    assert set(found.noticed) == {*told, "tool"}
    assert all(4.0 < found.noticed[name] / std < 8.0 for name, std in told.items() if std is not None)


def test_features_are_held_in_the_middle(known):
    arm, _ = known
    table = arm.measure_table(arm.poses(60))
    table["load"] = np.linspace(0.0, 2.0, 60)
    calibration = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), features=["load"])
    readings = arm.poses(10, seed=2)
    assert (Candidates(calibration, readings).values(readings)[:, -1] == 1.0).all()
    assert (Candidates(calibration, readings, features={"load": 2.0}).values(readings)[:, -1] == 2.0).all()
    with pytest.raises(ta.UsageError, match='does not vary with "laod".*It varies with "load".*Did you mean'):
        Candidates(calibration, readings, features={"laod": 2.0})


def test_what_cannot_be_proposed(known, tmp_path):
    arm, calibration = known
    with pytest.raises(ta.UsageError, match='no set-up "other"'):
        Candidates(calibration, arm.poses(5), group="other")
    with pytest.raises(ta.WorkError, match="6 poses are to be chosen from 5"):
        next_poses(Candidates(calibration, arm.poses(5)), arm.poses(5), 6)
    for expected in (
        lambda few: next_poses(few, np.empty((0, 5)), 2),
        lambda few: expected_by_update(few, np.empty((0, 5)), calibration),
    ):
        with pytest.raises(ta.UsageError, match="the workspace has no poses"):
            expected(Candidates(calibration, arm.poses(5)))
    calibration.save(tmp_path / "small.calib", with_rows=False)
    stripped = ta.Calibration.load(tmp_path / "small.calib")
    with pytest.raises(ta.WorkError, match="left out of this file"):
        acceptance_poses(Candidates(stripped, arm.poses(20)), 6)
    with pytest.raises(CoreError, match="must be square"):
        choose_informative(
            np.zeros((2, 3)), {"noise": np.ones((1, 1, 1)), "points": np.zeros((1, 3)), "apart": 0.0}, 1
        )
    with pytest.raises(CoreError, match=r"\(c, 3\)"):
        choose_informative(
            np.eye(2), {"noise": np.ones((1, 1, 1)), "points": np.zeros((2, 3)), "apart": 0.0}, 1
        )
