"""A program as a language's reader found it, and what a language has to know for that."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np

from truearm.programs.configuration import Configuration
from truearm.programs.environment import Environment
from truearm.programs.frames import Frames
from truearm.programs.layouts import JointLayout, Layout, PoseLayout, of_joints, of_pose
from truearm.programs.source import Source
from truearm.programs.tables import Motion, Moves, Targets, Via, all_ones
from truearm.robot import Robot
from truearm.rotations import rigid_inverse
from truearm.types import Floats, Integers


@dataclass(frozen=True, order=True)
class Listed:
    """A target or a motion that is left as it is.

    `truearm.compensate_program` makes one, in `rewritten.listed` and `rewritten.kept`.

    Attributes:
        file: Number of its file.
        line: Line, from 1.
        column: Column, from 1.
        name: The target's name, or the text of the statement where it has none.
        reason: Why, in words that end a line.
    """

    file: int
    line: int
    column: int
    name: str
    reason: str


@dataclass(frozen=True)
class Unplaced:
    """A motion to a place without numbers of its own, such as one that is computed at run time.

    Attributes:
        file: Number of its file.
        at: Offset of the statement.
        motion: A Motion.
        blended: Whether the arm does not stop there.
    """

    file: int
    at: int
    motion: int
    blended: bool


@dataclass(frozen=True)
class LineCount:
    """A number in a file that says how many lines a part of it has.

    Attributes:
        start: Offset of its first digit.
        end: Offset behind its last one.
        lines: Offsets between which lines are counted, both included.
    """

    start: int
    end: int
    lines: tuple[int, int]


@dataclass(frozen=True, eq=False)
class Program:
    """What a reader found.

    Attributes:
        language: Who read it, and can write it.
        sources: The files; the first is the one that was named.
        layouts: How numbers stand for joints or poses; targets name one by number.
        targets: Numbers that are targets, each once, in the order of the text.
        moves: Uses of targets, in the order of the text.
        environments: Tools, objects and offsets; moves name one by number.
        listed: What the reader could not take for a target with certainty.
        configuration: How poses tell their branch; None in a language that does not.
        fixed: Why targets cannot be changed with certainty whatever they are used for, by number.
        unsure: Numbers of those of them that may be others when the program runs: they tell no place.
        nearest: Moves to the configuration nearest to where the arm stands, whatever the data of the target
            says, by number; False where that is not certain.
        vias: How arcs are turned where they pass their via points, by number of the move there;
            Via.BETWEEN for those that are not named.
        unplaced: Motions that are listed as they lead to no numbers of the program.
        accurate: Why the controller is known to compute with a model of its own, where the program says so.
        line_count: Where its first file says how many lines it has; None where it does not.
    """

    language: "Language"
    sources: tuple[Source, ...]
    layouts: tuple[Layout, ...]
    targets: Targets
    moves: Moves
    environments: tuple[Environment, ...]
    listed: tuple[Listed, ...] = ()
    configuration: Configuration | None = None
    accurate: str = ""
    fixed: Mapping[int, str] = field(default_factory=dict)
    unsure: Set[int] = frozenset()
    nearest: Mapping[int, bool] = field(default_factory=dict)
    vias: Mapping[int, Via] = field(default_factory=dict)
    unplaced: Sequence[Unplaced] = ()
    line_count: LineCount | None = None


@dataclass(frozen=True)
class LinearStep:
    """A waypoint to insert before a linear move.

    Attributes:
        line: Line of the move, from 1, in file `file`.
        file: Number of the file.
        move: Number of the move.
        values: Numbers in the layout of the move's target, (width,), configuration included.
        decimals: Digits behind the point of each, (width,).
        room_m: Within which distance the arm may leave the line without reaching what blends its neighbours.
    """

    line: int
    file: int
    move: int
    values: tuple[float, ...]
    decimals: tuple[int, ...]
    room_m: float


@dataclass(frozen=True)
class Insertion:
    """Text that waypoints need.

    Attributes:
        file: Number of its file.
        start: Offset of the first character that it replaces.
        end: Offset behind the last one; `start` where it replaces none.
        text: What stands there.
    """

    file: int
    start: int
    end: int
    text: str


@dataclass(frozen=True)
class StepTexts:
    """How a language says waypoints.

    Attributes:
        insertions: Texts; those for one place follow each other.
        waypoints: How many waypoints they say.
        impossible: Numbers of moves whose waypoints it cannot say.
        why: Why it cannot, in words that end a listing.
    """

    insertions: tuple[Insertion, ...] = ()
    waypoints: int = 0
    impossible: tuple[int, ...] = ()
    why: str = "its statement is not a plain one, or belongs to others"


class Language(Protocol):
    """A reader and writer of programs in one language."""

    @property
    def name(self) -> str:
        """What people call it."""
        ...

    @property
    def endings(self) -> tuple[str, ...]:
        """Endings of its files, in small letters, with the dot; the first is the usual one."""
        ...

    @property
    def maker(self) -> str:
        """Whose controllers run it, as names of robots say it; empty where it is nobody's."""
        ...

    @property
    def controller_differs(self) -> str:
        """Why its controllers may compute with another model than the nominal one, in words that end a
        sentence; empty where they do not. A controller must be declared then.
        """
        ...

    def companions(self, path: Path) -> tuple[Path, ...]:
        """Further files of the program that exist beside `path`, such as KUKA's .dat."""
        ...

    def read(self, sources: Sequence[Source], robot: Robot, frames: Frames) -> Program:
        """The program of these texts, for an arm.

        Args:
            sources: The files, the named one first.
            robot: The nominal arm, for its joints and limits and for geometry that configuration data depends
                on, with the author's tool.
            frames: Tools and objects from outside the program.

        Raises:
            InputError: If the text is no program of this language; names file, line and column.
        """
        ...

    def mark(self, source: Source, text: str) -> tuple[int, str]:
        """Where a comment with `text` goes, and the whole line(s) to insert there, line end included."""
        ...

    def blends(self, program: Program, move: int) -> tuple[float, float] | None:
        """Radii in m within which a move is blended with the one before and the one behind it, where its
        controllers drop a target whose blending reaches another's; none where they make it smaller.

        None if they are not known.
        """
        ...

    def linear_steps(self, program: Program, moves: Sequence[Sequence[LinearStep]]) -> StepTexts:
        """What to insert so that linear moves pass waypoints: one or more for each move, in their order."""
        ...


