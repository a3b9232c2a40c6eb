"""Which rows are held out: tails of joints, clusters, groups, another target, and random rows."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from truearm.defaults import HOLDOUT
from truearm.errors import UsageError, did_you_mean, list_names
from truearm.measurements import Measurements
from truearm.splitting import HoldoutRange, Split, SplitRule, split_rows
from truearm.studies.accuracy.sets import DataSet, read_set

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


def cuts(data: Measurements, kinds: Sequence[Kind], split_by: Sequence[str], turn: int) -> list[Cut]:
    """The ways to hold out rows that `data` allows.

    Of each joint one tail, the lower and the upper ones in turn from joint to joint and from seed to seed;
    groups where the columns are there and most rows share their values with others; targets where several
    were measured.

    Args:
        data: What was measured.
        kinds: Kinds asked for.
        split_by: Columns of groups.
        turn: Number of the seed, from 0.
    """
    found: list[Cut] = []
    for kind in kinds:
        if kind == "tails":
            found += [Cut(kind, str(_tail(joint, turn))) for joint in range(1, data.joint_count + 1)]
        elif kind == "groups":
            found += [Cut(kind, ",".join(split_by))] if _has_groups(data, split_by) else []
        elif kind == "target":
            found += [Cut(kind, str(number)) for number in range(2, data.target_count + 1)]
        else:
            found.append(Cut(kind))
    return found


@lru_cache(maxsize=512)
def divide(data_set: DataSet, cut: Cut, seed: int) -> Split:
    """Training rows, of which the first are taken, and held-out rows, MOST_JUDGED at the most.

    Raises:
        InputError: If a column is empty or the rows cannot be divided.
    """
    data = read_set(data_set).data
    if cut.kind == "tails":
        rule = SplitRule(seed=seed, holdout_range=HoldoutRange.parse(cut.detail))
    elif cut.kind == "groups":
        rule = SplitRule(seed=seed, split_by=tuple(cut.detail.split(",")))
    elif cut.kind == "clusters":
        data = replace(data, features=data.features.assign(**{CLUSTER_COLUMN: _clusters(data, seed)}))
        rule = SplitRule(seed=seed, split_by=(CLUSTER_COLUMN,))
    else:
        rule = SplitRule(seed=seed, by_purpose=False)
    split = split_rows(data, rule)
    count = min(len(split.holdout), MOST_JUDGED)
    spread = np.arange(count) * len(split.holdout) // count
    return Split(split.train, split.holdout[spread])


def _tail(joint: int, turn: int) -> HoldoutRange:
    return HoldoutRange(joint, high=(joint + turn) % 2 == 0, share=HOLDOUT)


def _has_groups(data: Measurements, split_by: Sequence[str]) -> bool:
    """Whether the columns are there and most rows are equal in them to others."""
    if not all(name in data.features.columns for name in split_by):
        return False
    shared = data.features.duplicated(list(split_by), keep=False).mean()
    return bool(shared > MOST_SHARED)


def _clusters(data: Measurements, seed: int) -> NDArray[np.float64]:
    """Number (n,) of each row's cluster: k-means of the readings, each joint in its standard deviations."""
    spread = data.readings.std(axis=0)
    scaled = (data.readings - data.readings.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)
    count = min(CLUSTERS, len(np.unique(data.readings, axis=0)))
    _, label = kmeans2(scaled, count, minit="++", rng=np.random.default_rng([seed, count]))
    return np.asarray(label, dtype=np.float64)
