"""The compiled chain: against drawings, an independent oracle, another library, and its own rules."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from truearm import _core
from truearm.types import Floats

DEG = np.pi / 180
# Table I of the paper, mm: BASE, A1 to A5, TOOL.
RV_M2 = np.array(
    [
        [90 * DEG, 400, -80, 180 * DEG, 0],
        [0, 0, 120, -90 * DEG, 0],
        [0, 0, 250, 0, 0],
        [0, 0, 265, -90 * DEG, 0],
        [0, 0, 0, 90 * DEG, 0],
        [0, 0, 0, 0, 0],
        [0, 0, 170, 0, 0],
    ]
)
RV_M2_JOINTS = ["fixed", *["revolute"] * 5, "fixed"]
# Row and column (theta, d, a, alpha, beta) of the fifteen that the paper names as independent.
NAMED = [(0, k) for k in (0, 2, 3, 4)] + [(1, k) for k in (0, 1, 2, 3)]
NAMED += [(2, k) for k in (0, 2, 3, 4)] + [(3, k) for k in (0, 1, 2)]
# One unit of each scaled parameter moves the tool by about a millimetre.
SCALE_MM = np.array([1 / 300, 1.0, 1.0, 1 / 300, 1 / 300])
SIX_AXIS = np.array(
    [
        [0.0, 0.1273, 0.0, np.pi / 2, 0.0],
        [0.3, 0.02, -0.612, 0.0, 0.01],
        [0.0, 0.0, -0.5723, -0.02, 0.0],
        [0.0, 0.163941, 0.0, np.pi / 2, 0.0],
        [-0.1, 0.1157, 0.0, -np.pi / 2, 0.0],
        [0.0, 0.0922, 0.01, 0.2, -0.03],
    ]
)
END = np.array([[0.0, -1.0, 0.0, 0.01], [0.6, 0.0, -0.8, 0.02], [0.8, 0.0, 0.6, 0.15], [0.0, 0.0, 0.0, 1.0]])


def rv_m2() -> _core.Chain:
    return _core.Chain("standard", RV_M2_JOINTS, RV_M2, np.eye(4), np.eye(4))


def six_axis() -> _core.Chain:
    return _core.Chain("standard", ["revolute"] * 6, SIX_AXIS, np.eye(4), END)


def random_joints(n: int, joints: int = 6) -> Floats:
    return np.random.default_rng(3).uniform(-3.0, 3.0, (n, joints))


@pytest.fixture(scope="module")
def fixtures() -> dict[str, Any]:
    """Numbers of an independent oracle for the paper's arm, mm and rad."""
    path = Path(__file__).resolve().parents[2] / "shared" / "reference" / "rv_m2_fixtures.json"
    if not path.is_file():
        pytest.skip(f"the independent numbers for the RV-M2 are not at {path}")
    return dict(json.loads(path.read_text()))


def columns(pairs: list[tuple[int, int]]) -> list[int]:
    return [5 * row + k for row, k in pairs]


# By hand from Table I: joint one turns about the downward axis through (0, -80), so a reach of 805 swings
# from y to x; the shoulder is at (0, 40, 400), and world x is the axis of joint two.
@pytest.mark.parametrize(
    ("degrees", "point_mm"),
    [
        ([0, 0, 0, 0, 0], [0, 725, 400]),
        ([0, 90, 0, 0, 0], [0, 40, 1085]),
        ([90, 0, 0, 0, 0], [805, -80, 400]),
        ([0, 90, -90, 0, 0], [0, 40 + 265 + 170, 650]),
    ],
)
def test_positions_of_the_rv_m2_are_those_of_its_drawing(degrees: list[int], point_mm: list[int]) -> None:
    q = np.array([degrees]) * DEG
    np.testing.assert_allclose(rv_m2().position(q)[0], point_mm, rtol=0, atol=1e-9)


def test_positions_are_the_oracles(fixtures: dict[str, Any]) -> None:
    q = np.array(fixtures["q_rad"])
    np.testing.assert_allclose(rv_m2().position(q), fixtures["nominal_mm"], rtol=0, atol=1e-9)


def test_positions_with_errors_are_the_oracles(fixtures: dict[str, Any]) -> None:
    q, table = np.array(fixtures["q_rad"]), RV_M2.copy()
    table.flat[columns(NAMED)] += fixtures["ceps"]
    expected = fixtures["with_ceps_mm"]
    np.testing.assert_allclose(rv_m2().position(q, table), expected, rtol=0, atol=1e-9)
    each = np.ascontiguousarray(np.broadcast_to(table, (len(q), 7, 5)))
    np.testing.assert_allclose(rv_m2().position(q, each), expected, rtol=0, atol=1e-9)


