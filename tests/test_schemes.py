"""The paper's schemes as models of a calibration: fitted, judged, kept, refused where they cannot serve."""

import json
from contextlib import nullcontext
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.report_support import words_of
from truearm import (
    Calibration,
    CalibrationOptions,
    Measurements,
    Robot,
    UsageError,
    WorkError,
    calibrate,
    evaluate,
)
from truearm._core import CoreError, Network
from truearm.cli import main
from truearm.compensation import Compensator
from truearm.fits.fitted_rows import FittedRows
from truearm.fits.known_scale import KnownScale
from truearm.fits.scheme_options import SchemeOptions
from truearm.kinds import required
from truearm.simulation import Imperfections, VirtualArm

QUICK: dict[str, Any] = {"most_regions": 12, "region_rows": 12, "holdout": 0.3, "cells": (9, 7, 7)}
WAVY = Imperfections(share=0.5, noise_mm=0.01)


@pytest.fixture(scope="module")
def arm():
    return VirtualArm.paper(seed=2, imperfections=WAVY)


@pytest.fixture(scope="module")
def data(arm):
    return arm.measure(arm.poses(500, held=(4, 5)))


@pytest.fixture(scope="module")
def calibrations(data):
    robot = Robot.load("rv-m2")
    return {model: calibrate(robot, data, model=model, **QUICK) for model in ("regions", "fcmac", "cmac")}


@pytest.mark.parametrize("model", ["regions", "fcmac"])
def test_schemes_beat_the_constants_where_errors_vary(calibrations, model):
    held_out = calibrations[model].validation.holdout
    assert held_out[model].position.mean < 0.8 * held_out["constant"].position.mean


def test_what_a_scheme_leaves_is_its_own(calibrations, data, arm):
    found = calibrations["regions"]
    unexplained = found.summary["noise_mm"]
    held_out = found.validation.holdout
    assert unexplained == pytest.approx(held_out["regions"].position.rms / np.sqrt(3.0))
    assert unexplained < 0.9 * held_out["constant"].position.rms / np.sqrt(3.0)
    stated = replace(data, sigma_m=np.full(len(data), 1e-5))
    with_sigma = calibrate(arm.robot, stated, model="regions", **QUICK)
    rms = with_sigma.validation.holdout["regions"].position.rms
    assert with_sigma.summary["noise_mm"] == pytest.approx(np.sqrt(rms**2 / 3.0 - 0.01**2))


def missed_m(found):
    """How far each row's point (n,) is from where a calibration predicts it, by its predictions alone."""
    data = found.rows.data
    return np.linalg.norm(found.position(data.readings, group=found.groups[0]) - data.targets[:, 0], axis=1)


