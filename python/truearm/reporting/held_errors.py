"""Chapter: errors on held-out poses, their distribution, where along the joints, and the worst."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from truearm.errors import count_of, short_names
from truearm.judgement.held_rows import HeldRows
from truearm.reporting.along_joints import AlongJoints, drawable, ends
from truearm.reporting.charts import axis, legend, line, log_axis
from truearm.reporting.facts import ROWS, Facts
from truearm.reporting.numbers import fixed, listed, short
from truearm.reporting.parts import Figure, Part, Section, Table, Text
from truearm.reporting.style import colour_of, dash_of
from truearm.types import Floats
from truearm.units import MM_PER_METRE, MRAD_PER_RAD

BINS: Final = 32
WORST: Final = 12


def held_errors(facts: Facts) -> Section:
    """Errors that were made on poses that took no part in fitting."""
    title = f"Errors on {facts.those_judged}"
    if facts.held is None:
        return Section(title, [Text(_without_rows(facts))])
    errors = facts.errors_mm
    parts: list[Part] = [
        histogram(errors, facts.counted),
        cumulative(errors, facts.counted, _kept(facts, errors)),
    ]
    several = " A pose that was measured several times has their mean." if facts.counted == ROWS else ""
    words = (
        "Along the joints, lines are medians over stretches with equally many poses, and dots are errors of "
        f"the {facts.best} model; where poses are too few for lines, all models have dots.{several}"
    )
    parts.append(Text(words, is_note=True))
    along = AlongJoints.of(facts, facts.held)
    parts += [along.figure(joint) for joint in range(len(facts.joints))]
    parts += orientation(facts)
    return Section(title, [*parts, worst(facts.held, facts)])


def _without_rows(facts: Facts) -> str:
    if facts.calibration.selection.distances:
        return "Distances were measured, not points: their errors, which stand above, have no direction."
    if facts.calibration.rows is not None:
        return (
            "This file does not hold the errors of single poses, only their statistics, which stand in the "
            "table above."
        )
    return (
        "The measurements were left out of this file, so the errors of single poses cannot be shown; their "
        "statistics stand in the table above. The calibration before stripping has them."
    )


def histogram(errors: Mapping[str, Floats], counted: str) -> Figure:
    """Shares of the poses or rows, as `counted` says, over logarithmic classes of errors (n,) in mm."""
    known = {name: drawable(values) for name, values in errors.items()}
    low, high = ends(known)
    edges = np.geomspace(low, high, BINS + 1)
    traces = []
    for name, values in known.items():
        counts, _ = np.histogram(values, edges)
        shares = np.append(100.0 * counts / len(values), 0.0)
        shape = {"color": colour_of(name), "dash": dash_of(name), "width": 2, "shape": "hv"}
        filled = {"fill": "tozeroy"} if colour_of(name) == "@variable" else {}
        traces.append(line(edges, shares, name, line=shape, fillcolor="@band", **filled))
    medians = {name: float(np.median(values)) for name, values in known.items()}
    texts = short(*medians.values())
    halves = [f"{text} mm ({name})" for name, text in zip(medians, texts, strict=True)]
    return Figure(
        "Distribution of the errors",
        f"The median is {listed(halves)}.",
        traces,
        legend(
            xaxis=log_axis("position error, mm (logarithmic)", low, high),
            yaxis=axis(f"share of the {counted}, %", rangemode="tozero"),
        ),
    )


def cumulative(
    errors: Mapping[str, Floats], counted: str, without: Mapping[str, Floats] | None = None
) -> Figure:
    """Share of the poses or rows, as `counted` says, below each error (n,) in mm; `without` are those (k,)
    without outliers, where these are told.
    """
    known = {name: np.sort(drawable(values)) for name, values in errors.items()}
    low, high = ends(known)
    traces = []
    for name, values in known.items():
        share = 100.0 * np.arange(1, len(values) + 1) / len(values)
        kept = np.unique(np.linspace(0, len(values) - 1, min(len(values), 300)).astype(int))
        traces.append(line(values[kept], share[kept], name))
    mark = {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": 95, "y1": 95}
    return Figure(
        "Cumulative distribution of the errors",
        f"95 % of the {counted} have an error below {_bounds(known, without or {}, 'mm')}.",
        traces,
        legend(
            xaxis=log_axis("position error, mm (logarithmic)", low, high),
            yaxis=axis(f"{counted} with a smaller error, %", range=[0, 101]),
            shapes=[{**mark, "line": {"color": "@muted", "width": 1, "dash": "dot"}}],
        ),
    )


def _kept(facts: Facts, errors: Mapping[str, Floats]) -> dict[str, Floats]:
    """Errors (k,) without outliers, of errors (n,) of all held-out rows; empty where none is left out."""
    if facts.held is None or not facts.leaves_outliers_out:
        return {}
    kept = facts.held.without(facts.outliers.entries)
    return {name: values[kept] for name, values in errors.items()}


def _bounds(errors: Mapping[str, Floats], kept: Mapping[str, Floats], unit: str) -> str:
    """Below what 95 % of the errors (n,) of each model are, and without outliers where some are `kept`."""
    words = []
    for each in filter(None, (errors, kept)):
        bounds = short(*(float(np.nanquantile(values, 0.95)) for values in each.values()))
        words.append(listed([f"{text} {unit} ({name})" for name, text in zip(each, bounds, strict=True)]))
    return ", without the outliers below ".join(words)


def orientation(facts: Facts) -> list[Figure]:
    """Cumulative curves of the orientation's errors, where it was measured."""
    if facts.held is None:
        return []
    turned = {
        name: np.linalg.norm(found.orientation, axis=1) * MRAD_PER_RAD
        for name, found in facts.held.errors.items()
        if found.orientation is not None
    }
    known = {name: np.sort(drawable(values)) for name, values in turned.items()}
    if not known or min(map(len, known.values())) == 0:
        return []
    traces = [
        line(values, 100.0 * np.arange(1, len(values) + 1) / len(values), name)
        for name, values in known.items()
    ]
    kept = _kept(facts, turned) if facts.outliers.means_mrad else {}
    figure = Figure(
        "Cumulative distribution of the orientation errors",
        f"95 % of the {facts.counted} have an orientation error below {_bounds(known, kept, 'mrad')}.",
        traces,
        legend(
            xaxis=log_axis("orientation error, mrad (logarithmic)", *ends(known)),
            yaxis=axis(f"{facts.counted} with a smaller error, %", range=[0, 101]),
        ),
    )
    return [figure]


