"""An order of planned poses in which the arm gets from each to the next past the table."""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.cell.cell_file import Cell
from truearm.cell.poses_file import Poses
from truearm.cell.rehearsal import Walk
from truearm.cell.sequence import steps_of
from truearm.cell.session import Step
from truearm.cell.table_panel import TablePanel
from truearm.errors import InputError

Order = NDArray[np.int64]

# Which poses are contacts for the frame follows from the order, which begins where the last of them is.
ROUNDS: Final = 4


def within_reach(cell: Cell, poses: Poses) -> tuple[Poses, list[int]]:
    """Put poses to which there is no way from the one before off until there is one.

    A pose that is measured again comes behind its first time.

    Returns:
        The poses, and which of them (from 0), the last ones, there is no way to wherever the arm comes from.
    """
    left: list[int] = []
    if not isinstance(cell.sensor, TablePanel) or cell.file.world is None:
        return poses, left
    for _ in range(ROUNDS):
        order, left = _walked(cell, poses)
        if np.array_equal(order, np.arange(len(poses))):
            break
        poses = replace(
            poses,
            readings=poses.readings[order],
            approach=poses.approach[order],
            purpose=tuple(poses.purpose[k] for k in order),
        )
    return poses, left


def _walked(cell: Cell, poses: Poses) -> tuple[Order, list[int]]:
    """Rows of poses in the order in which the arm gets to them, and those last ones to which it does not."""
    walk = Walk(cell)
    for step in _contacts(cell, poses):
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
    reached = len(order)
    return np.array(order + waiting, dtype=np.int64), list(range(reached, len(poses)))


def _gone_to(walk: Walk, poses: Poses, waiting: list[int], order: list[int]) -> list[int]:
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


def _contacts(cell: Cell, poses: Poses) -> list[Step]:
    """The contacts for the frame; none where the poses are too few to be measured alone."""
    try:
        steps = steps_of(poses, cell.file.process)
    except InputError:
        return []
    return [step for step in steps if step.kind == "registration"]
