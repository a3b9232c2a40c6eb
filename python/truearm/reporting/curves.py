"""Figures: which parameter varies along which joint, and its curves with their uncertainty."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.models import VARIABLE
from truearm.reporting.charts import axis, band, colour_bar, line
from truearm.reporting.facts import Facts
from truearm.reporting.numbers import fixed, lean, short
from truearm.reporting.parameters import per_unit, unit_of
from truearm.reporting.parts import Choice, Figure
from truearm.reporting.style import SEQUENTIAL
from truearm.reporting.sweeps import deviations, own_name, sweep
from truearm.reporting.waves import strongest_wave
from truearm.summary import waves_in_words

Floats = NDArray[np.float64]

SHOWN_ALONG: Final = 3
"""Parameters whose curves are shown for each joint."""
SURE: Final = 2.0
"""Standard deviations of the band on either side."""


def influence(facts: Facts, effects: Floats) -> Figure:
    """What each parameter's variation along each joint does to the judged point; effects (N, 5 L) in mm."""
    candidates = facts.calibration.arm.candidates
    columns = [candidates.columns[k] for k in candidates.driven]
    names = [candidates.names[k] for k in candidates.driven]
    shown = effects[:, columns]
    joint, k = np.unravel_index(int(np.argmax(shown)), shown.shape)
    along = np.sum(shown, axis=1)
    trace = {
        "type": "heatmap",
        "x": names,
        "y": [f"joint {j + 1}" for j in range(len(facts.joints))],
        "z": lean(shown, 3),
        "colorscale": SEQUENTIAL,
        "colorbar": colour_bar("mm"),
    }
    return Figure(
        "Which parameter varies along which joint: the effect on the measured point",
        f"Largest: {names[k]} along joint {joint + 1}, {fixed(shown[joint, k])} mm peak to peak. Summed over "
        f"the parameters, the effect is largest along joint {int(np.argmax(along)) + 1}.",
        [trace],
        {
            "xaxis": axis("parameter", tickangle=-60),
            "yaxis": {**axis("varies along"), "autorange": "reversed"},
        },
        height=120 + 34 * len(facts.joints),
        is_wide=True,
    )


def along(facts: Facts, joint: int, effects: Floats) -> Figure:
    """Curves of the parameters that vary most along a joint, its own first; effects (5 L,) in mm."""
    names = _chosen(facts, joint, effects)
    found = sweep(facts, joint)
    q = facts.shown(_as_readings(facts, joint, found.q))[:, joint]
    spread = deviations(facts, joint, names) if facts.best == VARIABLE else None
    traces, choices, says = [], [], ""
    candidates = facts.calibration.arm.candidates
    each = 1 if spread is None else 2
    for k, name in enumerate(names):
        column = candidates.column(name)
        values = found.values[:, column] / per_unit(column)
        values = values - values.mean()
        if spread is not None:
            known_at = np.linspace(q[0], q[-1], len(spread))
            half = SURE * np.interp(q, known_at, spread[:, k]) / per_unit(column)
            traces.append(band(q, values - half, values + half, visible=k == 0))
        traces.append(line(q, values, facts.best, name=name, visible=k == 0))
        shown = [j // each == k for j in range(each * len(names))]
        title = {"yaxis": axis(f"{name}, {unit_of(column)}")}
        choices.append(Choice(name, shown, title))
        if k == 0:
            says = _says(
                name, unit_of(column), q, values, facts.unit(joint), _surely(spread, k, per_unit(column))
            )
    says += _fine_waves(facts, joint)
    first = candidates.column(names[0])
    return Figure(
        f"Variation along joint {joint + 1}",
        says,
        traces,
        {
            "xaxis": axis(f"joint {joint + 1}, {facts.unit(joint)}"),
            "yaxis": axis(f"{names[0]}, {unit_of(first)}"),
        },
        height=270,
        choices=choices,
    )


def _chosen(facts: Facts, joint: int, effects: Floats) -> list[str]:
    """Names of the parameters to show, the joint's own first."""
    candidates = facts.calibration.arm.candidates
    own = own_name(facts.calibration, joint)
    others = [candidates.names[k] for k in candidates.driven if candidates.names[k] != own]
    others.sort(key=lambda name: -effects[candidates.column(name)])
    return [*([own] if own in candidates.names else []), *others][:SHOWN_ALONG]


def _as_readings(facts: Facts, joint: int, values: Floats) -> Floats:
    readings = np.zeros((len(values), len(facts.joints)))
    readings[:, joint] = values
    return readings


def _surely(spread: Floats | None, k: int, unit: float) -> float | None:
    """Half width of the band in the median, in the shown unit."""
    return None if spread is None else SURE * float(np.median(spread[:, k])) / unit


def _says(name: str, unit: str, q: Floats, values: Floats, joint_unit: str, sure: float | None) -> str:
    """How far the curve goes, whether that is more than its uncertainty, and its strongest wave."""
    reach = float(np.ptp(values))
    if sure is None:
        start = f"{name} varies by {_four(reach)} {unit} over the measured range."
        return start + _wave(q, values, joint_unit, unit)
    start = f"{name} varies by {_four(reach)} {unit}; its 95 % band is {_four(2.0 * sure)} {unit} wide"
    if reach < 2.0 * sure:
        return f"{start}: these data do not show whether it varies."
    return f"{start}.{_wave(q, values, joint_unit, unit)}"


def _wave(q: Floats, values: Floats, joint_unit: str, unit: str) -> str:
    wave = strongest_wave(q, values)
    if wave is None:
        return ""
    return (
        f" A wave with a period of {short(wave.period)[0]} {joint_unit} and an amplitude of "
        f"{_four(wave.amplitude)} {unit} accounts for {100 * wave.share:.0f} % of the variance about a "
        "parabola."
    )


def _fine_waves(facts: Facts, joint: int) -> str:
    """What the field holds besides, too fine to be drawn."""
    waves = facts.waves(joint)
    if not waves:
        return ""
    return f" Not drawn: waves with {waves_in_words(waves)}, as gears, encoders and screws leave them."


def _four(value: float) -> str:
    return f"{value:.4f}"
