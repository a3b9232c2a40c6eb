"""Other people's tables as measurement tables: what is in them is stated, never guessed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from truearm.errors import (
    InputError,
    Notice,
    TruearmError,
    UsageError,
    did_you_mean,
    list_names,
    list_rows,
    typed,
)
from truearm.joined_tables import join_tables
from truearm.measurements import Measurements
from truearm.named_values import JOINT
from truearm.tables.columns import (
    DISTANCE_COLUMN,
    QUATERNION,
    SIGMA_COLUMNS,
    TARGET_COLUMN,
    WORDS,
    MissingColumnError,
    StatedUnits,
)
from truearm.tables.measured_fields import read_fields
from truearm.tables.missing_numbers import Meanings, without_numbers
from truearm.tables.our_columns import TURN, UNITS, is_ours, order, without_unit
from truearm.tables.raw_tables import Marks, RawTable, read_raw
from truearm.tables.reading import as_number, table_from_frame
from truearm.tables.rotation_columns import RotationColumns
from truearm.types import Floats
from truearm.units import (
    ANGLE_UNITS,
    COLUMN_ANGLE_UNITS,
    COLUMN_LENGTH_UNITS,
    STATED_LENGTH_UNITS,
    to_si,
    unit_in_header,
)

WHICH: Final = "target"
"""Which of several points on the tool was measured in a row, from 1, where x, y, z are of one each."""
POINT: Final = ("x", "y", "z")
MOST_TARGETS: Final = 100
AGREE: Final = "The name of a column, a unit below it and the one that is stated for it must agree"
WHICH_IS_WHICH: Final = "Say which is which: --map q1=COLUMN:deg --map x=COLUMN:mm, and so on"


@dataclass(frozen=True)
class ImportPlan:
    """What a table looks like and what its columns mean.

    Attributes:
        columns: Their column of each of ours (q1, x, x2, sigma, group, ...); a unit may stand behind
            it, as in "J1:deg". Columns that have our names already need not be named, but for "target": the
            column that says by a number from 1 which point on the tool x, y, z are of in each row.
        keep: Their column, with or without unit, of each further column to keep.
        rotation: Columns of the orientation, unless they are qw, qx, qy, qz in `columns`.
        joint_unit: Unit of joints whose column states none: "rad" or "deg".
        length_unit: Unit of positions, sigma and distances that state none: "m", "mm" or "in".
        marks: How the table is written.
        second: A second table, with columns that the first has not.
        second_marks: How it is written; as the first without.
        on: The column that says which of their rows belong together, as in join_tables.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    keep: Mapping[str, str] = field(default_factory=dict)
    rotation: RotationColumns | None = None
    joint_unit: str | None = None
    length_unit: str | None = None
    marks: Marks = field(default_factory=Marks)
    second: Path | None = None
    second_marks: Marks | None = None
    on: str | None = None

    def __post_init__(self) -> None:
        choices = (
            ("--joint-unit", self.joint_unit, ANGLE_UNITS),
            ("--length-unit", self.length_unit, STATED_LENGTH_UNITS),
        )
        for option, value, known in choices:
            if value is not None and value not in known:
                raise UsageError(
                    f'"{value}" is not known', where=option, rule=f"Known are {list_names(known)}"
                )
        if self.on is not None and self.second is None:
            raise UsageError("there is one table only", where="--on", way_out="Name the other: --with FILE")


class Imported(NamedTuple):
    """What came in.

    Attributes:
        frame: Joints, positions, orientation and what was kept, in rad and m, all rows in which something was
            measured. The column of a joint that is given as a length says so: q3_m.
        unused: Their columns that nothing was taken from.
        left_out: In words, rows that nothing was taken from.
        remarks: In words, lines that are remarks or units, and columns that count the rows.
        notices: What the user should know.
    """

    frame: pd.DataFrame
    unused: list[str]
    left_out: list[str]
    remarks: list[str]
    notices: list[Notice]


