"""The compiled CMAC and FCMAC networks: the paper's cells, and six inputs with orientation."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import truearm as ta
from truearm import _core
from truearm.fits.identified import IdentifiedArm
from truearm.types import Floats

LOW, HIGH = np.deg2rad([[-150.0, -30.0, -120.0], [150.0, 100.0, 0.0]])
CELLS = (17, 11, 11)
FIXTURES = Path(__file__).resolve().parents[2] / "shared" / "reference" / "rv_m2_fixtures.json"


def network(outputs: int = 15, c: int = 3, **given: Any) -> _core.Network:
    options: Any = {"membership": "gaussian", "sigma": 0.5, "composition": "min", "table": None, **given}
    return _core.Network([(LOW[k], HIGH[k], CELLS[k], c) for k in range(3)], outputs, options)


def test_the_papers_cells_and_grades() -> None:
    if not FIXTURES.exists():
        pytest.skip(f"reference numbers are not at {FIXTURES}")
    fixture = json.loads(FIXTURES.read_text())["fcmac"]
    paper = network(sigma=fixture["sigma"])
    assert (paper.sensor_cells, paper.cell_count, paper.active_count) == (39, 2057, 27)
    cells, grades = paper.active(np.array(fixture["inputs_rad"]))
    for k, (active, excitation) in enumerate(zip(fixture["active"], fixture["excitation"], strict=True)):
        expected = dict(zip(active, excitation, strict=True))
        assert set(cells[k].tolist()) == set(active)
        np.testing.assert_allclose(grades[k], [expected[cell] for cell in cells[k].tolist()], atol=1e-14)


def by_sorting(s: Floats, sigma: float) -> tuple[NDArray[np.int64], Floats]:
    """Cells and grades as the appendix has them: all grades, sorted, the first three, min over the inputs."""
    index, grade = [], []
    for k, count in enumerate(CELLS):
        distance = np.abs(s[:, k, None] - np.linspace(LOW[k], HIGH[k], count)) * (count - 1) / (HIGH - LOW)[k]
        nearest = np.sort(np.argsort(distance, axis=1, kind="stable")[:, :3], axis=1)
        index.append(nearest)
        grade.append(np.exp(-((np.take_along_axis(distance, nearest, 1) / sigma) ** 2) / 2))
    a, b, c = (x[:, :, None, None] if k == 0 else x[:, None, :, None] if k == 1 else x[:, None, None, :]
               for k, x in enumerate(index))  # fmt: skip
    u, v, w = grade[0][:, :, None, None], grade[1][:, None, :, None], grade[2][:, None, None, :]
    cells = (a * CELLS[1] + b) * CELLS[2] + c
    return cells.reshape(len(s), -1), np.minimum(np.minimum(u, v), w).reshape(len(s), -1)


def test_outputs_are_those_of_the_appendix() -> None:
    rng = np.random.default_rng(0)
    s, weights = rng.uniform(LOW, HIGH, (500, 3)), rng.normal(size=(2057, 15))
    cells, grades = by_sorting(s, 0.5)
    found = network().active(s)
    np.testing.assert_array_equal(found[0], cells)
    np.testing.assert_allclose(found[1], grades, atol=1e-13)
    expected = (grades[:, :, None] * weights[cells]).sum(1) / grades.sum(1)[:, None]
    made = network().with_weights(weights)
    np.testing.assert_allclose(made.output(s), expected, atol=1e-12)
    by_columns = np.asfortranarray(s)
    with pytest.raises(_core.CoreError, match="s is not C-contiguous"):
        made.output(by_columns)
    with pytest.raises(_core.CoreError, match="out is not C-contiguous"):
        made.output(s, np.asfortranarray(np.zeros((500, 15))))


def test_the_cmac_jumps_where_the_fcmac_does_not() -> None:
    path = np.linspace(LOW, HIGH, 4000)
    wanted = 1e-3 * np.sin(path[::40] @ [1.0, 0.7, 0.4])[:, None]
    options: Any = {"columns": [1], "rate": 1.0, "normalise": "printed", "tolerance": 1e-6, "epochs": 2000}

    def largest_jump(membership: str) -> float:
        made = network(outputs=1, membership=membership).train(path[::40], wanted, options).network
        return float(np.abs(np.diff(made.output(path), axis=0)).max())

    assert largest_jump("quantised") > 2.0 * largest_jump("gaussian")


class SixAxes:
    """A UR10 whose first joints err with their angle, measured in pose.

    Features are the flange's position and its roll, pitch and yaw (Rz Ry Rx), singular at a pitch of 90 deg:
    poses beyond 60 deg are left out.
    """

    COLUMNS = (0, 5, 6, 10, 15, 20)

    def __init__(self) -> None:
        robot = ta.Robot.load("ur10")
        self.arm = IdentifiedArm(robot)
        self.chain = self.arm.flange_chain

    def poses(self, count: int, seed: int) -> tuple[Floats, Floats]:
        """Joint values (n, 6) and features (n, 6) of poses about one configuration."""
        middle = np.array([0.3, -1.2, 1.5, -1.6, -1.4, 0.2])
        q = middle + np.random.default_rng(seed).uniform(-0.3, 0.3, (count, 6))
        pose = self.chain.pose(q)
        r = pose[:, :3, :3]
        pitch = np.arcsin(np.clip(-r[:, 2, 0], -1.0, 1.0))
        roll, yaw = np.arctan2(r[:, 2, 1], r[:, 2, 2]), np.arctan2(r[:, 1, 0], r[:, 0, 0])
        kept = np.abs(pitch) < np.deg2rad(60.0)
        return q[kept], np.column_stack([pose[:, :3, 3], roll, pitch, yaw])[kept]

    def linearised(self, q: Floats, points: Floats | None = None) -> tuple[Floats, Floats]:
        """Rows of poses, or of the positions alone of `points` (T, 3) of the tool."""
        flange = np.zeros((1, 3)) if points is None else points
        table = np.ascontiguousarray(self.arm.table)
        true = np.repeat(table[None], len(q), axis=0).reshape(len(q), -1)
        true[:, 5] += 1e-3 * np.sin(q[:, 0] + q[:, 1])
        true[:, 10] += 1e-3 * np.cos(q[:, 2])
        true[:, 6] += 4e-4
        pose = self.chain.pose(q, true.reshape(len(q), -1, 5))
        arrays: Any = {
            "joints": q,
            "group": np.zeros(len(q), dtype=np.int64),
            "targets": pose[:, None, :3, 3] + np.einsum("nij,tj->nti", pose[:, :3, :3], flange),
            "rotations": np.ascontiguousarray(pose[:, :3, :3]) if points is None else None,
            "sigma": np.zeros((len(q), 4)),
            "weight": np.ones(len(q)),
            "distances": [],
        }
        problem = _core.Problem(self.chain, _core.MeasurementSet(arrays), list(self.COLUMNS), True)
        setup = _core.Setup(np.eye(4)[None], flange[None], np.eye(3)[None], np.zeros((0, 3)))
        return _core.linearise(problem, table, setup)


def test_six_inputs_with_orientation_learn_in_a_hash_table() -> None:
    arm = SixAxes()
    q, features = arm.poses(1500, 1)
    low, high = features.min(0), features.max(0)
    sensors = [(low[k], high[k], 9, 3) for k in range(6)]
    shape: Any = {"membership": "gaussian", "sigma": 0.5, "composition": "min", "table": 60_000}
    empty = _core.Network(sensors, len(arm.COLUMNS), shape)
    assert (empty.cell_count, empty.table_size, empty.active_count) == (9**6, 60_000, 729)
    options: Any = {
        "columns": list(arm.COLUMNS),
        "rate": 1.0,
        "normalise": "squares",
        "tolerance": 2e-5,
        "epochs": 60,
    }
    trained = empty.train_on_measurements(features, *arm.linearised(q), options)
    assert trained.cells_excited > trained.collisions > 0
    held_out, inputs = arm.poses(300, 2)
    jacobian, residual = arm.linearised(held_out)
    ceps = trained.network.output(np.ascontiguousarray(inputs))
    left = residual - np.einsum("nmp,np->nm", jacobian, ceps)
    before, after = np.linalg.norm(residual[:, :3], axis=1), np.linalg.norm(left[:, :3], axis=1)
    assert after.mean() < 0.3 * before.mean()


def test_targets_count_alike_whichever_stands_first() -> None:
    arm = SixAxes()
    q, features = arm.poses(60, 1)
    s = np.ascontiguousarray(features[:, :2])
    sensors = [(low, high, 6, 3) for low, high in zip(s.min(0), s.max(0), strict=True)]
    shape: Any = {"membership": "gaussian", "sigma": 0.5, "composition": "product", "table": None}
    empty = _core.Network(sensors, len(arm.COLUMNS), shape)
    points = np.array([[0.0, 0.0, 0.1], [0.08, 0.02, -0.03], [-0.05, 0.06, 0.02]])
    noise = np.random.default_rng(0).normal(scale=3e-5, size=(len(q), 3, 3))
    options: Any = {"columns": list(arm.COLUMNS), "targets": 3, "scales": (2e-5, 1e-4, 1e-3), "threads": 1}
    training: Any = {"columns": options["columns"], "rate": 1.0, "normalise": "squares"}
    training |= {"tolerance": 1e-5, "epochs": 3}

    def rows(order: list[int]) -> tuple[Floats, Floats]:
        jacobian, residual = arm.linearised(q, points[order])
        return jacobian, residual + noise[:, order].reshape(len(q), 9)

    for order in ([1, 2, 0], [2, 0, 1]):
        outputs = [empty.fit(s, *rows(k), options).network.output(s) for k in ([0, 1, 2], order)]
        np.testing.assert_allclose(outputs[1], outputs[0], rtol=1e-6, atol=1e-12)
        kappa = [_core.observability(rows(k)[0], options["columns"], 3)["kappa"] for k in ([0, 1, 2], order)]
        assert kappa[1] == pytest.approx(kappa[0])
    assert empty.train_on_measurements(s, *rows([0, 1, 2]), training, 3).epochs == 3
    with pytest.raises(_core.CoreError, match="three for each target"):
        empty.fit(s, *rows([0, 1, 2]), options | {"targets": 1})


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"membership": "round"}, "membership is 'round'"),
        ({"composition": "max"}, "composition is 'max'"),
        ({"sigma": -1.0}, "sigma is -1"),
        ({"membership": "bspline"}, "B-spline is 5"),
    ],
)
def test_what_a_network_refuses(given: dict[str, Any], message: str) -> None:
    with pytest.raises(_core.CoreError, match=message):
        network(c=5, **given)


def test_shapes_are_named() -> None:
    with pytest.raises(_core.CoreError, match=r"s has shape \[4, 2\], it must be \[4, 3\]"):
        network().output(np.zeros((4, 2)))
    with pytest.raises(_core.CoreError, match="input is not finite at pose 1"):
        network().output(np.array([[0.0, 0.0, 0.0], [0.0, np.nan, 0.0]]))
