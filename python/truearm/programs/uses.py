"""What each target is used for: by which moves, with one tool, object and offset or with several."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.programs.environment import Environment
from truearm.programs.layouts import of_joints
from truearm.programs.program import Program, motion_is_straight
from truearm.programs.tables import Motion, run_of
from truearm.types import Integers, Mask, Transform

UNUSED: Final = "no motion goes there"
CURVED: Final = np.array([motion_is_straight(motion) for motion in Motion])
SEVERAL: Final = "it is used with several tools, objects or offsets, and one change cannot suit them all"


@dataclass(frozen=True, eq=False)
class Uses:
    """Uses of the targets of a program.

    Attributes:
        moved: Targets that a motion goes to, (t,).
        mentioned: These, and those that a motion starts its search for joints from, (t,).
        environment: Number of the environment of each, (t,); -1 where there is none.
        tool_of: Number of the tool of each environment among `tools`, (e,).
        tools: Number of an environment with each of the different tools.
        displaced: Number of what displaces its work object among `displacements`, (t,).
        displacements: What work objects are displaced by, (4, 4) each; the first is None, for nothing and for
            joint targets, which no work object moves.
        several: Targets that are used in environments that contradict each other, (t,).
        of_joints: Targets that are joint readings, (t,).
        straight: Targets that a move along a line or an arc goes to, or comes from, (t,).
        blended: Targets that are passed without a stop, or next to one that is, (t,).
    """

    moved: Mask
    mentioned: Mask
    environment: Integers
    tool_of: Integers
    tools: tuple[int, ...]
    displaced: Integers
    displacements: tuple[Transform | None, ...]
    several: Mask
    of_joints: Mask
    straight: Mask
    blended: Mask

    @classmethod
    def of(cls, program: Program, *, whole_poses: bool = True) -> "Uses":
        """Those of `program`.

        Args:
            program: The program.
            whole_poses: As in Models. Tools contradict each other for joint targets where a correction that
                brings the flange to its place differs; without whole poses wherever they differ.
        """
        targets, moves = program.targets, program.moves
        joints = np.array([of_joints(layout) for layout in program.layouts], dtype=bool)
        joint_targets = joints[targets.layout] if len(targets) else np.zeros(0, dtype=bool)
        real = _all_or(moves.moving)
        target = run_of(moves.target[real])
        moved = np.zeros(len(targets), dtype=bool)
        moved[target] = True
        mentioned = np.array(moved)
        mentioned[run_of(moves.target)] = True
        tool_of, tools = _distinct([(*one.tool.key, one.problem) for one in program.environments])
        flange_of, _ = _distinct([_of_flange(one) for one in program.environments])
        environment, several = _single(moves.environment[real], target, len(targets))
        needed = flange_of if whole_poses else tool_of
        _, several_tools = _single(needed[moves.environment[real]], target, len(targets))
        displaced_by, displacements = _displacements(program)
        straight, blended = _along(program, real)
        return cls(
            moved,
            mentioned,
            environment,
            tool_of,
            tools,
            np.where(joint_targets, 0, displaced_by[environment]),
            displacements,
            np.where(joint_targets, several_tools, several),
            joint_targets,
            straight,
            blended,
        )


def target_count(program: Program) -> int:
    """How many targets a program has; readings that a pose is only looked for next to are none."""
    real = program.moves.moving
    seeds = np.setdiff1d(program.moves.target[~real], program.moves.target[real])
    return len(program.targets) - len(seeds)


def _all_or(chosen: Mask) -> slice | Mask:
    """Chosen rows; all of them as a slice, which copies nothing."""
    return slice(None) if chosen.all() else chosen


def _distinct(keys: Sequence[object]) -> tuple[Integers, tuple[int, ...]]:
    """For each environment the number of what `keys` tells of it, and an environment for each number."""
    known: dict[object, int] = {}
    examples: list[int] = []
    numbers = []
    for place, key in enumerate(keys):
        if key not in known:
            known[key] = len(known)
            examples.append(place)
        numbers.append(known[key])
    return np.array(numbers, dtype=np.int64), tuple(examples)


def _of_flange(environment: Environment) -> tuple[bytes, str]:
    """What the correction of a joint target depends on where whole poses are met: not on the tool, only on
    how far the controller's is from the true one.
    """
    moved = environment.tool.mistaken
    return b"" if moved is None else moved.tobytes(), environment.problem


def _displacements(program: Program) -> tuple[Integers, tuple[Transform | None, ...]]:
    """For each environment, and for none, the number of what displaces its work object, and these."""
    known: dict[bytes, int] = {b"": 0}
    found: list[Transform | None] = [None]
    numbers = []
    for environment in program.environments:
        displacement = environment.displacement
        key = b"" if displacement is None else displacement.tobytes()
        if key not in known:
            known[key] = len(found)
            found.append(displacement)
        numbers.append(known[key])
    return np.array([*numbers, 0], dtype=np.int64), tuple(found)


def _single(values: Integers, targets: slice | Integers, count: int) -> tuple[Integers, Mask]:
    """For each target the value of its uses, -1 without any, and whether they differ."""
    last = np.full(count, -1, dtype=np.int64)
    last[targets] = values
    several = np.zeros(count, dtype=bool)
    if not isinstance(targets, slice):
        several[targets[last[targets] != values]] = True
    return last, several


def _along(program: Program, real: slice | Mask) -> tuple[Mask, Mask]:
    """Targets at either end of a straight move, and targets at or next to one that is passed."""
    moves, count = program.moves, len(program.targets)
    target = moves.target[real]
    curved = CURVED[moves.motion[real]]
    passed = moves.blended[real]
    straight, blended = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    straight[target[curved]] = True
    straight[target[:-1][curved[1:]]] = True
    blended[target[passed]] = True
    blended[target[:-1][passed[1:]]] = True
    blended[target[1:][passed[:-1]]] = True
    return straight, blended
