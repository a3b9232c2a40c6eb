"""The methods that are compared: one a file, and a table of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

from truearm.errors import UsageError, did_you_mean, list_names
from truearm.studies.accuracy.fitted import CorrectedArm, Correction, Fitted
from truearm.studies.accuracy.methods.arms import (
    fit_constant_model,
    fit_fcmac,
    fit_nominal,
    fit_regions,
    fit_without_outliers,
)
from truearm.studies.accuracy.methods.curves import fit_curves
from truearm.studies.accuracy.methods.gaussian import fit_additive, fit_cartesian, fit_joint
from truearm.studies.accuracy.methods.gravity import fit_gravity
from truearm.studies.accuracy.methods.grid import fit_grid
from truearm.studies.accuracy.methods.neighbours import fit_neighbours
from truearm.studies.accuracy.methods.network import fit_network
from truearm.studies.accuracy.methods.ours import OURS, PARTS, fit_variable
from truearm.studies.accuracy.methods.radial import fit_radial
from truearm.studies.accuracy.methods.searching import Effort, Learn
from truearm.studies.accuracy.methods.trees import fit_trees
from truearm.studies.accuracy.poses import Prepared

Family = Literal["model", "curves", "residual", "ours", "block"]
Fit = Callable[[Prepared, Effort], Mapping[str, Fitted]]


@dataclass(frozen=True)
class Method:
    """A method of the table.

    Attributes:
        name: Short name.
        title: Name for people.
        family: "model" of the arm; "curves" of single joints; "residual" of the constant model, learned;
            "ours"; or "block", a part of ours.
        fit: Fits it to a cell; may bring parts of itself with it.
        needs: Library that it is fitted by, where that does not come with truearm.
        parts: Names of the parts that it brings.
    """

    name: str
    title: str
    family: Family
    fit: Fit
    needs: str = ""
    parts: tuple[str, ...] = ()


def _one(name: str, fit: Callable[[Prepared], Fitted]) -> Fit:
    def run(prepared: Prepared, _: Effort) -> Mapping[str, Fitted]:
        return {name: fit(prepared)}

    return run


def _corrected(name: str, learn: Learn) -> Fit:
    def run(prepared: Prepared, effort: Effort) -> Mapping[str, Fitted]:
        correction: Correction = learn(prepared.train_poses, prepared.residuals, effort)
        return {name: CorrectedArm(correction)}

    return run


def _residual(name: str, title: str, learn: Learn, needs: str = "scikit-learn") -> Method:
    return Method(name, title, "residual", _corrected(name, learn), needs)


METHODS: Final = (
    Method("nominal", "nominal", "model", _one("nominal", fit_nominal)),
    Method("constant", "constant D-H", "model", _one("constant", fit_constant_model)),
    Method("robust", "constant D-H, outliers rejected", "model", _one("robust", fit_without_outliers)),
    Method("gravity", "constant D-H, gravity compliance", "model", _corrected("gravity", fit_gravity)),
    Method("curves", "constant D-H, theta curves", "curves", _corrected("curves", fit_curves)),
    Method("regions", "regional CEPs", "model", _one("regions", fit_regions)),
    Method("fcmac", "the paper's FCMAC", "model", _one("fcmac", fit_fcmac)),
    _residual("gp-joint", "Gaussian process, joints", fit_joint),
    _residual("gp-additive", "Gaussian process, sum over joints", fit_additive),
    _residual("gp-cartesian", "Gaussian process, Cartesian", fit_cartesian),
    _residual("rbf", "radial basis functions", fit_radial, ""),
    _residual("knn", "nearest neighbours by distance", fit_neighbours),
    _residual("mlp", "multilayer perceptron", fit_network),
    _residual("trees", "gradient-boosted trees", fit_trees, "lightgbm"),
    _residual("grid", "grid of errors", fit_grid, ""),
    Method("ours", "variable D-H (ours)", "ours", fit_variable, parts=tuple(PARTS)),
)
BY_NAME: Final = {method.name: method for method in METHODS}
PART_TITLES: Final = {part: f"ours, blocks up to {block}" for part, block in PARTS.items()}
TITLES: Final = {method.name: method.title for method in METHODS} | PART_TITLES
FAMILIES: Final = {method.name: method.family for method in METHODS} | dict.fromkeys(PART_TITLES, "block")


def check_methods(given: Sequence[str]) -> tuple[str, ...]:
    """The methods that are named, in the order of the table; all where none is.

    Raises:
        UsageError: If there is no such method.
    """
    for name in given:
        if name not in BY_NAME:
            raise UsageError(
                f'there is no method "{name}"',
                rule=f"There are {list_names(BY_NAME)}",
                way_out=did_you_mean(name, list(BY_NAME)),
            )
    return tuple(name for name in BY_NAME if not given or name in given)


__all__ = ["BY_NAME", "FAMILIES", "METHODS", "OURS", "TITLES", "Effort", "Method", "check_methods"]
