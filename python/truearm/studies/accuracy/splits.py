"""Which rows are held out: tails of joints, clusters, groups, another target, and random rows.

Rows of one pose are on one side, whatever is held out: a row of a pose that trained would say how the arm
repeats. Rows without the target that is fitted, or judged, take no part.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from truearm.defaults import HOLDOUT
from truearm.errors import InputError, UsageError, did_you_mean, list_names
from truearm.fits.stillness import still_joints
from truearm.measurements import Measurements
from truearm.rows.splitting import HoldoutRange, Split, SplitRule, split_columns, split_rows
from truearm.studies.accuracy.sets import DataSet, Read, read_set
from truearm.types import Rows

Kind = Literal["tails", "clusters", "groups", "target", "random"]

KINDS: Final[tuple[Kind, ...]] = ("tails", "clusters", "groups", "target", "random")
TITLES: Final = {
    "tails": "tails of joints held out",
    "clusters": "clusters of joint space held out",
    "groups": "whole groups held out",
    "target": "judged at another target",
    "random": "random rows held out",
}
CLUSTERS: Final = 10
CLUSTER_COLUMN: Final = "cluster of the study"
MOST_SHARED: Final = 0.5
FEWEST_JUDGED: Final = 5
"""Held-out rows at the least; a mean over fewer of them is chance."""
MOST_JUDGED: Final = 1000
"""Held-out rows at the most; a mean over more of them changes by less than it does with the seed."""


@dataclass(frozen=True)
class Cut:
    """One way to hold out rows.

    Attributes:
        kind: Of KINDS.
        detail: Range of a tail, columns of groups, number of a target; empty otherwise.
    """

    kind: Kind
    detail: str = ""

    def __str__(self) -> str:
        return " ".join(word for word in (TITLES[self.kind], self.detail) if word)

    @property
    def target(self) -> int:
        """The measured target that is judged, from 0; target 0 is the one that is fitted."""
        return int(self.detail) - 1 if self.kind == "target" else 0


def check_kinds(given: Sequence[str], *, split_by: bool) -> tuple[Kind, ...]:
    """The kinds that are named, in the order of KINDS; all that are possible where none is.

    Raises:
        UsageError: If there is no such kind, or groups are asked for without columns.
    """
    for name in given:
        if name not in KINDS:
            raise UsageError(
                f'there is no split "{name}"',
                rule=f"There are {list_names(KINDS)}",
                way_out=did_you_mean(name, KINDS),
            )
    if "groups" in given and not split_by:
        raise UsageError('the split "groups" needs columns', way_out="Name them with --split-by COL,COL")
    wanted = given or [kind for kind in KINDS if split_by or kind != "groups"]
    return tuple(kind for kind in KINDS if kind in wanted)


def cuts(read: Read, kinds: Sequence[Kind], split_by: Sequence[str], turn: int) -> list[Cut]:
    """The ways to hold out rows that a set allows.

    Of each joint that moved one tail, the lower and the upper ones in turn from joint to joint and from seed
    to seed; groups where the columns are there and most rows share their values with others; targets where
    several were measured.

    Args:
        read: The set.
        kinds: Kinds asked for.
        split_by: Columns of groups.
        turn: Number of the seed, from 0.
    """
    data, found = read.data, list[Cut]()
    still = still_joints(data.readings, read.robot.joints)
    moved = [joint for joint in range(1, data.joint_count + 1) if joint not in still]
    for kind in kinds:
        if kind == "tails":
            found += [Cut(kind, str(_tail(joint, turn))) for joint in moved]
        elif kind == "groups":
            found += [Cut(kind, ",".join(split_by))] if _has_groups(data, split_by) else []
        elif kind == "target":
            found += [Cut(kind, str(number)) for number in range(2, data.target_count + 1)]
        else:
            found.append(Cut(kind))
    return found


def why_no_cut(read: Read, kind: Kind, split_by: Sequence[str]) -> str:
    """Why a set does not allow a kind of split, in words; empty where it does."""
    if cuts(read, (kind,), split_by, 0):
        return ""
    if kind == "tails":
        return "no joint moves"
    if kind == "target":
        return "one target was measured"
    known = split_columns(read.data)
    absent = [name for name in split_by if name not in known]
    if absent:
        return f"it has no column {list_names(absent)}"
    return f"few of its rows are equal to others in {list_names(split_by)}"


@lru_cache(maxsize=512)
def divide(data_set: DataSet, cut: Cut, seed: int) -> Split:
    """Training rows, of which the first are taken, and held-out rows, MOST_JUDGED at the most.

    Training rows hold target 1, held-out ones the target that is judged.

    Raises:
        InputError: If a column is empty or the rows cannot be divided.
    """
    read = read_set(data_set)
    measured = read.data.seen()
    fitted, judged = measured[:, 0], measured[:, cut.target]
    rows = np.flatnonzero(fitted | judged)
    split = _divided(read.data.select(rows), cut, seed)
    train, holdout = _poses_together(read.pose, rows[split.train], rows[split.holdout])
    train, holdout = train[fitted[train]], holdout[judged[holdout]]
    count = min(len(holdout), MOST_JUDGED)
    spread = np.arange(count) * len(holdout) // max(count, 1)
    return Split(train, holdout[spread])


def rows_of(data_set: DataSet, cut: Cut, seed: int, poses: int) -> Split:
    """The first of the training rows, and the held-out rows that can be judged after these.

    Where a set-up stands, and where the judged target is on its tool, is found from its training rows:
    held-out rows of a set-up that has none of them take no part.

    Raises:
        InputError: If the rows cannot be divided, or fewer than FEWEST_JUDGED can be judged.
    """
    split, data = divide(data_set, cut, seed), read_set(data_set).data
    train = split.train[:poses]
    finding = train[data.seen(cut.target)[train]]
    holdout = split.holdout[np.isin(data.group[split.holdout], data.group[finding])]
    if len(holdout) < FEWEST_JUDGED:
        raise InputError(
            f"fewer than {FEWEST_JUDGED} held-out rows of set-ups that train can be judged",
            where=data_set.file,
        )
    return Split(train, holdout)


def _divided(data: Measurements, cut: Cut, seed: int) -> Split:
    """Rows divided by what the cut says; which set-ups train is asked later, of the rows that are taken."""
    known = split_columns(data)
    data = replace(data, group=np.full_like(data.group, ""))
    if cut.kind == "tails":
        rule = SplitRule(seed=seed, holdout_range=HoldoutRange.parse(cut.detail))
    elif cut.kind == "groups":
        names = cut.detail.split(",")
        data = replace(data, features=pd.DataFrame({name: known[name] for name in names}))
        rule = SplitRule(seed=seed, split_by=tuple(names))
    elif cut.kind == "clusters":
        data = replace(data, features=data.features.assign(**{CLUSTER_COLUMN: _clusters(data, seed)}))
        rule = SplitRule(seed=seed, split_by=(CLUSTER_COLUMN,))
    else:
        rule = SplitRule(seed=seed, by_purpose=False)
    return split_rows(data, rule)


def _poses_together(pose: Rows, train: Rows, holdout: Rows) -> tuple[Rows, Rows]:
    """Both sides with all rows of a pose on that of its first row; those that change it come last."""
    order = np.concatenate([train, holdout])
    held, there = np.isin(np.arange(len(pose)), holdout), np.sort(order)
    _, first, number = np.unique(pose[there], return_index=True, return_inverse=True)
    held[there] = held[there[first]][number.reshape(-1)]
    return order[~held[order]], order[held[order]]


def _tail(joint: int, turn: int) -> HoldoutRange:
    return HoldoutRange(joint, high=(joint + turn) % 2 == 0, share=HOLDOUT)


def _has_groups(data: Measurements, split_by: Sequence[str]) -> bool:
    """Whether the columns are there and most rows are equal in them to others."""
    known = split_columns(data)
    if not all(name in known for name in split_by):
        return False
    shared = pd.DataFrame({name: known[name] for name in split_by}).duplicated(keep=False).mean()
    return bool(shared > MOST_SHARED)


def _clusters(data: Measurements, seed: int) -> NDArray[np.float64]:
    """Number (n,) of each row's cluster: k-means of the readings, each joint in its standard deviations."""
    spread = data.readings.std(axis=0)
    scaled = (data.readings - data.readings.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)
    count = min(CLUSTERS, len(np.unique(data.readings, axis=0)))
    _, label = kmeans2(scaled, count, minit="++", rng=np.random.default_rng([seed, count]))
    return np.asarray(label, dtype=np.float64)
