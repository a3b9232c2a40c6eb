"""Table: parameters of a model that varies: its constants, and their range with what varies."""

from typing import Final

import numpy as np

from truearm.errors import WorkError
from truearm.reporting.facts import Facts
from truearm.reporting.numbers import signed
from truearm.reporting.parameters import POSES, effect_mm, per_unit, unit_of
from truearm.reporting.parts import Table
from truearm.reporting.sweeps import corrections

TOGETHER: Final = 3
"""Rows of a Jacobian that a covariance is asked for at once."""


def varying_parameters(facts: Facts) -> Table:
    """Corrections of the model that predicts: of its constants alone, and of the whole at some poses."""
    calibration, poses = facts.calibration, facts.drawn(POSES)
    candidates, nominal = calibration.arm.candidates, calibration.arm.table.ravel()
    constants = calibration.model.constants.ravel() - nominal
    whole = corrections(facts, poses)
    effects = effect_mm(facts) * np.sqrt(np.square(whole).mean(axis=0))
    spread = standard_deviations(facts, list(candidates.columns))
    only_vary = set(candidates.names) - {candidates.names[k] for k in candidates.constant}
    unknown = {name for name in calibration.identifiability.undetermined if name in candidates.names}
    instead = dict.fromkeys(unknown, NOMINAL) | dict.fromkeys(only_vary, NONE)
    rows = []
    for name, column in zip(candidates.names, candidates.columns, strict=True):
        unit, values = per_unit(column), whole[:, column]
        ends = (values.mean(), values.min(), values.max())
        rows.append(
            [
                name,
                unit_of(column),
                f"{nominal[column] / unit:.3f}",
                instead[name]
                if name in instead and not constants[column]
                else signed(constants[column] / unit),
                *(signed(value / unit) for value in ends),
                *([] if spread is None else ["" if name in only_vary else f"{spread[column] / unit:.4f}"]),
                f"{effects[column]:.3f}",
            ]
        )
    of = "measured poses" if facts.readings is not None else "poses in the usual ranges of the joints"
    says = (
        "Corrections to the nominal values: the constant part, then constant part and what varies together "
        f"at {len(poses)} {of}."
    )
    if calibration.scheme is None:
        says += " Compensation uses the latter."
    if unknown:
        says += f" Where the poses do not determine a constant, the maker's value stays: {NOMINAL}."
    if only_vary:
        says += (
            f" The d of a sliding joint only varies: it has no constant ({NONE}), which frame and target "
            "take over, and no standard deviation of the whole."
        )
    if spread is not None:
        says += (
            " Standard deviations are of the whole in a typical pose; parameters are correlated, so that "
            "together they are known far better than each."
        )
    deviation = [] if spread is None else ["standard deviation"]
    return Table(
        f"Parameters of the {facts.best} model",
        [*COLUMNS, *deviation, "at the point, mm"],
        rows,
        says=says,
        left=(0, 1),
    )


NONE: Final = "none"
NOMINAL: Final = "nominal"
COLUMNS: Final = ("", "unit", "nominal", "constant part", "mean", "smallest", "largest")


def standard_deviations(facts: Facts, columns: list[int]) -> dict[int, float] | None:
    """Standard deviation of parameters in a typical pose, SI; None where the model does not tell them."""
    calibration = facts.calibration
    count = -(-len(columns) // TOGETHER)
    jacobian = np.zeros((count, TOGETHER, calibration.arm.table.size))
    for k, column in enumerate(columns):
        jacobian[k // TOGETHER, k % TOGETHER, column] = 1.0
    inputs = facts.inputs(np.repeat(facts.typical[None], count, axis=0))
    try:
        found = calibration.spread.covariance(inputs, jacobian)
    except WorkError:
        return None
    variances = np.einsum("kii->ki", found).reshape(-1)
    return dict(zip(columns, np.sqrt(np.maximum(variances, 0.0)).tolist(), strict=False))