def worst(held: HeldRows, facts: Facts) -> Table:
    """The rows with the largest errors of the model that predicts."""
    errors = facts.errors_mm
    mine = np.nan_to_num(errors[facts.best], nan=-1.0)
    order = np.argsort(-mine, kind="stable")[:WORST]
    names = short_names(set(held.sources.tolist()))
    several = len(names) > 1
    shown = facts.shown(held.readings)
    rows = []
    for k in order:
        place = [names[str(held.sources[k])]] if several else []
        missed = [fixed(errors[name][k]) for name in facts.models]
        rows.append([str(held.rows[k]), *place, *missed, ", ".join(fixed(value, 1) for value in shown[k])])
    columns = ["row", *(["file"] if several else []), *(f"{name}, mm" for name in facts.models)]
    units = "/".join(dict.fromkeys(facts.unit(joint) for joint in range(len(facts.joints))))
    share = mine[order].sum() / mine[mine >= 0].sum()
    judged = count_of(len(held), f"{facts.calibration.validation.judged} row")
    part = f"These {len(rows)} of {judged} make up {100 * share:.0f} % of the sum of all errors. "
    return Table(
        "Worst poses",
        [*columns, f"joints, {units}"],
        rows,
        says=f"{part if len(rows) < len(held) else ''}Row 1 is the first below the header of the file.",
        left=(0, len(columns)) if not several else (0, 1, len(columns)),
    )


def vectors_mm(held: HeldRows, model: str) -> Floats:
    """Error vectors (n, 3) in the base frame, mm."""
    return np.asarray(MM_PER_METRE * held.errors[model].position)
