"""Bounds of the standard deviation against exact ones at configurations they have never seen."""

import dataclasses

import numpy as np
import pytest

import truearm as ta
from tests.calibration_file_support import read_calibration_file, write_calibration_file
from truearm.simulation import VirtualArm

JOINTS = 5


@pytest.fixture(scope="module")
def measured():
    arm = VirtualArm.paper(seed=3)
    return arm.robot, arm.measure(arm.poses(60))


@pytest.fixture(scope="module", params=["variable", "constant"])
def calibration(request, measured):
    return ta.calibrate(*measured, model=request.param)


@pytest.fixture(scope="module")
def readings(calibration):
    limits = calibration.robot.limits
    return np.random.default_rng(11).uniform(limits[:, 0], limits[:, 1], (1500, len(limits)))


def roots(calibration, q, tool):
    return np.sqrt(np.square(calibration.pose_std(q, tool=tool)).reshape(-1, 2, 3).sum(axis=2))


def test_it_is_never_below_the_exact_one(calibration, readings):
    for tool in (np.zeros(3), np.array([0.05, -0.1, 0.2])):
        bound, exact = calibration.conservative_std(readings, tool=tool), roots(calibration, readings, tool)
        assert (bound >= exact).all()


def test_it_is_not_far_above(calibration, readings):
    centre = calibration.conservative.content()["centre"]
    ratio = calibration.conservative_std(readings, tool=centre) / roots(calibration, readings, centre)
    assert (np.median(ratio, axis=0) < 1.8).all()
    assert calibration.conservative.content()["looseness"] == pytest.approx(np.median(ratio, axis=0), rel=0.1)


def test_nor_at_what_was_measured(calibration):
    q = calibration.rows.data.readings
    bound, exact = calibration.conservative_std(q), roots(calibration, q, None)
    assert (bound >= exact).all()


def test_a_far_tool_whose_position_alone_was_measured_is_not_far_above():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(60)))
    far = calibration.model.setup.targets[0, 0]
    assert np.linalg.norm(far) > 0.05
    q = arm.poses(60)
    ratio = calibration.conservative_std(q, tool=far) / roots(calibration, q, far)
    assert (ratio[:, 0] >= 1.0).all()
    assert np.median(ratio[:, 0]) < 3.5


def test_it_follows_what_is_known_where_joints_go_together():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=3)
    q = arm.poses(150)
    # As where a target has to face its instrument.
    q[:, 3:] = 0.2 * q[:, 3:] / np.pi
    q[:, 3] -= q[:, 1] + q[:, 2]
    calibration = ta.calibrate(arm.robot, arm.measure(q), refit=False)
    seen = calibration.model.setup.targets[0, 0]
    elsewhere = q + np.random.default_rng(0).uniform(-1.0, 1.0, q.shape)
    bounds, exact = zip(
        *(
            (calibration.conservative_std(each, tool=seen)[:, 0], roots(calibration, each, seen)[:, 0])
            for each in (q, elsewhere)
        ),
        strict=True,
    )
    assert np.median(exact[1]) > 1.8 * np.median(exact[0])
    for bound, known in zip(bounds, exact, strict=True):
        assert (bound >= known).all()
        assert np.median(bound / known) < 2.2


def test_it_is_the_same_when_read_even_without_the_measurements(calibration, readings, tmp_path):
    for name, with_rows in (("all.calib", True), ("stripped.calib", False)):
        calibration.save(tmp_path / name, with_rows=with_rows)
        read = ta.Calibration.load(tmp_path / name)
        assert np.array_equal(read.conservative_std(readings), calibration.conservative_std(readings))


def test_a_file_without_it_works_it_out_or_says_that_it_cannot(calibration, tmp_path):
    calibration.save(tmp_path / "new.calib")
    arrays, content = read_calibration_file(tmp_path / "new.calib")
    for key in ("schema", "sha256", "conservative"):
        content.pop(key)
    write_calibration_file(tmp_path / "old.calib", arrays, content)
    old = ta.Calibration.load(tmp_path / "old.calib")
    q = np.zeros(old.robot.joint_count)
    assert np.array_equal(old.conservative_std(q), calibration.conservative_std(q))
    write_calibration_file(tmp_path / "bare.calib", arrays, {**content, "rows": None})
    bare = ta.Calibration.load(tmp_path / "bare.calib")
    assert bare.has_conservative == (calibration.variable is None)
    if not bare.has_conservative:
        with pytest.raises(ta.WorkError, match="need the measurements"):
            bare.conservative_std(q)


def test_outside_the_limits_stands_the_largest_value(calibration):
    q = calibration.robot.limits[:, 1] + np.pi / 3
    ranges = calibration.conservative.content()["ranges"]
    assert any(bounds is not None for bounds in ranges)
    bounds = calibration.conservative.content()
    assert calibration.conservative_std(q, tool=bounds["centre"]) == pytest.approx(bounds["largest"])


def test_limits_stated_on_one_side_alone_are_closed_on_the_other(measured):
    robot, data = measured
    for joint, stated in ((0, (4.0, np.inf)), (1, (-np.inf, -4.0)), (0, (-np.inf, np.inf))):
        limits = robot.limits.copy()
        limits[joint] = stated
        calibration = ta.calibrate(dataclasses.replace(robot, limits=limits), data, model="constant")
        assert (calibration.conservative_std(data.readings) >= roots(calibration, data.readings, None)).all()


def test_compensation_judges_by_it(calibration):
    q, loose = calibration.rows.data.readings, ta.Limits(largest_std_mm=None, change_mm_per_mm=None)
    found = ta.Compensator(calibration, task="position", limits=loose).joints(q)
    good = ~found.refused
    assert good.sum() > 20
    exact = 1e3 * roots(calibration, found.q[good], None)[:, 0]
    assert (found.std_mm[good] >= 0.999999 * exact).all()
    assert (found.std_mm[good] < 4.0 * exact).all()
    strict = ta.Limits(largest_std_mm=float(0.9 * exact.min()))
    refused = ta.Compensator(calibration, task="position", limits=strict).joints(q[good][:1]).refusals
    assert refused[0].code == 8


def test_a_feature_a_little_beyond_what_was_learnt_does_not_make_all_unknown():
    arm = VirtualArm.paper(seed=3)
    table = arm.measure_table(arm.poses(80)).assign(temperature=np.linspace(15.0, 30.0, 80))
    data = ta.Measurements.from_dataframe(table)
    calibration = ta.calibrate(arm.robot, data, features=("temperature",), refit=False)
    q, tool = arm.poses(60, seed=8), calibration.model.setup.targets[0, 0]
    for temperature in (8.0, 14.9, 22.0, 30.1, 37.0):
        features = {"temperature": temperature}
        std = calibration.pose_std(q, tool=tool, features=features)
        exact = np.sqrt(np.square(std).reshape(-1, 2, 3).sum(axis=2))
        ratio = calibration.conservative_std(q, tool=tool, features=features) / exact
        assert (ratio >= 1.0).all()
        assert (np.median(ratio, axis=0) < 3.0).all()
