"""What was given, or made, is not changed behind anyone's back, nor set to no effect."""

import copy
import pickle
from dataclasses import FrozenInstanceError, replace
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from truearm.planning import CartesianSpace, InBox, InCone, InSphere, JointSpace, KeepOut, LeastContactAngle
from truearm.proposing import Candidates
from truearm.rows.splitting import split_columns
from truearm.simulation import VirtualArm

ROBOT = ta.Robot.load("ur10")


@pytest.fixture(scope="module")
def data():
    virtual = VirtualArm(ROBOT, seed=2)
    return virtual.measure(virtual.poses(60))


@pytest.fixture(scope="module")
def calibration(data):
    return ta.calibrate(ROBOT, data, model="constant")


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("calibration", None),
        ("programming", None),
        ("task", "position"),
        ("moving", (1, 2, 3)),
        ("limits", ta.Limits(largest_mm=0.01)),
        ("features", (22.0,)),
    ],
)
def test_what_a_compensator_was_made_of_cannot_be_set(name, other, calibration):
    compensator = ta.Compensator(calibration)
    with pytest.raises(AttributeError, match=name):
        setattr(compensator, name, other)


@pytest.mark.parametrize("name", ["ur10", "rv-m2"])
def test_joint_values_are_no_ones_readings(name):
    robot = ta.Robot.load(name)
    q = np.full((3, robot.joint_count), 0.2)
    for given in (q, q[0]):
        for convert in (robot.joints_from_readings, robot.readings_from_joints):
            convert(given)[:] += 1.0
    np.testing.assert_array_equal(q, 0.2)


def test_candidates_spaces_and_rules_keep_their_numbers(calibration):
    q = np.full((2, 6), 0.2)
    candidates = Candidates(calibration, q)
    held, low, high = q[0], np.zeros(3), np.ones(3)
    space, box, kept = JointSpace(ROBOT, low, high, held=held), InBox(low, high), KeepOut(low, high)
    for array in (q, low, high):
        array[:] = 5.0
    np.testing.assert_array_equal(candidates.readings, 0.2)
    assert not candidates.readings.flags.writeable
    np.testing.assert_array_equal(space.readings(np.zeros((1, 3)))[0][0, 3:], 0.2)
    np.testing.assert_array_equal([space.low, box.low, kept.low], 0.0)
    np.testing.assert_array_equal([space.high, box.high, kept.high], 1.0)


def test_rules_hold_arrays_that_cannot_be_changed():
    box: Any = InBox((0.0, 0.0, 0.1), np.ones(3))
    np.testing.assert_allclose(box.high - box.low, [1.0, 1.0, 0.9])
    sees: Any = InCone([1.0, 0.0, 0.5], (-1, 0, 0), 0.3)
    np.testing.assert_allclose(sees.apex + 2.0 * sees.axis, [-1.0, 0.0, 0.5])
    ball: Any = InSphere((1, 2, 3), 0.1)
    for held in (box.low, box.high, ball.centre, sees.apex, sees.axis):
        with pytest.raises(ValueError, match="read-only"):
            held[2] = 0.5
    assert len({box, sees, KeepOut(box.low, box.high), LeastContactAngle((0.0, 0.0, 1.0))}) == 4


def views_of(numbers):
    """A read-only view of an array that is its owner's to change, and the array."""
    owned = np.array(numbers)
    view = owned[:]
    view.flags.writeable = False
    return view, owned


def test_measurements_do_not_change_with_the_data_they_were_made_of(data):
    readings, own_readings = views_of(data.readings)
    sigma, own_sigma = views_of(np.full(len(data), 1e-4))
    table = pd.DataFrame({"temperature_C": np.full(len(data), 20.0)})
    made = replace(data, readings=readings, sigma_m=sigma, features=table)
    before = made.hash()
    own_readings[0], own_sigma[3] = 9.0, 5.0
    table.loc[0, "temperature_C"] = 40.0
    np.testing.assert_array_equal(made.readings, data.readings)
    assert made.hash() == before


def test_columns_of_a_table_become_measurements_own(data):
    table = pd.DataFrame({"s": np.full(len(data), 1e-4)})
    made = replace(data, sigma_m=table["s"].to_numpy())
    table.loc[3, "s"] = 5.0
    np.testing.assert_array_equal(made.sigma_m, 1e-4)


