"""The paper's schemes on measured rows, its passive mode: regions, their CEPs, and networks."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from truearm._core import (
    ANGLE_ARM_M,
    ConstantFit,
    Network,
    Problem,
    divide_rows,
    fill_without_data,
    linearise,
    observability,
    regional_ceps,
)
from truearm.errors import UsageError
from truearm.fits.parameters import are_lengths
from truearm.fits.scheme_options import SchemeOptions
from truearm.fits.schemes import FCMAC, REGIONS, NetworkCeps, RegionalCeps, Scheme, training_pairs
from truearm.fits.stillness import still_joints, still_words
from truearm.types import Floats
from truearm.units import MM_PER_METRE

if TYPE_CHECKING:
    from truearm._core import DivisionOptions, NetworkFitOptions, RegionalOptions


JUDGING_SHARE: Final = 0.2
LARGEST_CONDITION_OF_WHOLE: Final = 300.0
CONDITION_OF_WHOLE: Final = 30.0
"""A region is not divided where its condition number would be so many times that of the whole."""


@dataclass(frozen=True)
class SchemeDetails:
    """About a fitted scheme.

    Attributes:
        regions: Leaves of the tree; 0 where a network was fitted to measurements.
        regions_with_rows: Those that have CEPs of their own.
        prior_mm: Step from parent to child that the rows told, angles at 0.3 m; None if not shrunk.
        condition_median: Median condition number of the leaves; None where there are none.
        epochs: Runs of training; None without.
        largest_left_mm: Largest difference that training left; None without.
        ended: Why the training, or the fit, ended.
    """

    regions: int = 0
    regions_with_rows: int = 0
    prior_mm: float | None = None
    condition_median: float | None = None
    epochs: int | None = None
    largest_left_mm: float | None = None
    ended: str = ""

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class SchemeFit:
    """A fitted scheme and what is worth knowing of it."""

    scheme: Scheme
    details: SchemeDetails


@dataclass(frozen=True, eq=False)
class SchemeRows:
    """What a scheme is fitted to.

    Attributes:
        problem: Measured rows with the parameters that they determine.
        columns: Those parameters.
        constant: The constant fit beside which CEPs are found; its frames and targets are held.
        inputs: Joint values of all joints (n, N).
        joints: Kind of each joint.
        seed: Of the draw of the rows that judge the division.
    """

    problem: Problem
    columns: Sequence[int]
    constant: ConstantFit
    inputs: Floats
    joints: Sequence[str]
    seed: int


def well_determined(problem: Problem, constant: ConstantFit, columns: Sequence[int]) -> list[int]:
    """Those of a problem's columns that its rows determine well, one after another left out until they do.

    Least squares in small regions has no prior to hold a parameter that even the whole set hardly tells.
    """
    jacobian, _ = linearise(problem, constant.parameters, constant.setup)
    lengths = are_lengths(columns)
    rows = jacobian.reshape(-1, len(columns)) * np.where(lengths, 1.0, 1.0 / ANGLE_ARM_M)
    kept = list(range(len(columns)))
    while len(kept) > 1:
        _, singular, right = np.linalg.svd(rows[:, kept], full_matrices=False)
        if singular[0] <= LARGEST_CONDITION_OF_WHOLE * singular[-1]:
            break
        del kept[int(np.argmax(np.abs(right[-1])))]
    return [columns[k] for k in kept]


def fit_scheme(name: str, rows: SchemeRows, options: SchemeOptions) -> SchemeFit:
    """Fit the scheme of a name.

    Raises:
        UsageError: If the arm has no such joints, or one of them stood still.
    """
    _check_joints(rows, options.scheme_joints)
    if name != REGIONS and options.train_on == "measurements":
        return _fit_on_measurements(name, rows, options)
    regional, details = _fit_regions(rows, options)
    if name == REGIONS:
        filled = fill_without_data(regional.regions, regional.ceps)
        scheme = RegionalCeps(regional.inputs, regional.columns, regional.regions, filled)
        return SchemeFit(scheme, SchemeDetails(**details))
    return _train_on_ceps(name, rows, options, regional, details)


def _check_joints(rows: SchemeRows, chosen: Sequence[int]) -> None:
    joints = rows.inputs.shape[1]
    if any(not 1 <= joint <= joints for joint in chosen):
        raise UsageError(f"{list(chosen)}", where="scheme_joints", rule=f"There are 1 to {joints}")
    still = still_joints(rows.inputs, rows.joints)
    those = {joint: at for joint, at in still.items() if joint in chosen}
    if those:
        moved = [joint for joint in range(1, joints + 1) if joint not in still]
        others = [joint for joint in chosen if joint in moved] or moved
        raise UsageError(
            f"all rows have {still_words(those, rows.joints)}",
            where="scheme_joints",
            rule="The workspace is divided along joints that move",
            way_out=f"Name those that do: --scheme-joints {','.join(map(str, others))}",
        )


def _features(rows: SchemeRows, options: SchemeOptions) -> tuple[tuple[int, ...], Floats]:
    inputs = tuple(joint - 1 for joint in options.scheme_joints)
    return inputs, np.ascontiguousarray(rows.inputs[:, list(inputs)])


def _fit_regions(rows: SchemeRows, options: SchemeOptions) -> tuple[RegionalCeps, dict[str, Any]]:
    inputs, features = _features(rows, options)
    parameters, setup = rows.constant.parameters, rows.constant.setup
    judges = np.random.default_rng([rows.seed, len(features)]).uniform(size=len(features)) < JUDGING_SHARE
    jacobian, _ = linearise(rows.problem, parameters, setup)
    division: DivisionOptions = {
        "low": features.min(axis=0),
        "high": features.max(axis=0),
        "accuracy": options.demanded_mm / MM_PER_METRE,
        "regions": options.most_regions,
        "halving": options.halving,
        "order": "worst",
        "poses": options.region_rows,
        "limit": CONDITION_OF_WHOLE * observability(jacobian, list(rows.columns), _targets(rows))["kappa"],
        "seed": rows.seed,
    }
    regions = divide_rows(rows.problem, parameters, setup, features, judges, division).regions
    how: RegionalOptions = {"method": options.region_ceps, "prior": None}
    fit = regional_ceps(regions, rows.problem, parameters, setup, features, how)
    leaves = regions.leaves
    kappa = fit.kappa[leaves][np.isfinite(fit.kappa[leaves])]
    details = {
        "regions": len(leaves),
        "regions_with_rows": int(np.isfinite(fit.ceps[leaves]).all(axis=1).sum()),
        "prior_mm": float(MM_PER_METRE * np.max(fit.prior)) if len(fit.prior) else None,
        "condition_median": float(np.median(kappa)) if len(kappa) else None,
    }
    return RegionalCeps(inputs, tuple(rows.columns), regions, fit.ceps), details


def _train_on_ceps(
    name: str, rows: SchemeRows, options: SchemeOptions, regional: RegionalCeps, details: dict[str, Any]
) -> SchemeFit:
    network = _empty(name, rows, options)
    inputs, wanted = training_pairs(regional.regions, regional.ceps)
    trained = network.train(inputs, wanted, {**options.training, "columns": list(rows.columns)})
    details |= {
        "epochs": trained.epochs,
        "largest_left_mm": MM_PER_METRE * trained.largest,
        "ended": trained.reason,
    }
    return SchemeFit(_kept(name, rows, options, trained.network), SchemeDetails(**details))


def _fit_on_measurements(name: str, rows: SchemeRows, options: SchemeOptions) -> SchemeFit:
    jacobian, residual = linearise(rows.problem, rows.constant.parameters, rows.constant.setup)
    _, features = _features(rows, options)
    how: NetworkFitOptions = {
        "columns": list(rows.columns),
        "targets": _targets(rows),
        "scales": None,
        "threads": None,
    }
    fitted = _empty(name, rows, options).fit(features, jacobian, residual, how)
    details = SchemeDetails(ended="noise and roughness by the largest evidence")
    return SchemeFit(_kept(name, rows, options, fitted.network), details)


def _targets(rows: SchemeRows) -> int:
    """Targets of a pose."""
    return int(rows.constant.setup.targets.shape[1])


def _empty(name: str, rows: SchemeRows, options: SchemeOptions) -> Network:
    _, features = _features(rows, options)
    low, high = features.min(axis=0).tolist(), features.max(axis=0).tolist()
    sensors = [
        (least, most, cells, options.active)
        for least, most, cells in zip(low, high, options.sensor_cells, strict=True)
    ]
    return Network(sensors, len(rows.columns), options.network(fuzzy=name == FCMAC))


def _kept(name: str, rows: SchemeRows, options: SchemeOptions, network: Network) -> NetworkCeps:
    inputs, _ = _features(rows, options)
    return NetworkCeps(inputs, tuple(rows.columns), network, options.network(fuzzy=name == FCMAC))