@pytest.mark.parametrize("model", ["regions", "fcmac"])
def test_rows_of_a_scheme_are_measured_minus_predicted(calibrations, model):
    found = calibrations[model]
    rows, left = found.rows, missed_m(found)
    constant = replace(found, options=replace(found.options, model="constant"))
    assert left.mean() < 0.9 * missed_m(constant).mean()
    base_from_world = found.model.setup.frames[0, :3, :3].T
    seen = rows.data.targets[:, 0] - found.position(rows.data.readings, group=found.groups[0])
    np.testing.assert_allclose(rows.residual, seen @ base_from_world.T, rtol=0.0, atol=1e-12)
    clear = rows.score <= 1.0
    assert clear.sum() > 400
    np.testing.assert_allclose(rows.distance_m[clear], left[clear], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("shots", [1, 2])
def test_outliers_of_a_scheme_are_those_of_its_constants(data, arm, shots):
    targets = np.array(data.targets)
    targets[[7, 90]] += [0.0, 0.03, 0.0]
    spoilt = replace(data, targets=targets)
    spoilt = spoilt.concatenate([spoilt] * shots)
    found, constant = (
        calibrate(arm.robot, spoilt, model=model, **QUICK) for model in ("regions", "constant")
    )
    rows, theirs = found.rows, constant.rows
    assert rows is not None
    assert theirs is not None
    assert {entry["row"] for entry in rows.outliers()} == {8, 91}
    np.testing.assert_array_equal(rows.score, theirs.score)
    far = rows.score > 1.0
    np.testing.assert_array_equal(rows.distance_m[far], theirs.distance_m[far])
    np.testing.assert_allclose(rows.distance_m[~far], missed_m(found)[~far], rtol=0.0, atol=1e-12)


def test_the_scale_of_a_robust_loss_is_that_of_the_constants(arm, data):
    few = data.select(slice(0, 150))
    found, constant = (
        calibrate(arm.robot, few, model=model, robust="huber", **QUICK) for model in ("regions", "constant")
    )
    rows = required(constant.rows, FittedRows, "rows")
    scale = required(constant.constant.scale, KnownScale, "scale")
    clear = rows.score <= 1.0
    left = rows.residual[clear] / constant.constant.noise_m
    freedom = left.size - constant.identifiability.total_rank
    assert scale.widened == pytest.approx(np.sqrt((left**2).sum() / freedom), rel=1e-12)
    assert found.constant.scale == scale


def test_outliers_of_a_scheme_are_turned_as_far_as_they_are_away():
    """Both by the constants: a scheme follows rows that it was fitted to."""
    arm = VirtualArm(Robot.load("ur10"), seed=4, imperfections=WAVY)
    table = arm.measure_table(arm.poses(150), orientation=True)
    table.loc[[7, 60], "y"] += 0.02
    spoilt = Measurements.from_dataframe(table)
    found, constant = (
        calibrate(arm.robot, spoilt, model=model, most_regions=8) for model in ("regions", "constant")
    )
    again = Calibration.from_bytes(found.to_bytes(), where="again")
    rows, theirs, read = (required(each.rows, FittedRows, "rows") for each in (found, constant, again))
    assert [entry["row"] for entry in rows.outliers()] == [61, 8]
    assert rows.outliers() == theirs.outliers() == read.outliers()
    clear = rows.score <= 1.0
    own = np.linalg.norm(rows.residual[clear, 3:], axis=1)
    np.testing.assert_array_equal(rows.turn_rad[clear], own)
    assert rows.turn_rad[clear].mean() != pytest.approx(theirs.turn_rad[clear].mean(), rel=0.01)


def test_predictions_are_those_of_the_scheme(calibrations, arm):
    found = calibrations["fcmac"]
    assert found.model_name == "fcmac"
    q = arm.poses(20, seed=5, held=(4, 5))
    seen = arm.measure_table(q)[["x", "y", "z"]].to_numpy()
    missed = np.linalg.norm(found.position(q, group=found.groups[0]) - seen, axis=1)
    assert missed.mean() < found.validation.holdout["constant"].position.mean * 1e-3
    assert np.ptp(found.parameters(q), axis=0).max() > 0.0
    assert found.position(q[:0]).shape == (0, 3)


@pytest.mark.parametrize("model", ["regions", "fcmac", "cmac"])
def test_a_scheme_survives_its_file(calibrations, model, arm, data, tmp_path):
    found = calibrations[model]
    found.save(tmp_path / "a.calib")
    again = Calibration.load(tmp_path / "a.calib")
    q = arm.poses(50, seed=6)
    np.testing.assert_array_equal(again.parameters(q), found.parameters(q))
    assert again.scheme == found.scheme
    assert again.options == found.options
    errors = evaluate(again, data).errors
    assert errors[model].position.mean < errors["constant"].position.mean


def test_weights_on_measurements_beat_weights_on_regional_ceps(data, calibrations):
    options: dict[str, Any] = {
        **QUICK,
        "train_on": "measurements",
        "membership": "bspline",
        "composition": "product",
    }
    fitted = calibrate(Robot.load("rv-m2"), data, model="fcmac", refit=False, **options)
    trained = calibrations["fcmac"].validation.holdout["fcmac"].position.mean
    assert fitted.validation.holdout["fcmac"].position.mean < trained


def test_six_inputs_and_poses():
    """Section 8: a network over all joints of a six-axis arm, orientation measured, its table hashed."""
    robot = Robot.load("ur10")
    arm = VirtualArm(robot, seed=1, imperfections=WAVY)
    data = arm.measure(arm.poses(300), orientation=True)
    found = calibrate(
        robot,
        data,
        model="fcmac",
        scheme_joints=(1, 2, 3, 4, 5, 6),
        table=20_011,
        refit=False,
        most_regions=4,
    )
    held_out = found.validation.holdout
    assert held_out["fcmac"].orientation is not None
    assert held_out["fcmac"].position.mean < 1.5 * held_out["constant"].position.mean


def test_what_a_scheme_cannot_do_is_refused(calibrations, arm):
    found = calibrations["regions"]
    with pytest.raises(WorkError, match="does not tell"):
        found.position_std(arm.poses(2))
    with pytest.raises(UsageError, match="scheme regions"):
        Compensator(found)


def test_a_scheme_of_an_arm_without_determined_parameters_is_refused():
    text = 'name = "table"\nconvention = "standard"\nlength_unit = "m"\nangle_unit = "deg"\n'
    robot = Robot.from_toml(text + '[[link]]\njoint = "revolute"\nd = 0.3\na = 0.5\n')
    arm = VirtualArm(robot, seed=1, imperfections=Imperfections(share=0.0))
    with pytest.raises(WorkError, match=r"determine no parameter of the arm.*--model constant"):
        calibrate(robot, arm.measure(arm.poses(40)), model="regions", scheme_joints=(1,))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"model": "fuzzy"}, "fuzzy"),
        ({"region_ceps": "best"}, "shrunk or least_squares"),
        ({"scheme_joints": (1, 1)}, "once"),
        ({"cells": (3,)}, "scheme_joints"),
        ({"demanded_mm": -1.0}, "Zero or more"),
        ({"rate": 0.0}, "positive"),
        ({"repeatability_mm": 0.0}, "positive"),
        ({"model": "fcmac", "cells": (-5, 3, 3)}, r"cells: \[-5, 3, 3\]. Each above active, which is 3"),
        ({"model": "cmac", "scheme_joints": (1, 2), "active": 7}, r"cells: \[7, 7\]. Each above active"),
        ({"model": "fcmac", "cells": (2**70, 4, 4)}, r"At most 16777216.*table=20011"),
        (
            {"model": "fcmac", "cells": (2**70, 4, 4), "table": 99},
            r"At most 18446744073709551615. Give fewer",
        ),
        ({"model": "fcmac", "table": 2**30}, "table: 1073741824. 1 to 16777216"),
        ({"model": "fcmac", "active": 9, "cells": (20, 20, 20)}, "active: 9. 1 to 8"),
        ({"model": "cmac", "scheme_joints": range(1, 7), "cells": [9] * 6, "active": 8}, "262144 .* Lower"),
        ({"model": "fcmac", "membership": "bspline", "active": 5}, "cubic"),
        ({"model": "fcmac", "sigma_cells": 0.01}, "sigma_cells: 0.01. At least 0.05"),
        ({"model": "cmac", "rate": 2.0}, "rate: 2. Below 2"),
        ({"model": "regions", "features": ("t",)}, "varies"),
    ],
)
def test_options_that_make_no_sense_are_refused(given, message):
    with pytest.raises(UsageError, match=message):
        CalibrationOptions.of(**given)


