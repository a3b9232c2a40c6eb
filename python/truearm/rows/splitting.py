"""Which rows train and which are held out."""

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm import kinds
from truearm.defaults import HOLDOUT, SEED
from truearm.errors import InputError, Notice, UsageError, count_of, did_you_mean, list_names
from truearm.measurements import Measurements
from truearm.rows.linked_pairs import COMMON_POSE, components, in_stretches, on_one_side
from truearm.rows.visits import pose_numbers, visit_numbers
from truearm.tables.columns import VALIDATE
from truearm.types import Mask, Rows

NAMED: Final = 5
FEW_KNOWN: Final = 0.05
"""Share of held-out rows of poses that trained, which changes next to nothing in their errors."""
RANGE_FORM: Final = re.compile(r"q([1-9]\d*):(low|high):(.+)")


@dataclass(frozen=True)
class HoldoutRange:
    """The tail of one joint's readings: the `share` of the rows with the lowest or highest ones.

    Attributes:
        joint: Joint, counted from 1.
        high: Whether the highest readings are held out, not the lowest.
        share: Part of the rows, between 0 and 1.
    """

    joint: int
    high: bool
    share: float

    def __post_init__(self) -> None:
        kinds.settle(self, whole=("joint",), numbers=("share",), flags=("high",))
        if self.joint < 1:
            raise UsageError(f"joint {self.joint} of a range to hold out", rule="Joints are counted from 1")
        _check_share(self.share, f'the share in "{self}"')

    @classmethod
    def parse(cls, text: str) -> "HoldoutRange":
        """The range that "q2:high:0.3" stands for.

        Raises:
            UsageError: If it does not name a range.
        """
        found = RANGE_FORM.fullmatch(text)
        share = _number(found[3]) if found else None
        if found is None or share is None:
            raise UsageError(
                f'"{text}" is no range to hold out',
                rule="Write qJ:low:SHARE or qJ:high:SHARE, such as q2:high:0.3",
            )
        return cls(int(found[1]), found[2] == "high", share)

    def __str__(self) -> str:
        return f"q{self.joint}:{'high' if self.high else 'low'}:{self.share!r}"


def _as_range(given: object, name: str) -> HoldoutRange | None:
    if given is None:
        return None
    return kinds.required(HoldoutRange.parse(given) if isinstance(given, str) else given, HoldoutRange, name)


@dataclass(frozen=True)
class SplitRule:
    """How rows are divided; for each file alone, with numpy.random.default_rng(seed).

    Plain: permutation(n); from int((1 - holdout) n) on they are held out, of the others the first
    `train_size` train. With `split_by` the sorted different values of those columns are permuted, the last
    share of them is held out with all their rows, and the training rows are a permutation of the other
    rows. With `holdout_range` the tail is held out instead, and the training rows follow in the same way.

    Where a file says what its poses were planned for, in a column "purpose", those planned to "validate" are
    held out instead, all of them, and the training rows follow in the same way. A stated share, `split_by`
    and `holdout_range` come first.

    Rows with the same joint vector, rows after one another that were read within 0.3 mrad or mm of one
    pose, and the two rows of a pair, stay together, on the side of the first. Where pairs link a fifth of the
    rows of a file or more, as in a chain in which each pose is in two of them, stretches of its poses, from
    pair to pair, stay together, the last share of them is held out, as the permutation has their first rows,
    and pairs between both sides take no part but in the last fit.
    `train_size` takes no half of a pair: one that does not fit is passed over, for what comes next in the
    permutation.

    Attributes:
        holdout: Part of the rows that is held out, between 0 and 1.
        seed: Seed of the permutations.
        train_size: Training rows of each file, one less where only pairs are left to fill it; all that are
            not held out by default.
        split_by: Columns: features, joints ("q1") or "group".
        holdout_range: Tail of one joint, also as text, such as "q2:high:0.3".
        by_purpose: Whether rows that were planned to validate are held out, where there are some; only with
            the default share.
    """

    holdout: float = HOLDOUT
    seed: int = SEED
    train_size: int | None = None
    split_by: kinds.Names = kinds.Names(kinds.words, ())
    holdout_range: kinds.Kept[str | HoldoutRange | None, HoldoutRange | None] = kinds.Kept(_as_range, None)
    by_purpose: bool = True

    def __post_init__(self) -> None:
        kinds.settle(self, whole=("seed", "train_size"), numbers=("holdout",), flags=("by_purpose",))
        kinds.check_values(self, positive=("train_size",), not_negative=("seed",))
        _check_share(self.holdout, "the share to hold out")
        if self.split_by and self.holdout_range is not None:
            raise UsageError(
                "rows can be held out by columns or by a joint's range, not both",
                way_out="Give --split-by or --holdout-range",
            )


