"""How the tool is turned where arcs pass their via points: what these state of it does not always count."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from truearm.programs.arcs import Arc, StatedArc, apart_rad, stated_arcs
from truearm.programs.program import Program, flange_poses_of
from truearm.programs.tables import Motion, Via
from truearm.programs.uses import SEVERAL, Uses
from truearm.robot import Robot
from truearm.rotations import rigid_inverse
from truearm.types import Floats, Integers, Mask

PASSED: Final = "it is the via point of an arc, which passes it turned as the arc's start and end say"
ENDS_UNKNOWN: Final = (
    f"{PASSED}, and these are not both known: none comes before, or another may (a loop, a branch, a call), "
    "or one is not certain"
)
NO_ARC: Final = f"{PASSED}, and it lies in line with these, or at one of them"
TOLERATED_RAD: Final = np.deg2rad(3.0)
"""How far apart ways to be turned may be where one of them counts: what an arm's error changes by is about
0.02 mm then.
"""
TURNING_EVENLY: Final = 6
"""Arms with fewer joints cannot turn a tool about any axis."""


@dataclass(frozen=True, eq=False)
class Passed:
    """How the arcs of a program pass its via points.

    Attributes:
        flange: Poses (4, 4) of the flange at targets of which only the position counts, by number.
        reasons: Why it is not certain how a target is passed, by number.
        starts: Where the arc begins that a move belongs to, by its number: a target, and the pose (4, 4) of
            the flange there.
    """

    flange: Mapping[int, Floats] = field(default_factory=dict)
    reasons: Mapping[int, str] = field(default_factory=dict)
    starts: Mapping[int, tuple[int, Floats]] = field(default_factory=dict)


class _Turned(NamedTuple):
    """How one arc passes a via point.

    Attributes:
        stated: Pose (4, 4) of the tool.
        likely: How the tool is turned there, (3, 3).
        others: How it may be turned instead, (3, 3) each.
        heeded: Whether the controller may heed how the via point is turned.
        back: tool_from_flange (4, 4).
    """

    stated: Floats
    likely: Floats
    others: tuple[Floats, ...]
    heeded: bool
    back: Floats


def passed_vias(program: Program, uses: Uses, robot: Robot) -> Passed:
    """How the arcs of a program pass its via points; `robot` is the programming model."""
    moves = program.moves
    vias = np.flatnonzero(moves.motion == Motion.VIA)
    if len(vias) == 0:
        return Passed()
    every: dict[int, list[_Turned | str]] = {}
    starts: dict[int, tuple[int, Floats]] = {}
    arcs = stated_arcs(moves)
    flange = _flange_at(
        program, np.unique([move for arc in arcs for move in arc.all]).astype(np.int64), robot
    )
    for arc in arcs:
        if all(move in flange for move in arc.all):
            start = int(moves.target[arc.before]), flange[arc.before]
            starts.update(dict.fromkeys((*arc.vias, arc.end), start))
            for via, turned in zip(arc.vias, _turned(program, arc, flange), strict=True):
                every.setdefault(int(moves.target[via]), []).append(turned)
    for via in vias.tolist():
        if via not in starts:
            every.setdefault(int(moves.target[via]), []).append(ENDS_UNKNOWN)
    judge = _Judge(program, uses, robot)
    found = {target: judge(target, turned) for target, turned in every.items()}
    return Passed(
        {target: one for target, one in found.items() if one is not None and not isinstance(one, str)},
        {target: one for target, one in found.items() if isinstance(one, str)},
        starts,
    )


def _flange_at(program: Program, which: Integers, robot: Robot) -> dict[int, Floats]:
    """Poses (4, 4) of the flange at the targets of moves `which` (n,), by move, where they are certain."""
    targets = program.moves.target[which]
    found = flange_poses_of(program, targets, program.moves.environment[which], robot)
    known = np.isfinite(found).all(axis=(1, 2)) & ~np.isin(targets, list(program.unsure))
    return dict(zip(which[known].tolist(), found[known], strict=True))


def _turned(program: Program, arc: StatedArc, flange: Mapping[int, Floats]) -> list[_Turned | str]:
    """How an arc passes each of its via points, or why that is not known."""
    tool_frame = program.environments[int(program.moves.environment[arc.end])].tool
    if tool_frame.unknown:
        return [tool_frame.unknown] * len(arc.vias)
    tool = tool_frame.controller
    start, *vias, end = (flange[move] @ tool for move in arc.all)
    way = Arc.through(start, vias, end)
    if way is None:
        return [NO_ARC] * len(vias)
    back = rigid_inverse(tool)
    found: list[_Turned | str] = []
    for move, pose in zip(arc.vias, vias, strict=True):
        rule = program.vias.get(move, Via.BETWEEN)
        likely, *others = _ways(way, way.share_of(pose[:3, 3]), rule)
        found.append(_Turned(pose, likely, tuple(others), rule == Via.UNTOLD, back))
    return found


def _ways(way: Arc, share: float, rule: Via) -> tuple[Floats, ...]:
    """How the tool may be turned, (3, 3) each, at a share of an arc; the likely one first."""
    if rule == Via.OPEN:
        return way.turned(0.0), way.turned(1.0)
    even = way.turned_either_way(share)
    if rule == Via.BETWEEN:
        return tuple(even)
    on_path = way.turned_on_path(share)
    return on_path, min(even, key=lambda one: apart_rad(one, on_path))


class _Judge:
    """Tells how a target is passed from how all arcs pass it."""

    def __init__(self, program: Program, uses: Uses, robot: Robot) -> None:
        self._program, self._uses = program, uses
        self._also_ends = _also_ends(program)
        self._evenly = robot.joint_count >= TURNING_EVENLY

    def __call__(self, target: int, every: list[_Turned | str]) -> Floats | str | None:
        """The pose (4, 4) of the flange where only the position of a target counts; None where it is passed
        as it states; or why neither is certain.
        """
        known = []
        for one in every:
            if isinstance(one, str):
                return one
            known.append(one)
        first, heeded = known[0], any(one.heeded for one in known)
        whole = heeded or bool(self._also_ends[target]) or not self._evenly
        turned = first.stated[:3, :3] if whole else first.likely
        far = max(apart_rad(turned, way) for one in known for way in (one.likely, *one.others))
        if far > TOLERATED_RAD:
            return self._why(target, far, whole=whole, heeded=heeded)
        if whole:
            return None
        if self._uses.of_joints[target] and self._has_several_tools(target):
            return SEVERAL
        pose = np.array(first.stated)
        pose[:3, :3] = turned
        flange: Floats = pose @ first.back
        return flange

    def _why(self, target: int, far_rad: float, *, whole: bool, heeded: bool) -> str:
        """Why a target is not passed as is to be expected, by how much."""
        far = f"{np.rad2deg(far_rad):.1f} deg"
        if not whole:
            return (
                f"{PASSED}, which leaves {far} open: on some controllers, or in the arcs that it is used in"
            )
        why = f"{PASSED}, {far} from what it states itself"
        if self._also_ends[target]:
            return f"{why}, and another motion ends there: no change suits both, a target of its own does"
        if heeded:
            return f"{why}, and whether the controller heeds that is not known: turn it as start and end say"
        return f"{why}: turn it as they say"

    def _has_several_tools(self, target: int) -> bool:
        moves = self._program.moves
        here = moves.environment[moves.moving & (moves.target == target)]
        return len(set(self._uses.tool_of[here].tolist())) > 1


def _also_ends(program: Program) -> Mask:
    """Targets at which motions end as well, (t,).

    Of targets that stand for one with and without offsets, as in Offsets, the first one is written: for it
    the motions of all of them count.
    """
    targets, moves = program.targets, program.moves
    _, first, stored = np.unique(
        np.stack([targets.source, targets.at]), axis=1, return_index=True, return_inverse=True
    )
    ends = np.zeros(len(targets), dtype=bool)
    ends[moves.target[moves.moving & (moves.motion != Motion.VIA)]] = True
    ends[first[stored.reshape(-1)[ends]]] = True
    return ends
