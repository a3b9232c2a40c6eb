"""Candidate poses of a region: drawn evenly from it, as far as the arm gets there and may be measured."""

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from truearm import kinds
from truearm.errors import WorkError, count_of
from truearm.planning.accessibility import Rule, accessible
from truearm.planning.spaces import Space
from truearm.types import Floats

DRAWS_PER_POSE: Final = 50
"""A region of which less than one draw in so many can be measured gives fewer poses than asked for."""


@dataclass(frozen=True, eq=False)
class Pool:
    """Poses of a region that can be measured.

    Attributes:
        coordinates: In the space (n, D).
        readings: Joint readings (n, N).
        share: Share of the draws that could be measured.
    """

    coordinates: Floats
    readings: Floats
    share: float

    def __repr__(self) -> str:
        return (
            f"<Pool: {count_of(len(self), 'pose')}, {100 * self.share:.1f} % of the draws could be measured>"
        )

    def __len__(self) -> int:
        return len(self.readings)


@dataclass(frozen=True)
class PoolOptions:
    """How a pool is drawn.

    Attributes:
        rules: What makes a pose accessible; all must hold.
        seed: Seed of the draw, one number or several.
        tool: Transform (4, 4) from flange to tool, or a point (3,); the robot's own by default.
    """

    rules: Sequence[Rule] = ()
    seed: int | tuple[int, ...] = 0
    tool: ArrayLike | None = None


def draw_pool(
    space: Space,
    count: int,
    options: PoolOptions | None = None,
    *,
    box: tuple[ArrayLike, ArrayLike] | None = None,
) -> Pool:
    """At most `count` accessible poses, fewer where most of the region is out of reach.

    Args:
        space: What is drawn from.
        count: How many.
        options: Rules and seed.
        box: Lowest and highest coordinates (D,) of the region; the whole space by default.

    Raises:
        UsageError: If none are asked for.
    """
    kinds.check_number(count, "count", Integral)
    kinds.check_positive(count, "count")
    chosen = options or PoolOptions()
    low, high = (space.low, space.high) if box is None else map(np.asarray, box)
    rng = np.random.default_rng(chosen.seed)
    coordinates: list[Floats] = []
    readings: list[Floats] = []
    drawn = 0
    while sum(len(part) for part in readings) < count and drawn < DRAWS_PER_POSE * count:
        tried = rng.uniform(low, high, (count, len(low)))
        drawn += count
        found, reached = space.readings(tried)
        rows = np.flatnonzero(reached)
        rows = rows[accessible(space.robot, found[rows], chosen.rules, tool=chosen.tool)]
        coordinates.append(tried[rows])
        readings.append(found[rows])
    share = sum(len(part) for part in readings) / drawn
    return Pool(np.concatenate(coordinates)[:count], np.concatenate(readings)[:count], share)


def needed_pool(space: Space, count: int, options: PoolOptions | None = None) -> Pool:
    """Exactly `count` accessible poses of the whole space.

    Raises:
        WorkError: If there are fewer.
    """
    pool = draw_pool(space, count, options)
    if len(pool) < count:
        raise WorkError(
            f"{len(pool)} of {count} poses can be reached and measured",
            rule=f"{100 * pool.share:.1f} % of the draws obey every rule",
            way_out="Loosen the rules, or give the space another box or configuration",
        )
    return pool
