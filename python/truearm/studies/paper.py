"""The paper's simulations, section 6: each figure for one seed, and all of them over seeds."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing, nullcontext
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm.defaults import PAPER_FIGURES
from truearm.errors import UsageError
from truearm.planning.pool import PoolOptions, draw_pool
from truearm.stages import Stages, no_stages
from truearm.studies.experiment import Experiment, Plan, conduct
from truearm.studies.metrics import Trace, along, over_seeds, sizes, trace
from truearm.studies.schemes import (
    NETWORK,
    QUANTISED,
    TRAINING,
    Kept,
    Scheme,
    all_schemes,
    basic_schemes,
    constant_parameters,
    region_ceps,
    trained_network,
    variable_scheme,
)
from truearm.studies.setting import (
    DEMANDED_M,
    JOINT_REGIONS,
    READINGS,
    SPHERE_REGIONS,
    Kind,
    Reading,
    path_of,
    straight,
)
from truearm.types import Floats
from truearm.workers import check_workers, run_tasks

Result = dict[str, Any]

RANDOM_PATHS: Final = 10
REGION_POSES: Final = 500
SENSITIVITY: Final[Mapping[str, Mapping[str, Any]]] = {
    "sigma_quarter_cell": {"sigma": 0.25},
    "sigma_half_cell": {},
    "sigma_one_cell": {"sigma": 1.0},
    "product_composition": {"composition": "product"},
    "rate_tenth": {"rate": 0.1},
    "rate_one": {"rate": 1.0},
    "normalised": {"normalise": "squares"},
}


@dataclass(frozen=True, eq=False)
class Drawn:
    """What is drawn of the first seed.

    Attributes:
        made: The experiment.
        readings: Along the path (n, N).
        traces: Schemes along it by name.
        gap: First and last point of the path in the region without data, or None.
    """

    made: Experiment
    readings: Floats
    traces: dict[str, Trace]
    gap: tuple[int, int] | None = None


@dataclass(eq=False)
class Seed:
    """One seed: experiments and fits, made when a figure first asks for them.

    Attributes:
        number: The seed.
        kept: What the first seed found, by figure.
        stages: Told what is being done.
    """

    number: int
    kept: dict[str, Kept]
    stages: Stages
    drawn: dict[str, Drawn] = field(default_factory=dict)

    @cached_property
    def joint(self) -> Experiment:
        """Joint space in 110 regions without noise."""
        return conduct(self.number, Plan("joint", JOINT_REGIONS))

    @cached_property
    def joint_schemes(self) -> dict[str, Scheme]:
        """All schemes of it."""
        return all_schemes(self.joint, self.keep("figure6"))

    def keep(self, figure: str) -> Kept:
        """What is found once for a figure."""
        return self.kept.setdefault(figure, Kept())


def run(
    seeds: Sequence[int],
    figures: Sequence[str],
    stages: Stages = no_stages,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
) -> tuple[Result, dict[str, Drawn]]:
    """Results of figures over seeds, for paper.json, and what is drawn of the first seed.

    The first seed is done here, for the others use what it finds; they are done over local processes or a
    cluster.

    Args:
        seeds: Seeds of the arms.
        figures: Of PAPER_FIGURES.
        stages: Called with the name of each stage; gives a context manager that surrounds it.
        scheduler: Address of a Dask scheduler, as in run_tasks.
        workers: Local processes at the most, as in run_tasks.

    Raises:
        UsageError: If there is no such figure or no seed.
        Exception: What a seed raised.
    """
    unknown = [name for name in figures if name not in PAPER_FIGURES]
    if unknown or not seeds:
        what = f'there is no figure "{unknown[0]}"' if unknown else "no seed is given"
        raise UsageError(what, rule=f"Figures are {', '.join(PAPER_FIGURES)}; at least one seed is needed")
    check_workers(scheduler, workers)
    kept: dict[str, Kept] = {}
    with stages(f"seed 1 of {len(seeds)}") if len(seeds) > 1 else nullcontext():
        first = Seed(seeds[0], kept, stages)
        found = {0: _each(first, figures)}
    others = [(number, kept, tuple(figures)) for number in seeds[1:]]
    with closing(run_tasks(_elsewhere, others, scheduler=scheduler, workers=workers)) as finished:
        for position in range(1, len(seeds)):
            with stages(f"seed {position + 1} of {len(seeds)}"):
                done = next(finished)
            found[1 + done.index] = done.result()
    each = [found[position] for position in range(len(seeds))]
    return {"seeds": list(seeds), "each_seed": each, **over_seeds(each)}, first.drawn


def _each(seed: Seed, figures: Sequence[str]) -> Result:
    result: Result = {}
    for number, name in enumerate(figures, start=1):
        with seed.stages(f"figure {number} of {len(figures)}"):
            result |= RUNS[name](seed)
    return result


def _elsewhere(item: tuple[int, dict[str, Kept], tuple[str, ...]]) -> Result:
    number, kept, figures = item
    return _each(Seed(number, kept, no_stages), figures)


def figure6(seed: Seed) -> Result:
    """Division of joint space, and all readings of the errors."""
    result = _figure(seed, "figure6", seed.joint, seed.joint_schemes)
    readings = {}
    for number, reading in enumerate(READINGS, start=1):
        with seed.stages(f"reading {number} of {len(READINGS)}"):
            readings[reading.name] = _as_read(seed, reading)
    return {"figure6": result, "readings": readings}


def _as_read(seed: Seed, reading: Reading) -> Result:
    """Where division stops with a reading of the errors, and what schemes leave in the paper's regions."""
    stopped = conduct(seed.number, Plan("joint", None, reading=reading))
    part: Result = {"stops_at": {"regions": len(stopped.regions.leaves), "measured": stopped.measured}}
    for noisy in (False, True):
        made = conduct(seed.number, Plan("joint", JOINT_REGIONS, noisy, reading))
        part["noise" if noisy else "clean"] = _judged(made, basic_schemes(made), _paper_path(made))
    return part


