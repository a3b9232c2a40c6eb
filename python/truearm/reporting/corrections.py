"""Chapter: what compensation does: how large its corrections are, and what it refuses."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from truearm.compensation import Compensated
from truearm.errors import count_of, short_names
from truearm.limits import Task
from truearm.measurements import Measurements
from truearm.reporting.charts import axis
from truearm.reporting.facts import ROWS, Facts
from truearm.reporting.numbers import fixed, lean, short, signed, without_zeros
from truearm.reporting.parameters import shifted
from truearm.reporting.parts import Figure, Part, Section, Table, Text
from truearm.reporting.waypoints import Waypoints
from truearm.rows.visits import pose_numbers
from truearm.types import Floats, Mask, Rows
from truearm.units import MM_PER_METRE

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
    parts: list[Part] = [Text(words), *_sizes(facts, made)]
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


def _sizes(facts: Facts, made: Waypoints) -> list[Figure]:
    """How far each joint is corrected, and the tool with it."""
    found = made.found
    good = ~found.refused
    if not good.any():
        return []
    shift = found.correction_mm[good]
    most, middle = short(float(shift.max()), float(np.median(shift)))
    trace = {"type": "histogram", "x": lean(shift), "nbinsx": 40, "marker": {"color": "@variable"}}
    sizes = Figure(
        "Shift of the tool",
        f"The median shift is {middle} mm, the largest {most} mm; the largest rotation is "
        f"{short(float(found.correction_mrad[good].max()))[0]} mrad.",
        [trace],
        {"xaxis": axis("shift of the tool, mm", rangemode="tozero"), "yaxis": axis(ROWS), "bargap": 0.05},
        height=300,
    )
    return [*_of_joints(facts, found, good), sizes]


def _of_joints(facts: Facts, found: Compensated, good: Mask) -> list[Figure]:
    """Corrections of the joints at `good` waypoints (n,), a figure a unit: mm would flatten degrees."""
    change = found.q[good] - found.nominal[good]
    moved_mm = np.median(tool_moves_mm(facts, found.nominal[good], change), axis=0)
    by_unit: dict[str, list[int]] = {}
    for joint in range(len(facts.joints)):
        by_unit.setdefault(facts.unit(joint), []).append(joint)
    if len(by_unit) == 1:
        return [_boxes("Corrections of the joints", facts, change, moved_mm, range(len(facts.joints)))]
    return [
        _boxes(f"Corrections of the joints, {unit}", facts, change, moved_mm, joints)
        for unit, joints in by_unit.items()
    ]


def tool_moves_mm(facts: Facts, readings: Floats, change: Floats) -> Floats:
    """How far each joint's change (n, N), rad and m, moves the tool by itself (n, N), mm, to first order.

    Args:
        facts: Of the calibration; its nominal arm tells.
        readings: Where the joints are (n, N), rad and m.
        change: How they change.
    """
    robot = facts.calibration.robot
    end = robot.tool if facts.names_tool else shifted(facts.point)
    jacobian = replace(robot, tool=end).joint_jacobian(readings)
    return np.asarray(MM_PER_METRE * np.linalg.norm(jacobian * change[:, None, :], axis=1))


def _boxes(title: str, facts: Facts, change: Floats, moved_mm: Floats, joints: Sequence[int]) -> Figure:
    """Corrections (n, N), rad and m, of joints of one unit, with how far those of each (N,) move the tool."""
    shown, unit = facts.shown(change), facts.unit(joints[0])
    traces = [
        {
            "type": "box",
            "name": f"{joint + 1}",
            "y": lean(shown[:, joint], 3),
            "boxpoints": False,
            "marker": {"color": "@variable"},
            "line": {"color": "@variable"},
            "fillcolor": "@band",
        }
        for joint in joints
    ]
    first = max(joints, key=lambda joint: float(moved_mm[joint]))
    sizes, which = np.abs(shown[:, first]), f"The corrections of joint {first + 1}"
    which = which if len(joints) == 1 else f"{which} move the tool most. They"
    return Figure(
        title,
        f"{which} are {np.median(sizes):.3f} {unit} in the median, and alone would move the tool by "
        f"{short(float(moved_mm[first]))[0]} mm; the largest is {sizes.max():.3f} {unit}.",
        traces,
        {"xaxis": axis("joint"), "yaxis": axis(f"correction, {unit}")},
        height=300,
    )


def largest(facts: Facts, data: Measurements, found: Compensated) -> list[Table]:
    """Poses with the largest corrections, each by its row with the largest; none where all are refused."""
    shift = np.where(found.refused, -1.0, found.correction_mm)
    pose = pose_numbers(data.readings, data.group)
    order = [k for k in _first_of_each(pose, np.argsort(-shift, kind="stable"))[:LARGEST] if shift[k] >= 0.0]
    change, units = facts.shown(found.q - found.nominal), [facts.unit(k) for k in range(len(facts.joints))]
    one = len(set(units)) == 1
    rows = [
        [
            _row_name(data, k),
            fixed(found.correction_mm[k]),
            fixed(found.correction_mrad[k]),
            fixed(found.std_mm[k]),
            ", ".join(
                signed(value, 3) + ("" if one else f" {unit}")
                for value, unit in zip(change[k], units, strict=True)
            ),
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
            "corrections of the joints" + (f", {units[0]}" if one else ""),
        ],
        rows,
        says="" if len(np.unique(pose)) == len(pose) else "Of rows of one pose, that with the largest.",
        left=(0, 4),
    )
    return [table]


def _first_of_each(number: Rows, order: Rows) -> list[int]:
    """Those of `order` (n,) that are the first of their number (n,)."""
    _, first = np.unique(number[order], return_index=True)
    return [int(k) for k in order[np.sort(first)]]


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
