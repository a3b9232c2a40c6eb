"""The schemes that are compared: each says what the parameters are at a pose."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd

from truearm._core import Network, Regions, Training, fill_without_data, linearise, regional_ceps
from truearm.fits.core_set import Selection
from truearm.fits.fitting import Hyper, KnownHyper, Task, fit_rows
from truearm.fits.models import VARIABLE
from truearm.fits.options import CalibrationOptions
from truearm.fits.schemes import add_ceps, training_pairs
from truearm.measurements import Measurements
from truearm.studies.experiment import Experiment
from truearm.types import Floats
from truearm.units import MM_PER_METRE

if TYPE_CHECKING:
    from truearm._core import NetworkFitOptions, NetworkOptions, RegionalOptions, TrainingRule

Parameters = Callable[[Floats], Floats]

CONSTANT_STEPS: Final = 3
SIGMA_CELLS: Final = 0.5
NETWORK: Final["NetworkOptions"] = {
    "membership": "gaussian",
    "sigma": SIGMA_CELLS,
    "composition": "min",
    "table": None,
}
SPLINES: Final["NetworkOptions"] = {**NETWORK, "membership": "bspline", "composition": "product"}
QUANTISED: Final["NetworkOptions"] = {**NETWORK, "membership": "quantised"}
TRAINING: Final["TrainingRule"] = {
    "rate": 0.5,
    "normalise": "printed",
    "tolerance": 1e-6,
    "epochs": 2000,
}


@dataclass(frozen=True, eq=False)
class Scheme:
    """A fitted scheme.

    Attributes:
        parameters: Absolute parameters (n, L, 5) at readings (n, N).
        point_in_flange: The point (3,) that it predicts.
        notes: What is worth reporting, such as epochs of training.
    """

    parameters: Parameters
    point_in_flange: Floats
    notes: dict[str, float] = field(default_factory=dict)


@dataclass(eq=False)
class Kept:
    """What is found at the first seed of a figure and serves the others.

    Attributes:
        hyper: Hyper-parameters of the variable model.
        scales: Noise, roughness and level of networks that are fitted to measurements, by name.
    """

    hyper: Hyper | None = None
    scales: dict[str, tuple[float, float, float]] = field(default_factory=dict)


def all_schemes(made: Experiment, kept: Kept) -> dict[str, Scheme]:
    """Every scheme of an experiment by name."""
    return {**basic_schemes(made), **measured_schemes(made, kept), "variable": variable_scheme(made, kept)}


def basic_schemes(made: Experiment) -> dict[str, Scheme]:
    """Uncalibrated, conventional, regional and the paper's network, each of the regional ones shrunk too."""
    nominal, constant = made.identified.table, constant_parameters(made)
    found = {"uncalibrated": _constant(made, nominal), "conventional": _constant(made, constant)}
    for method, ending in (("least_squares", ""), ("shrunk", "_shrunk")):
        ceps = region_ceps(made, constant, method)
        found[f"regional{ending}"] = _regional(made, constant, ceps)
        found[f"fcmac{ending}"] = trained_network(made, constant, ceps)
    return found


def measured_schemes(made: Experiment, kept: Kept) -> dict[str, Scheme]:
    """The paper's cells and memberships, and B-splines, with weights fitted to the measurements."""
    constant = constant_parameters(made)
    networks = {"fcmac_measurements": NETWORK, "bspline_measurements": SPLINES}
    found = {}
    for name, network in networks.items():
        found[name], kept.scales[name] = _fitted_network(made, constant, network, kept.scales.get(name))
    return found


def variable_scheme(made: Experiment, kept: Kept) -> Scheme:
    """Our variable model with the base as a row, as `truearm calibrate --frame world` fits it."""
    task = Task(made.identified, Selection((0,)), ("measured",), CalibrationOptions(frame="world"))
    columns = {f"q{j + 1}": made.readings[:, j] for j in range(made.readings.shape[1])}
    columns |= dict(zip("xyz", made.points.T, strict=True))
    data = Measurements.from_dataframe(pd.DataFrame(columns | {"group": "measured"}))
    fits = fit_rows(task, data, KnownHyper(kept.hyper))
    model, robot = fits.models(made.identified)[VARIABLE], made.arm.robot
    if fits.variable is None:
        raise AssertionError("the variable model was asked for")

    def parameters(readings: Floats) -> Floats:
        return model.parameters(robot.joints_from_readings(readings))

    kept.hyper = fits.variable.hyper
    return Scheme(parameters, model.setup.targets[0, 0])


def constant_parameters(made: Experiment) -> Floats:
    """Conventional calibration, section 3.1: one region, least squares, parameters (L, 5)."""
    whole, parameters = Regions(made.space.low, made.space.high), made.identified.table.copy()
    options: RegionalOptions = {"method": "least_squares", "prior": None}
    for _ in range(CONSTANT_STEPS):
        fit = regional_ceps(whole, made.problem, parameters, made.setup, made.features, options)
        parameters = add_ceps(parameters, made.columns, fit.ceps[:1])[0]
    return parameters


def region_ceps(made: Experiment, constant: Floats, method: str) -> Floats:
    """CEPs (nodes, P) beside the conventional ones; regions without data have their neighbours' mean."""
    options: RegionalOptions = {"method": method, "prior": None}
    fit = regional_ceps(made.regions, made.problem, constant, made.setup, made.features, options)
    return np.asarray(fit.ceps)


def trained_network(
    made: Experiment,
    constant: Floats,
    ceps: Floats,
    network: "NetworkOptions" = NETWORK,
    training: "TrainingRule" = TRAINING,
) -> Scheme:
    """A network trained by (A5) on regional CEPs, several points of each region; it starts at their mean."""
    inputs, wanted = training_pairs(made.regions, ceps)
    empty = Network(made.sensors, len(made.columns), network)
    trained: Training = empty.train(inputs, wanted, {**training, "columns": made.columns})
    notes = {
        "epochs": float(trained.epochs),
        "converged": float(trained.converged),
        "largest_left_mm": MM_PER_METRE * trained.largest,
    }
    return _network(made, constant, trained.network, notes)


def _fitted_network(
    made: Experiment,
    constant: Floats,
    network: "NetworkOptions",
    scales: tuple[float, float, float] | None,
) -> tuple[Scheme, tuple[float, float, float]]:
    jacobian, residual = linearise(made.problem, constant, made.setup)
    empty = Network(made.sensors, len(made.columns), network)
    how: NetworkFitOptions = {"columns": made.columns, "targets": 1, "scales": scales, "threads": None}
    fitted = empty.fit(made.features, jacobian, residual, how)
    return _network(made, constant, fitted.network, {}), fitted.scales


def _constant(made: Experiment, parameters: Floats) -> Scheme:
    def everywhere(readings: Floats) -> Floats:
        return np.repeat(parameters[None], len(readings), axis=0)

    return Scheme(everywhere, made.arm.robot.tool[:3, 3])


def _regional(made: Experiment, constant: Floats, ceps: Floats) -> Scheme:
    filled = fill_without_data(made.regions, ceps)

    def parameters(readings: Floats) -> Floats:
        leaf = made.regions.find(made.space.coordinates(readings))
        return add_ceps(constant, made.columns, filled[leaf])

    return Scheme(parameters, made.arm.robot.tool[:3, 3])


def _network(made: Experiment, constant: Floats, network: Network, notes: dict[str, float]) -> Scheme:
    def parameters(readings: Floats) -> Floats:
        return add_ceps(constant, made.columns, network.output(made.space.coordinates(readings)))

    return Scheme(parameters, made.arm.robot.tool[:3, 3], notes)