@dataclass(frozen=True)
class Split:
    """Row indices, counted from 0.

    Attributes:
        train: Training rows (t,), in the permutations' order.
        holdout: Held-out rows (h,), in the permutations' order.
        planned: How many of them are held out because they were planned to validate.
        between: How many rows are on neither side, of pairs with one row on either.
    """

    train: Rows
    holdout: Rows
    planned: int = 0
    between: int = 0


@dataclass(frozen=True, eq=False)
class _Kin:
    """Rows that must stay on the same side.

    Attributes:
        first: For each row (n,) the first such row.
        parted: Which rows (n,) are of stretches of poses that pairs link to others.
    """

    first: Rows
    parted: Mask


def split_rows(data: Measurements, rule: SplitRule) -> Split:
    """Divide the rows of `data`.

    Raises:
        UsageError: If a column or joint is not there, or the train size reaches into the held-out rows.
        InputError: If no rows would train or be held out, or a held-out set-up has no training rows.
    """
    kin = _kin_of(data)
    parts = [_split_file(data, np.flatnonzero(data.sources == file), kin, rule) for file in data.files]
    split = Split(
        train=np.concatenate([part.train for part in parts]),
        holdout=np.concatenate([part.holdout for part in parts]),
        planned=sum(part.planned for part in parts),
        between=sum(part.between for part in parts),
    )
    _check_groups(data, split, rule)
    return split


def rows_needed(sizes: Sequence[int], wanted: int, share: float) -> int:
    """How many rows there must be that `wanted` train where `share` is held out plainly.

    Args:
        sizes: Rows of each file there are; those that are missing join the last one.
        wanted: Training rows.
        share: Part of the rows, between 0 and 1.
    """
    *others, last = sizes
    missing = wanted - sum(_trained(size, share) for size in others)
    last = next(count for count in itertools.count(last) if _trained(count, share) >= missing)
    return sum(others) + last


def share_needed(sizes: Sequence[int], wanted: int, share: float) -> float | None:
    """The largest share, in whole per cent below `share`, with which `wanted` of the rows of the files train.

    None where there is none that holds out a row of each file.
    """
    for percent in range(99, 0, -1):
        train = [_trained(size, percent / 100) for size in sizes]
        holds = all(count < size for count, size in zip(train, sizes, strict=True))
        if percent / 100 < share and sum(train) >= wanted and holds:
            return percent / 100
    return None


def _trained(count: int, share: float) -> int:
    """How many of so many train where `share` of them is held out plainly."""
    return int((1.0 - share) * count)


def _split_file(data: Measurements, rows: Rows, kin: _Kin, rule: SplitRule) -> Split:
    """Split the rows (r,) of one file; `kin` are those (n,) that stay together."""
    rng = np.random.default_rng(rule.seed)
    planned = _planned(data, rows, rule)
    if planned.any():
        held = planned
    elif rule.holdout_range is not None:
        held = _tail(data, rows, rule.holdout_range)
    elif rule.split_by:
        held = _drawn_keys(data, rows, rule, rng)
    else:
        order = rng.permutation(len(rows))
        held = np.zeros(len(rows), dtype=np.bool_)
        held[order[_trained(len(rows), rule.holdout) :]] = True
        held = _drawn_stretches(kin, rows, held, order, rule.holdout)
    held = _together(held, rows, kin.first)
    whole = on_one_side(data, rows, held)
    if rule.split_by or rule.holdout_range is not None or planned.any():
        order = np.concatenate([rng.permutation(np.flatnonzero(~held)), np.flatnonzero(held)])
    train, holdout = order[(~held & whole)[order]], order[(held & whole)[order]]
    between = int((~whole).sum())
    _check_sizes(len(train), len(holdout), rule, data.select(rows))
    count = len(holdout) if planned.any() else 0
    return Split(_first(data, rows[train], rule), rows[holdout], count, between)


