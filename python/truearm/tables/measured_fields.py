"""From the columns of a table to the fields of Measurements: SI units, every row checked."""

from typing import Any, Final

import numpy as np
import pandas as pd

from truearm.errors import Notice, list_names
from truearm.rotations import UNIT_QUATERNIONS, UNIT_TOLERANCE
from truearm.tables.columns import (
    PURPOSE,
    PURPOSES,
    QUATERNION,
    Layout,
    StatedUnits,
    canonical,
    lookalikes,
    read_joint_layout,
    read_layout,
)
from truearm.tables.reading import Table
from truearm.tables.row_values import refuse_rows, si_values
from truearm.tables.same_tables import own_anchor
from truearm.tables.sigmas import read_sigmas
from truearm.types import Floats, Mask, Texts

SAME_PLACE_M: Final = 1e-9
"""Coordinates that differ by less are one, in whatever unit they were written."""
ONE_ANCHOR: Final = "anchor 1"
"""The fixed point of distances that nothing names, in tables whose set-ups a column names."""


def read_fields(
    table: Table, stated: StatedUnits, *, default_group: str, measured: bool = True
) -> dict[str, Any]:
    """Arguments of Measurements; unless `measured`, rows of joints alone will do.

    Raises:
        InputError: If a column is missing or a value breaks a rule; names the rows.
    """
    layout = read_layout(table.names, stated, where=table.where, measured=measured)
    readings = _readings(table, layout)
    targets = _targets(table, layout)
    distance = _distances(table, layout)
    if measured or layout.targets:
        _check_measured(table, targets, distance)
    sigmas = read_sigmas(table, layout)
    own = ONE_ANCHOR if "group" in layout.words else str(own_anchor(np.array(default_group)))
    ends = _ends(table, layout, (distance, sigmas["sigma_m"]), own)
    purpose, unknown = _purpose(table, layout)
    features, notices = _features(table, layout, known=() if purpose is None else (PURPOSE,))
    return {
        "readings": readings,
        "targets": targets,
        "orientations": _orientations(table) if layout.quaternion else None,
        **sigmas,
        "group": _group(table, layout, default_group),
        "features": features,
        "sources": np.full(table.row_count, table.where),
        "rows": table.row_numbers,
        "joint_units": tuple(column.unit for column in layout.joints),
        "distance_m": distance,
        **ends,
        "purpose": purpose,
        "notices": (
            *_left_out(table),
            *_repeated(table, layout, targets),
            *_of_distances(table, layout, (targets, distance), own),
            *unknown,
            *notices,
        ),
        "default_group": None if "group" in layout.words else np.full(table.row_count, default_group),
    }


def _left_out(table: Table) -> list[Notice]:
    return [Notice("row_numbers", f"Left out: {words}.") for words in table.remarks]


def read_joint_columns(table: Table, stated: StatedUnits) -> Floats:
    """The joint readings (n, N) of a table in which nothing need be measured, rad and m.

    Raises:
        InputError: If a column is missing or a cell is empty or no number.
    """
    layout = Layout(joints=read_joint_layout(table.names, stated, where=table.where), targets=[])
    return _readings(table, layout)


def _readings(table: Table, layout: Layout) -> Floats:
    readings = np.column_stack([si_values(table, column) for column in layout.joints])
    for column, values in zip(layout.joints, readings.T, strict=True):
        refuse_rows(
            table, np.isnan(values), f'column "{column.name}" is empty in', "Every row needs all joints"
        )
    return readings


def _targets(table: Table, layout: Layout) -> Floats:
    targets = np.full((table.row_count, len(layout.targets), 3), np.nan)
    for number, columns in enumerate(layout.targets):
        targets[:, number] = np.column_stack([si_values(table, column) for column in columns])
        empty = np.isnan(targets[:, number])
        names = list_names([column.name for column in columns])
        rule = "A point is measured with all three coordinates, or all three cells are empty"
        refuse_rows(table, _is_partial(empty), f"only some of {names} are given in", rule)
    return targets