def test_numbers_that_a_model_does_not_use_may_be_any():
    for given in (
        {"model": "cmac", "sigma_cells": 0.01, "rate": 3.0, "train_on": "measurements"},
        {"model": "fcmac", "sigma_cells": 0.01, "membership": "bspline"},
        {"model": "regions", "rate": 3.0, "cells": [1, 1, 1], "train_on": "measurements"},
    ):
        assert CalibrationOptions.of(**given).to_dict().items() >= given.items()


def test_the_core_knows_the_rules_of_networks():
    """What these options allow at the most, and no more, the core takes."""
    for sensor, sigma, fits in (
        ((0.0, 1.0, 9, 8), 0.05, True),
        ((0.0, 1.0, 8, 8), 0.05, False),
        ((0.0, 1.0, 10, 9), 0.05, False),
        ((0.0, 1.0, 9, 8), 0.0499, False),
    ):
        given: Any = {"model": "fcmac", "scheme_joints": (1,), "cells": (sensor[2],), "active": sensor[3]}
        with nullcontext() if fits else pytest.raises(UsageError):
            CalibrationOptions.of(**given, sigma_cells=sigma)
        with nullcontext() if fits else pytest.raises(CoreError):
            Network([sensor], 1, SchemeOptions(sigma_cells=sigma).network(fuzzy=True))