def import_table(path: Path, plan: ImportPlan) -> Imported:
    """Read a table as `plan` says it is, as one that Measurements.from_dataframe takes.

    Raises:
        InputError: If a file is not what the plan says, or the measurements break a rule.
        UsageError: If the plan names columns that are not there, or leaves a unit open.
    """
    table = read_raw(path, plan.marks)
    if plan.second is not None:
        table = join_tables(table, read_raw(plan.second, plan.second_marks or plan.marks), plan.on)
    columns: dict[str, Floats | NDArray[np.str_]] = {}
    named = _all_columns(table, plan)
    table, said = without_numbers(table, _meanings(table, named, plan))
    for ours, theirs in named.items():
        unit = _unit(table, ours, theirs, plan)
        columns[_written(ours, unit)] = _converted(table, ours, theirs, unit)
    if plan.rotation is not None:
        columns |= _orientation(table, plan.rotation)
    for ours, theirs in plan.keep.items():
        if ours in columns:
            raise UsageError(f'column "{ours}" is named twice', where="--keep")
        columns[ours] = _kept(table, ours, theirs, plan)
    if not columns:
        raise InputError(
            "none of its columns has a name of ours",
            where=table.where,
            rule=f"They are {', '.join(table.names)}",
            way_out=WHICH_IS_WHICH,
        )
    if WHICH in plan.columns:
        columns = _by_target(columns, table)
    frame, empty = _with_measurements(pd.DataFrame(columns), table)
    _check(frame, table)
    left_out, unused = [*table.left_out, *empty], _unused(table, named, plan)
    rows = frame.index.to_numpy(dtype=np.int64)
    of_numbers = (notice for each in said for notice in each.notices(rows))
    notices = [*_unsaid(table), *of_numbers, *_kept_as_text(table, plan)]
    return Imported(frame.reset_index(drop=True), unused, left_out, table.remarks, notices)


def _meanings(table: RawTable, named: Mapping[str, str], plan: ImportPlan) -> Meanings:
    """What the table's columns mean, for the numbers by which they may say that nothing was measured."""
    theirs = {ours: _split_unit(table, name)[0] for ours, name in named.items()}
    points: dict[str, list[str]] = {}
    for ours, name in theirs.items():
        if point := TARGET_COLUMN.fullmatch(ours):
            points.setdefault(point[2] or "", []).append(name)
    rotation = () if plan.rotation is None else tuple(map(table.existing, plan.rotation.columns))
    kept = [_split_unit(table, name)[0] for name in plan.keep.values()]
    key = None if plan.on is None else plan.on.partition("=")[0]
    return Meanings(
        joints=tuple(name for ours, name in theirs.items() if JOINT.fullmatch(ours)),
        points=tuple(map(tuple, points.values())),
        orientation=rotation or tuple(theirs[name] for name in QUATERNION if name in theirs),
        has_angles=plan.rotation is not None and bool(plan.rotation.unit),
        single=tuple(
            name
            for ours, name in theirs.items()
            if ours == TURN or any(one.fullmatch(ours) for one in (*SIGMA_COLUMNS, DISTANCE_COLUMN))
        ),
        kept=tuple(name for name in kept if name != key),
    )


def _unsaid(table: RawTable) -> list[Notice]:
    """That no cell says what was stated of cells where nothing was measured."""
    return [
        Notice("missing", f"no cell of {table.where} says what --missing {typed(word)} says")
        for word in table.unsaid
    ]


def _check(frame: pd.DataFrame, table: RawTable) -> None:
    """Raise InputError if rows of a table, whose numbers are the index of `frame`, break a rule."""
    numbers = frame.index.to_numpy(dtype=np.int64) + 1
    checked = table_from_frame(frame, where=table.where, row_numbers=numbers)
    try:
        Measurements(**read_fields(checked, StatedUnits(), default_group=table.where))
    except MissingColumnError as error:
        names = ", ".join(table.names)
        raise InputError(
            error.what, where=table.where, rule=f"Its columns are {names}", way_out=WHICH_IS_WHICH
        ) from None


