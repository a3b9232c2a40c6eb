"""What a process would do, without moving anything: which poses can be measured, and how long it takes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truearm.cell.cell_file import Cell
from truearm.cell.clearance import Clearance
from truearm.cell.device_errors import RefusedError
from truearm.cell.poses_file import Poses
from truearm.cell.prediction import Prediction
from truearm.cell.sequence import steps_of
from truearm.cell.session import Step
from truearm.cell.table_panel import TablePanel
from truearm.units import MM_PER_METRE

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Planned:
    """A step as it is planned: where its target is expected in the world, and why it cannot be, if so."""

    step: Step
    point_in_world: Floats | None
    problem: str


@dataclass(frozen=True, eq=False)
class Rehearsal:
    """All steps, and the time they take at the cell file's pace."""

    steps: list[Planned]
    seconds: float

    @property
    def refused(self) -> list[Planned]:
        """The steps that cannot be measured."""
        return [planned for planned in self.steps if planned.problem]


def rehearse(cell: Cell, poses: Poses) -> Rehearsal:
    """Go through all steps with the frame as the cell file has it.

    Raises:
        InputError: If there are fewer poses than registration needs.
    """
    prediction = Prediction(cell)
    planned = []
    for step in steps_of(poses, cell.file.process):
        expected = prediction.expected(step)
        known = np.isfinite(expected.radius_m) and prediction.world_from_base is not None
        problem = problem_of(cell, prediction, step) if known else ""
        planned.append(Planned(step, expected.point_in_world if known else None, problem))
    possible = len(planned) - len([each for each in planned if each.problem])
    return Rehearsal(planned, cell.file.process.seconds_per_pose * possible)


def problem_of(cell: Cell, prediction: Prediction, step: Step) -> str:
    """Why the table cannot measure a step; empty where it can, and for sensors that stay away."""
    if not isinstance(cell.sensor, TablePanel) or prediction.world_from_base is None:
        return ""
    try:
        carriage = cell.sensor.carriage_for(prediction.expected(step))
    except RefusedError as error:
        return f"{error.what}. {error.rule}"
    clearance = Clearance(cell.arm, cell.flange_from_target, cell.sensor.panel, cell.file.clearance)
    gap = clearance.meets(step.readings, carriage, prediction.world_from_base)
    if gap is not None:
        return f"link and table come within {MM_PER_METRE * gap:.0f} mm"
    return ""
