"""Options as objects: checked however they are made, and kept as what a file can hold."""

import json
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import truearm as ta
from truearm import intervals
from truearm.cell.plan import PlanOptions
from truearm.fits import core_set
from truearm.fits.scheme_options import SchemeOptions
from truearm.programs.densify import Spacing
from truearm.rows.splitting import HoldoutRange
from truearm.simulation import VirtualArm

api: Any = ta
RULES: Any = {"plan": PlanOptions, "scheme": SchemeOptions}


@pytest.fixture(scope="module")
def arm():
    return VirtualArm(ta.Robot.load("ur10"), seed=1)


@pytest.fixture(scope="module")
def data(arm):
    return arm.measure(arm.poses(60))


WRONG = {
    "a prior in words": (
        lambda: api.CalibrationOptions(prior_mm="2"),
        "prior_mm is '2'. It must be a number",
    ),
    "an infinite prior": (
        lambda: api.CalibrationOptions(prior_mm=np.inf),
        "prior_mm: inf. It must be positive and finite",
    ),
    "a prior that is none": (lambda: api.CalibrationOptions(prior_mrad=np.nan), "positive and finite"),
    "a share in words": (lambda: api.SplitRule(holdout="0.3"), "holdout is '0.3'. It must be a number"),
    "half a row": (lambda: api.SplitRule(train_size=20.5), "train_size is 20.5. It must be a whole number"),
    "no seed": (lambda: api.CalibrationOptions.of(seed=None), "seed is None. It must be a whole number"),
    "no features": (
        lambda: api.CalibrationOptions.of(features=None),
        "features is None. It must be a list of names",
    ),
    "features that are numbers": (lambda: api.CalibrationOptions(features=[1]), "a name of features is 1"),
    "a column that is none": (lambda: api.SplitRule(split_by=3), "split_by is 3. It must be a list of names"),
    "a repeatability in words": (
        lambda: api.CalibrationOptions.of(repeatability_mm="0.1"),
        "must be a number",
    ),
    "a degree in words": (
        lambda: api.CalibrationOptions.of(degree="2"),
        "degree is '2'. It must be a whole number",
    ),
    "no fit in words": (
        lambda: api.CalibrationOptions(refit="no"),
        "refit is 'no'. It must be True or False",
    ),
    "a range in words": (lambda: api.SplitRule(holdout_range="q2"), '"q2" is no range to hold out'),
    "a range of another kind": (lambda: api.SplitRule(holdout_range=2), "is of type int. A .*HoldoutRange"),
    "a split of another kind": (lambda: api.CalibrationOptions(split=0.3), "the split is of type float"),
    "half a frame row": (lambda: api.EvaluationOptions(frame_rows=10.5), "frame_rows is 10.5"),
    "half a seed": (lambda: api.EvaluationOptions(seed=1.5), "seed is 1.5. It must be a whole number"),
    "a kept tool in words": (lambda: api.UpdateOptions(keep_tool="no"), "keep_tool is 'no'"),
    "an offset that is infinite": (
        lambda: api.UpdateOptions(offset_deg=np.inf),
        "offset_deg: inf. It must be positive and finite",
    ),
    "a tool that is infinite": (
        lambda: api.UpdateOptions(tool_mm=np.inf),
        "tool_mm: inf. It must be positive and finite",
    ),
    "a repeatability below all sizes": (
        lambda: api.CalibrationOptions(repeatability_mm=5e-324),
        "repeatability_mm: 4.94066e-324. At least 1e-06 and at most 1,000,000, in mm",
    ),
    "a prior beyond all sizes": (
        lambda: api.CalibrationOptions(prior_mrad=1e300),
        r"prior_mrad: 1e\+300. At least 1e-06 and at most 1,000,000, in mrad",
    ),
    "a spacing that is infinite": (
        lambda: Spacing.of(0.1, np.inf),
        "--least-spacing-mm: inf. It must be positive and finite",
    ),
    "a seed below zero": (lambda: api.SplitRule(seed=-1), "seed: -1. Zero or more"),
    "no rows that train": (lambda: api.SplitRule(train_size=0), "train_size: 0. It must be positive"),
    "a word with a slip": (
        lambda: api.CalibrationOptions(robust="hubre"),
        'robust: "hubre" .* Did you mean "huber"',
    ),
    "joint limits in words": (
        lambda: api.Limits(joint_limits="no"),
        "joint_limits is 'no'. It must be True or False",
    ),
    "half a region": (lambda: RULES["scheme"](most_regions=1.5), "most_regions is 1.5"),
    "joints in words": (lambda: RULES["scheme"](scheme_joints="12"), "scheme_joints is '12'"),
    "half a joint": (lambda: RULES["scheme"](scheme_joints=(1.5,)), "a number of scheme_joints is 1.5"),
    "an order": (lambda: RULES["plan"](order="shortest"), '"shortest" is not known. Either there-and-back'),
    "a criterion": (lambda: RULES["plan"](criterion="e"), '"e" is not known. Either kappa or d'),
    "no poses": (lambda: RULES["plan"](count=0), "0 poses. At least one is planned"),
    "a split in two ways": (
        lambda: api.CalibrationOptions.of(split=ta.SplitRule(holdout=0.2), seed=3),
        'split is given as an object, and "seed" by keyword',
    ),
    "a scheme in two ways": (
        lambda: api.CalibrationOptions.of(scheme=SchemeOptions(), rate=0.2, epochs=3),
        'scheme is given as an object, and "rate" and "epochs" by keyword',
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_options_that_cannot_be_are_refused_when_they_are_made(case):
    make, words = WRONG[case]
    with pytest.raises(ta.UsageError, match=words):
        make()


@pytest.mark.parametrize("threads", ["2", 1.5, 0])
def test_threads_that_cannot_be_are_refused(threads, arm, data):
    with pytest.raises(ta.UsageError, match="threads"):
        ta.calibrate(arm.robot, data, threads=threads)


def test_stages_may_be_told_to_nobody(arm, data):
    calibration = ta.calibrate(arm.robot, data, model="constant", stages=None)
    assert ta.evaluate(calibration, data, stages=None).n_judged
    assert ta.update(calibration, data.select(range(20)), stages=None).verdict


def test_numbers_of_numpy_become_those_of_python():
    options = ta.CalibrationOptions.of(
        train_size=np.int64(30),
        seed=np.int32(2),
        holdout=np.float32(0.25),
        by_purpose=np.True_,
        repeatability_mm=np.float32(0.5),
        degree=np.int64(3),
        refit=np.False_,
        scheme_joints=np.array([1, 2]),
        cells=(np.int64(7), np.int64(9)),
        region_rows=np.int64(20),
        rate=np.float32(0.5),
    )
    told = options.to_dict()
    assert json.loads(json.dumps(told, allow_nan=False)) == told
    assert ta.CalibrationOptions.of(**told) == options
    assert (told["train_size"], told["holdout"], told["scheme_joints"]) == (30, 0.25, [1, 2])
    assert type(options.split.seed) is int
    assert type(ta.EvaluationOptions(seed=np.int64(1)).seed) is int  # type: ignore[arg-type]


def test_a_calibration_with_numbers_of_numpy_is_saved(arm, data, tmp_path):
    asked: dict[str, Any] = {
        "train_size": np.int64(30),
        "repeatability_mm": np.float32(0.5),
        "holdout": np.float32(0.25),
    }
    found = ta.calibrate(arm.robot, data, model="constant", **asked)
    found.save(tmp_path / "arm.calib")
    assert ta.Calibration.load(tmp_path / "arm.calib").options == found.options
    assert pickle.loads(pickle.dumps(found)).options == found.options
    json.dumps(found.summary, allow_nan=False)


def test_names_are_one_text_or_several():
    options = ta.CalibrationOptions(features="load, warmth")
    assert options == ta.CalibrationOptions(features=["load", "warmth"])
    assert ta.SplitRule(split_by=["a", "b"]) == ta.SplitRule(split_by="a,b")


def test_what_is_held_is_of_one_type_however_it_was_given():
    """Type checkers see both: calls as the documentation shows them, and what is read of them."""
    split = ta.SplitRule(holdout_range="q2:high:0.3")
    held: HoldoutRange | None = split.holdout_range
    assert held == HoldoutRange(2, high=True, share=0.3)
    names: tuple[str, ...] = ta.CalibrationOptions(features=["t"]).features
    joints: tuple[int, ...] = SchemeOptions(scheme_joints=[1, 2]).scheme_joints
    assert (names, joints) == (("t",), (1, 2))
    again = pickle.loads(pickle.dumps(replace(split, seed=3)))
    assert again == ta.SplitRule(holdout_range=held, seed=3)
    assert repr(ta.SplitRule()) == (
        "SplitRule(holdout=0.3, seed=7, train_size=None, split_by=(), holdout_range=None, by_purpose=True)"
    )


def test_measurements_without_rows_are_refused(arm, data):
    none = data.select([])
    calibration = ta.calibrate(arm.robot, data, model="constant")
    for call in (
        lambda: ta.calibrate(arm.robot, none),
        lambda: ta.evaluate(calibration, none),
        lambda: ta.update(calibration, none),
    ):
        with pytest.raises(ta.InputError, match="the measurements have no rows"):
            call()


def test_a_train_size_keeps_distances_between_rows(arm):
    q = arm.poses(400, seed=1)
    points = arm.true_position(q)
    frame = ta.Measurements.from_dataframe
    table = arm.measure_table(q).drop(columns=["x", "y", "z"])
    table["distance"] = np.repeat(np.linalg.norm(points[0::2] - points[1::2], axis=1), 2)
    table["pair"] = [f"p{k // 2}" for k in range(len(q))]
    found = ta.calibrate(arm.robot, frame(table), model="constant", train_size=100)
    assert found.rows is not None
    assert core_set.distance_count(found.rows.data.select(found.rows.side == 1)) == 50


def test_intervals_are_counted_in_every_file(arm, monkeypatch):
    seen, made = list[list[str]](), core_set.core_set

    def noted(robot, rows, *more):
        seen.append(rows.files)
        return made(robot, rows, *more)

    monkeypatch.setattr(intervals, "MOST_ROWS", 12)
    monkeypatch.setattr(intervals, "core_set", noted)
    parts = [
        ta.Measurements.from_dataframe(arm.measure_table(arm.poses(50, seed=k), seed=k), name=f"s{k}")
        for k in range(3)
    ]
    ta.calibrate(arm.robot, parts, refit=False)
    assert seen == [["s0", "s1", "s2"]]
