"""Calibration files: everything comes back bit for bit, and no altered byte goes unnoticed."""

import hashlib
import json
import os
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from safetensors.numpy import save as save_arrays

import truearm as ta
from tests.calibration_file_support import read_calibration_file, write_calibration_file
from truearm.simulation import VirtualArm
from truearm.storage import calibration_file
from truearm.storage.calibration_file import DIGEST, NO_DIGEST

DEEP = '{"a":' + 100_000 * "[" + 100_000 * "]" + "}"
"""JSON in which Python cannot look down to the ground."""


@pytest.fixture(scope="module")
def calibrated():
    arm = VirtualArm.paper(seed=2)
    table = arm.measure_table(arm.poses(70), orientation=True)
    table["temperature_C"] = np.linspace(20.0, 30.0, 70)
    table["sigma_mm"] = 0.02
    table["group"] = ["morning", "evening"] * 35
    data = ta.Measurements.from_dataframe(table)
    return arm, ta.calibrate(arm.robot, data, features="temperature_C", split_by="temperature_C")


@pytest.fixture(scope="module")
def written(calibrated, tmp_path_factory):
    path = tmp_path_factory.mktemp("file") / "arm.calib"
    calibrated[1].save(path)
    return path


def rows_of(calibration):
    """The rows of a calibration that has them."""
    assert calibration.rows is not None
    return calibration.rows


@pytest.mark.parametrize("method", ["position", "pose", "parameters", "position_std", "pose_std"])
def test_predictions_come_back_bit_for_bit(calibrated, written, method):
    arm, calibration = calibrated
    again = ta.Calibration.load(written)
    asked = {"features": {"temperature_C": 24.0}}
    q = arm.poses(10, seed=4)
    np.testing.assert_array_equal(
        getattr(again, method)(q, **asked), getattr(calibration, method)(q, **asked)
    )


def test_a_target_in_world_comes_back_bit_for_bit(calibrated, written):
    arm, calibration = calibrated
    again = ta.Calibration.load(written)
    q, warm = arm.poses(10, seed=4), {"temperature_C": 24.0}
    first, second = (c.pose(q, group="evening", target=1, features=warm) for c in (again, calibration))
    np.testing.assert_array_equal(first, second)


def test_everything_else_comes_back(calibrated, written):
    _, calibration = calibrated
    again = ta.Calibration.load(written)
    timeless = {key: value for key, value in calibration.summary.items() if key != "seconds"}
    assert {key: again.summary[key] for key in timeless} == timeless
    assert again.robot == calibration.robot
    assert again.options == calibration.options
    assert again.validation == calibration.validation
    assert again.groups == calibration.groups
    assert again.notices == calibration.notices
    assert rows_of(again).data.hash() == rows_of(calibration).data.hash()
    np.testing.assert_array_equal(rows_of(again).data.rows, rows_of(calibration).data.rows)
    np.testing.assert_array_equal(rows_of(again).side, rows_of(calibration).side)
    np.testing.assert_array_equal(again.constant.covariance, calibration.constant.covariance)


def test_written_again_it_is_the_same_file(written, tmp_path):
    ta.Calibration.load(written).save(tmp_path / "again.calib")
    assert (tmp_path / "again.calib").read_bytes() == written.read_bytes()


def test_a_constant_calibration_comes_back(calibrated, tmp_path):
    arm, _ = calibrated
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(40)), model="constant")
    calibration.save(tmp_path / "c.calib")
    again = ta.Calibration.load(tmp_path / "c.calib")
    q = arm.poses(5, seed=4)
    np.testing.assert_array_equal(again.position_std(q), calibration.position_std(q))
    assert set(again.models) == {"nominal", "constant"}


def test_parallel_within_and_frame_come_back(tmp_path):
    arm = VirtualArm.paper(seed=2)
    calibration = ta.calibrate(
        arm.robot, arm.measure(arm.poses(60)), frame="world", parallel_within_deg=1.0, model="constant"
    )
    calibration.save(tmp_path / "w.calib")
    again = ta.Calibration.load(tmp_path / "w.calib")
    assert again.arm.candidates == calibration.arm.candidates
    q = arm.poses(5, seed=4)
    np.testing.assert_array_equal(again.position(q), calibration.position(q))


