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
    """A step as it is planned.

    Attributes:
        step: The step.
        beside: Where the joints start (N,) so that all come from one side; None where any will do.
        point_in_world: Where its target is expected (3,), m; None where that is not known.
        problem: Why it cannot be measured; empty where it can.
    """

    step: Step
    beside: Floats | None
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
        beside = cell.beside(step.readings, step.approach) if step.approach else None
        planned.append(Planned(step, beside, expected.point_in_world if known else None, problem))
    possible = len(planned) - len([each for each in planned if each.problem])
    return Rehearsal(planned, cell.file.process.seconds_per_pose * possible)


def problem_of(cell: Cell, prediction: Prediction, step: Step) -> str:
    """Why the table cannot measure a step, or not from the side that is asked for; empty where it can.

    Sensors that stay away have no problem.
    """
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
    if not step.approach:
        return ""
    # The table lets the arm by as far out of its way as it can go.
    beside, away = cell.beside(step.readings, step.approach), cell.sensor.released(carriage)
    gap = clearance.meets(beside, away, prediction.world_from_base)
    if gap is not None:
        return f"link and table come within {MM_PER_METRE * gap:.0f} mm beside it, where the joints start"
    return ""
