"""`truearm strip` as people run it."""

import numpy as np
import pytest

import truearm as ta
from truearm.cli import main
from truearm.simulation import VirtualArm


@pytest.fixture(scope="module")
def calib(tmp_path_factory):
    path = tmp_path_factory.mktemp("strip") / "arm.calib"
    arm = VirtualArm.paper(seed=2)
    ta.calibrate(arm.robot, arm.measure(arm.poses(50))).save(path)
    return path


def test_the_measurements_are_left_out_and_predictions_stay(calib, tmp_path, capsys):
    assert main(["strip", str(calib), "-o", str(tmp_path / "small.calib")]) == 0
    assert "without the measurements" in capsys.readouterr().out
    whole, small = ta.Calibration.load(calib), ta.Calibration.load(tmp_path / "small.calib")
    assert whole.rows is not None
    assert small.rows is None
    q = whole.rows.data.readings
    assert np.array_equal(small.pose(q), whole.pose(q))
    assert np.array_equal(small.conservative_std(q), whole.conservative_std(q))
    assert (tmp_path / "small.calib").stat().st_size < calib.stat().st_size


def test_a_calibration_is_not_stripped_in_place(calib, capsys):
    before = calib.read_bytes()
    assert main(["strip", str(calib), "-o", str(calib)]) == 2
    assert "never written over" in capsys.readouterr().err
    assert calib.read_bytes() == before
