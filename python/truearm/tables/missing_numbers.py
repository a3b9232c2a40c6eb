"""Numbers by which other people's tables say that nothing was measured, in the columns where they can."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from truearm.errors import Notice, list_rows
from truearm.tables.missing_cells import said_numbers
from truearm.tables.raw_tables import DECIMAL_MARKS, Part, RawTable
from truearm.tables.reading import Table
from truearm.types import Floats, Integers, Mask

STAYS: Final = "missing_stays"
EMPTIED: Final = "missing_kept"
OF_JOINTS: Final = "a reading is never left out: leave out the row"
OF_PARTS: Final = "nothing was measured only where all columns of a point, or of an orientation, say so"
OF_ANGLES: Final = "angles of zero are an orientation: empty the cells where none was measured"
OF_KEPT: Final = "0 may be what is kept: leave the cells empty where nothing was noted"


@dataclass(frozen=True)
class Meanings:
    """Columns of a table by what they mean.

    Attributes:
        joints: Those of joint readings.
        points: The coordinates of each point.
        orientation: Those of the orientation; () without.
        has_angles: Whether these are angles or a rotation vector, of which zeros are an orientation as well.
        single: Those that measure by themselves: distance and sigma.
        kept: Those that are kept beside.
    """

    joints: tuple[str, ...] = ()
    points: tuple[tuple[str, ...], ...] = ()
    orientation: tuple[str, ...] = ()
    has_angles: bool = False
    single: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Said:
    """A number in a column that is not plainly a gap, and what becomes of it.

    Attributes:
        column: The column.
        numbers: What its cells say (n,); NaN where that is nothing of the kind.
        why: Why it stays a number; "" where the cells are left empty.
    """

    column: str
    numbers: Floats
    why: str = ""

    def notices(self, rows: Integers) -> Iterator[Notice]:
        """A notice of each number that the `rows`, from 0, say."""
        said = self.numbers[rows]
        for number in np.unique(said[np.isfinite(said)]).tolist():
            where = list_rows((rows[said == number] + 1).tolist())
            what = f'column "{self.column}" says {number:g} in {where}'
            if self.why:
                yield Notice(STAYS, f"{what}, which stays a number: {self.why}")
            else:
                yield Notice(EMPTIED, f"{what}, which is left empty there: --missing says so")


def without_numbers(table: RawTable, meanings: Meanings) -> tuple[RawTable, list[Said]]:
    """The table with empty cells where numbers say that nothing was measured, and what is to be told.

    A point is missing where all of its coordinates say so, since one of them may be any number; so is an
    orientation, which angles of zero are as well. Of what is kept zero may be one.
    """
    if not any(part.marks.missing for part in table.parts.values()):
        return table, []
    said = {name: _said(table.parts[name]) for name in table.names}
    empty = {name: np.zeros(table.row_count, dtype=np.bool_) for name in table.names}
    told = [Said(name, _other_than_zero(said[name]), OF_JOINTS) for name in meanings.joints]
    for columns in filter(None, (*meanings.points, meanings.orientation)):
        missing, is_zero = _all_of(table, columns, said)
        if columns == meanings.orientation and meanings.has_angles:
            missing &= ~is_zero
            told.append(Said(columns[0], np.where(is_zero, 0.0, np.nan), OF_ANGLES))
        for name in columns:
            empty[name] |= missing
            told.append(Said(name, np.where(missing, np.nan, _other_than_zero(said[name])), OF_PARTS))
    for name in meanings.single:
        empty[name] |= np.isfinite(said[name])
    for name in meanings.kept:
        others = _other_than_zero(said[name])
        empty[name] |= np.isfinite(others)
        told += [Said(name, others), Said(name, np.where(said[name] == 0.0, 0.0, np.nan), OF_KEPT)]
    parts = {name: _emptied(part, empty[name]) for name, part in table.parts.items()}
    return replace(table, parts=parts), told


def _said(part: Part) -> Floats:
    """Of each row (n,) the number by which a column says that nothing was measured; NaN of others."""
    return said_numbers(part.table, part.name, part.marks.missing, part.marks.decimal or DECIMAL_MARKS[0])[
        part.rows
    ]


def _other_than_zero(said: Floats) -> Floats:
    return np.where(said == 0.0, np.nan, said)


def _all_of(table: RawTable, columns: tuple[str, ...], said: Mapping[str, Floats]) -> tuple[Mask, Mask]:
    """Rows (n,) of which some columns say a number where they are not empty, and those that say zeros."""
    blank = np.array([table.texts(name) == "" for name in columns])
    numbers = np.array([said[name] for name in columns])
    stated = np.isfinite(numbers)
    whole = (blank | stated).all(axis=0) & stated.any(axis=0)
    return np.asarray(whole), np.asarray((numbers == 0.0).all(axis=0))


def _emptied(part: Part, rows: Mask) -> Part:
    """A column without what its cells say in some of its rows (n,)."""
    if not rows.any():
        return part
    cells = np.array(part.table.cells(part.name), dtype=np.object_)
    cells[part.rows[rows]] = ""
    table = Table(part.table.where, {part.name: cells}, part.table.row_count)
    return part._replace(table=table)
