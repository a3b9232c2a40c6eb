"""Whether rows hold more values than there are unknowns to determine; shots of a pose hold the same ones."""

from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from truearm._core import Setup
from truearm.description.one_turn import one_turn
from truearm.errors import WorkError, count_of, list_names, rows_in_words
from truearm.fits.core_set import core_set, distances_apart
from truearm.fits.identifiability import identify
from truearm.fits.measured_parts import held_parts
from truearm.measurements import Measurements
from truearm.rows.splitting import rows_needed, share_needed
from truearm.rows.visits import pose_count, pose_numbers
from truearm.types import AXES

if TYPE_CHECKING:
    from truearm.fits.fitting import Task

POSES_PER_ROW: Final = 20
ANY_TARGET_M: Final = 0.3
"""How many poses are drawn for each row, and how far from the flange targets lie, to count unknowns."""


def check_enough(task: "Task", data: Measurements, rank: int) -> None:
    """Refuse rows that leave nothing to tell the unknowns from the noise with."""
    values = measured_values(task, data)
    if values > rank:
        return
    unknowns = max(rank, _full_rank(task, data))
    poses = pose_count(data)
    needed = unknowns * poses // max(values, 1) + 1
    raise WorkError(
        f"{values} measured values in {rows_in_words(len(data), poses, 'training ')} cannot determine "
        f"{unknowns} unknowns",
        where=", ".join(data.files),
        rule="There must be more measured values than unknowns",
        way_out=_way_out_of_few(task, needed),
    )


def _full_rank(task: "Task", data: Measurements) -> int:
    """How many unknowns many poses all over the joints would determine, of each of which as much is measured.

    With distances all unknowns are counted: what they tell depends on where the bars and wires are.
    """
    if task.selection.distances:
        return len(task.arm.candidates.constant) + setup_unknowns(task)
    robot, rng = task.arm.robot, np.random.default_rng(0)
    rows = data.select(np.tile(np.arange(len(data)), POSES_PER_ROW))
    low, high = one_turn(robot)
    readings = rng.uniform(low, high, rows.readings.shape)
    measured = core_set(robot, replace(rows, readings=readings), task.selection, task.groups)
    frames = np.tile(np.eye(4), (len(task.groups), 1, 1))
    points = rng.uniform(-ANY_TARGET_M, ANY_TARGET_M, (len(frames), len(task.selection.targets), 3))
    setup = Setup(frames, points, frames[:, :3, :3].copy(), np.zeros((0, 3)))
    return identify(task.arm, measured, setup).total_rank


def _way_out_of_few(task: "Task", needed: int) -> str:
    """What to do where fewer than `needed` poses train."""
    split = task.options.split
    if not task.sizes:
        return f"Measure at least {needed} poses to train on"
    if split.train_size is not None or split.split_by or split.holdout_range is not None:
        return f"Measure at least {needed} poses to train on, or use a larger --train-size"
    share, poses = split.holdout, rows_needed(task.sizes, needed, split.holdout)
    way_out = f"Measure at least {poses} poses: {share:.0%} are held out"
    smaller = share_needed(task.sizes, needed, share)
    if smaller is None:
        return way_out
    return f"{way_out}, or hold out less: --holdout {smaller:g} is enough for {sum(task.sizes)} poses"


def check_set_ups(task: "Task", data: Measurements) -> None:
    """Refuse a set-up whose rows cannot find its own frame and target, and a fixed point that none find."""
    if task.selection.distances:
        _check_anchors(task, data)
        return
    for group in task.groups:
        rows = data.select(data.group == group)
        values, unknowns = measured_values(task, rows), group_unknowns(task, rows)
        if values > unknowns:
            continue
        raise WorkError(
            f"{values} measured values in {rows_in_words(len(rows), pose_count(rows), 'training ')} cannot "
            f"determine the {unknowns} unknowns of frame and target of set-up {list_names([group])}",
            where=", ".join(rows.files or data.files),
            rule="In each set-up there must be more measured values than unknowns",
            way_out=f"Measure more poses there{_or_hold_out_fewer(task)}. If device and target stood where "
            'they did in another set-up, give the rows of both the same name in a column "group"',
        )


def _check_anchors(task: "Task", data: Measurements) -> None:
    """Refuse a fixed point that no more distances of training rows lead to than it has unknowns."""
    for anchor in task.anchors:
        rows = data.select(np.flatnonzero(data.anchor == anchor))
        if (values := measured_values(task, rows)) > AXES:
            continue
        raise WorkError(
            f"{count_of(values, 'distance')} in the training rows cannot determine the {AXES} unknowns of "
            f"the fixed point {list_names([anchor])}",
            where=", ".join(data.files),
            rule="Of each fixed point there must be more distances, of different poses, than it has unknowns",
            way_out=f"Measure more poses to it{_or_hold_out_fewer(task)}, or leave its rows out. If it is "
            'one of the other fixed points, give both the same name in the column "anchor"',
        )


def _or_hold_out_fewer(task: "Task") -> str:
    return ", or hold out fewer of its rows (--holdout, or another --seed)" if task.sizes else ""


def measured_values(task: "Task", data: Measurements) -> int:
    """Numbers that were measured of what is fitted, those of each pose once: its other shots add none."""
    poses = pose_numbers(data.readings, data.group)
    if task.selection.distances:
        return len(np.unique(distances_apart(data, poses)[1]))
    rows, parts = np.nonzero(held_parts(data, task.selection))
    return 3 * len(np.unique(np.column_stack([poses[rows], parts]), axis=0))


def frame_unknowns(task: "Task") -> int:
    """Unknowns of the frame of one set-up: none where it is known, or only distances were measured."""
    return 0 if task.selection.distances else task.arm.frame_unknowns


def setup_unknowns(task: "Task") -> int:
    """Unknowns of all set-ups: frames, targets, orientations of targets; without anchors."""
    frame = frame_unknowns(task)
    points = 1 if task.selection.distances else len(task.selection.targets)
    return len(task.groups) * (frame + 3 * points + (3 if task.selection.orientation else 0))


def group_unknowns(task: "Task", rows: Measurements) -> int:
    """Unknowns of the one set-up of `rows`, as far as they measured of it: what was not measured is none."""
    return frame_unknowns(task) + 3 * int(held_parts(rows, task.selection).any(axis=0).sum())