def test_without_rows_it_predicts_and_says_why_it_has_no_deviations(calibrated, tmp_path):
    arm, calibration = calibrated
    calibration.save(tmp_path / "small.calib", with_rows=False)
    again = ta.Calibration.load(tmp_path / "small.calib")
    q, warm = arm.poses(5, seed=4), {"temperature_C": 24.0}
    np.testing.assert_array_equal(again.position(q, features=warm), calibration.position(q, features=warm))
    with pytest.raises(ta.WorkError, match="left out of this file"):
        again.position_std(q, features=warm)


@pytest.mark.parametrize("read", [False, True])
def test_without_rows_it_is_what_a_file_without_them_holds(calibrated, written, read):
    whole = ta.Calibration.load(written) if read else calibrated[1]
    stripped = whole.without_rows()
    assert stripped.file is None
    assert stripped.to_bytes() == whole.to_bytes(with_rows=False)
    assert len(pickle.dumps(stripped)) < len(whole.to_bytes())


@given(data=st.data())
def test_any_altered_byte_is_noticed(written, data):
    content = bytearray(written.read_bytes())
    place = data.draw(st.integers(0, len(content) - 1))
    content[place] ^= data.draw(st.integers(1, 255))
    altered = written.with_name("altered.calib")
    altered.write_bytes(content)
    with pytest.raises(ta.InputError, match=r"altered\.calib: "):
        ta.Calibration.load(altered)


@given(place=st.integers(0, 3000), change=st.integers(1, 255))
def test_any_altered_byte_of_the_header_is_noticed(written, place, change):
    content = bytearray(written.read_bytes())
    content[place] ^= change
    altered = written.with_name("altered.calib")
    altered.write_bytes(content)
    with pytest.raises(ta.InputError, match=r"altered\.calib: "):
        ta.Calibration.load(altered)


@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_any_truncated_file_is_noticed(written, share):
    content = written.read_bytes()
    cut = written.with_name("cut.calib")
    cut.write_bytes(content[: int(share * len(content))])
    with pytest.raises(ta.InputError, match="cut short|no calibration file|empty file"):
        ta.Calibration.load(cut)


def test_bytes_behind_the_end_are_noticed(written, tmp_path):
    (tmp_path / "long.calib").write_bytes(written.read_bytes() + b"\0")
    with pytest.raises(ta.InputError, match="altered"):
        ta.Calibration.load(tmp_path / "long.calib")


def test_another_schema_version_is_said(monkeypatch, tmp_path):
    monkeypatch.setattr(calibration_file, "SCHEMA", 99)
    write_calibration_file(tmp_path / "new.calib", {"a": np.zeros(2)}, {"version": "9.9.0"})
    monkeypatch.undo()
    with pytest.raises(ta.InputError, match=r"version 99.*reads version \d+.*truearm 9\.9\.0"):
        ta.Calibration.load(tmp_path / "new.calib")


def test_a_missing_key_is_said(tmp_path):
    write_calibration_file(tmp_path / "odd.calib", {"a": np.zeros(2)}, {"version": "0.1.0"})
    with pytest.raises(ta.InputError, match="has no '"):
        ta.Calibration.load(tmp_path / "odd.calib")


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        (("conservative",), 0, "what this calibration holds cannot be read: .*It is whole, but not as"),
        (("conservative", "level", 0), None, "what this calibration holds cannot be read"),
        (("models",), None, "what this calibration holds cannot be read"),
        (("models", "variable", "blocks"), 1.5, "what this calibration holds cannot be read"),
        (("models", "variable", "blocks", 0, "axes", 0, 4), 10**12, "what this calibration holds cannot be"),
        (("options", "rate"), [], r"rate is \[\]. It must be a number"),
        (("robot",), 1.5, "what this calibration holds cannot be read"),
        (("selection", "targets"), 1.5, "'selection.targets' is 1.5. Input should be a valid list"),
        (("variable", "hyper", "sag"), "1", "'variable.hyper.sag' is '1'. Input should be a valid list"),
        (("rows", "words", "group", 0), "zzz", 'rows are of the set-up "zzz"'),
        (("groups",), ["morning"], "the calibration names 1 set-ups. Its models have 2"),
        (("version",), 7, "'version' is 7"),
    ],
)
def test_odd_values_under_a_valid_digest_are_refused_by_name(written, tmp_path, place, value, words):
    arrays, content = read_calibration_file(written)
    part = content
    for key in place[:-1]:
        part = part[key]
    part[place[-1]] = value
    write_calibration_file(tmp_path / "odd.calib", arrays, {**content, "sha256": NO_DIGEST})
    with pytest.raises(ta.InputError, match=f"odd.calib.*{words}") as raised:
        ta.Calibration.load(tmp_path / "odd.calib")
    assert raised.value.__cause__ is not None


