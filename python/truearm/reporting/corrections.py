"""Chapter: what compensation does: how large its corrections are, and what it refuses."""

from collections import Counter
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.compensation import Compensated
from truearm.errors import count_of, short_names
from truearm.limits import Task
from truearm.measurements import Measurements
from truearm.reporting.charts import axis
from truearm.reporting.facts import ROWS, Facts
from truearm.reporting.numbers import fixed, lean, short, signed, without_zeros
from truearm.reporting.parts import Figure, Part, Section, Table, Text

Floats = NDArray[np.float64]

LARGEST: Final = 6


def compensation(facts: Facts) -> Section:
    """The poses that were measured, corrected as waypoints of a program."""
    title = "Compensation"
    calibration, rows, made = facts.calibration, facts.calibration.rows, facts.waypoints
    if calibration.scheme is not None:
        words = f"Compensation takes constant and variable models; this one is {facts.best}."
        return Section(title, [Text(words)])
    if rows is None or made is None:
        return Section(
            title, [Text("The measurements were left out of this file: there are no poses to correct.")]
        )
    data, task, found = made.data, made.task, made.found
    point = "flange" if calibration.selection.distances else "measured target"
    whose = "robot file's tool" if facts.names_tool else f"{point}, as the robot file names no tool"
    words = _overall(found, (task, f"the {whose}"), len(rows.data)) + facts.at_features
    parts: list[Part] = [Text(words), *_sizes(facts, found)]
    return Section(title, [*parts, *largest(facts, data, found), *_refusals(data, found)])


def _overall(found: Compensated, asked: tuple[Task, str], count: int) -> str:
    """In a sentence; `asked` are the task and whose it is."""
    task, of = asked
    corrected = int((~found.refused).sum())
    met = {"pose": "position and orientation", "axis": "position and tool axis", "position": "position"}[task]
    refused = f"{int(found.refused.sum()) or 'none'} refused"
    which = "first " if len(found.q) < count else ""
    return (
        f"The {which}{count_of(len(found.q), 'measured row')}, each corrected as a waypoint of a program "
        f"({met} of {of}): {corrected} corrected, {refused}."
    )


def _sizes(facts: Facts, found: Compensated) -> list[Figure]:
    """How far each joint is corrected."""
    good = ~found.refused
    if not good.any():
        return []
    change = facts.shown(found.q[good] - found.nominal[good])
    shift = found.correction_mm[good]
    traces = [
        {
            "type": "box",
            "name": f"{joint + 1}",
            "y": lean(change[:, joint], 3),
            "boxpoints": False,
            "marker": {"color": "@variable"},
            "line": {"color": "@variable"},
            "fillcolor": "@band",
        }
        for joint in range(change.shape[1])
    ]
    widest = int(np.argmax(np.abs(change).max(axis=0)))
    most, middle = short(float(shift.max()), float(np.median(shift)))
    units = "/".join(dict.fromkeys(facts.unit(joint) for joint in range(len(facts.joints))))
    figure = Figure(
        "Corrections of the joints",
        f"Joint {widest + 1} is corrected most, by up to {np.abs(change[:, widest]).max():.3f} "
        f"{facts.unit(widest)}. The tool is moved by {middle} mm in the median and {most} mm at most.",
        traces,
        {"xaxis": axis("joint"), "yaxis": axis(f"correction, {units}")},
        height=300,
    )
    trace = {"type": "histogram", "x": lean(shift), "nbinsx": 40, "marker": {"color": "@variable"}}
    sizes = Figure(
        "Shift of the tool",
        f"The median shift is {middle} mm, the largest {most} mm; the largest rotation is "
        f"{short(float(found.correction_mrad[good].max()))[0]} mrad.",
        [trace],
        {"xaxis": axis("shift of the tool, mm", rangemode="tozero"), "yaxis": axis(ROWS), "bargap": 0.05},
        height=300,
    )
    return [figure, sizes]


def largest(facts: Facts, data: Measurements, found: Compensated) -> list[Table]:
    """The rows with the largest corrections; none where all are refused."""
    shift = np.where(found.refused, -1.0, found.correction_mm)
    order = [k for k in np.argsort(-shift, kind="stable")[:LARGEST] if shift[k] >= 0.0]
    change = facts.shown(found.q - found.nominal)
    units = "/".join(dict.fromkeys(facts.unit(joint) for joint in range(len(facts.joints))))
    rows = [
        [
            _row_name(data, k),
            fixed(found.correction_mm[k]),
            fixed(found.correction_mrad[k]),
            fixed(found.std_mm[k]),
            ", ".join(signed(value, 3) for value in change[k]),
        ]
        for k in order
    ]
    if not rows:
        return []
    table = Table(
        "Largest corrections",
        [
            "row",
            "shift, mm",
            "rotation, mrad",
            "standard deviation, mm",
            f"corrections of the joints, {units}",
        ],
        rows,
        left=(0, 4),
    )
    return [table]


def _row_name(data: Measurements, k: int) -> str:
    place = f" of {short_names(data.files)[str(data.sources[k])]}" if len(data.files) > 1 else ""
    return f"{data.rows[k]}{place}"


def _refusals(data: Measurements, found: Compensated) -> list[Table]:
    """How often each reason was given, with the first rows."""
    if not found.refusals:
        return []
    codes = Counter(refusal.code for refusal in found.refusals)
    rows = []
    for code, times in codes.most_common():
        mine = [refusal for refusal in found.refusals if refusal.code == code]
        named = ", ".join(_row_name(data, refusal.number - 1) for refusal in mine[:5])
        rows.append([str(times), named + (" ..." if times > 5 else ""), without_zeros(mine[0].reason)])
    table = Table(
        "Refused",
        ["count", "rows", "reason for the first"],
        rows,
        says="A refused waypoint needs a person's decision: no correction is clipped.",
        left=(1, 2),
    )
    return [table]