def _repeated(table: Table, layout: Layout, targets: Floats) -> list[Notice]:
    """Notices of targets (n, T, 3) that are where one before them is in all rows."""
    each = targets.swapaxes(0, 1)
    return [
        Notice(
            "repeated_target",
            f"{table.where}: {list_names([column.name for column in layout.targets[number]])} hold the same "
            "as the columns of another target in all rows, and count as a second point on the tool. A point "
            "that is there twice tells no more than once: remove these columns.",
        )
        for number in range(1, len(each))
        if np.isfinite(each[number]).any()
        and any(
            np.allclose(each[number], one, rtol=0.0, atol=SAME_PLACE_M, equal_nan=True)
            for one in each[:number]
        )
    ]


def _orientations(table: Table) -> Floats | None:
    """Measured orientations (n, 4), NaN where there is none; None where there is none at all."""
    q = np.column_stack([table.numbers(name) for name in QUATERNION])
    empty = np.isnan(q)
    if empty.all():
        return None
    rule = "An orientation has all four numbers, or all four cells are empty"
    refuse_rows(table, _is_partial(empty), 'only some of "qw" to "qz" are given in', rule)
    length: Floats = np.sqrt(np.square(q).sum(axis=1))
    off = np.abs(length - 1.0) > UNIT_TOLERANCE
    worst = length[np.nanargmax(np.abs(length - 1.0))] if off.any() else 1.0
    refuse_rows(
        table,
        off,
        f"the quaternion qw qx qy qz has not length 1 (up to {worst:.6g}) in",
        UNIT_QUATERNIONS,
        "Other notations come in by: truearm import --rotation",
    )
    return q / length[:, None]


def _distances(table: Table, layout: Layout) -> Floats | None:
    """Measured distances (n,), NaN where there is none; None where there is none at all."""
    if layout.distance is None:
        return None
    distance = si_values(table, layout.distance)
    if np.isnan(distance).all():
        return None
    refuse_rows(
        table,
        distance <= 0.0,
        f'column "{layout.distance.name}" is not positive in',
        "Distances are positive",
        "Correct or remove the rows. Where a ball sat in sockets, give the distance of two of them (`pair`)",
    )
    return distance


def _check_measured(table: Table, targets: Floats, distance: Floats | None) -> None:
    measured = np.any(np.all(np.isfinite(targets), axis=2), axis=1)
    if distance is not None:
        measured = measured | np.isfinite(distance)
    refuse_rows(table, ~measured, "nothing was measured in", "Every row needs a position or a distance")


def _group(table: Table, layout: Layout, default: str) -> Texts:
    if "group" not in layout.words:
        return np.full(table.row_count, default)
    groups = table.names_in("group")
    refuse_rows(
        table,
        ~_is_given(groups, table.row_count),
        'column "group" is empty in',
        "Every row needs the name of its set-up",
    )
    return groups


def _ends(
    table: Table, layout: Layout, measured: tuple[Floats | None, Floats | None], own: str
) -> dict[str, Texts | None]:
    """What the distances lead to: `anchor` and `pair`, each None where there is none.

    Distances without either column lead to one fixed point, `own`. `measured` are distances and sigmas.
    """
    distance, sigma = measured
    anchor = table.names_in("anchor") if "anchor" in layout.words else None
    pair = table.names_in("pair") if "pair" in layout.words else None
    if distance is None:
        return {"anchor": anchor, "pair": pair}
    if anchor is None and pair is None:
        return {"anchor": np.where(np.isfinite(distance), own, ""), "pair": None}
    has_anchor, has_pair = (_is_given(word, table.row_count) for word in (anchor, pair))
    rule = 'A distance leads to a fixed point named in "anchor", or to the other row of the same "pair"'
    found = np.isfinite(distance)
    refuse_rows(table, found & ~has_anchor & ~has_pair, "the distance leads nowhere in", rule)
    refuse_rows(table, found & has_anchor & has_pair, "the distance leads to an anchor and a pair in", rule)
    if pair is not None:
        _check_pairs(table, pair, distance)
        _check_alike(table, pair, "distances", distance)
        if sigma is not None:
            _check_alike(table, pair, "sigmas", sigma)
    return {"anchor": anchor, "pair": pair}