def test_jacobian_is_the_oracles(fixtures: dict[str, Any]) -> None:
    expected = np.array(fixtures["jacobian_first3"])
    q = np.array(fixtures["q_rad"])[: len(expected)]
    found = rv_m2().parameter_jacobian(q)[:, :, columns(NAMED)]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5)


def test_the_paper_s_fifteen_of_twentyfive_are_independent() -> None:
    q = np.zeros((400, 5))
    low, high = np.array([-150, -30, -120]) * DEG, np.array([150, 100, 0]) * DEG
    q[:, :3] = np.random.default_rng(0).uniform(low, high, (400, 3))
    jacobian = rv_m2().parameter_jacobian(q).reshape(-1, 35) * np.tile(SCALE_MM, 7)

    every = [(row, k) for row in (0, 1, 2, 3, 6) for k in range(5)]
    all_values = np.linalg.svd(jacobian[:, columns(every)], compute_uv=False)
    assert np.count_nonzero(all_values > 1e-10 * all_values[0]) == 15

    named_values = np.linalg.svd(jacobian[:, columns(NAMED)], compute_uv=False)
    assert named_values[-1] > 1e-2 * named_values[0]


def pinocchio_arm() -> tuple[Any, Any, int]:
    """The six-axis arm in pinocchio: module, model and the end's frame."""
    pin = pytest.importorskip("pinocchio", reason="pinocchio is not installed (the pin wheel)")
    model = pin.Model()
    placement, parent = pin.SE3.Identity(), 0
    for theta, d, a, alpha, beta in SIX_AXIS:
        here = placement * pin.SE3(pin.utils.rotate("z", theta), np.zeros(3))
        parent = model.addJoint(parent, pin.JointModelRZ(), here, f"joint{parent + 1}")
        turn = pin.utils.rotate("x", alpha) @ pin.utils.rotate("y", beta)
        placement = pin.SE3(turn, np.array([a, 0.0, d]))
    end = placement * pin.SE3(END)
    frame = model.addFrame(pin.Frame("end", parent, 0, end, pin.FrameType.OP_FRAME))
    return pin, model, frame


def test_poses_and_joint_jacobians_are_pinocchio_s() -> None:
    pin, model, frame = pinocchio_arm()
    data, q = model.createData(), random_joints(37)
    poses, jacobians = six_axis().pose(q), six_axis().joint_jacobian(q, pose=True)
    for row, pose, jacobian in zip(q, poses, jacobians, strict=True):
        pin.framesForwardKinematics(model, data, row)
        np.testing.assert_allclose(pose, data.oMf[frame].homogeneous, rtol=0, atol=1e-14)
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        theirs = pin.computeFrameJacobian(model, data, row, frame, world)
        np.testing.assert_allclose(jacobian, theirs, rtol=0, atol=1e-14)


def motions_of_parameters(q: Floats) -> Floats:
    """Twists (36, 30), linear before angular, by the links' parameters, in the joints' unturned frames."""
    motions = np.zeros((36, 30))
    for link, (_, d, a, alpha, _) in enumerate(SIX_AXIS):
        cos, sin = np.cos(q[link]), np.sin(q[link])
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        x, y, z = turn @ [1.0, 0.0, 0.0], turn @ [0.0, np.cos(alpha), np.sin(alpha)], turn[2]
        point, still = turn @ [a, 0.0, d], np.zeros(3)
        twists = [(still, z), (z, still), (x, still), (np.cross(point, x), x), (np.cross(point, y), y)]
        motions[6 * link :, 5 * link :][:6, :5] = np.transpose([np.concatenate(twist) for twist in twists])
    return motions


def test_parameter_jacobian_is_pinocchio_s_regressor() -> None:
    pin, model, frame = pinocchio_arm()
    data, q = model.createData(), random_joints(11)
    for row, jacobian in zip(q, six_axis().parameter_jacobian(q, pose=True), strict=True):
        pin.framesForwardKinematics(model, data, row)
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        regressor = pin.computeFrameKinematicRegressor(model, data, frame, world)
        np.testing.assert_allclose(jacobian, regressor @ motions_of_parameters(row), rtol=0, atol=1e-14)


CALLS = [
    ("position", {}, (3,)),
    ("pose", {}, (4, 4)),
    ("parameter_jacobian", {}, (3, 30)),
    ("parameter_jacobian", {"pose": True}, (6, 30)),
    ("joint_jacobian", {}, (3, 6)),
    ("joint_jacobian", {"pose": True}, (6, 6)),
]