def test_numbers_of_other_kinds_in_memory_are_stored_as_ours(tmp_path):
    arm = VirtualArm.paper(seed=2)
    data = arm.measure(arm.poses(40), orientation=True)
    assert data.orientations is not None
    odd = replace(data, rows=data.rows.astype(np.int32), orientations=data.orientations.astype(np.float32))
    ta.calibrate(arm.robot, odd, model="constant").save(tmp_path / "odd.calib")
    arrays, _ = read_calibration_file(tmp_path / "odd.calib")
    assert arrays["rows.rows"].dtype == "int64"
    assert arrays["rows.orientations"].dtype == "float64"
    assert ta.Calibration.load(tmp_path / "odd.calib").rows is not None


def _last(values, value):
    changed = values.copy()
    changed.flat[-1] = value
    return changed


def _nan(values):
    return _last(values, np.nan)


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("variable.constants", _nan, "'variable.constants' holds NaN or infinite numbers"),
        ("variable.frames", _nan, "'variable.frames' holds NaN or infinite numbers"),
        ("variable.block7.weights", _nan, "'variable.block7.weights' holds NaN or infinite numbers"),
        ("variable.block0.weights", lambda values: values * 1e45, "weights of a block"),
        (
            "variable.constants",
            lambda values: values[:2],
            r"'variable.constants' has shape \(2, 5\). It",
        ),
        ("variable.targets", lambda values: values[..., :2], "'variable.targets' has shape"),
        ("constant.constants", lambda values: values.astype(np.float32), "holds float32 numbers. It holds f"),
        ("constant.covariance", lambda values: values[:-1], "'constant.covariance' has shape"),
        ("constant.standard_errors", lambda values: values[:-1], "'constant.standard_errors' has shape"),
        ("rows.targets", lambda values: _last(values, np.inf), "'rows.targets' holds .*inf.* in row"),
        ("rows.targets", _nan, "All numbers of one are finite, or all NaN"),
        ("rows.sigma_m", lambda values: _last(values, -1.0), "'rows.sigma_m' holds -1.0 in row .*Each is"),
        ("outcome.weight", lambda values: _last(values, 1.5), "holds 1.5 in row .* between 0 and 1"),
        ("rows.targets", None, "the calibration has no 'rows.targets'"),
        ("rows.readings", lambda values: values[:, :-1], "'rows.readings' has shape"),
        ("outcome.weight", lambda values: values.astype(np.float32), "'outcome.weight' holds float32"),
        ("outcome.score", lambda values: values[:-1], r"'outcome.score' has shape .* There are \d+ rows"),
        ("held.readings", lambda values: values[:, :-1], "'held.readings' has shape"),
    ],
)
def test_odd_arrays_under_a_valid_digest_are_refused_by_name(written, tmp_path, name, change, words):
    arrays, content = read_calibration_file(written)
    values = arrays.pop(name)
    if change is not None:
        arrays[name] = np.ascontiguousarray(change(values))
    write_calibration_file(tmp_path / "odd.calib", arrays, {**content, "sha256": NO_DIGEST})
    with pytest.raises(ta.InputError, match=f"odd.calib.*{words}"):
        ta.Calibration.load(tmp_path / "odd.calib")


def test_numbers_of_another_kind_are_taken_where_they_are_equal(written, tmp_path):
    arrays, content = read_calibration_file(written)
    kept = content["options"]
    odd = {"refit": 1, "degree": 2.0, "judge_target": True, "epochs": 2000.0, "scheme_joints": [1.0, 2, 3]}
    for stored in (odd, {"refit": 0}):
        changed = {**content, "options": {**kept, **stored}, "sha256": NO_DIGEST}
        write_calibration_file(tmp_path / "old.calib", arrays, changed)
        found = ta.Calibration.load(tmp_path / "old.calib").options.to_dict()
        assert found == {**kept, "refit": stored["refit"] == 1}
        assert type(found["refit"]) is bool
        assert {type(found[name]) for name in ("degree", "judge_target", "epochs")} == {int}
    write_calibration_file(
        tmp_path / "odd.calib", arrays, {**content, "options": {**kept, "degree": 2.5}, "sha256": NO_DIGEST}
    )
    with pytest.raises(ta.InputError, match="odd.calib: degree is 2.5. It must be a whole number") as raised:
        ta.Calibration.load(tmp_path / "odd.calib")
    assert not isinstance(raised.value, ta.UsageError)


