"""What part of the errors of an evaluation is that of frame and tool, which few rows find badly."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm._core import setup_jacobian
from truearm.errors import Notice, rows_in_words
from truearm.fits.core_set import core_set, first_measured
from truearm.fits.enough_values import frame_unknowns
from truearm.fits.fitting import Task
from truearm.fits.measured_parts import held_parts
from truearm.fits.models import ArmModel
from truearm.judgement.judging import model_inputs
from truearm.judgement.validation import RowErrors
from truearm.lengths import length_mm
from truearm.measurements import Measurements
from truearm.rows.shots import Scatter
from truearm.rows.visits import pose_count, pose_numbers
from truearm.types import AXES, Floats
from truearm.units import MM_PER_METRE

FRAME_UNCERTAIN: Final = "frame_uncertain"
WORTH_A_WORD: Final = 0.2
"""Part of the mean error from which on that of frame and tool is told."""


@dataclass(frozen=True, eq=False)
class FoundSetUps:
    """Set-ups of a model as some rows found them.

    Attributes:
        task: The set-ups of the rows, and what of them is used.
        model: The model, with these set-ups.
        data: The rows that found them.
        keep_tool: Whether the tool was known.
        lever_m: Noise of positions over that of orientations, m/rad.
    """

    task: Task
    model: ArmModel
    data: Measurements
    keep_tool: bool
    lever_m: float

    def notices(self, judged: Measurements, errors: RowErrors) -> list[Notice]:
        """A notice where much of the mean of errors at judged rows is what frame and tool are off."""
        parts = ["frame"] * bool(frame_unknowns(self.task)) + ["tool"] * (not self.keep_tool)
        if self.task.selection.judges_another or not parts:
            return []
        seen = errors.measured
        judged, missed = judged.select(seen), errors.position[seen]
        mean_mm = MM_PER_METRE * float(np.linalg.norm(missed, axis=1).mean())
        without_mm = mean_mm / float(np.sqrt(1.0 + self._added(judged, missed)))
        if mean_mm - without_mm < WORTH_A_WORD * mean_mm:
            return []
        found = rows_in_words(len(self.data), pose_count(self.data))
        text = (
            f"No more than {found} found the {' and '.join(parts)}. How far off that may be makes about "
            f"{100.0 * (1.0 - without_mm / mean_mm):.0f} % of the mean error: about "
            f"{length_mm(without_mm, 2)} would be left without. Measure more poses, or let more of them find "
            "the frame (--frame-rows)."
        )
        return [Notice(FRAME_UNCERTAIN, text)]

    def _added(self, judged: Measurements, missed: Floats) -> float:
        """Mean variance that the set-ups add to a coordinate at judged rows, as a multiple of the others'."""
        own = pose_numbers(self.data.readings, self.data.group)
        counts = Scatter.of(missed, pose_numbers(judged.readings, judged.group)).counts(own)
        known = self._jacobian(self.data) * np.sqrt(counts)[:, None, None]
        asked = self._jacobian(judged)[:, : AXES * len(self.task.selection.targets)]
        asked = asked.reshape(len(judged), -1, AXES, asked.shape[2])
        asked = asked[np.arange(len(judged)), first_measured(judged, self.task.selection)]
        added = np.zeros(len(judged))
        for group in self.data.groups:
            told = known[self.data.group == group].reshape(-1, known.shape[2])
            there = asked[judged.group == group]
            added[judged.group == group] = np.square(there @ np.linalg.pinv(told)).sum(axis=(1, 2)) / AXES
        return float(added.mean())

    def _jacobian(self, data: Measurements) -> Floats:
        """Derivatives (n, m, w) of what rows hold by the unknowns that were found of their set-up, m."""
        task, selection = self.task, self.task.selection
        parameters = self.model.parameters(model_inputs(task.arm, data, task.options.features))
        problem = task.problem(core_set(task.arm.robot, data, selection, task.groups), [])
        jacobian = setup_jacobian(problem, np.ascontiguousarray(parameters), self.model.setup)
        held = np.repeat(held_parts(data, selection), AXES, axis=1)[:, : jacobian.shape[1], None]
        turns = slice(AXES * len(selection.targets), None)
        jacobian[:, turns] *= self.lever_m
        return np.where(held, jacobian, 0.0)[:, :, : frame_unknowns(task) if self.keep_tool else None]