def test_features_are_handed_out_as_copies(data):
    made = replace(data, features=pd.DataFrame({"temperature_C": np.full(len(data), 20.0)}))
    before = made.hash()
    table = made.features
    table["temperature_C"] += 273.15
    made.features["temperature_C"].to_numpy(copy=True)[0] = 0.0
    assert made.hash() == before
    warmer = replace(made, features=table)
    np.testing.assert_array_equal(warmer.features["temperature_C"], 293.15)
    with pytest.raises(FrozenInstanceError):
        made.features = table
    assert pickle.loads(pickle.dumps(made)).hash() == copy.deepcopy(made).hash() == before


def test_features_of_the_class_are_no_table():
    kind: Any = ta.Measurements
    assert not isinstance(kind.features, pd.DataFrame)


def test_features_are_copied_once_for_all_columns(data, monkeypatch):
    made = replace(data, features=pd.DataFrame(np.ones((len(data), 30))).add_prefix("f"))
    copies, copy_of = list[bool](), pd.DataFrame.copy

    def counted(table, deep=True):
        copies.append(deep)
        return copy_of(table, deep)

    monkeypatch.setattr(pd.DataFrame, "copy", counted)
    for ask in (made.hash, made.content, lambda: split_columns(made)):
        copies.clear()
        ask()
        assert len(copies) == 1


def test_own_rows_are_kept_without_copies(data):
    assert np.shares_memory(replace(data, readings=data.readings[:]).readings, data.readings)


def test_what_a_calibration_says_by_name_cannot_be_set(calibration, data):
    evaluation = ta.evaluate(calibration, data)
    told: list[Any] = [calibration.models, calibration.validation.holdout, evaluation.errors]
    for said in told:
        with pytest.raises(TypeError, match="read-only"):
            said["constant"] = said["nominal"]
        with pytest.raises(TypeError, match="read-only"):
            said.pop("constant")
    with pytest.raises(ValueError, match="read-only"):
        calibration.held.errors["constant"].position[:] = 0.0
    for again in (copy.deepcopy, lambda said: pickle.loads(pickle.dumps(said))):
        found = again(calibration.validation)
        assert found == calibration.validation
        with pytest.raises(TypeError, match="read-only"):
            found.holdout.clear()


def test_the_errors_of_a_virtual_arm_are_as_drawn():
    arm = VirtualArm(ROBOT, seed=1)
    with pytest.raises(ValueError, match="read-only"):
        arm.errors[2, 2] += 0.01
    with pytest.raises(AttributeError, match="errors"):
        cast("Any", arm).errors = np.zeros((6, 5))


def sent(value):
    return pickle.loads(pickle.dumps(value))


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, sent])
def test_what_cannot_be_changed_cannot_be_after_a_copy_either(again, data, calibration):
    evaluated = ta.evaluate(calibration, data)
    held: list[tuple[Any, str]] = [
        (calibration.rows, "residual"),
        (calibration.held, "readings"),
        (calibration.held.errors["constant"], "position"),
        (calibration.constant, "covariance"),
        (calibration.measured, "targets"),
        (Candidates(calibration, data.readings), "readings"),
        (VirtualArm(ROBOT, seed=1), "errors"),
        (JointSpace(ROBOT, np.zeros(3), np.ones(3)), "low"),
        (CartesianSpace(ROBOT, np.zeros(3), np.ones(3)), "origin"),
        (InBox(np.zeros(3), np.ones(3)), "high"),
    ]
    for thing, name in held:
        array, same = getattr(again(thing), name), getattr(thing, name)
        np.testing.assert_array_equal(array, same)
        assert not array.flags.writeable, (thing, name)
    assert not again(evaluated).rows.errors["constant"].position.flags.writeable


class OwnRobot(ta.Robot):
    """A user's own kind of robot."""


class OwnMeasurements(ta.Measurements):
    """A user's own kind of measurements."""


class OwnCalibration(ta.Calibration):
    """A user's own kind of calibration."""


class OwnCompensator(ta.Compensator):
    """A user's own kind of compensator."""


def test_own_kinds_are_sent_and_copied_as_what_they_are(data, calibration, tmp_path):
    calibration.save(tmp_path / "arm.calib")
    own = OwnCalibration.load(tmp_path / "arm.calib")
    compensator = OwnCompensator(own, task="position")
    for thing in (OwnRobot.load("ur10"), OwnMeasurements.concatenate([data]), own, compensator):
        for again in (copy.copy, copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))):
            assert type(again(thing)) is type(thing)
    assert copy.deepcopy(own).to_bytes() == calibration.to_bytes()
