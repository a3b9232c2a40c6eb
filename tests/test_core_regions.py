"""The compiled division of the workspace, its regions' CEPs, and the choice of their poses."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import truearm as ta
from truearm import _core
from truearm.fits.identified import IdentifiedArm
from truearm.simulation import PAPER_PARAMETERS
from truearm.types import Floats

NAMES = ("theta", "d", "a", "alpha", "beta")
COLUMNS = [5 * int(name[-1]) + NAMES.index(name[:-1]) for name in PAPER_PARAMETERS]
LOW, HIGH = np.deg2rad([[-150.0, -30.0, -120.0], [150.0, 100.0, 0.0]])
OPTIONS: Any = {
    "low": LOW,
    "high": HIGH,
    "accuracy": 0.0,
    "regions": 12,
    "halving": "longest",
    "order": "breadth",
    "poses": 20,
    "limit": 2000.0,
    "seed": 1,
}
MEASURING: Any = {
    "candidates": 150,
    "tests": 10,
    "criterion": "d",
    "passes": 5,
    "orientation": False,
}


class Arm:
    """An RV-M2 with errors of the fifteen parameters, and a wave of its own over the first joint."""

    def __init__(self, wave_mm: float = 0.1, noise_mm: float = 0.0) -> None:
        robot = ta.Robot.load("rv-m2")
        arm = IdentifiedArm(robot, "world")
        self.chain, self.table = arm.flange_chain, np.ascontiguousarray(arm.table)
        self.with_tool = arm.chain(robot.flange @ robot.tool)
        self.true = self.table.copy()
        for column in COLUMNS:
            self.true.flat[column] += 4e-4 if column % 5 in (1, 2) else np.deg2rad(0.05)
        point = np.asarray(robot.tool)[:3, 3]
        self.setup = _core.Setup(np.eye(4)[None], point[None, None], np.eye(3)[None], np.zeros((0, 3)))
        self.wave, self.noise, self.rng = wave_mm * 1e-3, noise_mm * 1e-3, np.random.default_rng(0)
        self.measured: list[Floats] = []

    def candidates(self, low: Floats, high: Floats, count: int, seed: int) -> tuple[Floats, Floats]:
        features = np.random.default_rng(seed).uniform(low, high, (count, 3))
        return np.hstack([features, np.zeros((count, 2))]), features

    def points(self, q: Floats) -> Floats:
        wave = self.wave * np.column_stack([np.cos(q[:, 0]), np.sin(q[:, 0]), np.sin(q[:, 1])])
        return self.with_tool.position(q, self.true) + wave

    def measure(self, q: Floats) -> _core.MeasurementSet:
        self.measured.append(q)
        points = self.points(q) + self.noise * self.rng.normal(size=(len(q), 3))
        arrays: Any = {
            "joints": q,
            "group": np.zeros(len(q), dtype=np.int64),
            "targets": points[:, None],
            "rotations": None,
            "sigma": np.zeros((len(q), 4)),
            "weight": np.ones(len(q)),
            "distances": [],
        }
        return _core.MeasurementSet(arrays)

    def divide(self, measuring: dict[str, Any] | None = None, **options: Any) -> _core.Division:
        arguments = (self.chain, COLUMNS, self.table, self.setup, self)
        return _core.divide(*arguments, OPTIONS | options, MEASURING | (measuring or {}))

    def errors(self, ceps: Floats, q: Floats) -> Floats:
        """Lengths (n,) in mm of what CEPs (n, P) leave at joint values (n, 5)."""
        parameters = np.repeat(self.table[None], len(q), axis=0).reshape(len(q), -1)
        parameters[:, COLUMNS] += ceps
        predicted = self.with_tool.position(q, parameters.reshape(len(q), -1, 5))
        return np.asarray(1e3 * np.linalg.norm(self.points(q) - predicted, axis=1))


def everywhere(count: int = 600) -> Floats:
    q = np.random.default_rng(9).uniform(LOW, HIGH, (count, 3))
    return np.hstack([q, np.zeros((count, 2))])


def test_a_forced_count_is_reached_and_helps() -> None:
    arm = Arm()
    division = arm.divide()
    regions = division.regions
    assert (len(regions.leaves), regions.count) == (12, 23)
    assert division.measurements == 23 * 30 == sum(len(q) for q in arm.measured)
    assert [batch[:2] for batch in division.batches[:2]] == [(0, 20), (0, 10)]
    q = everywhere()
    whole = arm.errors(np.repeat(division.ceps[:1], len(q), axis=0), q)
    regional = arm.errors(division.ceps[regions.find(np.ascontiguousarray(q[:, :3]))], q)
    assert regional.mean() < 0.5 * whole.mean()
    reasons = {division.ended[leaf] for leaf in regions.leaves}
    assert reasons == {"the number of regions is reached"}


def test_an_arm_without_a_wave_is_one_region_with_its_true_ceps() -> None:
    division = Arm(wave_mm=0.0).divide(accuracy=1e-5)
    assert division.regions.count == 1
    assert "accurate" in str(division.ended[0])
    expected = [4e-4 if column % 5 in (1, 2) else np.deg2rad(0.05) for column in COLUMNS]
    np.testing.assert_allclose(division.ceps[0], expected, atol=1e-9)


def test_regions_whose_tests_were_not_measured_are_not_called_accurate() -> None:
    class Blind(Arm):
        def points(self, q: Floats) -> Floats:
            tests = len(q) == MEASURING["tests"]
            return np.full((len(q), 3), np.nan) if tests else super().points(q)

    division = Blind().divide(accuracy=1e-9)
    assert division.regions.count == 1
    assert np.isnan(division.error[0])
    assert "accurate" not in str(division.ended[0])


@pytest.mark.parametrize("halving", ["longest", "best"])
@pytest.mark.parametrize("order", ["worst", "breadth"])
def test_the_demanded_accuracy_ends_division(halving: str, order: str) -> None:
    division = Arm().divide(accuracy=8e-5, regions=60, halving=halving, order=order)
    leaves = division.regions.leaves
    assert 1 < len(leaves) < 60
    assert (division.error[leaves] <= 8e-5).all()
    halved = [k for k, ended in enumerate(division.ended) if ended is None]
    assert (division.error[halved] > 8e-5).all()


def test_ill_conditioned_halves_are_not_made() -> None:
    division = Arm().divide(limit=60.0, regions=200)
    leaves = division.regions.leaves
    assert len(leaves) < 60
    assert (division.kappa[leaves] <= 60.0).all()
    assert any("too small" in str(division.ended[leaf]) for leaf in leaves)
    with pytest.raises(_core.CoreError, match="condition number of the whole workspace"):
        Arm().divide(limit=2.0)


def test_what_cannot_be_reached_has_no_ceps_until_it_is_filled() -> None:
    arm = Arm()
    inner = arm.candidates

    def reachable(low: Floats, high: Floats, count: int, seed: int) -> tuple[Floats, Floats]:
        q, features = inner(low, high, count, seed)
        kept = features[:, 0] > 0.0
        return q[kept], features[kept]

    arm.candidates = reachable  # type: ignore[method-assign]
    division = arm.divide(regions=8, order="breadth")
    empty = [leaf for leaf in division.regions.leaves if "inaccessible" in str(division.ended[leaf])]
    assert empty
    assert np.isnan(division.ceps[empty]).all()
    filled = _core.fill_without_data(division.regions, division.ceps)
    assert np.isfinite(filled).all()
    known = division.regions.neighbours(empty[0])
    known = [leaf for leaf in known if np.isfinite(division.ceps[leaf]).all()]
    np.testing.assert_allclose(filled[empty[0]], division.ceps[known].mean(axis=0), rtol=1e-12)


def test_what_the_instrument_raises_ends_the_division() -> None:
    class Broken(Arm):
        def measure(self, q: Floats) -> _core.MeasurementSet:
            raise OSError("the tracker lost its beam")

    with pytest.raises(OSError, match="lost its beam"):
        Broken().divide()


def recorded(arm: Arm, count: int) -> tuple[_core.Problem, Floats]:
    q = np.random.default_rng(4).uniform(LOW, HIGH, (count, 3))
    readings = np.hstack([q, np.zeros((count, 2))])
    return _core.Problem(arm.chain, arm.measure(readings), COLUMNS, True), q


def test_passive_division_judges_on_rows_it_did_not_use() -> None:
    arm = Arm()
    problem, features = recorded(arm, 900)
    judges = np.arange(900) % 4 == 0
    options = OPTIONS | {"accuracy": 5e-5, "regions": 40, "limit": 1000.0}
    division = _core.divide_rows(problem, arm.table, arm.setup, features, judges, options)
    leaves = division.regions.leaves
    assert len(leaves) > 4
    leaf_of = division.regions.find(features)
    np.testing.assert_array_equal(division.regions.find(np.asfortranarray(features)), leaf_of)
    for leaf in leaves:
        inside = leaf_of == leaf
        batches = {test: count for region, count, test in division.batches if region == leaf}
        assert batches == {False: int((inside & ~judges).sum()), True: int((inside & judges).sum())}
        assert batches[False] >= 20
        q = np.hstack([features[inside & judges], np.zeros((batches[True], 2))])
        ceps = np.repeat(division.ceps[leaf : leaf + 1], len(q), axis=0)
        np.testing.assert_allclose(arm.errors(ceps, q).max(), 1e3 * division.error[leaf], rtol=1e-6)


def test_shrunk_ceps_withstand_noise() -> None:
    arm = Arm(wave_mm=0.05, noise_mm=0.04)
    problem, features = recorded(arm, 1280)
    regions = _core.Regions(LOW, HIGH).evenly(64)

    def estimate(method: str) -> _core.RegionalFit:
        options: Any = {"method": method, "prior": None}
        return _core.regional_ceps(regions, problem, arm.table, arm.setup, features, options)

    alone, shrunk = estimate("least_squares"), estimate("shrunk")
    q = everywhere()
    leaf_of = regions.find(np.ascontiguousarray(q[:, :3]))
    errors = {fit: arm.errors(fit.ceps[leaf_of], q).mean() for fit in (alone, shrunk)}
    constant = arm.errors(np.repeat(alone.ceps[:1], len(q), axis=0), q).mean()
    assert errors[shrunk] < 0.8 * errors[alone]
    assert errors[shrunk] < 0.8 * constant
    assert shrunk.noise == pytest.approx(4e-5, rel=0.2)
    assert len(shrunk.prior) == 6
    assert alone.poses[0] == 1280


def test_regions_without_enough_rows_have_none_or_those_of_the_whole() -> None:
    arm = Arm()
    problem, features = recorded(arm, 60)
    regions = _core.Regions(LOW, HIGH).evenly(16)
    fits = [
        _core.regional_ceps(
            regions, problem, arm.table, arm.setup, features, {"method": method, "prior": None}
        )
        for method in ("least_squares", "shrunk")
    ]
    scarce = fits[0].poses < 5
    assert scarce.any()
    assert np.isnan(fits[0].ceps[scarce]).all()
    assert np.isfinite(fits[1].ceps).all()


def test_chosen_poses_are_better_than_any_and_the_limit_is_judged() -> None:
    arm = Arm()
    problem, _ = recorded(arm, 400)
    jacobian, _ = _core.linearise(problem, arm.table, arm.setup)
    options: Any = {"columns": COLUMNS, "limit": 20.0, "given": None, "start": None, "passes": 20}
    for criterion in ("kappa", "d", "o1", "o2", "o3", "o4", "o5"):
        choice = _core.choose_poses(jacobian, 20, options | {"criterion": criterion})
        assert choice.after["kappa"] < 20.0 < choice.before["kappa"]
        assert choice.well_conditioned
        found = _core.observability(np.ascontiguousarray(jacobian[choice.chosen]), COLUMNS)
        assert found == pytest.approx(choice.after)
        assert found["kappa_normal"] == pytest.approx(found["kappa"] ** 2)
    refused = options | {"criterion": "kappa", "limit": 5.0}
    assert not _core.choose_poses(jacobian, 20, refused).well_conditioned
    with pytest.raises(_core.CoreError, match="criterion is 'best'"):
        _core.choose_poses(jacobian, 20, options | {"criterion": "best"})
    for criterion in ("kappa", "d"):
        with pytest.raises(_core.CoreError, match="Jacobians are zero"):
            _core.choose_poses(np.zeros_like(jacobian), 20, options | {"criterion": criterion})


def test_columns_that_do_not_ascend_are_refused() -> None:
    arm = Arm()
    with pytest.raises(_core.CoreError, match="ascending"):
        _core.divide(arm.chain, COLUMNS[::-1], arm.table, arm.setup, arm, OPTIONS, MEASURING)


def test_a_tree_survives_being_saved() -> None:
    regions = _core.Regions(LOW, HIGH).evenly(9)
    again = _core.Regions.from_arrays(regions.arrays())
    np.testing.assert_array_equal(again.low, regions.low)
    np.testing.assert_array_equal(again.high, regions.high)
    with pytest.raises(_core.CoreError, match="is no leaf"):
        regions.halve(0, 0)
    with pytest.raises(_core.CoreError, match="axis is 3"):
        regions.halve(int(regions.leaves[0]), 3)


def test_threads_change_no_bit() -> None:
    program = (
        "import hashlib, numpy as np; from truearm import _core; from tests import test_core_regions as t\n"
        "arm = t.Arm(noise_mm=0.04); problem, features = t.recorded(arm, 1000)\n"
        "regions = _core.Regions(t.LOW, t.HIGH).evenly(20)\n"
        "how = {'method': 'shrunk', 'prior': None}\n"
        "fit = _core.regional_ceps(regions, problem, arm.table, arm.setup, features, how)\n"
        "found = np.concatenate([fit.ceps.ravel(), fit.kappa, arm.divide().ceps.ravel()])\n"
        "print(hashlib.sha256(found.tobytes()).hexdigest())"
    )

    def by(threads: int) -> str:
        root = Path(__file__).resolve().parents[1]
        environment = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
        command = [sys.executable, "-c", program]
        done = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, check=True)
        return done.stdout

    assert by(1) == by(4)
