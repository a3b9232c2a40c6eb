"""The C library reads what Python writes, and computes the same."""

import ctypes
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import truearm as ta
from tests.parallel_link import calibrated
from tests.wall import on_a_wall
from truearm.simulation import Imperfections, VirtualArm

OK, REFUSED = 0, 2
HOME = [0.3, -1.2, 1.4, -0.7, 1.1, 0.2]


class Correction(ctypes.Structure):
    """truearm_correction."""

    _fields_ = [
        ("residual_m", ctypes.c_double),
        ("residual_rad", ctypes.c_double),
        ("shift_m", ctypes.c_double * 3),
        ("turn_rad", ctypes.c_double * 3),
        ("std_m", ctypes.c_double),
        ("reason", ctypes.c_uint32),
        ("joint", ctypes.c_uint32),
        ("value", ctypes.c_double),
        ("limit", ctypes.c_double),
    ]


class Options(ctypes.Structure):
    """truearm_options."""

    _fields_ = [
        ("task", ctypes.c_uint32),
        ("moving", ctypes.c_uint64),
        ("largest_angle_rad", ctypes.c_double),
        ("largest_slide_m", ctypes.c_double),
        ("largest_shift_m", ctypes.c_double),
        ("largest_turn_rad", ctypes.c_double),
        ("largest_std_m", ctypes.c_double),
    ]


def numbers(values):
    return (ctypes.c_double * len(values))(*values)


class Library:
    """The shared library with one calibration."""

    def __init__(self, path: Path, calib: Path, tool: np.ndarray, joints: int = 6) -> None:
        self.core = ctypes.CDLL(str(path))
        self.core.truearm_joint_count.restype = ctypes.c_size_t
        calibration, self.corrector, self.workspace = (ctypes.c_void_p() for _ in range(3))
        message = ctypes.create_string_buffer(300)
        status = self.core.truearm_load_file(
            str(calib).encode(), ctypes.byref(calibration), message, ctypes.c_size_t(300)
        )
        assert status == OK, message.value
        assert self.core.truearm_joint_count(calibration) == joints
        made = ctypes.byref(self.corrector)
        tool = numbers(tool.ravel())
        self.core.truearm_default_options.restype = Options
        options = self.core.truearm_default_options()
        options.largest_std_m = np.inf
        given = calibration, tool, ctypes.byref(options), made, message, ctypes.c_size_t(300)
        assert self.core.truearm_corrector_new(*given) == OK, message.value
        assert self.core.truearm_workspace_new(self.corrector, ctypes.byref(self.workspace)) == OK

    def call(self, name, q, features, size, *more):
        out = numbers([np.nan] * size)
        sized = [ctypes.c_size_t(len(values)) for values in (q, features)]
        status = getattr(self.core, name)(
            self.corrector,
            self.workspace,
            numbers(q),
            sized[0],
            numbers(features),
            sized[1],
            out,
            ctypes.c_size_t(size),
            *more,
        )
        return status, np.array(out)

    def pose(self, q, features=()):
        status, out = self.call("truearm_predict_pose", q, features, 16)
        assert status == OK
        return out.reshape(4, 4)

    def correct(self, q, features=()):
        found = Correction()
        status, out = self.call("truearm_correct", q, features, len(q), ctypes.byref(found))
        return status, out, found


@pytest.fixture(scope="module")
def library(root):
    found = [*root.glob("target/*/libtruearm.so"), *root.glob("target/*/deps/libtruearm.so")]
    newest = max(found, key=modified, default=None)
    if newest is None or modified(newest) < max(map(modified, sources(root))):
        pytest.skip("the C library is not built from these sources: cargo build --release -p truearm-capi")
    return newest


def sources(root):
    """What the library is built from; neither other libraries nor what tests alone compile."""
    crates = [crate for crate in root.glob("crates/*") if crate.name not in {"python", "text", "clearance"}]
    return [path for crate in crates for path in crate.glob("src/**/*.rs") if "tests" not in path.parts[-2:]]


def modified(path):
    return path.stat().st_mtime


