"""How the arm of a plan gets from pose to pose: past a table, within rules, in which order of steps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

import numpy as np

from truearm.cell.cell_file import Cell, ClearanceSection, ProcessSection
from truearm.cell.poses_file import Poses
from truearm.cell.rehearsal import BROKEN, Walk
from truearm.cell.run_up import RunUp
from truearm.cell.sequence import steps_of
from truearm.cell.session import Step
from truearm.cell.table_panel import TablePanel
from truearm.errors import InputError
from truearm.planning.accessibility import AboveFloor, InBox, Rule, accessible, lowest, name_of
from truearm.planning.folding import ClearOfItself
from truearm.planning.joint_ways import JointWays
from truearm.robot import Robot
from truearm.types import Floats, Mask
from truearm.units import MM_PER_METRE, to_si

IN_WORDS: Final[Mapping[type, str]] = {
    AboveFloor: "the floor",
    InBox: "the box",
    ClearOfItself: "links clear of one another",
}
"""What people who give rules by options call them."""


@dataclass(frozen=True)
class Passage:
    """How an arm gets from pose to pose.

    Attributes:
        lowest_m: The lowest place of arm and tools at the poses, in the base frame.
        lowest_way_m: The lowest one on the ways, from where joints start beside the first pose on; in a cell
            with contacts for the frame and checks.
        unreached: Which poses (from 0) the arm does not get to, past a table or as rules allow it, from
            wherever it comes.
        blocked: How many ways to contacts and checks, or on from them, rules do not allow.
        passes_table: Whether a table is on the way.
    """

    lowest_m: float
    lowest_way_m: float
    unreached: list[int]
    blocked: int
    passes_table: bool

    def to_dict(self) -> dict[str, Any]:
        """JSON values; heights in mm, poses from 1."""
        return {
            "lowest_mm": MM_PER_METRE * self.lowest_m,
            "lowest_way_mm": MM_PER_METRE * self.lowest_way_m,
            "unreached": [pose + 1 for pose in self.unreached],
            "blocked": self.blocked,
        }


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion of an arm to poses.

    Attributes:
        arm: The nominal arm.
        cell: Its cell, if there is one: the way of coming to a pose is the cell file's, else the default.
        rules: What every pose has to keep to; those that hold on ways are kept to on the way there as well.
        tools: Transforms (4, 4) from flange to what is measured, with each of which they hold.
    """

    arm: Robot
    cell: Cell | None = None
    rules: Sequence[Rule] = ()
    tools: Sequence[Floats] = field(default_factory=list)

    @classmethod
    def of(
        cls,
        arm: Robot,
        cell: Cell | None,
        rules: Sequence[Rule],
        tools: Sequence[Floats],
        link_radius_mm: float | None,
    ) -> "Motion":
        """A motion above the cell's floor, of an arm that is clear of itself.

        Args:
            arm: The nominal arm.
            cell: Its cell, if there is one.
            rules: What else every pose has to keep to.
            tools: As the attribute.
            link_radius_mm: Half the thickness of links: 0 where they may meet, None for the cell's or 40.
        """
        sizes = ClearanceSection() if cell is None else cell.file.clearance
        radius = sizes.link_radius_mm if link_radius_mm is None else link_radius_mm
        own: list[Rule] = [] if radius == 0.0 else [ClearOfItself(to_si(radius, "mm"))]
        return cls(arm, cell, [*rules, *sizes.rules(), *own], tools)

    @cached_property
    def run_up(self) -> RunUp:
        """How far beside a pose joints start."""
        return (ProcessSection() if self.cell is None else self.cell.file.process).run_up(self.arm)

    @cached_property
    def ways(self) -> JointWays:
        """The ways that the rules allow."""
        return JointWays(self.arm, self.rules, self.tools)

    @property
    def passes_table(self) -> bool:
        """Whether a table is on the way, and it is known where."""
        cell = self.cell
        return cell is not None and isinstance(cell.sensor, TablePanel) and cell.file.world is not None

    def allowed(self, readings: Floats) -> Mask:
        """Which poses (n, N) keep to the rules, and so do joints that start beside them, (n,)."""
        kept = np.ones(len(readings), dtype=np.bool_)
        for side in (0, 1, -1):
            rules = self.ways.rules_on_ways if side else self.rules
            for tool in self.tools:
                rows = np.flatnonzero(kept)
                kept[rows] = accessible(self.arm, self.run_up.beside(readings[rows], side), rules, tool=tool)
        return kept

    def allowed_by_each(self, readings: Floats) -> list[tuple[str, int]]:
        """How many of poses (n, N) each rule alone allows, by its name: the strictest first."""
        found = []
        for rule in self.rules:
            masks = [accessible(self.arm, readings, [rule], tool=tool) for tool in self.tools]
            name = IN_WORDS.get(type(rule)) or name_of(rule)
            found.append((name, int(np.count_nonzero(np.all(masks, axis=0)))))
        return sorted(found, key=lambda each: each[1])

    def walk(self) -> "Walk | FreeWalk":
        """A walk from step to step that has not begun."""
        if self.cell is not None and self.passes_table:
            return Walk(self.cell, self.ways)
        return FreeWalk(self.run_up, self.ways)

    def steps(self, poses: Poses) -> list[Step]:
        """What is done with poses: in a cell with contacts for the frame before, and with checks.

        The poses alone where they are too few for contacts.
        """
        if self.cell is not None:
            try:
                return steps_of(poses, self.cell.file.process)
            except InputError:
                pass
        sides = poses.approach.tolist()
        return [Step(k, "pose", k, poses.purpose[k], sides[k], poses.readings[k]) for k in range(len(poses))]

    def passage(self, poses: Poses, unreached: list[int]) -> "Passage":
        """How the arm gets from pose to pose, some of which (from 0) it does not get to."""
        lowest_m = min(lowest(self.arm, poses.readings, tool=tool) for tool in self.tools)
        legs = self._legs(poses)
        stops = [at for _, way in legs for at in way]
        on_ways = self.ways.lowest_m(np.array(stops or poses.readings[:1]))
        return Passage(lowest_m, on_ways, unreached, self._blocked_besides(legs), self.passes_table)

    def _legs(self, poses: Poses) -> list[tuple[Step, list[Floats]]]:
        """Each step, and readings (N,) that the arm goes through to it, whether or not rules allow it."""
        steps = self.steps(poses)
        if self.cell is None:
            return [(step, self.run_up.places(step.readings, step.approach)) for step in steps]
        walk, legs = Walk(self.cell), list[tuple[Step, list[Floats]]]()
        for step in steps:
            if step.kind == "pose":
                walk.register()
            gone = len(walk.stops)
            walk.problem_of_way(step)
            legs.append((step, walk.stops[gone:]))
        return legs

    def _blocked_besides(self, legs: list[tuple[Step, list[Floats]]]) -> int:
        """On how many ways to contacts for the frame and checks, or on from these, a rule is broken."""
        blocked, before = 0, "pose"
        here: list[Floats] = []
        for step, way in legs:
            if not before == step.kind == "pose":
                blocked += bool(way) and not self.ways.clear(np.array([*here, *way]))
            here, before = way[-1:] or here, step.kind
        return blocked


class FreeWalk:
    """An arm as it goes from step to step, in thought, with nothing on its way but what rules say.

    From where it comes to the first one is not known.
    """

    def __init__(self, run_up: RunUp, ways: JointWays) -> None:
        self._run_up, self._ways = run_up, ways
        self._here: list[Floats] = []

    def problem_of_way(self, step: Step) -> str:
        """Why there is no way to a step from the one before; empty where there is one, which it goes."""
        if not self.is_clear(self._here, step.readings, step.approach):
            return BROKEN
        self._here = [step.readings]
        return ""

    def is_clear(self, here: list[Floats], readings: Floats, side: int) -> bool:
        """Whether the way to a pose from here, a place (N,) or nowhere, keeps to the rules."""
        return self._ways.clear(np.array([*here, *self._run_up.places(readings, side)]))
