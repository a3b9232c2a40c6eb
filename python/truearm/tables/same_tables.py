"""Which rows of several measurements were read from the same table, and what their set-ups are called."""

import hashlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm.errors import InputError, list_names
from truearm.types import Texts

if TYPE_CHECKING:
    from truearm.measurements import Measurements


NAMES: Final = ("group0", "anchor0", "pair0")
"""Columns of names, which tables are given other ones of when they are put together."""
IDENTITY_BYTES: Final = 8


def own_anchor(group: Texts) -> Texts:
    """The fixed point that distances lead to where nothing names it, by the set-up's name (n,)."""
    return np.char.add("anchor of ", group)


def identities(data: "Measurements") -> NDArray[np.int64]:
    """What tells the table of each row from others (n,): a hash of its name and of all that was read."""
    content, found = data.hash(), np.zeros(len(data), dtype=np.int64)
    for source in data.files:
        digest = hashlib.sha256(f"{source}:{content}".encode()).digest()
        found[data.sources == source] = int.from_bytes(digest[:IDENTITY_BYTES], "little", signed=True)
    return found


def called_as_files(group: Texts, sources: Texts) -> Texts:
    """The set-ups (n,) that have the name of their file, whole or without folders and ending; else ""."""
    stems = {source: PurePath(source).stem for source in set(sources.tolist())}
    pairs = zip(group.tolist(), sources.tolist(), strict=True)
    own = [name in (source, stems[source]) for name, source in pairs]
    return np.where(own, group, "")


def copied_rows(data: "Measurements") -> NDArray[np.bool_]:
    """Mask (n,) of rows that hold what an earlier one does, in a set-up of another name of a file."""
    found = np.zeros(len(data), dtype=np.bool_)
    called = np.flatnonzero(_called_after_file(data))
    if len(set(data.group[called].tolist())) < 2:
        return found
    content = data.select(called).content()
    measured = [name for name in content.columns if name not in NAMES]
    first = content.groupby(measured, dropna=False, sort=False)["group0"].transform("first")
    found[called] = (first != content["group0"]).to_numpy()
    return found


def told_apart(parts: Sequence["Measurements"]) -> list["Measurements"]:
    """The parts with different names for the set-ups of different files, where no column names them.

    Raises:
        InputError: If a column names a set-up as several such files are called.
    """
    known: dict[str, list[Measurements]] = {}
    parts = [_own_table(part, known) for part in parts]
    called = set[tuple[str, str]]()
    for part in parts:
        rows = _called_after_file(part)
        called |= set(zip(part.group[rows].tolist(), part.sources[rows].tolist(), strict=True))
    groups, sources = Counter(group for group, _ in called), Counter(source for _, source in called)
    for part in parts:
        _check_one_is_meant(part, called, groups)
    unclear = [source for group, source in called if groups[group] > 1 or sources[source] > 1]
    return [
        _renamed(part, _called_after_file(part) & np.isin(part.sources, unclear), group=part.sources)
        for part in parts
    ]


def _check_one_is_meant(part: "Measurements", called: set[tuple[str, str]], count: Counter[str]) -> None:
    """Raise InputError if a column of the part names a set-up as several files are called."""
    named = ~_called_after_file(part)
    for group in dict.fromkeys(part.group[named].tolist()):
        if count[group] > 1:
            alike = list_names(sorted(source for name, source in called if name == group))
            raise InputError(
                f'column "group" says "{group}", as {alike} are called',
                where=list_names(dict.fromkeys(part.sources[named & (part.group == group)].tolist())),
                rule="A file without that column is a set-up of its own, called after the file",
                way_out='Give these files a column "group" too, with equal names for one set-up',
            )


def _own_table(part: "Measurements", known: dict[str, list["Measurements"]]) -> "Measurements":
    """The part with a name of its own for each table that is called as another one; adds to `known`."""
    called, names = _called_after_file(part), part.sources
    for source, own in product(part.files, (called, ~called)):
        mask = own & (part.sources == source)
        if mask.any():
            table = part.select(mask)
            name = _name(table, source, known)
            known.setdefault(name, []).append(table)
            names = np.where(mask, name, names)
    return _renamed(part, names != part.sources, sources=names)


def _name(table: "Measurements", source: str, known: dict[str, list["Measurements"]]) -> str:
    """What a table is called: as rows of it that are known, else by its source, with a number if taken."""
    for name, others in known.items():
        shared = any(_share_a_table(table, other) for other in others)
        if shared and not any(_are_different(table, other) for other in others):
            return name
    name, number = source, 1
    while any(_are_different(table, other) for other in known.get(name, [])):
        number += 1
        name = f"{source} {number}"
    return name


def _are_different(table: "Measurements", other: "Measurements") -> bool:
    """Whether two tables hold different things in a row of the same number.

    Without such a row those are different whose set-ups are called after them, unless something says that
    they are one; where a column names the set-ups, rows of unlike numbers may have come from one table.
    """
    common, mine, others = np.intersect1d(table.rows, other.rows, return_indices=True)
    if len(common) == 0:
        return _both_called(table, other) and not _share_a_table(table, other)
    one, another = table.select(mine).content(), other.select(others).content()
    both = [name for name in one.columns if name in another.columns and name not in NAMES]
    return not all(_agree(one[name].to_numpy(), another[name].to_numpy()) for name in both)


def _share_a_table(table: "Measurements", other: "Measurements") -> bool:
    """Whether rows of both were read at once from one table, as far as it is known of set-ups called so."""
    if not _both_called(table, other) or table.tables is None or other.tables is None:
        return False
    return bool(np.isin(table.tables, other.tables).any())


def _both_called(table: "Measurements", other: "Measurements") -> bool:
    """Whether the set-ups of both tables are called after them, and not by a column."""
    return bool(_called_after_file(table).any() and _called_after_file(other).any())


def _agree(one: NDArray[Any], other: NDArray[Any]) -> bool:
    """Whether two columns hold the same; one that is empty was added when tables were put together."""
    if one.dtype.kind == "O":
        return not ((one != "").any() and (other != "").any()) or np.array_equal(one, other)
    first, second = (np.asarray(column, dtype=np.float64) for column in (one, other))
    empty = np.isnan(first).all() or np.isnan(second).all()
    return bool(empty) or np.array_equal(first, second, equal_nan=True)


def _called_after_file(part: "Measurements") -> NDArray[np.bool_]:
    """Mask (n,) of the rows whose set-up is called after its file."""
    if part.default_group is None:
        return np.zeros(len(part), dtype=np.bool_)
    return np.asarray((part.default_group == part.group) & (part.default_group != ""))


def _renamed(part: "Measurements", mask: NDArray[np.bool_], **names: Texts) -> "Measurements":
    """The part with other texts (n,) in the rows of a mask, `group` or `sources`."""
    if not mask.any():
        return part
    if "group" in names:
        names["default_group"] = names["group"]
        if part.anchor is not None:
            is_own = part.anchor == own_anchor(part.group)
            names["anchor"] = np.where(is_own, own_anchor(names["group"]), part.anchor)
    changes: dict[str, Any] = {key: np.where(mask, text, getattr(part, key)) for key, text in names.items()}
    return replace(part, **changes)
