"""What a process would do, without moving anything: which poses can be measured, and how long it takes.

Ways from each step to the next are tried as the process tries them. The arm is taken to begin at the origin
of its driver, or with all joints at zero where that has none, and the table at the beginning of its ranges.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.cell.cell_file import Cell
from truearm.cell.clearance import Clearance
from truearm.cell.crew import places_on_the_way
from truearm.cell.device_errors import RefusedError
from truearm.cell.poses_file import Poses
from truearm.cell.prediction import Prediction
from truearm.cell.rv_m2 import RvM2
from truearm.cell.sequence import steps_of
from truearm.cell.session import Step
from truearm.cell.table_panel import TablePanel
from truearm.cell.ways import Ways
from truearm.planning.joint_ways import JointWays
from truearm.types import Floats
from truearm.units import MM_PER_METRE, to_si

BROKEN: Final = "arm or tool would leave the room on the way there, from the step before"


@dataclass(frozen=True, eq=False)
class Planned:
    """A step as it is planned.

    Attributes:
        step: The step.
        beside: Where the joints start (N,) so that all come from one side; None where any will do.
        point_in_world: Where its target is expected (3,), m; None where that is not known.
        problem: Why it cannot be measured; empty where it can.
        nearer: Joints, from 1, that start nearer to it than others, since a limit is in the way.
        lowest_m: The lowest place of arm and tool on the way to it, in the base frame; None where the cell
            file has no floor, or it is not gone to.
    """

    step: Step
    beside: Floats | None
    point_in_world: Floats | None
    problem: str
    nearer: tuple[int, ...] = ()
    lowest_m: float | None = None


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
    prediction, walk, lowest = Prediction(cell), Walk(cell), _lowest_of(cell)
    planned = []
    for step in steps_of(poses, cell.file.process):
        if step.kind == "pose":
            walk.register()
        expected = prediction.expected(step)
        known = np.isfinite(expected.radius_m) and prediction.world_from_base is not None
        problem = problem_of(cell, prediction, step) if known else ""
        gone = len(walk.stops)
        problem = problem or walk.problem_of_way(step)
        beside = cell.beside(step.readings, step.approach) if step.approach else None
        nearer = np.flatnonzero(cell.run_up.shortened(step.readings, step.approach)) + 1
        point = expected.point_in_world if known else None
        low = None if problem else lowest(walk.stops[max(0, gone - 1) :])
        planned.append(Planned(step, beside, point, problem, tuple(nearer.tolist()), low))
    possible = len(planned) - len([each for each in planned if each.problem])
    return Rehearsal(planned, cell.file.process.seconds_per_pose * possible)


def _lowest_of(cell: Cell) -> Callable[[list[Floats]], float | None]:
    """What tells how low an arm gets on a way through readings (N,), where there is a floor."""
    ways = JointWays(cell.arm, (), [cell.flange_from_target])
    has_floor = cell.file.clearance.floor_mm is not None
    return lambda stops: ways.lowest_m(np.array(stops)) if has_floor and stops else None


class Walk:
    """Arm and table as they go from step to step, in thought, where `ways` allow it too if they are given.

    Attributes:
        stops: Readings (N,) that the arm went through so far.
    """

    def __init__(self, cell: Cell, ways: JointWays | None = None) -> None:
        self._cell, self._prediction, self._allowed = cell, Prediction(cell), ways
        table = cell.sensor if isinstance(cell.sensor, TablePanel) else None
        self._table, self._ways = table, None if table is None else Ways(cell, table)
        self._here = self._refuge = _at_first(cell)
        self._carriage = np.zeros(3) if table is None else table.released(np.zeros(3))
        self.stops: list[Floats] = []

    def register(self) -> None:
        """From now on the frame is as good as known, and targets are no farther off than expected."""
        if self._prediction.world_from_base is not None and not self._prediction.is_registered:
            self._prediction.register(self._prediction.world_from_base, 0.0)

    def problem_of_way(self, step: Step) -> str:
        """Why there is no way to a step from the one before; empty where there is one, which it goes.

        Sensors that stay away have no problem.
        """
        frame = self._prediction.world_from_base
        way = places_on_the_way(self._cell, step.readings, step.approach)
        if self._table is None or self._ways is None or frame is None:
            self.stops += way
            return ""
        expected = self._prediction.expected(step)
        try:
            carriage = self._table.carriage_for(expected)
            found = self._ways.to(
                way,
                expected,
                here=self._here,
                carriage=self._carriage,
                refuge=self._refuge,
                world_from_base=frame,
            )
        except RefusedError as error:
            return f"{error.what}, from the step before"
        if self._allowed is not None and not self._allowed.clear(np.array([self._here, *found.arm])):
            return BROKEN
        self.stops += found.arm
        self._here, self._carriage = step.readings, carriage
        return ""


def _at_first(cell: Cell) -> Floats:
    """Where the arm is (N,) before anybody moves it, as far as can be known."""
    settings = cell.robot_settings
    degrees = settings.origin_deg if isinstance(settings, RvM2.Settings) else np.zeros(cell.arm.joint_count)
    return np.asarray(np.clip(to_si(np.array(degrees), "deg"), *cell.arm.limits.T))


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
