"""Targets used as they stand and with constant offsets: one change may suit all these uses well enough.

An approach above a target is the target with an offset. Its correction differs a little from the target's,
as the arm's error varies. To know by how much, each such use is followed as a target of its own.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from truearm.errors import Notice, count_of
from truearm.programs.configuration import ANY
from truearm.programs.layouts import of_pose
from truearm.programs.listing import listed_target
from truearm.programs.program import Program, numbers_of, turned_as_stated
from truearm.programs.solving import Solved, are_singular
from truearm.programs.tables import Targets
from truearm.programs.uses import Uses
from truearm.robot import Robot
from truearm.rotations import rotation_vector_from_matrix
from truearm.types import Floats, Integers, Mask
from truearm.units import MM_PER_METRE, MRAD_PER_RAD

ALSO_OFFSET: Final = (
    "it is used as it stands and with offsets, and one change cannot suit them all exactly; --offsets-mm "
    "allows some deviation"
)
NOT_KNOWN: Final = "it is used with offsets too, and its correction is not known there"
STRETCHED: Final = "it is used with offsets too, and its correction ends at a singularity there"
TURNED: Final = "it is used with offsets too, where its corrected configuration data would name other joints"


def also_with_offsets(program: Program) -> dict[int, list[int]]:
    """Cartesian targets that are used as they stand and with constant offsets: the numbers of these moves.

    All uses of a target have the same tool and work object.
    """
    moves = program.moves
    target, environment = moves.target[moves.moving], moves.environment[moves.moving]
    if (environment == environment[:1]).all():
        return {}
    used = np.unique(target * len(program.environments) + environment)
    targets, environments = np.divmod(used, len(program.environments))
    first = np.flatnonzero(np.diff(targets, prepend=-1))
    counts = np.diff(first, append=len(targets))
    suited = [
        int(targets[at])
        for at, count in zip(first[counts > 1].tolist(), counts[counts > 1].tolist(), strict=True)
        if _suited(program, int(targets[at]), environments[at : at + count].tolist())
    ]
    found = dict[int, list[int]]()
    for move in np.flatnonzero(moves.moving & np.isin(moves.target, suited)).tolist():
        if not program.environments[int(moves.environment[move])].places_as_stored:
            found.setdefault(int(moves.target[move]), []).append(move)
    return found


def _suited(program: Program, target: int, environments: list[int]) -> bool:
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
        uses: How its targets are used.
        stands_for: Number of the target that each of them is another place of, (n,).
        others: Their own numbers, (n,).
    """

    program: Program
    uses: Uses
    stands_for: Integers
    others: Integers

    @classmethod
    def of(cls, program: Program, *, whole_poses: bool = True) -> "Offsets":
        """Those of a program; `whole_poses` as in Models."""
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
        apart = replace(program, targets=targets, moves=moves_now)
        return cls(apart, Uses.of(apart, whole_poses=whole_poses), stands_for, count + np.arange(len(places)))

    def judged(self, known: Mask, corrected: Solved, controller: Robot, largest_mm: float) -> "Judged":
        """Whether the change of a target for its use as it stands suits its uses with offsets.

        Args:
            known: Targets whose corrections are known, (t,).
            corrected: What the targets mean, with corrected readings.
            controller: The controller's model.
            largest_mm: How far off the tool's place may be at a use with an offset.
        """
        off_mm, off_mrad = np.full((2, len(known)), np.nan)
        reasons: dict[int, str] = {}
        q, heeding = corrected.q, self._heeding()
        whole = np.ones(len(known), dtype=bool)
        whole[list(corrected.points)] = False
        for target in np.unique(self.stands_for).tolist():
            others = self.others[self.stands_for == target]
            if not (known[target] and known[others].all()):
                reasons[target] = NOT_KNOWN
                continue
            rows = np.array([target, *others.tolist()])
            off_mm[target], off_mrad[target] = self._off(rows, q[rows], controller, whole[rows])
            if off_mm[target] > largest_mm:
                reasons[target] = (
                    f"with its correction a use with an offset would be {off_mm[target]:.3f} mm off"
                )
            elif are_singular(controller, q[others]).any():
                reasons[target] = STRETCHED
            elif whole[target] and self._turned(np.append(target, others[(heeding & whole)[others]]), q):
                reasons[target] = TURNED
        return Judged(reasons, off_mm, off_mrad)

    def _off(self, rows: Integers, q: Floats, controller: Robot, whole: Mask) -> tuple[float, float]:
        """How far off the tool is at most, mm and mrad, at the last of targets `rows` (n,), if the first says
        what readings `q` (n, N) have for it; these are all places of one stored target. Those that are not
        `whole` (n,) say a position alone, and are passed turned as at `q`.
        """
        flange = controller.flange_chain.pose(np.ascontiguousarray(controller.joints_from_readings(q)))
        uses = self.uses.environment[rows]
        here, *with_offsets = (self.program.environments[int(number)] for number in uses)
        written = flange[:1]
        if not whole[0]:
            written = turned_as_stated(self.program, rows[:1], int(uses[0]), written, controller)
        stored, counting = here.stored_poses(written), whole[1:]
        # Turned alike, a tool that is elsewhere than the controller has it is as far off as that one.
        tool = np.where(counting[:, None, None], here.tool.true, here.tool.controller)
        wanted = flange[1:] @ tool
        commanded = np.concatenate([one.flange_poses(stored) for one in with_offsets]) @ tool
        far_m = np.linalg.norm(commanded[:, :3, 3] - wanted[:, :3, 3], axis=1)
        turned = np.swapaxes(wanted[:, :3, :3], 1, 2) @ commanded[:, :3, :3]
        turn_rad = np.linalg.norm(rotation_vector_from_matrix(turned), axis=-1)[counting]
        return MM_PER_METRE * float(far_m.max()), MRAD_PER_RAD * float(turn_rad.max(initial=0.0))

    def _heeding(self) -> Mask:
        """Targets at which the controller may heed configuration data, (t,)."""
        moves = self.program.moves
        unheeded = np.zeros(len(moves), dtype=bool)
        unheeded[[move for move, certain in self.program.nearest.items() if certain]] = True
        found = np.zeros(len(self.program.targets), dtype=bool)
        found[moves.target[moves.moving & ~unheeded]] = True
        return found

    def _turned(self, rows: Integers, corrected: Floats) -> bool:
        """Whether digits that are written for the first of targets `rows` are not those of all the others."""
        configuration = self.program.configuration
        layout = self.program.layouts[int(self.program.targets.layout[rows[0]])]
        if configuration is None or not of_pose(layout) or layout.configuration == 0:
            return False
        stated = numbers_of(self.program, rows[:1], layout)[:, -layout.configuration :]
        digits = configuration.digits(corrected[rows])
        said = configuration.text_of_digits(digits[:1], stated)
        written = configuration.digits_of_text(np.where(np.isnan(stated), np.nan, said))
        return bool(((digits != digits[:1]) & (written != ANY)).any())


@dataclass(frozen=True, eq=False)
class Judged:
    """What the changes of targets for their uses as they stand make of their uses with offsets.

    Attributes:
        reasons: Why a target is not to be changed, by its number.
        off_mm: How far off the tool would be at most at a use with an offset, (t,); NaN where there is none,
            or that is not known.
        off_mrad: How far turned it would be at most, (t,).
    """

    reasons: dict[int, str]
    off_mm: Floats
    off_mrad: Floats


def offset_notices(program: Program, off_mm: Floats, off_mrad: Floats) -> tuple[Notice, ...]:
    """What it costs that targets are changed for their uses as they stand, as in Judged; (t,) each."""
    which = np.flatnonzero(np.isfinite(off_mm))
    if len(which) == 0:
        return ()
    changed = (
        "is changed for its use as it stands"
        if len(which) == 1
        else "are changed for their use as they stand"
    )
    text = (
        f"{count_of(len(which), 'target')} {changed} (--offsets-mm): uses with offsets are up to "
        f"{off_mm[which].max():.3f} mm and {off_mrad[which].max():.3f} mrad off"
    )
    lines = {listed_target(program, int(target), "").line for target in which}
    return (Notice("offsets", text, tuple(sorted(lines))),)


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
