"""What moved, in numbers for people: offsets of joints, frames and tools."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np

from truearm.types import Floats
from truearm.units import MM_PER_METRE, RADIANS_PER_DEGREE
from truearm.updating.estimating import Estimate, posterior
from truearm.updating.options import UpdateOptions
from truearm.updating.scattering import Scatter
from truearm.updating.scene import Scene, State
from truearm.updating.squares import SquaresTest, student_p, wald
from truearm.updating.unknowns import Unknowns, arm_std

TOLD: Final = 0.5
"""An offset is told when its standard error is below this share of the prior's deviation."""
STEP: Final = 1e-6
"""For derivatives, in rad and m."""
NO_CHANGE: Final = 0.5
"""A joint value that changed by less than this share of its reading's change may not have changed."""


@dataclass(frozen=True)
class Judge:
    """What is too large to be chance.

    Attributes:
        level: Share of unmoved joints, frames and tools that are said to have moved, of each; zero where the
            test of all of them finds no change.
        known: Degrees of freedom that the scale of standard errors is known from.
    """

    level: float
    known: int

    @classmethod
    def of(cls, changed: SquaresTest, level: float, unknowns: Unknowns, known: int) -> "Judge":
        """One for the parts of what was tested at a level, which they share where that found a change."""
        return cls(level / unknowns.count_compared if changed.p < level else 0.0, known)


@dataclass(frozen=True)
class Offset:
    """The change of a joint's offset: what is added to its reading.

    `truearm.update` makes one of each joint, `update.offsets`.

    Attributes:
        joint: From 1.
        unit: "deg" or "mm".
        change: In that unit.
        std: Standard error in that unit; None where it is not told.
        p: How often an unmoved joint shows as large a change; None where it is not told.
        moved: Whether that is too rare, for one among all that was tested, and these did change.
        told: Whether the poses tell it; where they do not, the offset is held as it was.
        confounded: What it cannot be told from: "frame", "tool", "frame and tool", or "" for the others.
        follows: The coupled joint, from 1, whose change alone makes this one; None where there is none.
    """

    joint: int
    unit: str
    change: float
    std: float | None
    p: float | None
    moved: bool
    told: bool
    confounded: str = ""
    follows: int | None = None

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return asdict(self)


@dataclass(frozen=True)
class Motion:
    """How far a frame, a tool, or the base of a known world moved.

    `truearm.update` makes one of each set-up, in `update.frames` and `update.tools`.

    Attributes:
        part: "frame", "base" or "tool".
        group: Name of the set-up.
        shift_mm: Of the frame's origin in its own axes, or of each target in the flange's (k, 3).
        shift_std_mm: Standard errors of it.
        turn_deg: Rotation vector (3,); None where it is not known.
        turn_std_deg: Standard errors of it.
        p: How often an unmoved one shows as much; None for what was found anew.
        moved: Whether that is too rare, for one among all that was tested, and these did change.
    """

    part: str
    group: str
    shift_mm: tuple[tuple[float, ...], ...]
    shift_std_mm: tuple[tuple[float, ...], ...]
    turn_deg: tuple[float, ...] | None
    turn_std_deg: tuple[float, ...] | None
    p: float | None
    moved: bool

    @property
    def largest_mm(self) -> float:
        """Length of the largest shift."""
        return float(np.linalg.norm(self.shift_mm, axis=1).max(initial=0.0))

    @property
    def kept(self) -> bool:
        """Whether it was not estimated."""
        return not np.any(self.shift_std_mm)

    @property
    def angle_deg(self) -> float | None:
        """Angle of the turn."""
        return None if self.turn_deg is None else float(np.linalg.norm(self.turn_deg))

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {**asdict(self), "kept": self.kept}


def untold(scene: Scene, scatter: Scatter, state: State) -> dict[int, str]:
    """Joints, from 0, whose offsets the poses do not tell, and what they cannot be told from.

    It depends on the poses and on what may have moved, not on what was measured. Priors of offsets are as
    wide as they are by default, at the least: narrower ones are what is known besides, which measurements may
    contradict.

    Args:
        scene: The measurements.
        scatter: What the residuals of an unchanged arm may scatter by.
        state: Where derivatives are taken.
    """
    unknowns, std = scene.unknowns, scene.unknowns.std.copy()
    joints = range(scene.task.arm.robot.joint_count)
    usual = [arm_std(scene.task.arm, unknowns.arm_names[joint], UpdateOptions()) for joint in joints]
    std[joints] = np.maximum(std[joints], usual)
    covariance = posterior(scene.linear(state), scatter, std, unknowns.free)
    error = np.sqrt(np.diag(covariance))
    return {
        joint: _confounded(unknowns, covariance, joint, TOLD * std[joint])
        for joint in joints
        if error[joint] >= TOLD * std[joint]
    }


def offsets(scene: Scene, found: Estimate, held: dict[int, str], judge: Judge) -> tuple[Offset, ...]:
    """Changes of all joints' offsets, those that are `held` for not being told among them."""
    kinds = scene.task.arm.robot.joints
    std = np.sqrt(np.diag(found.covariance))
    result = []
    for joint, kind in enumerate(kinds):
        scale, unit = (MM_PER_METRE, "mm") if kind == "prismatic" else (1.0 / RADIANS_PER_DEGREE, "deg")
        if joint in held:
            result.append(Offset(joint + 1, unit, 0.0, None, None, False, False, held[joint]))
            continue
        change, error = float(found.state.arm[joint]), float(std[joint])
        p = student_p(change / error, judge.known)
        result.append(Offset(joint + 1, unit, scale * change, scale * error, p, p < judge.level, told=True))
    coupled = _Coupled(scene.task.arm.robot.coupling, found, judge)
    return tuple(replace(offset, follows=coupled.followed(result, offset)) for offset in result)