@pytest.fixture(scope="module")
def data():
    robot = ta.Robot.load("ur5e")
    arm = VirtualArm(robot, seed=4, imperfections=Imperfections(share=0.5))
    return robot, arm.measure(arm.poses(80))


def tool_of(robot):
    tool = np.eye(4)
    tool[:3, 3] = [0.02, -0.05, 0.16]
    return robot.tool @ tool


def test_programs_look_for_the_shared_library_by_its_name(library):
    assert b"\0libtruearm.so\0" in library.read_bytes()


@pytest.mark.parametrize("model", ["variable", "constant"])
def test_it_computes_what_python_computes(model, data, library, tmp_path):
    robot, measured = data
    calibration = ta.calibrate(robot, measured, model=model)
    calibration.save(tmp_path / "arm.calib", with_rows=False)
    tool = tool_of(robot)
    known = Library(library, tmp_path / "arm.calib", tool)
    compensator = ta.Compensator(calibration, limits=ta.Limits(largest_std_mm=None))
    draws = np.random.default_rng(2).uniform(-1.5, 1.5, (20, 6))
    corrected = 0
    for q in [np.array(HOME), *draws]:
        assert known.pose(q) == pytest.approx(calibration.pose(q, tool=tool), abs=1e-12)
        status, out, found = known.correct(q)
        theirs = compensator.joints(q, tool=tool)
        assert (status == REFUSED) == bool(theirs.refusals)
        if status == OK:
            corrected += 1
            assert out == pytest.approx(theirs.q[0], abs=1e-12)
            bound = calibration.conservative_std(theirs.q[0], tool=tool)[0]
            assert found.std_m == pytest.approx(bound, rel=1e-9)
    assert corrected > 5


def test_it_knows_which_way_is_up(library, tmp_path):
    calibration, measured = on_a_wall()
    calibration.save(tmp_path / "arm.calib")
    known = Library(library, tmp_path / "arm.calib", calibration.robot.tool)
    for q in measured.readings[:5]:
        assert known.pose(q) == pytest.approx(calibration.pose(q), abs=1e-12)


def test_it_knows_what_goes_with_readings(library, tmp_path):
    calibration = calibrated(behind_a_link=True)
    calibration.save(tmp_path / "arm.calib", with_rows=False)
    known = Library(library, tmp_path / "arm.calib", calibration.robot.tool)
    compensator = ta.Compensator(calibration, limits=ta.Limits(largest_std_mm=None))
    for q in np.random.default_rng(5).uniform(-0.8, 0.8, (20, 6)):
        assert known.pose(q) == pytest.approx(calibration.pose(q), abs=1e-12)
        status, out, _ = known.correct(q)
        assert status == OK
        assert out == pytest.approx(compensator.joints(q).q[0], abs=1e-12)


def test_a_base_that_is_corrected_is_read(library, tmp_path):
    arm = VirtualArm.paper(seed=2)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(60)), frame="world", model="constant")
    calibration.save(tmp_path / "arm.calib")
    known = Library(library, tmp_path / "arm.calib", arm.robot.tool, joints=5)
    q = arm.robot.limits.mean(axis=1)
    assert known.pose(q) == pytest.approx(calibration.pose(q), abs=1e-12)


@pytest.mark.parametrize("name", ["temperature", "payload_kg"])
def test_features_are_passed(data, library, tmp_path, name):
    robot, measured = data
    rng = np.random.default_rng(0)
    values = rng.uniform(18.0, 30.0, len(measured))
    warm = replace(measured, features=measured.features.assign(**{name: values}))
    calibration = ta.calibrate(robot, warm, features=(name,))
    calibration.save(tmp_path / "arm.calib", with_rows=False)
    (sag,) = (block for block in calibration.summary["blocks"] if block["name"] == "sag")
    assert sag["features"] == ([name] if name == "payload_kg" else [])
    known = Library(library, tmp_path / "arm.calib", robot.tool)
    for value in (19.0, 28.0):
        expected = calibration.pose(HOME, features={name: value})
        assert known.pose(HOME, [value]) == pytest.approx(expected, abs=1e-12)
    assert known.pose(HOME, [19.0]) != pytest.approx(known.pose(HOME, [28.0]), abs=1e-9)