def test_numbers_beyond_all_are_refused(written, tmp_path):
    arrays, content = read_calibration_file(written)
    content["constant"]["noise_m"] = 0.12345
    write_calibration_file(tmp_path / "odd.calib", arrays, {**content, "sha256": NO_DIGEST})
    blank = (tmp_path / "odd.calib").read_bytes().replace(b"0.12345", b"1.0e999")
    digits = DIGEST.search(blank)
    assert digits is not None
    zeros = blank[: digits.start(1)] + NO_DIGEST.encode() + blank[digits.end(1) :]
    digest = hashlib.sha256(zeros).hexdigest().encode()
    (tmp_path / "odd.calib").write_bytes(zeros.replace(NO_DIGEST.encode(), digest, 1))
    with pytest.raises(ta.InputError, match=r"odd.calib: this calibration has been altered"):
        ta.Calibration.load(tmp_path / "odd.calib")


def nested(header):
    """A safetensors file of a header alone."""
    return len(header).to_bytes(8, "little") + header


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty file"),
        (b"q1,q2,x,y,z\n1,2,3,4,5\n", "no calibration file"),
        (b"PK\x03\x04" + bytes(100), "no calibration file"),
        (save_arrays({"a": np.zeros(3)}), "safetensors file, but no calibration"),
        (save_arrays({"a": np.zeros(3)}, {"truearm": "[1]"}), "no JSON object"),
        (json.dumps({"robot": "UR10"}).encode(), "no calibration file"),
        pytest.param(nested(DEEP.encode()), "its header is no JSON", id="deep header"),
        pytest.param(
            save_arrays({"a": np.zeros(3)}, {"truearm": DEEP}), "its metadata is no JSON", id="deep metadata"
        ),
    ],
)
def test_files_that_are_no_calibration(content, words, tmp_path):
    (tmp_path / "x.calib").write_bytes(content)
    with pytest.raises(ta.InputError, match=words):
        ta.Calibration.load(tmp_path / "x.calib")


def test_what_is_no_regular_file_is_refused_and_not_waited_for(tmp_path):
    pipe = tmp_path / "pipe.calib"
    os.mkfifo(pipe)
    for path in (pipe, Path("/dev/zero")):
        with pytest.raises(ta.InputError, match=rf"{path}: this is a pipe or a device. A regular file"):
            ta.Calibration.load(path)
    with pytest.raises(ta.InputError, match="this is a directory"):
        ta.Calibration.load(tmp_path)


@pytest.mark.parametrize("first", [b"", b"\x02" + bytes(7) + b"[", bytes(5) + b"\x01\0\0{"])
def test_a_file_is_refused_by_its_first_bytes_however_long_it_is(first, tmp_path):
    path = tmp_path / "long.calib"
    path.write_bytes(first)
    os.truncate(path, 2**40)
    with pytest.raises(ta.InputError, match=r"long\.calib: this is no calibration file"):
        ta.Calibration.load(path)


def test_a_file_that_is_not_there():
    with pytest.raises(ta.InputError, match="no such file"):
        ta.Calibration.load("nowhere.calib")


def test_a_failed_write_leaves_nothing(calibrated, tmp_path, monkeypatch):
    _, calibration = calibrated
    monkeypatch.setattr("pathlib.Path.replace", _refuse)
    with pytest.raises(ta.InputError, match=r"arm\.calib: this cannot be written: disk full"):
        calibration.save(tmp_path / "arm.calib")
    assert list(tmp_path.iterdir()) == []


def _refuse(*_):
    raise OSError("disk full")


def test_the_content_is_arrays_and_plain_json(written):
    arrays, content = read_calibration_file(written)
    assert content["schema"] == calibration_file.SCHEMA
    assert content["robot"]["name"] == "RV-M2"
    assert content["controller_model"] is None
    assert "payload" in content["robot"]
    assert set(content["models"]) == {"nominal", "constant", "variable"}
    assert arrays["rows.readings"].shape == (70, 5)
    assert arrays["variable.constants"].shape == (5, 5)