@dataclass(frozen=True, eq=False)
class _Coupled:
    """Joint values (N,) as C (N, N) makes them of readings, and how certain their changes are."""

    coupling: Floats
    found: Estimate
    judge: Judge

    def followed(self, offsets: Sequence[Offset], offset: Offset) -> int | None:
        """The joint, from 1, whose change alone makes that of a reading; None where there is none.

        It follows where the joint value changed by no more than chance, and far less than the reading.
        """
        row, joint = self.coupling[offset.joint - 1], offset.joint - 1
        others = [
            other.joint for other in offsets if other.moved and other is not offset and row[other.joint - 1]
        ]
        if not offset.moved or len(others) != 1:
            return None
        count = len(row)
        changes, covariance = self.found.state.arm[:count], self.found.covariance[:count, :count]
        left, error = float(row @ changes), float(np.sqrt(row @ covariance @ row))
        is_chance = student_p(left / error, self.judge.known) >= self.judge.level
        is_small = abs(left) < NO_CHANGE * abs(row[joint] * changes[joint])
        return others[0] if is_chance and is_small else None


def motions(scene: Scene, found: Estimate, judge: Judge) -> tuple[tuple[Motion, ...], tuple[Motion, ...]]:
    """Motions of the frames, and of the tools, of the set-ups that the calibration knows.

    In a known world the base takes the place of the frames.
    """
    judged = _Judged(scene, found, judge)
    frames, tools = [judged.base()] if scene.task.arm.world_is_known else [], []
    for number, group in enumerate(scene.task.groups):
        place = scene.unknowns.group(number)
        frame, tool = scene.motion(found.state, number)
        if frame is not None:
            own = slice(place.start, place.start + len(frame))
            frames.append(judged.motion("frame", group, frame, own))
        if tool is not None:
            own = slice(place.stop - len(tool), place.stop)
            tools.append(judged.motion("tool", group, tool, own))
    return tuple(frames), tuple(tools)


@dataclass(frozen=True, eq=False)
class _Judged:
    """Changes of the set-ups' unknowns, and whether they are too large to be chance."""

    scene: Scene
    found: Estimate
    judge: Judge

    def motion(self, part: str, group: str, change: Floats, place: slice) -> Motion:
        """That of a frame or a tool."""
        covariance = self.found.covariance[place, place]
        tested = self.scene.unknowns.is_compared(place)
        p = wald(change, covariance, self.judge.known).p if tested else None
        return self._told(part, group, change, covariance, p)

    def base(self) -> Motion:
        """That of the base of a known world, whose row has five of the six freedoms."""
        own = np.flatnonzero(self.scene.unknowns.base)
        change, covariance = self.found.state.arm[own], self.found.covariance[np.ix_(own, own)]
        motion, by_row = _linearised(self.scene.base_motion, change)
        tested = self.scene.unknowns.is_compared(own)
        p = wald(change, covariance, self.judge.known).p if tested else None
        return self._told("base", self.scene.task.groups[0], motion, by_row @ covariance @ by_row.T, p)

    def _told(self, part: str, group: str, change: Floats, covariance: Floats, p: float | None) -> Motion:
        """A motion: shifts, then a turn if there is one."""
        points = len(self.scene.task.selection.targets) if part == "tool" else 1
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        has_turn = len(change) > 3 * points
        return Motion(
            part,
            group,
            _rows(MM_PER_METRE * change[: 3 * points]),
            _rows(MM_PER_METRE * std[: 3 * points]),
            _degrees(change[3 * points :]) if has_turn else None,
            _degrees(std[3 * points :]) if has_turn else None,
            p,
            p is not None and p < self.judge.level,
        )


def _linearised(function: Callable[[Floats], Floats], at: Floats) -> tuple[Floats, Floats]:
    """Values (k,) of a function of a few unknowns (u,), and its derivatives (k, u)."""
    ways = STEP * np.eye(len(at))
    slopes = [(function(at + way) - function(at - way)) / (2.0 * STEP) for way in ways]
    return function(at), np.column_stack(slopes)


def _confounded(unknowns: Unknowns, covariance: Floats, joint: int, error: float) -> str:
    """Of frame, or base, and tool what would have to be known for an offset's error to be below `error`."""
    parts = list(unknowns.parts)
    names, masks = zip(*parts, strict=True)
    parts.append((" and ".join(names), np.logical_or.reduce(masks)))
    for name, chosen in parts:
        known = chosen & unknowns.free
        if not known.any():
            continue
        across = covariance[joint, known]
        inner = covariance[np.ix_(known, known)]
        left = covariance[joint, joint] - across @ np.linalg.solve(inner, across)
        if np.sqrt(max(left, 0.0)) < error:
            return name
    return ""


def _rows(values: Floats) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in values.reshape(-1, 3).tolist())


def _degrees(values: Floats) -> tuple[float, ...]:
    return tuple((values / RADIANS_PER_DEGREE).tolist())