def _first(data: Measurements, train: Rows, rule: SplitRule) -> Rows:
    """The first `train_size` of the training rows (t,) of a file, without half a pair.

    A distance between two rows says nothing where one of them is missing.
    """
    if rule.train_size is None or data.pair is None:
        return train[: rule.train_size]
    alone = data.pair[train] == ""
    labels = np.where(
        alone, np.char.add("row ", train.astype(np.str_)), np.char.add("pair ", data.pair[train])
    )
    _, first, index, sizes = np.unique(labels, return_index=True, return_inverse=True, return_counts=True)
    taken, free = np.zeros(len(sizes), dtype=np.bool_), rule.train_size
    for kin in np.argsort(first):
        if sizes[kin] <= free:
            taken[kin], free = True, free - sizes[kin]
    if not taken.any():
        raise UsageError(
            f"a train size of {rule.train_size} holds no whole pair",
            where=str(data.sources[train[0]]),
            rule="The two rows of a pair stay together",
            way_out="Give a larger --train-size",
        )
    return train[taken[index.reshape(-1)]]


def _planned(data: Measurements, rows: Rows, rule: SplitRule) -> Mask:
    """Mask (r,) of the rows that were planned to validate; none where another rule is stated."""
    stated = bool(rule.split_by) or rule.holdout_range is not None or rule.holdout != HOLDOUT
    if data.purpose is None or stated or not rule.by_purpose:
        return np.zeros(len(rows), dtype=np.bool_)
    return np.asarray(data.purpose[rows] == VALIDATE)


def _tail(data: Measurements, rows: Rows, tail: HoldoutRange) -> Mask:
    """Held-out mask (r,): readings from the boundary on, so that equal ones stay together."""
    if tail.joint > data.joint_count:
        raise UsageError(
            f'"{tail}" names joint {tail.joint}', rule=f"The measurements have {data.joint_count} joints"
        )
    readings = data.readings[rows, tail.joint - 1] * (1.0 if tail.high else -1.0)
    boundary = np.sort(readings)[_trained(len(rows), tail.share)]
    return np.asarray(readings >= boundary)


def measured_on_both_sides(data: Measurements, split: Split) -> list[Notice]:
    """A notice where many held-out rows are of poses that trained: of another visit, or in another file."""
    pose = pose_numbers(data.readings, np.full(len(data), ""))
    known = np.isin(pose[split.holdout], pose[split.train])
    if known.mean() <= FEW_KNOWN:
        return []
    text = (
        f"{known.sum()} of {count_of(len(known), 'held-out row')} are of poses that also trained, on another "
        "visit or in another file: errors there say how the arm repeats, and less of what the model makes of "
        "new poses. A column of numbers that tell poses apart keeps the rows of each together: --split-by."
    )
    return [Notice("known_poses", text)]


def _drawn_keys(data: Measurements, rows: Rows, rule: SplitRule, rng: np.random.Generator) -> Mask:
    """Held-out mask (r,): the rows of the last share of the permuted keys."""
    _, index = np.unique(_key_columns(data, rule.split_by)[rows], axis=0, return_inverse=True)
    count = int(index.max()) + 1
    if count == 1:
        raise UsageError(
            f"all rows are equal in {list_names(rule.split_by)}",
            where=str(data.sources[rows[0]]),
            rule="Rows that are equal in these columns stay together, so there would be nothing to hold out",
            way_out="Name columns that tell rows apart, or leave out --split-by",
        )
    drawn = rng.permutation(count)[_trained(count, rule.holdout) :]
    return np.isin(index.reshape(-1), drawn)


def _key_columns(data: Measurements, names: Sequence[str]) -> NDArray[np.float64]:
    """Columns (n, k) to split by."""
    known = split_columns(data)
    for name in names:
        if name not in known:
            raise UsageError(
                f'there is no column "{name}" to split by',
                where=", ".join(data.files),
                rule=f"There are {list_names(known)}",
                way_out=did_you_mean(name, list(known)),
            )
        empty = np.isnan(known[name])
        if empty.any():
            raise InputError(
                f'column "{name}" is empty in {data.row_names(empty)}',
                where=", ".join(data.files),
                rule="Rows are divided by the values of this column",
            )
    return np.column_stack([known[name] for name in names])