@pytest.mark.parametrize(("method", "options", "shape"), CALLS)
def test_parameters_out_and_threads(method: str, options: dict[str, bool], shape: tuple[int, ...]) -> None:
    q = random_joints(10_001)
    call = getattr(six_axis(), method)
    plain = call(q, **options)
    assert plain.shape == (10_001, *shape)

    out = np.full_like(plain, np.nan)
    assert call(q, out=out, threads=1, **options) is out
    np.testing.assert_array_equal(out, plain)
    np.testing.assert_array_equal(call(q, SIX_AXIS, threads=2, **options), plain)
    each = np.ascontiguousarray(np.broadcast_to(SIX_AXIS, (10_001, 6, 5)))
    np.testing.assert_allclose(call(q, each, **options), plain, rtol=0, atol=1e-14)
    assert call(q[:0], **options).shape == (0, *shape)


@pytest.mark.parametrize(("method", "options", "shape"), CALLS)
def test_shapes_that_do_not_fit(method: str, options: dict[str, bool], shape: tuple[int, ...]) -> None:
    call, q = getattr(six_axis(), method), random_joints(4)
    with pytest.raises(_core.CoreError, match=r"q has shape \[4, 5\].*\(n, 6\)"):
        call(np.zeros((4, 5)), **options)
    with pytest.raises(_core.CoreError, match=r"parameters has shape \[3, 6, 5\].*\(4, 6, 5\)"):
        call(q, np.zeros((3, 6, 5)), **options)
    with pytest.raises(_core.CoreError, match="out has shape"):
        call(q, out=np.zeros((5, *shape)), **options)
    with pytest.raises(_core.CoreError, match="q is not C-contiguous"):
        call(np.asfortranarray(q), **options)
    with pytest.raises(_core.CoreError, match="out is not C-contiguous"):
        call(q, out=np.zeros((8, *shape))[::2], **options)
    with pytest.raises(TypeError):
        call(q.astype(np.float32), **options)


def test_an_array_that_must_not_be_written_is_not() -> None:
    q, out = random_joints(4), np.zeros((4, 3))
    out.flags.writeable = False
    with pytest.raises(_core.CoreError, match="out"):
        six_axis().position(q, out=out)
    square = random_joints(3, 6).reshape(6, 3)
    chain = _core.Chain("standard", ["revolute"] * 3, SIX_AXIS[:3].copy(), np.eye(4), np.eye(4))
    with pytest.raises(_core.CoreError, match="out"):
        chain.position(square, out=square)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"convention": "craig"}, "convention is 'craig', it must be 'standard' or 'modified'"),
        ({"joints": ["revolute"] * 5 + ["helical"]}, "joint is 'helical'"),
        ({"joints": ["revolute"] * 5}, r"links has shape \[6, 5\]"),
        ({"joints": ["fixed"] * 6}, "none of the 6 links has a joint"),
        ({"links": np.full((6, 5), np.nan)}, "link 0: theta is NaN"),
        ({"base": np.diag([2.0, 2.0, 2.0, 1.0])}, "base transform is not rigid"),
        ({"end": np.diag([1.0, 1.0, -1.0, 1.0])}, "end transform is not rigid"),
        ({"end": np.eye(3)}, r"end has shape \[3, 3\], it must be \(4, 4\)"),
        ({"base": np.full((4, 4), 1.0)}, "last row of base"),
    ],
)
def test_chains_that_cannot_be(change: dict[str, Any], words: str) -> None:
    given: dict[str, Any] = {
        "convention": "standard",
        "joints": ["revolute"] * 6,
        "links": SIX_AXIS,
        "base": np.eye(4),
        "end": END,
    }
    with pytest.raises(_core.CoreError, match=words):
        _core.Chain(**(given | change))


SNIPPET = """
import sys, numpy as np
from truearm import _core
chain = _core.Chain("standard", ["revolute"] * 6, np.linspace(-1, 1, 30).reshape(6, 5), np.eye(4), np.eye(4))
q = np.linspace(-3, 3, 6 * 19).reshape(19, 6)
sys.stdout.buffer.write(chain.pose(q).tobytes() + chain.parameter_jacobian(q, pose=True).tobytes())
"""


def run_with(instruction_set: str) -> subprocess.CompletedProcess[bytes]:
    environment = {**os.environ, "TRUEARM_ISA": instruction_set}
    return subprocess.run(
        [sys.executable, "-c", SNIPPET], env=environment, capture_output=True, check=False, timeout=120
    )


def test_instruction_sets_agree() -> None:
    found = [run_with(name) for name in ("baseline", "avx2", "avx512")]
    assert [run.returncode for run in found] == [0, 0, 0]
    baseline, *others = (np.frombuffer(run.stdout) for run in found)
    assert baseline.size == 19 * (16 + 180)
    for other in others:
        np.testing.assert_allclose(other, baseline, rtol=0, atol=1e-12)


def test_an_unknown_instruction_set_is_refused_at_import() -> None:
    run = run_with("sse9")
    assert run.returncode != 0
    assert b"TRUEARM_ISA" in run.stderr
    assert b"baseline, avx2 or avx512" in run.stderr
