"""Targets, joints and set-ups that stand otherwise from some row on are told, with row, size and way out."""

from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from truearm.cli.calibrate import suggest_next
from truearm.doubts.at_once import (
    AT_ONCE,
    JOINT,
    JOINT_MOVED,
    SETUP_TURNED,
    TARGET_SLIPPED,
    Left,
    Shape,
    likeliest_step,
)
from truearm.doubts.moved_joints import JOINTS_MOVED
from truearm.fleet.doubted import grave_notices
from truearm.reporting.advice import advise
from truearm.reporting.facts import Facts
from truearm.reporting.verdict import cards
from truearm.rotations import matrix_from_rotation_vector
from truearm.simulation import Imperfections, VirtualArm

ROWS = 50
HALF = ROWS // 2
SLIP = np.array([0.4, 0.0, 0.3]) * 1e-3
"""How far the target slips, m."""


@pytest.fixture(scope="module")
def arm():
    return VirtualArm(ta.Robot.load("ur10"), seed=4, imperfections=Imperfections(share=0.0, noise_mm=0.02))


@pytest.fixture(scope="module")
def steady(arm):
    return arm.measure(arm.poses(ROWS))


def with_slip(arm, data, first=HALF):
    """The rows, from `first` on with the target elsewhere on the flange."""
    by = arm.true_pose(data.readings)[:, :3, :3] @ SLIP @ arm.world_from_base[:3, :3].T
    by[:first] = 0.0
    return replace(data, targets=data.targets + by[:, None])


def with_groups(data):
    return replace(data, group=np.where(np.arange(len(data)) < HALF, "before", "behind"))


def calibrated(arm, data):
    found = ta.calibrate(arm.robot, data, refit=False, holdout=0.1)
    return found, {notice.kind: str(notice) for notice in found.notices}


def told(notices):
    return {notice.kind: str(notice) for notice in notices if notice.kind in AT_ONCE}


@pytest.fixture(scope="module")
def known(arm, steady):
    return calibrated(arm, steady)


@pytest.fixture(scope="module")
def slipped(arm, steady):
    return calibrated(arm, with_slip(arm, steady))


def test_an_arm_that_stays_as_it_is_is_not_doubted(known):
    assert not set(AT_ONCE) & set(known[1])


def test_a_target_that_slips_is_told_with_row_and_size(slipped):
    found, notices = slipped
    said = notices[TARGET_SLIPPED]
    assert said.startswith("Between row 25 and row 26 the target slipped on the tool")
    assert float(said.split("elsewhere on it, by ")[1].split(" mm")[0]) == pytest.approx(0.5, rel=0.2)
    assert said in grave_notices(found)


def test_the_report_puts_it_first_and_advises_no_more_poses(slipped):
    advice = advise(Facts(slipped[0]), None)
    assert slipped[1][TARGET_SLIPPED] in advice[0].words
    assert advice[0].name == "Find what gave way."
    assert not {"more_poses", "constant_suffices"} & {each.kind for each in advice}


def test_noise_that_holds_a_slip_is_not_told_and_nothing_is_corrected_by_it(slipped, tmp_path, capsys):
    shown = " ".join(card.label for card in cards(Facts(slipped[0])))
    assert "noise alone would leave" not in shown
    suggest_next(slipped[0], tmp_path / "arm.calib")
    assert "truearm compensate" not in capsys.readouterr().out


def test_rows_behind_in_a_group_of_their_own_are_right(arm, steady, slipped):
    found, notices = calibrated(arm, with_groups(with_slip(arm, steady)))
    assert not set(AT_ONCE) & set(notices)
    means = [each.validation.holdout["variable"].position.mean for each in (found, slipped[0])]
    assert means[0] < 0.4 * means[1]


@pytest.mark.parametrize("grouped", [False, True])
def test_a_joint_that_moves_at_once_does_not_warm_up(arm, grouped):
    readings, turned = arm.poses(ROWS), np.zeros((ROWS, 6))
    turned[HALF:, 1] = np.radians(0.03)
    data = replace(arm.measure(readings + turned), readings=readings)
    _, notices = calibrated(arm, with_groups(data) if grouped else data)
    assert JOINTS_MOVED not in notices
    where = "In behind, against the other" if grouped else "Between row 25 and row 26"
    said = notices[JOINT_MOVED]
    assert said.startswith((where, "In before, against the other"))
    size = float(said.split("joint 2 moved by ")[1].split(" deg")[0])
    assert abs(size) == pytest.approx(0.03, rel=0.15)
    assert "calibrate from those behind alone" in said


def test_a_device_that_turns_is_told(arm, steady):
    turn = matrix_from_rotation_vector([0.0, 3e-4, 0.0])
    targets = steady.targets.copy()
    targets[HALF:] = targets[HALF:] @ turn.T
    _, notices = calibrated(arm, replace(steady, targets=targets))
    assert "between row 25 and row 26" in notices[SETUP_TURNED].lower()


def test_evaluations_and_updates_do_not_blame_the_calibration(arm, known):
    data = with_slip(arm, arm.measure(arm.poses(HALF, seed=7)), HALF // 2)
    judged, found = ta.evaluate(known[0], data), ta.update(known[0], data)
    assert list(told(judged.notices)) == [TARGET_SLIPPED]
    assert "not_as_calibrated" not in {notice.kind for notice in judged.notices}
    assert found.verdict == "field"
    assert found.changed_meanwhile
    assert "calibrate_anew" not in {advice.kind for advice in advise(Facts(found.calibration), None)}


def noise_alone(rng, visits):
    """What is left of a fit with 20 unknowns to noise, and columns that tell nothing of it."""
    values = 3 * visits
    fitted, _ = np.linalg.qr(rng.normal(size=(values, 20)))
    metric = np.eye(values) - fitted @ fitted.T
    pull = metric @ rng.normal(size=values)
    visit = np.repeat(np.arange(visits), 3)
    return Left(pull, metric, np.eye(values), visit, float(pull @ pull), values - 20.0)


def test_what_noise_shows_somewhere_is_told_as_likely():
    rng, shapes = np.random.default_rng(0), [Shape(JOINT, (k,), (k,)) for k in range(4)]
    found = [likeliest_step(noise_alone(rng, 40), rng.normal(size=(120, 4)), shapes) for _ in range(60)]
    assert np.mean([step is not None and step.chance < 0.1 for step in found]) < 0.2


def test_a_step_is_found_at_its_place_beside_another_with_its_size():
    rng = np.random.default_rng(1)
    left, columns = noise_alone(rng, 40), rng.normal(size=(120, 4))
    behind = columns * (left.visit >= 17)[:, None]
    pull = left.pull + left.metric @ behind @ np.array([2.0, 3.0, 0.0, 0.0])
    square = float(pull @ np.linalg.pinv(left.metric) @ pull)
    shapes = [Shape(JOINT, (k,), (k,)) for k in range(1, 4)]
    found = likeliest_step(replace(left, pull=pull, square=square), columns, shapes, [0])
    assert found is not None
    assert (found.shape.numbers, found.place) == ((1,), 17)
    assert found.sizes == pytest.approx([3.0], abs=0.5)
    assert found.chance < 1e-20