class BlendsShortened:
    """A language whose controllers blend within less where two targets are near each other."""

    def blends(self, program: Program, move: int) -> tuple[float, float]:
        """No radii: waypoints may lie anywhere."""
        return (0.0, 0.0)


def motion_is_straight(motion: int) -> bool:
    """Whether a motion follows a line or an arc, on which a step would show."""
    return motion in (Motion.LINEAR, Motion.VIA, Motion.CIRCULAR)


def numbers_of(program: Program, which: Integers, layout: JointLayout | PoseLayout) -> Floats:
    """Numbers (n, width) of targets of one layout, in the layout's units."""
    targets, width = program.targets, layout.width
    numbers: Floats = targets.of(targets.values, which, width)
    factors = targets.of(targets.factors, which, width)
    return numbers if all_ones(factors) else numbers * factors


def flange_poses_of(program: Program, which: Integers, environments: Integers, robot: Robot) -> Floats:
    """Poses (n, 4, 4) of the flange that the controller makes of targets; NaN where they are not known.

    Args:
        program: The program.
        which: Numbers of the targets, (n,).
        environments: Number of the environment in which each is used, (n,).
        robot: The programming model.
    """
    found = np.full((len(which), 4, 4), np.nan)
    for number, layout in enumerate(program.layouts):
        for environment in np.unique(environments).tolist():
            here = (program.targets.layout[which] == number) & (environments == environment)
            used = program.environments[environment]
            if not here.any():
                continue
            numbers = numbers_of(program, which[here], layout)
            if of_joints(layout) and not used.problem:
                q = np.ascontiguousarray(layout.to_readings(numbers))
                found[here] = robot.flange_chain.pose(robot.joints_from_readings(q))
            elif of_pose(layout) and not used.why_not_poses:
                stored = layout.to_poses(numbers[:, : layout.width - layout.configuration])
                found[here] = used.flange_poses(stored)
    return found


def turned_as_stated(
    program: Program, which: Integers, environment: int, flange: Floats, robot: Robot
) -> Floats:
    """Poses (n, 4, 4) of the flange with the tool where it is with the flange at poses `flange` (n, 4, 4),
    but turned as targets `which` (n,) state, which are used in one environment.
    """
    stated = flange_poses_of(program, which, np.full(len(which), environment), robot)
    tool = program.environments[environment].tool.controller
    tools = flange @ tool
    tools[:, :3, :3] = (stated @ tool)[:, :3, :3]
    found: Floats = tools @ rigid_inverse(tool)
    return found
