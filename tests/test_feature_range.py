"""Features beyond what a calibration learned are told wherever it is used."""

import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import truearm as ta
from truearm.cli import main
from truearm.exporting import ExportOptions, export
from truearm.reporting.report import report
from truearm.simulation import VirtualArm
from truearm.solving import beyond_learnt
from truearm.storage.calibration_file import NO_DIGEST, calibration_bytes, parse_calibration

PROGRAM = str(Path(sys.executable).parent / "truearm")
FAR = "payload_kg = 500 lies beyond 0 to 8, where it was learnt: corrections are guesses there."


@pytest.fixture(scope="module")
def arm():
    return VirtualArm.paper(seed=2)


def measured(arm, count, seed, payload_kg):
    """Rows whose payload, which bends nothing here, is as stated."""
    table = arm.measure_table(arm.poses(count, seed=seed), seed=seed).assign(payload_kg=payload_kg)
    return ta.Measurements.from_dataframe(table)


@pytest.fixture(scope="module")
def known(arm):
    data = measured(arm, 60, 0, np.tile([0.0, 4.0, 6.0, 8.0], 15))
    return ta.calibrate(arm.robot, data, features=("payload_kg",), refit=False)


def told(notices):
    return [str(notice) for notice in notices if notice.kind == "feature_range"]


def test_rows_beyond_are_told_with_their_values(known):
    assert beyond_learnt(known, [[-0.1], [8.1]]) == []
    assert beyond_learnt(known, [[-3.0], [12.0], [9.0]]) == [
        "payload_kg = -3 and 9 to 12 lies beyond 0 to 8, where it was learnt"
    ]
    assert beyond_learnt(known, [[4.0], [12.0], [9.0]]) == [
        "payload_kg = 9 to 12 lies beyond 0 to 8, where it was learnt"
    ]
    assert beyond_learnt(known, [500.0]) == [FAR.split(":", maxsplit=1)[0]]


def test_an_evaluation_and_its_report_tell_it(arm, known):
    assert told(ta.evaluate(known, measured(arm, 40, 5, 6.0)).notices) == []
    found = ta.evaluate(known, measured(arm, 40, 5, 500.0))
    assert told(found.notices) == [FAR]
    advice = report(known, found, other_names=("far.csv",)).advice[0]
    assert advice.kind == "other_measurements"
    assert FAR in advice.words


def test_an_update_tells_it(arm, known):
    assert told(ta.update(known, measured(arm, 20, 6, 6.0)).notices) == []
    assert told(ta.update(known, measured(arm, 20, 6, 500.0)).notices) == [FAR]


def test_files_without_measurements_and_their_updates_tell_it(arm, known, tmp_path):
    updated = ta.update(known, measured(arm, 20, 6, 6.0)).calibration
    for name, calibration in {"a": known, "b": updated}.items():
        assert beyond_learnt(calibration.without_rows(), [500.0]) == [FAR.split(":", maxsplit=1)[0]]
        calibration.save(tmp_path / name, with_rows=False)
        stripped = ta.Calibration.load(tmp_path / name)
        assert beyond_learnt(stripped, [500.0]) == [FAR.split(":", maxsplit=1)[0]]
        assert beyond_learnt(stripped, [8.1]) == []


def test_files_that_do_not_say_where_features_lay_tell_it_by_their_rows(known, tmp_path):
    """As those of earlier versions, until they are written again."""
    arrays, content = parse_calibration(known.to_bytes(), "new.calib")
    del content["variable"]["feature_lowest"]
    again = ta.Calibration.from_bytes(
        calibration_bytes(arrays, {**content, "sha256": NO_DIGEST}), where="older.calib"
    )
    assert beyond_learnt(again, [500.0]) == [FAR.split(":", maxsplit=1)[0]]
    stripped = ta.Calibration.from_bytes(again.to_bytes(with_rows=False), where="stripped.calib")
    assert beyond_learnt(stripped, [500.0]) == [FAR.split(":", maxsplit=1)[0]]


def test_an_update_that_is_refused_tells_it(arm, known):
    shifted = measured(arm, 20, 6, 500.0)
    shifted = replace(shifted, readings=shifted.readings + np.radians([0.0, 8.0, 0.0, 0.0, 0.0]))
    with pytest.raises(ta.WorkError, match="would be off by") as caught:
        ta.update(known, shifted)
    assert FAR in str(caught.value)


def test_a_refused_compensation_tells_it(arm, known, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    known.save("a.calib")
    np.savetxt("path.csv", np.degrees(0.5 * arm.poses(4, seed=7)), delimiter=",", comments="",
               header=",".join(f"q{k}_deg" for k in range(1, 6)))  # fmt: skip
    command = ["compensate", "a.calib", "path.csv", "--dry-run", "--largest-mm", "1e-6", "--task", "position"]
    command += ["--controller", "nominal", "--feature"]
    assert main([*command, "payload_kg=500"]) == 1
    error = " ".join(capsys.readouterr().err.split())
    assert "payload_kg = 500 lies beyond 0 to 8, where it was learnt: measure there" in error
    assert main([*command, "payload_kg=6"]) == 1
    assert "learnt" not in capsys.readouterr().err


@pytest.mark.parametrize(("payload_kg", "words"), [(500, FAR), (6, "")])
def test_serving_tells_it_before_it_begins(known, tmp_path, payload_kg, words):
    known.save(tmp_path / "a.calib")
    command = [PROGRAM, "serve", "a.calib", "--port", "0", "--feature", f"payload_kg={payload_kg}"]
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as running:
        assert running.stdout is not None
        assert "Correcting" in running.stdout.readline()
        os.kill(running.pid, signal.SIGINT)
        _, error = running.communicate(timeout=20)
    assert (words in " ".join(error.split())) if words else "learnt" not in error


@pytest.mark.parametrize(("payload_kg", "beyond"), [(500.0, [FAR]), (6.0, [])])
def test_samples_beyond_are_told_with_them_and_in_their_file(known, payload_kg, beyond):
    made = export(known, "field-csv", options=ExportOptions(grid="q1=3", features={"payload_kg": payload_kg}))
    assert [note for note in made.notes if "learnt" in note] == beyond
    comments = " ".join(line[2:] for line in made.text.splitlines() if line.startswith("#"))
    assert (FAR in comments) == bool(beyond)