def test_regions_are_not_trained(data):
    with pytest.raises(UsageError, match="train_on: .* regions are not. .* --model cmac or fcmac"):
        calibrate(Robot.load("rv-m2"), data, model="regions", train_on="measurements")


@pytest.mark.parametrize(
    ("model", "train_on"), [("regions", "ceps"), ("cmac", "ceps"), ("fcmac", "measurements")]
)
def test_joints_that_stood_still_are_named(arm, model, train_on):
    q = arm.poses(80)
    q[:, 0] = 0.3
    words = r"scheme_joints: all rows have joint 1 at 17\.19 deg\. .*--scheme-joints 2,3\."
    with pytest.raises(UsageError, match=words):
        calibrate(arm.robot, arm.measure(q), model=model, train_on=train_on)


def test_an_arm_has_only_its_joints(data):
    with pytest.raises(UsageError, match="1 to 5"):
        calibrate(Robot.load("rv-m2"), data, model="regions", scheme_joints=(1, 2, 9))


def test_commands_propose_none_that_refuses_a_scheme(calibrations, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    calibrations["cmac"].save("a.calib")
    assert main(["strip", "a.calib", "-o", "b.calib"]) == 0
    assert "truearm serve" not in capsys.readouterr().out
    assert main(["export", "a.calib", "--to", "urdf", "-o", "a.urdf"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "truearm compensate does not know the scheme cmac" in told
    assert "rewritten by truearm compensate" not in told
    assert main(["export", "a.calib", "--to", "field-csv", "-o", "a.csv"]) == 1
    refused = capsys.readouterr().err
    assert "of the scheme cmac" in refused
    assert "constant" not in refused.split("--to urdf")[0]


def test_from_the_command_line(arm, tmp_path, capsys):
    table = arm.measure_table(arm.poses(300, held=(4, 5)))
    table.to_csv(tmp_path / "m.csv", index=False)
    out = tmp_path / "out"
    words = ["calibrate", "rv-m2", str(tmp_path / "m.csv"), "-o", str(out), "--model", "regions"]
    assert main([*words, "--regions", "8", "--scheme-joints", "1,2", "--repeatability-mm", "0.1"]) == 0
    printed = capsys.readouterr().out
    assert "regions have CEPs of their own" in printed
    assert "truearm evaluate" in printed
    assert "truearm compensate" not in printed
    assert "repeatability" in printed
    assert "noise and, with the model regions, what varies with the joints." in " ".join(printed.split())
    for told in (printed, words_of((out / "report.html").read_text())):
        assert "noise alone" not in told
    summary = json.loads((out / "summary.json").read_text())
    ratio = summary["error_to_repeatability"]["regions"]
    assert ratio == pytest.approx(summary["holdout"]["regions"]["mean_mm"] / 0.1)
    assert main(["evaluate", str(out / "calibration.calib"), str(tmp_path / "m.csv")]) == 0
    assert "regions" in capsys.readouterr().out
    assert main([*words, "--scheme-joints", "one"]) == 2
    assert "--scheme-joints" in capsys.readouterr().err