def _by_target(
    columns: Mapping[str, Floats | NDArray[np.str_]], table: RawTable
) -> dict[str, Floats | NDArray[np.str_]]:
    """Columns of points with those of further targets: x2, y2, z2 for rows whose target is 2, and so on."""
    which = np.asarray(columns[WHICH], dtype=np.float64)
    others = {name: values for name, values in columns.items() if name != WHICH}
    several = [name for name in others if TARGET_COLUMN.fullmatch(name) and name not in POINT]
    if several or not set(POINT) <= set(others):
        raise UsageError(
            f"there {'are columns of several points' if several else 'is no point'}",
            where=table.where,
            rule=f'"{WHICH}" says of which target x, y, z are',
        )
    measured = np.isfinite(np.column_stack([others[axis] for axis in POINT]).astype(np.float64)).any(axis=1)
    wrong = measured & ~np.isin(which, np.arange(1, MOST_TARGETS + 1))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(
            f"the target of row {row + 1} is {'not stated' if np.isnan(which[row]) else f'{which[row]:g}'}",
            where=table.where,
            rule=f"Targets are counted from 1, to {MOST_TARGETS} at the most",
            way_out="Correct it, or leave the point of this row empty",
        )
    spread = {}
    for number in range(1, int(np.max(which[measured], initial=1)) + 1):
        for axis in POINT:
            spread[axis if number == 1 else f"{axis}{number}"] = np.where(
                which == number, others[axis], np.nan
            )
    ordered = {name: values for name, values in others.items() if JOINT.fullmatch(name)} | spread
    return ordered | {name: values for name, values in others.items() if name not in ordered}


def _with_measurements(frame: pd.DataFrame, table: RawTable) -> tuple[pd.DataFrame, list[str]]:
    """The rows in which something was measured if there are any, and in words those in which nothing was."""
    places = [
        name
        for name in frame.columns
        if TARGET_COLUMN.fullmatch(str(name)) or DISTANCE_COLUMN.fullmatch(str(name))
    ]
    measured = frame[places].notna().any(axis=1)
    if measured.all() or not measured.any():
        return frame, []
    rows = list_rows((np.flatnonzero(~measured) + 1).tolist())
    words = f"{rows} of {table.where}, as nothing was measured"
    return frame[measured], [words]


def _unused(table: RawTable, named: Mapping[str, str], plan: ImportPlan) -> list[str]:
    used = {_split_unit(table, theirs)[0] for theirs in (*named.values(), *plan.keep.values())}
    used |= set(plan.rotation.columns) if plan.rotation else set()
    if plan.on is not None:
        used |= {plan.on.partition("=")[0]}
    return [name for name in table.names if name not in used]


def _all_columns(table: RawTable, plan: ImportPlan) -> dict[str, str]:
    """Their column of each of ours: those of the plan, and those that have our names already."""
    for ours in plan.columns:
        _check_is_ours(ours)
    mapped = [_split_unit(table, theirs)[0] for ours, theirs in plan.columns.items() if ours not in WORDS]
    twice = [name for name in dict.fromkeys(mapped) if mapped.count(name) > 1]
    if twice:
        raise UsageError(f'column "{twice[0]}" is taken for two of ours', where="--map")
    taken = {_split_unit(table, theirs)[0] for theirs in plan.columns.values()}
    taken |= {_split_unit(table, theirs)[0] for theirs in plan.keep.values()}
    named = dict(plan.columns)
    found: dict[str, list[str]] = {}
    for name, part in table.parts.items():
        ours, unit = without_unit(part.name)
        if name not in taken and is_ours(ours) and ours not in named:
            found.setdefault(ours, []).append(f"{name}:{unit}" if unit else name)
    _refuse_several(table, found)
    named |= {ours: theirs[0] for ours, theirs in found.items()}
    return dict(sorted(named.items(), key=lambda item: order(item[0])))


def _refuse_several(table: RawTable, found: Mapping[str, Sequence[str]]) -> None:
    """Raise UsageError if several columns have a name of one of ours."""
    for ours, theirs in found.items():
        if len(theirs) > 1:
            ways = " or ".join(f'--map "{ours}={each}"' for each in theirs)
            raise UsageError(
                f'{list_names(theirs)} are all "{ours}"',
                where=table.where,
                way_out=f"Say which is meant: {ways}",
            )


