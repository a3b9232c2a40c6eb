"""Figures: which parameter varies along which joint or feature, and its curves with their uncertainty."""

from typing import Final

import numpy as np

from truearm.fits.models import VARIABLE
from truearm.reporting.charts import EVERY_NAME, axis, band, colour_bar, line
from truearm.reporting.facts import Facts
from truearm.reporting.numbers import fixed, lean, short, significant
from truearm.reporting.parameters import per_unit, unit_of
from truearm.reporting.parts import Choice, Figure
from truearm.reporting.style import SEQUENTIAL
from truearm.reporting.sweeps import deviations, feature_ends, moved_mm, own_name, sweep, swept_names
from truearm.reporting.waves import strongest_wave
from truearm.storage.summary import waves_in_words
from truearm.types import Floats

SHOWN_ALONG: Final = 3
"""Parameters whose curves are shown for each joint and feature."""
LAST_DIGIT: Final = 1e-4
"""Of what is told of curves, deg or mm."""
SURE: Final = 2.0
"""Standard deviations of the band on either side."""


def influence(facts: Facts, effects: Floats) -> Figure:
    """What each parameter's variation along each input does to the judged point; effects (I, 5 L) in mm."""
    candidates = facts.calibration.arm.candidates
    columns = [candidates.columns[k] for k in candidates.driven]
    names = [candidates.names[k] for k in candidates.driven]
    shown = effects[:, columns]
    inputs = swept_names(facts)
    which, k = np.unravel_index(int(np.argmax(shown)), shown.shape)
    summed = int(np.argmax(np.sum(shown, axis=1)))
    trace = {
        "type": "heatmap",
        "x": names,
        "y": inputs,
        "z": lean(shown, 3),
        "colorscale": SEQUENTIAL,
        "colorbar": colour_bar("mm"),
    }
    return Figure(
        f"Which parameter varies along which {_kinds(facts)}: the effect on the measured point",
        f"Largest: {names[k]} along {inputs[which]}, {fixed(shown[which, k])} mm peak to peak. Summed over "
        f"the parameters, the effect is largest along {inputs[summed]}. Each cell is of one parameter "
        "alone, in the mean over a few poses: together they may move the point farther.",
        [trace],
        {
            "xaxis": axis("parameter", tickangle=-90, **EVERY_NAME),
            "yaxis": {**axis("varies along"), "autorange": "reversed"},
        },
        height=120 + 34 * len(inputs),
        is_wide=True,
    )


def _kinds(facts: Facts) -> str:
    return "joint or feature" if len(swept_names(facts)) > len(facts.joints) else "joint"


def along(facts: Facts, which: int, effects: Floats) -> Figure:
    """Curves of the parameters that vary most along an input, and of a joint's own; effects (5 L,) in mm.

    Joints count from 0; features follow.
    """
    names = _chosen(facts, which, effects)
    found = sweep(facts, which)
    is_joint, swept = which < len(facts.joints), swept_names(facts)[which]
    unit = facts.unit(which) if is_joint else f"units of {swept}"
    q = facts.shown_of(which, found.q) if is_joint else found.q
    spread = deviations(facts, which, names) if facts.best == VARIABLE else None
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
            says = in_words(name, unit_of(column), q, values, unit, _surely(spread, k, per_unit(column)))
    says = says + _fine_waves(facts, which) if is_joint else f"{_moves(facts, swept)} {says}"
    first = candidates.column(names[0])
    return Figure(
        f"Variation along {swept}",
        says,
        traces,
        {
            "xaxis": axis(f"{swept}, {unit}" if is_joint else f"{swept}, in its own unit"),
            "yaxis": axis(f"{names[0]}, {unit_of(first)}"),
        },
        height=270,
        choices=choices,
    )


def _moves(facts: Facts, feature: str) -> str:
    """What a feature does to the judged point as a whole."""
    moved, ends = moved_mm(facts, feature), feature_ends(facts, feature)
    mean, most = short(float(moved.mean()), float(moved.max()))
    poses = "measured poses" if facts.readings is not None else "poses"
    return (
        f"From {significant(ends[0])} to {significant(ends[1])}, {feature} moves the {facts.point_name} "
        f"by {mean} mm on average over {poses}, by {most} mm at most."
    )


def _chosen(facts: Facts, which: int, effects: Floats) -> list[str]:
    """Names of the parameters to show, by their effect; a joint's own is among them whatever its effect."""
    candidates = facts.calibration.arm.candidates
    names = [candidates.names[k] for k in candidates.driven]
    names.sort(key=lambda name: -effects[candidates.column(name)])
    own = own_name(facts.calibration, which) if which < len(facts.joints) else ""
    if own not in candidates.names or own in names[:SHOWN_ALONG]:
        return names[:SHOWN_ALONG]
    return [*names[: SHOWN_ALONG - 1], own]


def _surely(spread: Floats | None, k: int, unit: float) -> float | None:
    """Half width of the band in the median, in the shown unit."""
    return None if spread is None else SURE * float(np.median(spread[:, k])) / unit


def in_words(name: str, unit: str, q: Floats, values: Floats, joint_unit: str, sure: float | None) -> str:
    """How far the curve goes, whether that is more than its uncertainty, and its strongest wave.

    A wave within the band is none that these data show, and not told.
    """
    reach = float(np.ptp(values))
    varies = _four(reach) if reach >= LAST_DIGIT else f"less than {_four(LAST_DIGIT)}"
    if sure is None:
        start = f"{name} varies by {varies} {unit} over the measured range."
        return start + _wave(q, values, joint_unit, unit)
    start = f"{name} varies by {varies} {unit}; its 95 % band is {_four(2.0 * sure)} {unit} wide"
    if reach < 2.0 * sure:
        return f"{start}: these data do not show whether it varies."
    return f"{start}.{_wave(q, values, joint_unit, unit, least=sure)}"


def _wave(q: Floats, values: Floats, joint_unit: str, unit: str, *, least: float = 0.0) -> str:
    wave = strongest_wave(q, values)
    if wave is None or wave.amplitude < max(least, LAST_DIGIT):
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
