"""Streams of set-points from Python."""

from typing import Any

import numpy as np
import pytest

import truearm as ta
from truearm._core import Corrector, Stream
from truearm.simulation import Imperfections, VirtualArm
from truearm.streaming import CorrectionStream, StreamOptions

CYCLE = 0.004
OPEN = ta.Limits(largest_std_mm=50.0)


def test_what_is_not_stated_is_the_core_s_in_streams_and_bounds():
    stated: Any = StreamOptions().core()
    usual = Stream.usual()
    assert stated.keys() == usual.keys()
    assert all(stated[name] == pytest.approx(value, rel=1e-15) for name, value in usual.items())
    bounds: Any = ta.Limits().core(ta.Robot.load("ur5e"))
    assert bounds.keys() == {"joints"} | Corrector.usual().keys()
    assert {name: bounds[name] for name in Corrector.usual()} == pytest.approx(Corrector.usual(), rel=1e-15)


@pytest.fixture(scope="module")
def compensator():
    robot = ta.Robot.load("ur5e")
    arm = VirtualArm(robot, seed=4, imperfections=Imperfections(share=0.5))
    calibration = ta.calibrate(robot, arm.measure(arm.poses(80)), model="constant")
    return ta.Compensator(calibration)


@pytest.fixture
def home():
    return np.array([0.3, -1.2, 1.4, -0.7, 1.1, 0.2])


def run(stream, q, seconds):
    return [stream.step(q, CYCLE) for _ in range(round(seconds / CYCLE))]


def test_it_ramps_to_the_correction_of_single_waypoints(compensator, home):
    stream = CorrectionStream(compensator)
    steps = run(stream, home, 1.4)
    applied = np.array([step.q - home for step in steps])
    assert np.array_equal(applied[0], np.zeros(6)) or np.abs(applied[0]).max() < 1e-6
    assert (steps[-1].phase, steps[-1].fault) == ("on", None)
    assert steps[-1].q == pytest.approx(compensator.correct(home), abs=1e-9)
    rates = np.diff(applied, axis=0) / CYCLE
    assert np.abs(rates).max() <= np.radians(6.0) + 1e-9
    assert np.abs(np.diff(rates, axis=0)).max() / CYCLE <= np.radians(120.0) + 1e-6


def test_what_has_no_correction_holds_the_last_one(compensator, home):
    stream = CorrectionStream(compensator, StreamOptions(hold_s=0.02))
    last = run(stream, home, 1.4)[-1].q
    for bad, words in ((None, "missing"), (np.full(6, np.nan), "missing")):
        step = stream.step(bad, CYCLE)
        assert step.phase == "holding"
        assert words in str(step.fault)
        assert step.q == pytest.approx(last, abs=1e-6)
        stream.step(home, CYCLE)
    beyond = np.concatenate([[7.0], home[1:]])
    steps = run(stream, beyond, 2.0)
    assert "limit" in str(steps[0].fault)
    assert [steps[k].phase for k in (0, 10, -1)] == ["holding", "falling", "off"]
    assert np.array_equal(steps[-1].q, beyond)


@pytest.mark.parametrize(
    ("bad", "words"),
    [(np.zeros(5), r"shape \(5,\)"), (np.zeros((1, 6)), r"shape \(1, 6\)"), ("six", "are not real numbers")],
)
def test_what_is_no_set_point_is_an_error_and_changes_nothing(compensator, home, bad, words):
    stream = CorrectionStream(compensator)
    before = run(stream, home, 0.2)[-1]
    with pytest.raises(ta.InputError, match=words):
        stream.step(bad, CYCLE)
    assert stream.last is before
    assert stream.step(home, CYCLE).fault is None


def test_nothing_comes_out_before_something_went_in(compensator):
    step = CorrectionStream(compensator).step(None, 0.0)
    assert (step.q, step.fault) == (None, "there was no set-point yet")


def test_it_is_switched_off_and_on(compensator, home):
    stream = CorrectionStream(compensator)
    run(stream, home, 1.4)
    stream.switch(False)
    steps = run(stream, home, 2.0)
    assert steps[0].phase == "falling"
    assert np.array_equal(steps[-1].q, home)
    stream.switch(True)
    assert run(stream, home, 1.4)[-1].phase == "on"


def test_options_that_bound_nothing_are_refused(compensator):
    with pytest.raises(ta.UsageError, match="ramp_s: 0. It must be positive"):
        StreamOptions(ramp_s=0.0)
    with pytest.raises(ta.UsageError, match="ramp_s: inf. It must be positive and finite"):
        StreamOptions(ramp_s=np.inf)
    with pytest.raises(ta.UsageError, match="rate_deg_s: -1. It must be positive. inf switches it off"):
        StreamOptions(rate_deg_s=-1)
    unbounded = StreamOptions(rate_deg_s=np.inf, acceleration_deg_s2=np.inf)
    assert CorrectionStream(compensator, unbounded).last.q is None


@pytest.fixture(scope="module")
def warm():
    """A compensator whose calibration depends on the temperature, at 16 deg."""
    robot = ta.Robot.load("ur5e")
    arm = VirtualArm(robot, seed=4, imperfections=Imperfections(share=0.5))
    q = arm.poses(80)
    temperature = np.random.default_rng(1).uniform(15.0, 30.0, len(q))
    table = arm.measure_table(q).assign(temperature=temperature)
    table["y"] += 2e-5 * (temperature - 15.0)
    data = ta.Measurements.from_dataframe(table)
    calibration = ta.calibrate(robot, data, features=("temperature",), refit=False)
    return ta.Compensator(calibration, limits=OPEN, features={"temperature": 16.0})


def test_features_change_while_it_runs(warm, home):
    stream = CorrectionStream(warm, StreamOptions(hold_s=0.02))
    before = run(stream, home, 1.4)[-1].q
    assert before == pytest.approx(warm.correct(home), abs=1e-9)
    stream.set_features({"temperature": 29.0})
    steps = run(stream, home, 0.4)
    later = ta.Compensator(warm.calibration, limits=OPEN, features={"temperature": 29.0}).correct(home)
    assert np.abs(later - before).max() > 1e-5
    assert steps[-1].q == pytest.approx(later, abs=1e-9)
    rates = np.diff([step.q for step in steps], axis=0) / CYCLE
    assert np.abs(rates).max() <= np.radians(6.0) + 1e-9
    stream.set_features({"temperature": np.nan})
    held = stream.step(home, CYCLE)
    assert held.phase == "holding"
    assert "feature" in str(held.fault)
    assert held.q == pytest.approx(later, abs=1e-6)


@pytest.mark.parametrize(
    "wrong", [{"temperature": 20.0, "temp": 20.0}, {"temperature": "20"}, {"temperature": 10**400}]
)
def test_features_that_are_none_change_nothing(warm, wrong):
    stream = CorrectionStream(warm)
    with pytest.raises(ta.UsageError, match="is no feature of the calibration|must be a number|is beyond"):
        stream.set_features(wrong)
    assert stream.features == {"temperature": 16.0}