def _converted(table: RawTable, ours: str, theirs: str, unit: str) -> Floats | NDArray[np.str_]:
    name, _ = _split_unit(table, theirs)
    if ours in WORDS:
        return table.texts(name)
    values = table.numbers(name)
    return to_si(values, unit) if unit else values


def _unit(table: RawTable, ours: str, theirs: str, plan: ImportPlan) -> str:
    """Unit of a column; "" where it has none.

    Raises:
        UsageError: If it is not stated, is one that no such column has, or another one than its name says.
    """
    name, unit = _split_unit(table, theirs)
    known: tuple[str, ...] = UNITS if JOINT.fullmatch(ours) else COLUMN_LENGTH_UNITS
    if ours == TURN:
        known = COLUMN_ANGLE_UNITS
    if ours in (*WORDS, *QUATERNION, WHICH):
        known = ()
    if unit and unit not in known:
        kind = f"has one of the units {', '.join(known)}" if known else "has no unit"
        raise UsageError(
            f'column "{ours}" is said to be in {unit}: "{theirs}"',
            where=table.where,
            rule=f'"{ours}" {kind}',
            way_out=f"Write --map {ours}=COLUMN{':' + known[-1] if known else ''}",
        )
    if (unit and ours in plan.columns) or not known:
        return unit
    _check_file_agrees(table, ours, name, unit, plan)
    if unit:
        return unit
    stated = _stated_unit(ours, plan)
    _check_header(table, ours, theirs, stated)
    return stated


def _check_file_agrees(table: RawTable, ours: str, name: str, unit: str, plan: ImportPlan) -> None:
    """Raise UsageError if a column's name, with `unit` at its end or none, says another than stands below.

    A last "in" may be the word: it is no unit beside another one that is stated for lengths.
    """
    part = table.parts[name]
    named, below = unit or unit_in_header(part.name), part.unit
    by = "the row of units below it"
    if unit == "in" and not below and not JOINT.fullmatch(ours) and plan.length_unit is not None:
        below, by = plan.length_unit, "--length-unit"
    if "" in (named, below) or named == below:
        return
    ways = [typed(f"{ours}={name}:{each}") for each in (named, below) if each in UNITS]
    raise UsageError(
        f'column "{name}" says {named}, {by} says {below}',
        where=table.where,
        rule=AGREE,
        way_out=f"State the right one behind the column: {' or '.join(f'--map {way}' for way in ways)}"
        if ways
        else "Convert this column in the file",
    )


def _check_header(table: RawTable, ours: str, theirs: str, stated: str) -> None:
    """Raise UsageError if the column's own name says another unit than the option for all of them."""
    said = table.parts[theirs].said_unit
    if said in ("", stated):
        return
    option = "--joint-unit" if JOINT.fullmatch(ours) else "--length-unit"
    right = typed(f"{ours}={theirs}:{said}") if said in UNITS else "convert this column in the file"
    raise UsageError(
        f'column "{theirs}" says {said}, {option} says {stated}',
        where=table.where,
        rule=AGREE,
        way_out=f"Give the right {option}, or state the unit of this column alone behind it: --map "
        f"{typed(f'{ours}={theirs}:{stated}')} if its name is wrong, {right} if its name is right",
    )


def _written(ours: str, unit: str) -> str:
    """Name of a column that is written in SI: joints are angles unless their names say otherwise."""
    return f"{ours}_m" if unit in COLUMN_LENGTH_UNITS and JOINT.fullmatch(ours) else ours


def _stated_unit(ours: str, plan: ImportPlan) -> str:
    if ours == TURN:
        return "rad"
    is_joint = JOINT.fullmatch(ours) is not None
    unit = plan.joint_unit if is_joint else plan.length_unit
    if unit is None:
        option, units = ("--joint-unit", ANGLE_UNITS) if is_joint else ("--length-unit", STATED_LENGTH_UNITS)
        raise UsageError(
            f'the unit of column "{ours}" is not stated',
            way_out=f"Give {option} {' or '.join(units)}, or name it: --map {ours}=COLUMN:{units[-1]}",
        )
    return unit


