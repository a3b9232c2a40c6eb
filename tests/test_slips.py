"""Targets, joints and set-ups that stand otherwise from some row on are told, with row, size and way out."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from truearm.cli import update as of_command
from truearm.cli.calibrate import suggest_next
from truearm.doubts.at_once import (
    JOINT,
    JOINT_MOVED,
    SCALE_DIFFERS,
    SETUP_TURNED,
    STEP_KINDS,
    TARGET,
    TARGET_SLIPPED,
    Left,
    Shape,
    likeliest_step,
)
from truearm.doubts.moved_words import JOINTS_MOVED, SETUP_TURNING
from truearm.doubts.tool_slips import tool_slips
from truearm.fleet.doubted import grave_notices
from truearm.programs.notices import update_notices
from truearm.reporting.advice import advise
from truearm.reporting.facts import Facts
from truearm.reporting.since_update import since_update
from truearm.reporting.verdict import cards
from truearm.rotations import (
    matrix_from_quaternion,
    matrix_from_rotation_vector,
    quaternion_from_matrix,
)
from truearm.simulation import Imperfections, VirtualArm
from truearm.update_words import MEANWHILE

ROWS = 50
HALF = ROWS // 2
LONG = 90
"""Rows that leave enough of a scale or a slow turn, which what varies follows in few."""
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


def with_groups(data, first=HALF):
    return replace(data, group=np.where(np.arange(len(data)) < first, "before", "behind"))


def calibrated(arm, data):
    found = ta.calibrate(arm.robot, data, refit=False, holdout=0.1)
    return found, {notice.kind: str(notice) for notice in found.notices}


def told(notices):
    return {notice.kind: str(notice) for notice in notices if notice.kind in STEP_KINDS}


@pytest.fixture(scope="module")
def known(arm, steady):
    return calibrated(arm, steady)


@pytest.fixture(scope="module")
def slipped(arm, steady):
    return calibrated(arm, with_slip(arm, steady))


def test_an_arm_that_stays_as_it_is_is_not_doubted(known):
    assert not set(STEP_KINDS) & set(known[1])


def test_a_target_that_slips_is_told_with_row_and_size(slipped):
    found, notices = slipped
    said = notices[TARGET_SLIPPED]
    assert said.startswith("Between row 25 and row 26 the target slipped on the tool")
    assert float(said.split("elsewhere on it, by ")[1].split(" mm")[0]) == pytest.approx(0.5, rel=0.2)
    assert said in grave_notices(found)


def test_of_several_targets_the_one_that_slips_has_the_number_of_its_columns(arm, steady):
    further = 0.05 * arm.true_pose(steady.readings)[:, :3, 0] @ arm.world_from_base[:3, :3].T
    third = with_slip(arm, arm.measure(steady.readings, seed=1)).targets + further[:, None]
    targets = np.hstack([steady.targets, np.full_like(third, np.nan), third])
    _, notices = calibrated(arm, replace(steady, targets=targets))
    assert "target 3 slipped on the tool" in notices[TARGET_SLIPPED]


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
    assert not set(STEP_KINDS) & set(notices)
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
    assert ("calibrate from those behind alone" in said) is not grouped


def test_a_joint_that_moves_is_told_by_its_reading_where_that_turns_others_and_counts_the_other_way(arm):
    coupling = np.diag([1.0, -1.0, 1.0, 1.0, 1.0, 1.0])
    coupling[2, 1] = -1.0
    coupled = replace(arm.robot, coupling=coupling)
    of_coupled = VirtualArm(coupled, seed=4, imperfections=arm.imperfections)
    readings, turned = of_coupled.poses(ROWS), np.zeros((ROWS, 6))
    turned[HALF:, 1] = np.radians(0.05)
    _, notices = calibrated(of_coupled, replace(of_coupled.measure(readings + turned), readings=readings))
    size = notices[JOINT_MOVED].split("joint 2 moved by ")[1].split(" deg")[0]
    assert float(size) == pytest.approx(0.05, rel=0.15)


def test_a_device_that_turns_is_told(arm, steady):
    turn = matrix_from_rotation_vector([0.0, 3e-4, 0.0])
    targets = steady.targets.copy()
    targets[HALF:] = targets[HALF:] @ turn.T
    _, notices = calibrated(arm, replace(steady, targets=targets))
    assert "between row 25 and row 26" in notices[SETUP_TURNED].lower()


@pytest.fixture(scope="module")
def long(arm):
    return arm.measure(arm.poses(LONG))


def test_a_device_that_turns_all_the_while_gave_way_at_no_row(arm, long):
    """About an axis through the device, 0.3 mrad from the first row to the last."""
    turned = np.outer(np.linspace(0.0, 1.0, LONG), [0.0, 2.4e-4, 1.8e-4])
    targets = np.einsum("nij,ntj->nti", matrix_from_rotation_vector(turned), long.targets)
    _, notices = calibrated(arm, replace(long, targets=targets))
    assert not set(STEP_KINDS) & set(notices)
    size = notices[SETUP_TURNING].split("turned evenly while it was measured: by ")[1].split(" mrad")[0]
    assert float(size) == pytest.approx(0.3, rel=0.15)


@pytest.mark.parametrize("grouped", [False, True])
def test_an_instrument_of_another_scale_is_no_joint_that_moves(arm, long, grouped):
    targets = long.targets.copy()
    targets[LONG // 2 :] *= 1.0005
    data = replace(long, targets=targets)
    found, notices = calibrated(arm, with_groups(data, LONG // 2) if grouped else data)
    assert set(STEP_KINDS) & set(notices) == {SCALE_DIFFERS}
    said = notices[SCALE_DIFFERS]
    where = (
        ("In behind", "In before") if grouped else ("Between row 45 and row 46", "Between row 44 and row 45")
    )
    assert said.startswith(where)
    longer = said.split("all lengths are ")[1]
    assert longer.startswith("shorter" if "In before" in said else "longer")
    assert float(longer.split(" by ")[1].split(" ppm")[0]) == pytest.approx(500.0, rel=0.15)
    assert "an instrument of another scale" in said
    assert said in grave_notices(found)


@pytest.fixture(scope="module")
def again(arm):
    return with_slip(arm, arm.measure(arm.poses(HALF, seed=7)), HALF // 2)


@pytest.fixture(scope="module")
def updated(known, again):
    return ta.update(known[0], again)


def test_evaluations_and_updates_do_not_blame_the_calibration(known, again, updated):
    judged, found = ta.evaluate(known[0], again), updated
    assert list(told(judged.notices)) == [TARGET_SLIPPED]
    assert "not_as_calibrated" not in {notice.kind for notice in judged.notices}
    assert found.verdict == "field"
    assert found.changed_meanwhile
    assert "calibrate_anew" not in {advice.kind for advice in advise(Facts(found.calibration), None)}


@pytest.mark.parametrize("verdict", ["holds", "moved", "field"])
def test_what_slipped_is_put_right_first_whatever_an_update_found(known, updated, verdict, capsys):
    found = replace(updated, verdict=verdict)
    assert MEANWHILE in of_command._verdict(found)
    of_command._suggest(found, known[0], Path("arm.calib"), Path("new.calib"), "new.csv")
    assert capsys.readouterr().out == ""
    revision = updated.calibration.revision
    told = replace(revision, report={**revision.report, "verdict": verdict})
    calibration = replace(updated.calibration, revision=told)
    assert MEANWHILE in str(since_update(Facts(calibration)).parts[0])
    assert MEANWHILE in str(update_notices(calibration)[0])


@pytest.fixture(scope="module")
def posed(arm):
    data = arm.measure(arm.poses(ROWS), orientation=True)
    return ta.calibrate(arm.robot, data, model="constant", refit=False, holdout=0.1)


@pytest.mark.parametrize("slips", [False, True])
def test_a_target_that_turns_is_told_and_slips_only_where_it_does(arm, posed, slips):
    data = arm.measure(arm.poses(HALF, seed=7), orientation=True)
    turn = np.tile(np.eye(3), (HALF, 1, 1))
    turn[HALF // 2 :] = matrix_from_rotation_vector([0.0, 2e-3, 0.0])
    turned = replace(
        data, orientations=quaternion_from_matrix(matrix_from_quaternion(data.orientations) @ turn)
    )
    found = ta.update(posed, with_slip(arm, turned, HALF // 2) if slips else turned)
    said = told(found.notices)[TARGET_SLIPPED]
    assert ("slipped on the tool" in said) is slips
    assert float(said.split("turned")[1].split(" by ")[1].split(" mrad")[0]) == pytest.approx(2.0, rel=0.15)


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


def noise_of_targets(rng, visits, targets):
    """Visits to poses where targets are off alike by ten times what each is off by itself, nothing fitted but
    the columns' level and 12 unknowns; and derivatives by a shift of each target in the flange's frame.
    """
    size = 3 * targets
    own = np.eye(size) + 100.0 * np.kron(np.ones((targets, targets)), np.eye(3))
    root = np.kron(np.eye(visits), np.linalg.cholesky(np.linalg.inv(own)).T)
    turned = matrix_from_rotation_vector(rng.normal(size=(visits, 3)))
    columns = np.einsum("kl,vij->vkilj", np.eye(targets), turned).reshape(visits * size, size)
    fitted, _ = np.linalg.qr(root @ np.hstack([columns, rng.normal(size=(visits * size, 12))]))
    taken = np.eye(visits * size) - fitted @ fitted.T
    visit = np.repeat(np.arange(visits), size)

    def left(step):
        off = taken @ (rng.normal(size=visits * size) + root @ (columns * (visit >= 17)[:, None]) @ step)
        square, freedom = float(off @ off), float(np.trace(taken))
        return Left(root.T @ off, root.T @ taken @ root, root.T @ root, visit, square, freedom)

    return left, columns


@pytest.mark.parametrize("targets", [2, 3])
def test_a_tool_that_slips_with_its_targets_is_found(targets):
    """All of them move alike, by what each is known to from its differences to the others and not as well."""
    left, columns = noise_of_targets(np.random.default_rng(2), 40, targets)
    each = [Shape(TARGET, (k,), tuple(range(3 * k, 3 * k + 3))) for k in range(targets)]
    shapes = [Shape(TARGET, tuple(range(targets)), tuple(range(3 * targets))), *each]
    found = likeliest_step(left(np.tile([30.0, -30.0, 30.0], targets)), columns, shapes)
    assert found is not None
    assert (found.shape, found.place) == (shapes[0], 17)
    assert found.chance < 1e-4
    sizes = found.sizes.reshape(targets, 3)
    np.testing.assert_allclose(sizes, np.tile(sizes[0], (targets, 1)))
    assert np.linalg.norm(sizes[0]) == pytest.approx(30.0 * np.sqrt(3.0), rel=0.2)
    still = likeliest_step(left(np.zeros(3 * targets)), columns, shapes)
    assert still is None or still.chance > 1e-3


@pytest.mark.parametrize("slip_mm", [0.0, 1.0])
def test_a_tool_that_slips_is_told_by_the_middle_of_its_targets(slip_mm):
    """Constants leave more than the slip at each pose, and what varies would follow it."""
    arm = VirtualArm(ta.Robot.load("ur10"), seed=2, imperfections=Imperfections(share=0.2, noise_mm=0.01))
    q = arm.poses(60, seed=7)
    table = {f"q{joint + 1}": q[:, joint] for joint in range(6)}
    for number, target_mm in enumerate(([30.0, 20.0, 50.0], [-60.0, 10.0, 80.0], [20.0, -70.0, 20.0])):
        arm.target_in_flange = 1e-3 * np.array(target_mm)
        points = arm.measure_table(q, seed=1)[["x", "y", "z"]].to_numpy()
        slip = arm.true_pose(q)[:, :3, :3] @ np.array([0.6e-3, 0.0, 0.8e-3]) @ arm.world_from_base[:3, :3].T
        points = points + slip_mm * slip * (np.arange(60) >= 30)[:, None]
        points += 1e-5 * np.random.default_rng(number).normal(size=points.shape)
        table |= {f"{axis}{number + 1 if number else ''}": points[:, k] for k, axis in enumerate("xyz")}
    found = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(pd.DataFrame(table)), model="constant")
    assert found.rows is not None
    told = [str(slip.notice) for slip in tool_slips(found, found.rows, found.rows.data.rows / 60.0)]
    assert len(told) == (slip_mm > 0.0)
    for said in told:
        assert said.startswith("Between row 30 and row 31 the targets slipped on the tool")
        assert float(said.split("elsewhere on it, by ")[1].split(" mm")[0]) == pytest.approx(1.0, rel=0.25)
