"""Errors of fitted models on rows, at the target that they are judged at."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from truearm._core import Setup
from truearm.errors import InputError, Notice, count_of, list_names
from truearm.fits.core_set import Selection, anchor_names
from truearm.fits.fitting import Task, feature_values
from truearm.fits.identified import IdentifiedArm
from truearm.fits.measured_parts import held_parts
from truearm.fits.models import ArmModel
from truearm.judgement.validation import RowErrors, row_errors
from truearm.measurements import Measurements
from truearm.types import Floats, Mask

UNUSUAL: Final = 9.0
"""Times the median distance from the median point: what is farther off is no measurement of the target."""


def model_inputs(arm: IdentifiedArm, data: Measurements, features: tuple[str, ...]) -> Floats:
    """Inputs (n, I) of a field at measured rows: joint values, then features."""
    values = arm.robot.joints_from_readings(data.readings)
    return np.hstack([values, feature_values(data, features)])


def check_judged(fitted: Measurements, judged: Measurements, selection: Selection) -> list[Notice]:
    """A notice of the targets and set-ups that are not judged, since no row finds the point on the tool.

    Args:
        fitted: The rows that are to find its point in each set-up.
        judged: The rows that are to be judged.
        selection: What is used of them.

    Raises:
        InputError: If nothing is left to judge; names targets or set-ups.
    """
    if not selection.judges_another:
        lost = never_found(_lost(fitted, judged, selection), judged, selection)
        return [*lost, *holding_nothing(judged, selection)]
    found, held = _groups_with(fitted, selection.judge), _groups_with(judged, selection.judge)
    missing = [group for group in fitted.groups if group not in found]
    words = (
        f"target {selection.judge + 1} was measured in none of the rows of the set-up "
        f"{list_names(missing or fitted.groups)} that would {'find it' if missing else 'be judged'}"
    )
    if not found & held:
        raise InputError(
            words,
            where=", ".join(fitted.files),
            rule="Where the judged target takes no part in the fit, a set-up needs rows with it",
            way_out="Measure it there, or judge at another target",
        )
    nothing = holding_nothing(judged, selection, missing)
    if not missing:
        return nothing
    judging = [group for group in fitted.groups if group in found]
    text = f"{words[0].upper()}{words[1:]}: errors are those of the set-up {list_names(judging)} alone."
    return [Notice("not_judged", text), *nothing]


def never_found(lost: Mask, judged: Measurements, selection: Selection) -> list[Notice]:
    """A notice of what judged rows hold, and nothing has found in their set-up.

    Args:
        lost: Which of the fitted targets, and of orientations, are such (n, t + 1).
        judged: The rows.
        selection: What is used of them.

    Raises:
        InputError: If nothing is left to judge; names targets.
    """
    if not lost.any():
        return []
    names = [*(f"target {target + 1}" for target in selection.targets), "the orientation"]
    places = [
        f"{names[k]} of {list_names([group])}"
        for group in judged.groups
        for k in np.flatnonzero(lost[judged.group == group].any(axis=0))
    ]
    words = f"{', '.join(places)} was measured in none of the rows that find where it is on the tool"
    unjudged = ~(held_parts(judged, selection) & ~lost)[:, :-1].any(axis=1)
    if unjudged.all():
        raise InputError(
            words,
            where=", ".join(judged.files),
            rule="A target is judged where other rows of its set-up have found it",
            way_out="Let rows with it find it as well, or judge at another target",
        )
    rest = (
        f": {count_of(int(unjudged.sum()), 'row')} with no other target have no error"
        if unjudged.any()
        else ""
    )
    return [Notice("not_judged", f"{words[0].upper()}{words[1:]}, and is not judged{rest}.")]


def holding_nothing(judged: Measurements, selection: Selection, groups: Sequence[str] = ()) -> list[Notice]:
    """A notice of judged rows that hold nothing that is judged; those of `groups` are told otherwise."""
    targets = [selection.judge] if selection.judges_another else list(selection.targets)
    seen = judged.seen(targets)
    empty = ~seen.any(axis=1) & ~np.isin(judged.group, groups)
    if selection.distances or not empty.any():
        return []
    text = f"{count_of(int(empty.sum()), 'row')} of {len(empty)} to judge hold nothing that is judged."
    return [Notice("not_judged", text)]


def where_found(fitted: Measurements, judged: Measurements, selection: Selection) -> Measurements:
    """The judged rows without the targets and orientations that no fitted row of their set-up holds."""
    if selection.judges_another:
        return judged
    return without_parts(_lost(fitted, judged, selection), judged, selection)


def without_parts(lost: Mask, judged: Measurements, selection: Selection) -> Measurements:
    """Rows without what nothing has found in their set-up (n, t + 1): what a model has for it is a guess."""
    if not lost.any():
        return judged
    targets, orientations = judged.targets.copy(), judged.orientations
    rows, places = np.nonzero(lost[:, :-1])
    targets[rows, np.array(selection.targets)[places]] = np.nan
    if orientations is not None:
        orientations = np.where(lost[:, -1:], np.nan, orientations)
    return replace(judged, targets=targets, orientations=orientations)


def _lost(fitted: Measurements, judged: Measurements, selection: Selection) -> Mask:
    """What a judged row holds, and none of the fitted rows of its set-up: targets, orientation (n, t + 1)."""
    held, found = held_parts(judged, selection), held_parts(fitted, selection)
    for group in judged.groups:
        held[judged.group == group] &= ~found[fitted.group == group].any(axis=0)
    return held


def _groups_with(data: Measurements, target: int) -> set[str]:
    """The set-ups with rows that hold a target, from 0."""
    return set(data.group[data.seen(target)].tolist())


def judge(
    task: Task, models: Mapping[str, ArmModel], data: Measurements, fitted: Measurements
) -> dict[str, RowErrors]:
    """Errors of each model at every row of `data`.

    Args:
        task: What was fitted.
        models: The models, with the set-ups of `task.groups`.
        data: Rows to judge.
        fitted: Rows that find the point of a judged target that took no part in the fit.
    """
    features = task.options.features
    found = {}
    for name, model in models.items():
        selection, setup = task.selection, model.setup
        if selection.judges_another:
            at = model.parameters(model_inputs(task.arm, fitted, features))
            setup = setup_of_judged(task, fitted, at, model.setup)
            selection = Selection((selection.judge,), selection.orientation, judge=selection.judge)
        if selection.distances:
            setup = _with_anchors_of(data, task, setup)
        parameters = model.parameters(model_inputs(task.arm, data, features))
        found[name] = row_errors(task.arm, data, selection, task.groups, parameters, setup)
    return found


def _with_anchors_of(data: Measurements, task: Task, setup: Setup) -> Setup:
    """The set-up with the fixed points that distances of `data` lead to: rows number those that they name."""
    numbers = np.array([task.anchors.index(name) for name in anchor_names(data)], dtype=np.int64)
    return Setup(setup.frames, setup.targets, setup.rotations, setup.anchors[numbers])


def setup_of_judged(task: Task, data: Measurements, parameters: Floats, setup: Setup) -> Setup:
    """The set-up with the judged target as its only one, its point found from rows and nothing else moved.

    The point is NaN where a set-up has no row with the judged target. Rows far from where the others have it
    take no part: no fit has judged them at this target.

    Args:
        task: What was fitted.
        data: Rows, n of them.
        parameters: The model's parameters there (n, L, 5).
        setup: Frames of the fit.
    """
    joints = task.arm.robot.joints_from_readings(data.readings)
    base_from_flange = task.arm.flange_chain.pose(joints, np.ascontiguousarray(parameters))
    frames = setup.frames
    points = np.full((len(task.groups), 1, 3), np.nan)
    held = data.seen(task.selection.judge)
    for number, group in enumerate(task.groups):
        rows = held & (data.group == group)
        if not rows.any():
            continue
        world_from_flange = frames[number] @ base_from_flange[rows]
        offset = data.targets[rows, task.selection.judge] - world_from_flange[:, :3, 3]
        in_flange = np.einsum("nji,nj->ni", world_from_flange[:, :3, :3], offset)
        points[number, 0] = _middle(in_flange)
    return Setup(frames, points, setup.rotations, setup.anchors)


def _middle(points: Floats) -> Floats:
    """Mean (3,) of points (n, 3) without those far from their median."""
    distance = np.linalg.norm(points - np.median(points, axis=0), axis=1)
    return np.asarray(points[distance <= UNUSUAL * np.median(distance)].mean(axis=0))
