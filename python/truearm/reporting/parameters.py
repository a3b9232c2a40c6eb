"""The constant model: nominal, correction, standard error, and which parameters are confounded."""

from typing import Final

import numpy as np

from truearm._core import Chain
from truearm.certainty.standard_errors import of_covariance
from truearm.errors import count_of
from truearm.fits.models import CONSTANT
from truearm.fits.parameters import KIND_COUNT, KINDS
from truearm.reporting.charts import EVERY_NAME, axis, colour_bar
from truearm.reporting.facts import Facts
from truearm.reporting.numbers import lean, signed
from truearm.reporting.parts import Cell, Figure, Table
from truearm.reporting.style import DIVERGING
from truearm.types import Floats
from truearm.units import MM_PER_METRE, RADIANS_PER_DEGREE

LENGTHS: Final = ("d", "a")
POSES: Final = 300
CONFOUNDED: Final = 0.9
NO_WORDS: Final = ""


def kind_of(column: int) -> str:
    """Kind of the parameter in a column of the chain's parameters."""
    return KINDS[column % KIND_COUNT]


def unit_of(column: int) -> str:
    """Unit it is shown in."""
    return "mm" if kind_of(column) in LENGTHS else "deg"


def per_unit(column: int) -> float:
    """What its SI value is divided by to be shown."""
    return 1.0 / MM_PER_METRE if kind_of(column) in LENGTHS else RADIANS_PER_DEGREE


def table(facts: Facts) -> Table:
    """A row for each parameter that was asked for."""
    calibration = facts.calibration
    candidates, found = calibration.arm.candidates, calibration.identifiability
    errors = standard_errors(facts)
    words = dict(zip(found.undetermined, found.words, strict=True))
    nominal = calibration.arm.table.ravel()
    corrected = calibration.models[CONSTANT].constants.ravel()
    effects = effect_mm(facts)
    rows: list[list[str | Cell]] = []
    largest = ("", 0.0)
    for k in candidates.constant:
        column, name = candidates.columns[k], candidates.names[k]
        unit = per_unit(column)
        change = corrected[column] - nominal[column]
        effect = float(effects[column] * abs(change))
        largest = max(largest, (name, effect), key=lambda entry: entry[1])
        known = name in errors
        rows.append(
            [
                name,
                unit_of(column),
                f"{nominal[column] / unit:.3f}",
                signed(change / unit) if known else NO_WORDS,
                f"{errors[name] / unit:.4f}" if known else NO_WORDS,
                f"{effect:.3f}" if known else NO_WORDS,
                Cell("determined", "good") if known else Cell(_remark(name, words.get(name, "")), "fair"),
            ]
        )
    return Table(
        f"Parameters of the constant model{_purpose(facts)}",
        ["", "unit", "nominal", "correction", "standard error", "at the point, mm", "determined?"],
        rows,
        says=f"{largest[0]} has the largest effect: its correction moves the {facts.point_name} by "
        f"{largest[1]:.3f} mm (root mean square over the poses). {_of_errors(facts)}",
        left=(0, 1, 6),
    )


def _of_errors(facts: Facts) -> str:
    """What standard errors hold; those of earlier versions were of the covariance alone."""
    details = facts.calibration.constant
    if np.array_equal(details.standard_errors, of_covariance(details.covariance, len(details.names))):
        return (
            "Standard errors take all that the constants leave for noise: where the arm varies with the "
            "pose, constants may be off by several of them."
        )
    return "Standard errors hold what the constants may have taken over of what varies with the pose."


def _purpose(facts: Facts) -> str:
    """What the constant model is for where another one predicts."""
    return "" if facts.best == CONSTANT else ", which exports of constants hold"


def _remark(name: str, words: str) -> str:
    return words.removeprefix(name).strip().rstrip(".") or "not estimated"


def standard_errors(facts: Facts) -> dict[str, float]:
    """Standard error of each determined constant, SI."""
    details = facts.calibration.constant
    return dict(zip(details.names, details.standard_errors.tolist(), strict=True))


def effect_mm(facts: Facts) -> Floats:
    """How far one rad or m of each parameter moves the judged point (5 L,), mm, RMS over poses."""
    poses = facts.drawn(POSES)
    jacobian = chain_to_point(facts).parameter_jacobian(facts.calibration.robot.joints_from_readings(poses))
    return np.asarray(MM_PER_METRE * np.sqrt(np.square(jacobian).sum(axis=1).mean(axis=0)))


def chain_to_point(facts: Facts) -> Chain:
    """The identified chain, to the judged point."""
    return facts.calibration.arm.chain(facts.calibration.robot.flange @ shifted(facts.point))


def shifted(point: Floats) -> Floats:
    """The transform (4, 4) of a point (3,) that is not turned."""
    transform = np.eye(4)
    transform[:3, 3] = point
    return transform


def confounding(facts: Facts) -> Figure | None:
    """Correlations between the determined constants; None where there is one alone."""
    details = facts.calibration.constant
    names, size = list(details.names), len(details.names)
    if size < 2:
        return None
    covariance = details.covariance[:size, :size]
    deviation = np.sqrt(np.diagonal(covariance))
    scale = np.outer(deviation, deviation)
    # An update keeps constants that its poses do not tell: they correlate with nothing.
    correlation = np.divide(covariance, scale, out=np.zeros_like(covariance), where=scale > 0.0)
    off = np.where(np.eye(size, dtype=bool), 0.0, correlation)
    row, column = np.unravel_index(int(np.argmax(np.abs(off))), off.shape)
    strong = int((np.abs(np.triu(off)) > CONFOUNDED).sum())
    pair = f"The largest correlation is {off[row, column]:+.2f}, of {names[row]} and {names[column]}"
    pairs = f"{count_of(strong, 'pair')} {'exceeds' if strong == 1 else 'exceed'}"
    others = (
        f"No pair exceeds {CONFOUNDED} either way."
        if strong == 0
        else f"{pairs} {CONFOUNDED} either way: a combination of the two is known far better than each."
    )
    trace = {
        "type": "heatmap",
        "x": names,
        "y": names,
        "z": lean(correlation, 2),
        "colorscale": DIVERGING,
        "zmin": -1,
        "zmax": 1,
        "colorbar": colour_bar("correlation"),
    }
    return Figure(
        "Correlations of the constant model's parameters",
        f"{pair}. {others}",
        [trace],
        {
            "xaxis": {**axis("parameter", **EVERY_NAME), "tickangle": -90},
            "yaxis": {**axis("parameter", **EVERY_NAME), "autorange": "reversed"},
        },
        height=max(340, 16 * size + 120),
        is_wide=True,
    )