def _of_distances(
    table: Table, layout: Layout, measured: tuple[Floats, Floats | None], own: str
) -> list[Notice]:
    """A notice of distances that are left out, or of which nothing says where they lead.

    `measured` are targets and distances.
    """
    targets, distance = measured
    if distance is None:
        return []
    if np.isfinite(targets).any():
        text = f"{table.where}: distances are left out: points were measured as well, and points are fitted."
        return [Notice("distances_left_out", text)]
    if "anchor" in layout.words or "pair" in layout.words:
        return []
    text = (
        f"{table.where}: no column says where the distances lead: all are taken as measured to one fixed "
        f'point, "{own}". If there are several, name them in a column anchor; distances between two '
        "poses have a column pair."
    )
    return [Notice("no_anchor_named", text)]


def _is_given(words: Texts | None, count: int) -> Mask:
    return np.zeros(count, dtype=np.bool_) if words is None else np.char.str_len(words) > 0


def _is_partial(empty: Mask) -> Mask:
    """Rows of `empty` (n, k) that have both empty and filled cells."""
    return np.asarray(np.any(empty, axis=1) & ~np.all(empty, axis=1))


def _check_pairs(table: Table, pair: Texts, distance: Floats) -> None:
    _, index, count = np.unique(pair, return_inverse=True, return_counts=True)
    lonely = (pair != "") & (count[index] != 2)
    refuse_rows(table, lonely, 'not exactly two rows share the name in "pair" in', "A pair is two rows")
    empty = (pair != "") & np.isnan(distance)
    refuse_rows(
        table, empty, "the distance of a pair is empty in", "Both rows of a pair hold the same distance"
    )


def _check_alike(table: Table, pair: Texts, what: str, values: Floats) -> None:
    """Refuse a pair whose two rows hold different values (n,), m."""
    for name in np.unique(pair[pair != ""]):
        first, second = values[pair == name]
        refuse_rows(
            table,
            (pair == name) & (first != second),
            f'pair "{name}" has two {what}, {first:g} m and {second:g} m, in',
            f"Both rows of a pair hold the same {what[:-1]}",
        )


def _purpose(table: Table, layout: Layout) -> tuple[Texts | None, list[Notice]]:
    """What each pose was planned for, in words that are known in small letters; None where there is no such
    column. With a notice of words that are not known.
    """
    if PURPOSE not in layout.others or table.is_numeric(PURPOSE):
        return None, []
    words = table.texts(PURPOSE)
    small = np.char.lower(np.char.strip(words))
    known = np.isin(small, PURPOSES)
    strange = sorted(set(words[~known & (small != "")].tolist()))
    text = (
        f'{table.where}: column "{PURPOSE}" holds {list_names(strange)}, which plans nothing: '
        f"{list_names(PURPOSES)} are known."
    )
    return np.where(known, small, words), [Notice("purpose", text)] if strange else []


def _features(table: Table, layout: Layout, known: tuple[str, ...]) -> tuple[pd.DataFrame, list[Notice]]:
    """Columns of numbers, and notices of the columns that are left out; `known` mean something else."""
    numeric = [name for name in layout.others if table.is_numeric(name)]
    notices = []
    texts = [name for name in layout.others if name not in (*numeric, *known)]
    if texts:
        small = [canonical(name) for name in lookalikes(texts)]
        written = f"; what means something is written in small letters: {list_names(small)}" if small else ""
        notices.append(
            Notice("text_columns", f"{table.where}: left out, as not numeric: {list_names(texts)}{written}.")
        )
    alike = lookalikes(numeric)
    if alike:
        text = (
            f"{table.where}: {list_names(alike)} kept as plain features; names are written in small letters."
        )
        notices.append(Notice("column_names", text))
    index = pd.RangeIndex(table.row_count)
    return pd.DataFrame({name: table.numbers(name) for name in numeric}, index=index), notices
