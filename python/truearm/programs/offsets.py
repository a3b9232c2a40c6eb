"""Targets used as they stand and with constant offsets: one change may suit all these uses well enough.

An approach above a target is the target with an offset. Its correction differs a little from the target's,
as the arm's error varies. To know by how much, each such use is followed as a target of its own.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.programs.layouts import of_pose
from truearm.programs.program import Program
from truearm.programs.tables import Targets
from truearm.programs.uses import Uses
from truearm.robot import Robot
from truearm.units import MM_PER_METRE

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Bools = NDArray[np.bool_]

ALSO_OFFSET: Final = (
    "it is used as it stands and with offsets, and one change cannot suit them all exactly; --offsets-mm "
    "allows some deviation"
)
NOT_KNOWN: Final = "it is used with offsets too, and its correction is not known there"
TURNED: Final = "it is used with offsets too, where its corrected configuration data would name other joints"


def also_with_offsets(program: Program) -> dict[int, list[int]]:
    """Cartesian targets that are used as they stand and with constant offsets: the numbers of these moves.

    All uses of a target have the same tool and work object.
    """
    moves, found = program.moves, dict[int, list[int]]()
    uses: dict[int, set[int]] = {}
    for move in np.flatnonzero(moves.moving).tolist():
        uses.setdefault(int(moves.target[move]), set()).add(int(moves.environment[move]))
    suited = {target for target, all_ in uses.items() if len(all_) > 1 and _suited(program, target, all_)}
    for move in np.flatnonzero(moves.moving & np.isin(moves.target, list(suited))).tolist():
        if not program.environments[int(moves.environment[move])].places_as_stored:
            found.setdefault(int(moves.target[move]), []).append(move)
    return found


def _suited(program: Program, target: int, environments: set[int]) -> bool:
    if target in program.fixed or not of_pose(program.layouts[int(program.targets.layout[target])]):
        return False
    every = [program.environments[number] for number in environments]
    alike = len({(one.tool.key, one.work_object.key, one.payload_kg) for one in every}) == 1
    known = not any(one.why_not_poses for one in every)
    return alike and known and any(one.places_as_stored for one in every)


@dataclass(frozen=True, eq=False)
class Offsets:
    """A program in which each use of a target with an offset goes to a target of its own.

    Attributes:
        program: The program; these targets stand behind all others.
        stands_for: Number of the target that each of them is another place of, (n,).
        others: Their own numbers, (n,).
    """

    program: Program
    stands_for: Integers
    others: Integers

    @classmethod
    def of(cls, program: Program) -> "Offsets":
        """Those of a program."""
        places: dict[tuple[int, int], int] = {}
        target_of = np.array(program.moves.target)
        count = len(program.targets)
        for target, moves in also_with_offsets(program).items():
            for move in moves:
                place = (target, int(program.moves.environment[move]))
                target_of[move] = places.setdefault(place, count + len(places))
        stands_for = np.array([target for target, _ in places], dtype=np.int64)
        moves_now = replace(program.moves, target=target_of)
        targets = _extended(program.targets, stands_for)
        return cls(
            replace(program, targets=targets, moves=moves_now), stands_for, count + np.arange(len(places))
        )

    def unsuited(
        self, known: Bools, corrected: Floats, controller: Robot, largest_mm: float
    ) -> Iterator[tuple[int, str]]:
        """Targets that are not to be changed since a use with an offset would suffer, and why.

        Args:
            known: Targets whose corrections are known, (t,).
            corrected: Corrected readings (t, N).
            controller: The controller's model.
            largest_mm: How far off a use with an offset may be.
        """
        program, uses = self.program, Uses.of(self.program)
        for target in np.unique(self.stands_for).tolist():
            others = self.others[self.stands_for == target]
            if not (known[target] and known[others].all()):
                yield target, NOT_KNOWN
                continue
            rows = np.array([target, *others.tolist()])
            flange = controller.flange_chain.pose(
                np.ascontiguousarray(controller.joints_from_readings(corrected[rows]))
            )
            here, *with_offsets = (program.environments[int(number)] for number in uses.environment[rows])
            (stored,) = here.stored_poses(flange[:1])
            far = [
                np.linalg.norm(((one.flange_poses(stored[None])[0] - is_to_be) @ one.tool.controller)[:3, 3])
                for one, is_to_be in zip(with_offsets, flange[1:], strict=True)
            ]
            off_mm = MM_PER_METRE * float(max(far))
            if off_mm > largest_mm:
                yield target, f"with its correction a use with an offset would be {off_mm:.3f} mm off"
            elif program.configuration is not None:
                digits = program.configuration.digits(corrected[rows])
                if (digits != digits[0]).any():
                    yield target, TURNED


def _extended(targets: Targets, more: Integers) -> Targets:
    """The targets, and behind them `more` of them again."""
    counts = np.diff(targets.first)
    where = [np.arange(targets.first[target], targets.first[target + 1]) for target in more]
    numbers = np.concatenate([np.arange(len(targets.values)), *where]).astype(np.int64)
    rows = np.concatenate([np.arange(len(targets)), more])
    first = np.concatenate([[0], np.cumsum(counts[rows])]).astype(np.int64)
    names = {
        len(targets) + place: targets.names[target]
        for place, target in enumerate(more.tolist())
        if target in targets.names
    }
    return Targets(
        targets.source[rows],
        targets.at[rows],
        targets.layout[rows],
        first,
        targets.starts[numbers],
        targets.ends[numbers],
        targets.values[numbers],
        targets.decimals[numbers],
        targets.factors[numbers],
        targets.names | names,
    )
