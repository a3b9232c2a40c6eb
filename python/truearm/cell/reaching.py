"""An order of planned poses in which the arm gets from each to the next, past the table and within rules."""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.cell.motion import FreeWalk, Motion
from truearm.cell.poses_file import Poses
from truearm.cell.rehearsal import Walk
from truearm.cell.session import Step

Order = NDArray[np.int64]

# Which poses are contacts for the frame follows from the order, which begins where the last of them is.
ROUNDS: Final = 4


def within_reach(motion: Motion, poses: Poses) -> tuple[Poses, list[int]]:
    """Put poses to which there is no way from the one before where there is one.

    A pose that is measured again comes behind its first time.

    Returns:
        The poses, and which of them (from 0), the last ones, there is no way to wherever the arm comes from.
    """
    if not motion.passes_table:
        order, waiting = _put_elsewhere(motion, poses)
        return _arranged(poses, [*order, *waiting]), list(range(len(order), len(poses)))
    left: list[int] = []
    for _ in range(ROUNDS):
        order, waiting = _put_off(motion, poses)
        left = list(range(len(order), len(poses)))
        if [*order, *waiting] == list(range(len(poses))):
            break
        poses = _arranged(poses, [*order, *waiting])
    return poses, left


def _arranged(poses: Poses, order: list[int]) -> Poses:
    return replace(
        poses,
        readings=poses.readings[order],
        approach=poses.approach[order],
        purpose=tuple(poses.purpose[k] for k in order),
    )


def _put_elsewhere(motion: Motion, poses: Poses) -> tuple[list[int], list[int]]:
    """Rows of poses in an order in which rules allow all ways, and those for which there is no place in it.

    A pose without a way from the one before goes between two others, where the way is longest least.
    """
    walk, order, waiting = _from_the_first(motion, poses)
    left: list[int] = []
    for k in waiting:
        place = _place_for(walk, poses, k, order)
        if place is None:
            left.append(k)
        else:
            order.insert(place, k)
    return order, left


def _from_the_first(motion: Motion, poses: Poses) -> tuple[FreeWalk, list[int], list[int]]:
    """A walk to the poses that can be gone to one after another, their rows, and those of the others.

    It begins at the first pose from which half of the others are gone to.
    """
    rows = list(range(len(poses)))
    for begin in [*range(ROUNDS), 0]:
        walk, order = FreeWalk(motion.run_up, motion.ways), list[int]()
        waiting = rows[:begin] + _gone_to(walk, poses, rows[begin:], order)
        if len(order) >= len(waiting):
            break
    return walk, order, waiting


def _place_for(walk: FreeWalk, poses: Poses, k: int, order: list[int]) -> int | None:
    """Where in an order a pose has a way to it and on from it, the shortest ones; None for nowhere."""
    readings, there = poses.readings, poses.readings[k]
    alike = [at for at, row in enumerate(order) if np.array_equal(readings[row], there)]
    is_again = any(np.array_equal(row, there) for row in readings[:k])
    if is_again and not alike:
        return None
    first, last = (alike[0] + 1, len(order)) if is_again else (0, min(alike, default=len(order)))
    ways = np.abs(readings[order] - there).max(axis=1, initial=0.0)
    between = np.abs(np.diff(readings[order], axis=0)).max(axis=1, initial=0.0)
    longer = np.r_[0.0, ways] + np.r_[ways, 0.0] - np.r_[0.0, between, 0.0]
    places: list[int] = np.argsort(longer, kind="stable").tolist()
    for place in places:
        if not first <= place <= last:
            continue
        before, behind = order[max(0, place - 1) : place], order[place : place + 1]
        if walk.is_clear([readings[row] for row in before], there, int(poses.approach[k])) and all(
            walk.is_clear([there], readings[row], int(poses.approach[row])) for row in behind
        ):
            return place
    return None


def _put_off(motion: Motion, poses: Poses) -> tuple[list[int], list[int]]:
    """Rows of poses in the order in which the arm gets to them, and those to which it does not.

    A pose to which there is no way is put off until there is one.
    """
    walk = motion.walk()
    if isinstance(walk, Walk):
        for step in motion.steps(poses):
            if step.kind == "registration":
                walk.problem_of_way(step)
        walk.register()
    order: list[int] = []
    waiting: list[int] = []
    for k in range(len(poses)):
        waiting = _gone_to(walk, poses, [*waiting, k], order)
    before = len(poses)
    while len(waiting) < before:
        before = len(waiting)
        waiting = _gone_to(walk, poses, waiting, order)
    return order, waiting


def _gone_to(walk: Walk | FreeWalk, poses: Poses, waiting: list[int], order: list[int]) -> list[int]:
    """Go to those of the waiting poses that can be gone to, which are added to an order; the others."""
    left: list[int] = []
    for k in waiting:
        readings = poses.readings[k]
        again = any(np.array_equal(readings, poses.readings[other]) for other in left)
        step = Step(k, "pose", k, poses.purpose[k], int(poses.approach[k]), readings)
        if again or walk.problem_of_way(step):
            left.append(k)
        else:
            order.append(k)
    return left