def split_columns(data: Measurements) -> dict[str, NDArray[np.float64]]:
    """What rows can be split by, a number for each row (n,): features, group and joints."""
    known = {f"q{j + 1}": data.readings[:, j] for j in range(data.joint_count)}
    known["group"] = np.unique(data.group, return_inverse=True)[1].astype(np.float64)
    return known | {str(name): values.to_numpy(np.float64) for name, values in data.features.items()}


def _kin_of(data: Measurements) -> _Kin:
    """Which rows must stay together."""
    count = len(data)
    _, alike = np.unique(data.readings, axis=0, return_inverse=True)
    kin, parted = np.arange(count), np.zeros(count, dtype=np.bool_)
    for labels in (alike.reshape(-1), visit_numbers(data.readings, data.sources)):
        kin = components(kin, labels)
    if data.pair is not None:
        _, pair = np.unique(data.pair, return_inverse=True)
        pair = np.where(data.pair == "", len(pair) + np.arange(count), pair)
        kin, parted = in_stretches(kin, pair, components(kin, pair), data.sources)
    _, first, index = np.unique(kin, return_index=True, return_inverse=True)
    return _Kin(np.asarray(first[index.reshape(-1)], dtype=np.int64), parted)


def _drawn_stretches(kin: _Kin, rows: Rows, held: Mask, order: Rows, share: float) -> Mask:
    """The mask (r,) with the last share of the stretches, in the order (r,) that the rows are permuted to."""
    parted = np.flatnonzero(kin.parted[rows])
    _, first, stretch = np.unique(kin.first[rows[parted]], return_index=True, return_inverse=True)
    permuted = np.argsort(np.argsort(order)[parted[first]])
    held[parted] = np.isin(stretch.reshape(-1), permuted[_trained(len(first), share) :])
    return held


def _together(held: Mask, rows: Rows, first_of: Rows) -> Mask:
    """The mask (r,) with every row on the side of its first kin within the file."""
    _, index = np.unique(first_of[rows], return_inverse=True)
    _, first = np.unique(index.reshape(-1), return_index=True)
    return np.asarray(held[first[index.reshape(-1)]])


def _check_sizes(train: int, holdout: int, rule: SplitRule, data: Measurements) -> None:
    """Whether so many rows of one file leave something to do on either side."""
    where = str(data.sources[0])
    if holdout == 0 or train == 0:
        side = "held out" if holdout == 0 else "left to train on"
        raise InputError(
            f"no row would be {side}: {count_of(train + holdout, 'row')}, of which {holdout} held out",
            where=where,
            rule=""
            if data.pair is None
            else "The two rows of a pair are on one side, and so are few poses that pairs link",
            way_out="Measure more poses, or hold out another share"
            if data.pair is None
            else f"Measure pairs of further poses, or hold out another share. {COMMON_POSE}",
        )
    if rule.train_size is not None and rule.train_size > train:
        raise UsageError(
            f"a train size of {rule.train_size} reaches into the held-out rows",
            where=where,
            rule=f"Of {train + holdout} rows {holdout} are held out, so at most {train} can train",
            way_out="Give a smaller --train-size or a smaller --holdout",
        )


def _check_groups(data: Measurements, split: Split, rule: SplitRule) -> None:
    trained = set(data.group[split.train].tolist())
    missing = [group for group in data.groups if group not in trained]
    if missing:
        more = f" and {len(missing) - NAMED} others" if len(missing) > NAMED else ""
        raise InputError(
            f"no row of the set-up {list_names(missing[:NAMED])}{more} trains",
            where=", ".join(data.files),
            rule="The frame and tool of every set-up are found from its training rows",
            way_out=f"{_way_to_train(data, missing, rule)}; to judge a whole set-up, use: truearm evaluate",
        )


def _way_to_train(data: Measurements, groups: list[str], rule: SplitRule) -> str:
    """How rows of set-ups come to train of which none does."""
    if _planned(data, np.flatnonzero(np.isin(data.group, groups)), rule).all():
        marked = f'All of them are marked "{VALIDATE}" in the column "purpose": mark some "train"'
        return f"{marked}, or state a --holdout other than {HOLDOUT:g}"
    if rule.train_size is not None:
        return "Give a larger --train-size or another --seed"
    less = "--holdout" if rule.holdout_range is None else "share of --holdout-range"
    return f"Give a smaller {less} or another --seed"


def _check_share(share: float, what: str) -> None:
    if not 0.0 < share < 1.0:
        raise UsageError(f"{what} is {share:g}", rule="It must be between 0 and 1")


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