def _orientation(table: RawTable, rotation: RotationColumns) -> dict[str, Floats]:
    """Quaternions of the columns that hold them, or what they are found from.

    Raises:
        UsageError: If there is no such column, or its own name says another unit than the option.
    """
    for name in map(table.existing, rotation.columns):
        said = table.parts[name].said_unit
        if rotation.unit and said not in ("", rotation.unit):
            raise UsageError(
                f'column "{name}" says {said}, --rotation says {rotation.unit}',
                where=table.where,
                rule=AGREE,
                way_out="Give the unit in which the angles are; a wrong name has to be mended in the file",
            )
    values = np.column_stack([table.numbers(table.existing(name)) for name in rotation.columns])
    quaternions = rotation.quaternions(values)
    return {name: quaternions[:, k] for k, name in enumerate(QUATERNION)}


def _kept(table: RawTable, ours: str, theirs: str, plan: ImportPlan) -> Floats | NDArray[np.str_]:
    if is_ours(ours):
        raise UsageError(f'"{ours}" is a measurement column', where="--keep", way_out="Give it with --map")
    name, unit = _split_unit(table, theirs)
    if unit:
        return to_si(table.numbers(name), unit)
    if plan.on is not None and name == plan.on.partition("=")[0]:
        return table.texts(name)
    return table.texts(name) if _why_text(table, name) else table.numbers(name)


def _why_text(table: RawTable, name: str) -> str:
    """Why a column that is kept without a unit stays text, in words; "" where it holds numbers alone."""
    try:
        table.numbers(name)
    except TruearmError as error:
        return str(error)
    return ""


def _kept_as_text(table: RawTable, plan: ImportPlan) -> list[Notice]:
    """Of the columns that are kept those that are text by some of their cells: others hold numbers."""
    key = "" if plan.on is None else plan.on.partition("=")[0]
    found = {}
    for ours, theirs in plan.keep.items():
        name, unit = _split_unit(table, theirs)
        if not unit and name != key and any(map(_is_number, table.texts(name).tolist())):
            found[ours] = _why_text(table, name)
    return [
        Notice("kept_as_text", f'"{ours}" is kept as text, which nothing varies with: {why}')
        for ours, why in found.items()
        if why
    ]


def _is_number(cell: str) -> bool:
    """Whether a cell holds a finite number, with a point or a comma."""
    number = as_number(cell.replace(",", "."))
    return number is not None and bool(np.isfinite(number))


def _split_unit(table: RawTable, theirs: str) -> tuple[str, str]:
    """Their column and the unit behind it, "" where there is none."""
    name, mark, unit = theirs.rpartition(":")
    if not mark or theirs in table.parts:
        name, unit = theirs, ""
    if name not in table.parts and "=" in name.partition(",")[2]:
        raise UsageError(
            f'"{theirs}" names several columns', rule="One --map names one column", way_out="Repeat --map"
        )
    table.existing(name)
    if unit and unit not in UNITS:
        raise UsageError(f'"{unit}" behind "{name}" is no unit', rule=f"Units are {', '.join(UNITS)}")
    return name, unit


def _check_is_ours(ours: str) -> None:
    if is_ours(ours) or ours == WHICH:
        return
    bare, unit = without_unit(ours)
    known = ["q1", "x", "y", "z", "x2", *QUATERNION, "sigma", "sigma_x", TURN, "distance", WHICH, *WORDS]
    rule = did_you_mean(ours, known) or f"Known are {list_names(known)} and their like"
    way_out = "Further columns are kept with --keep"
    if unit:
        rule, way_out = "Units stand behind their column", f"Write --map {bare}=COLUMN:{unit}"
    raise UsageError(f'"{ours}" is no measurement column', where="--map", rule=rule, way_out=way_out)