def figure7(seed: Seed) -> Result:
    """Division of spherical coordinates."""
    made = conduct(seed.number, Plan("sphere", SPHERE_REGIONS))
    stopped = conduct(seed.number, Plan("sphere", None))
    result = _figure(seed, "figure7", made, all_schemes(made, seed.keep("figure7")))
    result["facts"]["stops_at_regions"] = len(stopped.regions.leaves)
    return {"figure7": result}


def figure8(seed: Seed) -> Result:
    """One region on the path of Figure 6 is not measured."""
    readings = _paper_path(seed.joint)
    leaf = seed.joint.regions.find(seed.joint.space.coordinates(readings))
    missing = int(leaf[len(leaf) // 2])
    made, inside = seed.joint.without(missing), leaf == missing
    schemes = {**basic_schemes(made), "variable": variable_scheme(made, seed.keep("figure6"))}
    box = (seed.joint.regions.low[missing], seed.joint.regions.high[missing])
    poses = draw_pool(made.space, REGION_POSES, PoolOptions(seed=(seed.number, 8)), box=box).readings
    result: Result = {}
    traces = {name: trace(made, scheme, readings) for name, scheme in schemes.items()}
    for name, scheme in schemes.items():
        found = traces[name]
        parts = {"inside": inside, "rest": ~inside}
        path = {where: _part(made, found, readings, rows) for where, rows in parts.items()}
        everywhere = sizes(trace(made, scheme, made.workspace).size_mm)
        region = sizes(trace(made, scheme, poses).size_mm)
        result[name] = {"path": path, "region": region, "workspace": everywhere}
    rows = np.flatnonzero(inside)
    seed.drawn["figure8"] = Drawn(made, readings, traces, (int(rows[0]), int(rows[-1])))
    return {"figure8": result}


def paths(seed: Seed) -> Result:
    """Straight lines of joint space between random poses."""
    made = seed.joint
    rng = np.random.default_rng([seed.number, 13])
    lines = [straight(*rng.uniform(made.space.low, made.space.high, (2, 3))) for _ in range(RANDOM_PATHS)]
    result: Result = {}
    for name, scheme in seed.joint_schemes.items():
        readings = [made.space.readings(line)[0] for line in lines]
        each = [along(made, trace(made, scheme, line), line) for line in readings]
        means = [found["mean_mm"] for found in each]
        path = {key: float(np.mean([found[key] for found in each])) for key in each[0]}
        path["worst_mean_mm"] = max(means)
        path["worst_to_best"] = max(means) / min(means)
        result[name] = {"path": path}
    return {"paths": result}


def noise(seed: Seed) -> Result:
    """Figure 6 with 3 % of noise."""
    made = conduct(seed.number, Plan("joint", JOINT_REGIONS, noisy=True))
    return {"noise": _figure(seed, "noise", made, all_schemes(made, seed.keep("noise")))}


def cmac(seed: Seed) -> Result:
    """CMAC against FCMAC on the regional CEPs of Figure 6, and what the network's open values change."""
    made, constant = seed.joint, constant_parameters(seed.joint)
    ceps, readings = region_ceps(made, constant, "least_squares"), _paper_path(seed.joint)
    schemes = {
        "fcmac": trained_network(made, constant, ceps),
        "cmac": trained_network(made, constant, ceps, QUANTISED),
    }
    result = _judged(made, schemes, readings)
    sensitivity: Result = {}
    for number, (name, change) in enumerate(SENSITIVITY.items(), start=1):
        network: Any = {key: change.get(key, value) for key, value in NETWORK.items()}
        training: Any = {key: change.get(key, value) for key, value in TRAINING.items()}
        with seed.stages(f"network {number} of {len(SENSITIVITY)}"):
            scheme = trained_network(made, constant, ceps, network, training)
        sensitivity |= {name: {**_judged(made, {name: scheme}, readings)[name], "training": scheme.notes}}
    seed.drawn["cmac"] = _draw(made, readings, schemes)
    return {"cmac": {**result, "sensitivity": sensitivity}}


RUNS: Final[Mapping[str, Callable[[Seed], Result]]] = {
    "6": figure6,
    "7": figure7,
    "8": figure8,
    "paths": paths,
    "noise": noise,
    "cmac": cmac,
}


def _figure(seed: Seed, name: str, made: Experiment, schemes: Mapping[str, Scheme]) -> Result:
    readings = _paper_path(made)
    result = _judged(made, schemes, readings)
    seed.drawn[name] = _draw(made, readings, schemes)
    return {**result, "facts": _facts(made, schemes)}


def _judged(made: Experiment, schemes: Mapping[str, Scheme], readings: Floats) -> Result:
    result = {}
    for name, scheme in schemes.items():
        path = along(made, trace(made, scheme, readings), readings)
        path["least_mm"] = float(trace(made, scheme, readings).size_mm.min())
        result[name] = {"path": path, "workspace": sizes(trace(made, scheme, made.workspace).size_mm)}
    return result


def _draw(made: Experiment, readings: Floats, schemes: Mapping[str, Scheme]) -> Drawn:
    return Drawn(made, readings, {name: trace(made, scheme, readings) for name, scheme in schemes.items()})


def _part(made: Experiment, found: Trace, readings: Floats, rows: NDArray[np.bool_]) -> dict[str, float]:
    """Path statistics of some of its points; jumps between those that are neighbours on the path too."""
    pieces = np.split(np.flatnonzero(rows), np.flatnonzero(np.diff(np.flatnonzero(rows)) > 1) + 1)
    each = [
        along(made, Trace(found.errors_mm[piece], found.parameters[piece]), readings[piece])
        for piece in pieces
        if len(piece) > 1
    ]
    jumps = {key: max(part[key] for part in each) for key in ("jump_mm", "cep_jump")}
    return {**sizes(found.size_mm[rows]), **jumps}


def _facts(made: Experiment, schemes: Mapping[str, Scheme]) -> dict[str, float]:
    leaves = np.asarray(made.regions.leaves)
    kappa = made.node_kappa[leaves]
    facts = {
        "regions": float(len(leaves)),
        "measurements": float(len(made.readings)),
        "measured_in_all": float(made.measured),
        "condition_median": float(np.nanmedian(kappa)),
        "condition_max": float(np.nanmax(kappa)),
        "leaves_within_demanded": float(np.mean(made.node_error_m[leaves] <= DEMANDED_M)),
    }
    for name, scheme in schemes.items():
        facts |= {f"{name}_{key}": value for key, value in scheme.notes.items()}
    return facts


def _paper_path(made: Experiment) -> Floats:
    kind: Kind = made.plan.kind
    readings, reached = made.space.readings(path_of(kind))
    if not reached.all():
        raise UsageError("the paper's path is out of reach", rule="It must lie within the arm's limits")
    return readings
