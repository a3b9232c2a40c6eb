"""Reads a FANUC listing: the motions of /MN, and how each uses the positions of /POS."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from truearm.programs.branches import Branches
from truearm.programs.environment import Environment, Frame
from truearm.programs.frames import Frames
from truearm.programs.gathered import Gathered
from truearm.programs.source import Source
from truearm.programs.tables import Motion, Number, Via
from truearm.programs.tp_calls import may_leave
from truearm.programs.tp_configuration import LETTERS, ConfiguredPose, FanucConfiguration, turn_orders
from truearm.programs.tp_positions import CURRENT, JOINTS, POSE, Position, line_count, positions, section
from truearm.programs.tp_registers import StatedFrames
from truearm.programs.tp_state import OFFSET, SENSED, Current, moved_at
from truearm.robot import Robot
from truearm.types import Floats

_LINE: Final = re.compile(r"[ \t]*(\d*)[ \t]*:([^\n]*)\n?|[^\n]*\n|[^\n]+")
_MOTION: Final = re.compile(r"\s*([JLCAS])[ \t]*(?=P\[|PR\[)")
_TARGET: Final = re.compile(r"\b(PR|P)\[\s*(\d{1,9}(?!\d)|A?R\[\d+[^\]]*\])[^\]]*\]")
_COMMENT: Final = re.compile(r":[^\[\]\n]*(?=\])")
_ASSIGNED: Final = re.compile(r"\s*=(?!=)")
_STRING: Final = re.compile(r"'[^'\n]*'|\"[^\"\n]*\"")
_BLEND: Final = re.compile(r"\b(FINE|CNT\s*(\d+|R\[)|CR\s*\d+|CD\s*\d+)", re.IGNORECASE)
# fmt: off
_OPTIONS: Final = (
    (re.compile(r"\bINC\b", re.IGNORECASE), "it is a relative move (INC)"),
    (re.compile(r"\b(TOOL_OFFSET|VOFFSET|OFFSET)\b", re.IGNORECASE), OFFSET),
    (re.compile(r"\bRTCP\b", re.IGNORECASE), "the tool stands still and the arm holds the part (RTCP)"),
    (re.compile(r"\bCOORD\b", re.IGNORECASE), "it is coordinated with another motion group (COORD)"),
    (re.compile(r"\b(TRACK|STITCH|TOUCH|SEARCH)\b", re.IGNORECASE), SENSED),
)
# fmt: on
_MOTIONS: Final = {"J": Motion.JOINT, "L": Motion.LINEAR, "C": Motion.CIRCULAR, "A": Motion.CIRCULAR}
_POSE: Final = ConfiguredPose()
SHARED: Final = "/POS has its number more than once,"
ORDER_UNKNOWN: Final = (
    "its turn numbers mean different joints to different controllers, and no joint position of the "
    "same place tells which"
)


class Reader:
    """One listing.

    Attributes:
        found: Positions and their uses.
    """

    def __init__(self, source: Source, robot: Robot, frames: Frames) -> None:
        self.found = Gathered((source,), line_count=line_count(source))
        self._source, self._robot, self._frames = source, robot, frames
        self._main = section(source, "MN")
        start, end = section(source, "POS")
        stated = self._told_apart(positions(source, start, end, robot.joint_count))
        self._positions = {p.number: p for p in stated}
        self._targets = {p.number: self._target(p) for p in stated}
        self._current = Current()
        self._settings()
        self._moved = moved_at(source.part(0, self._main[0]), self._statements())
        self._stated = StatedFrames()
        self._used, self._chosen = dict[int, set[int]](), 0
        self._motions()
        self._turn_orders = self._orders()

    def configuration(self) -> FanucConfiguration:
        """How CONFIG is meant.

        Raises:
            InputError: If the arm's branches cannot be told by it.
        """
        return FanucConfiguration(Branches.of(self._robot), self._turn_orders)

    def _told_apart(self, stated: Iterable[Position]) -> list[Position]:
        """Positions; which of those that share a number a controller takes is not known."""
        found = list(stated)
        lines: dict[int, list[str]] = {}
        for position in found:
            lines.setdefault(position.number, []).append(str(self._source.place(position.at)[0]))
        shared = {number: " and ".join(every) for number, every in lines.items() if len(every) > 1}
        return [
            replace(p, problem=f"{SHARED} in lines {shared[p.number]}", sure=False)
            if p.number in shared
            else p
            for p in found
        ]

    def _target(self, position: Position) -> int:
        name = f"P[{position.number}]"
        number = self.found.targets.add(0, position.at, position.layout, position.numbers, name)
        if position.problem:
            self.found.fixed[number] = position.problem
        if not position.sure:
            self.found.unsure.add(number)
        return number

    def _statements(self) -> Iterator[tuple[int, str]]:
        """Offset and text of each statement of /MN, remarks and what is commented out left out."""
        for start, text in self._whole_lines():
            body = text.lstrip()
            if not body.startswith(("!", "//", "--")):
                yield start + len(text) - len(body), _STRING.sub(lambda one: " " * len(one.group()), text)

    def _whole_lines(self) -> Iterator[tuple[int, str]]:
        """Offset and text of each line up to its semicolon, with the lines that go on with it."""
        start, pieces = -1, list[str]()
        for found in _LINE.finditer(self._source.text_with_line_feeds, *self._main):
            text = found.group(2)
            if text is None or found.group(1) or not pieces:
                start, pieces = found.start(2), []
            if text is None:
                continue
            ended = text.rstrip().endswith(";")
            pieces.append(text.rstrip()[:-1] if ended else text)
            if ended:
                yield start, " ".join(pieces)
                pieces = []

    def _settings(self) -> None:
        straight = True
        for at, text in self._statements():
            self._current.read(self._source.place(at)[0], text, straight=straight)
            straight = straight and _MOTION.match(text) is None and not may_leave(text)

    def _motions(self) -> None:
        follows = False
        for at, text in self._statements():
            motion = _MOTION.match(text)
            self._stated.read(text)
            if motion is None:
                self._other_use(at, text)
                follows = follows and not may_leave(text)
            else:
                follows = self._motion(at, text, motion.group(1), follows=follows)
        self._settle()

    def _settle(self) -> None:
        """Positions that only a motion to a computed number may go to."""
        if self._chosen:
            unused = set(self._targets.values()) - self._used.keys()
            self.found.keep(unused, f"only line {self._chosen} may go there, by a computed number")

    def _other_use(self, at: int, text: str) -> None:
        """A position that is read or compared: what it is changed to would be computed with."""
        line = self._source.place(at)[0]
        for found in _TARGET.finditer(text):
            if found.group(1) == "PR":
                continue
            number, reason = found.group(2), f"used in line {line} for something else than a motion"
            if number.isdigit():
                touched = {self._targets[n] for n in {int(number)} & self._targets.keys()}
                self.found.keep(touched, f"it is also {reason}")
            else:
                touched = set(self._targets.values())
                self.found.keep(touched, f"it may also be {reason}")
            if _ASSIGNED.match(text, found.end()):
                self.found.unsure |= touched

    def _motion(self, at: int, text: str, kind: str, *, follows: bool) -> bool:
        """One motion; whether the arm is where it leads, afterwards."""
        found = [one for one in _TARGET.finditer(text) if one.start() < _options_at(text)]
        bare = _COMMENT.sub("", text)
        problem = self._moved.get(at) or next((why for option, why in _OPTIONS if option.search(bare)), "")
        blended, known = _is_blended(bare), len(found) > (kind == "C")
        if not found:
            self._choose(at, text.strip(), problem)
        for place, target in enumerate(found[:2]):
            via = kind == "C" and place == 0
            motion = Motion.VIA if via else _MOTIONS.get(kind, Motion.LINEAR)
            number = int(target.group(2)) if target.group(2).isdigit() else None
            reason = self._why_unknown(target.group(1), number)
            if number is None and target.group(1) == "P":
                self._choose(at, target.group(), problem)
            elif number is None or reason:
                self.found.leave((0, at), reason, target.group())
                self.found.unplace((0, at), motion, blended=blended or via)
            if number is None or reason:
                follows = known = False
                continue
            position = self._positions[number]
            environment = self.found.environments.number(self._environment(position, problem))
            self._used.setdefault(self._targets[number], set()).add(environment)
            if via:
                # FANUC's manuals that can be had do not say whether the orientation of a via point counts.
                self.found.vias[len(self.found.moves)] = Via.UNTOLD
            self.found.moves.add(
                self._targets[number],
                (0, at),
                motion,
                environment=environment,
                blended=blended or via,
                follows=follows,
            )
            follows = True
        return known and not problem and not re.search(r"\bSKIP\b", bare, re.IGNORECASE)

    def _choose(self, at: int, name: str, problem: str) -> None:
        """A motion to any position."""
        self.found.leave((0, at), "which position it is, is computed at run time", name)
        self._chosen = self._chosen or self._source.place(at)[0]
        if problem:
            line = self._source.place(at)[0]
            self.found.keep(self._targets.values(), f"line {line} may go there too: {problem}")

    def _why_unknown(self, kind: str, number: int | None) -> str:
        if kind == "PR":
            return "a position register is set at run time"
        return "" if number in self._positions else "there is no such position in /POS"

    def _environment(self, position: Position, problem: str) -> Environment:
        tool = self._frame("UTOOL", position.tool)
        return Environment(
            tool=tool,
            work_object=self._frame("UFRAME", position.frame),
            problem=problem,
            payload_kg=self._frames.payloads_kg.get(tool.name.casefold()),
        )

    def _frame(self, kind: str, number: str) -> Frame:
        """The frame that a position is in, or its tool; number 0 is the robot's own."""
        if number == CURRENT:
            doubt = self._current.doubt(kind)
            if doubt:
                return Frame.missing(doubt, number)
            number = self._current.number(kind)
        unknown, stated = self._current.why_unknown(kind, number), np.eye(4) if number == "0" else None
        if unknown:
            placed = self._stated.of(kind, number)
            if placed is None:
                return Frame.missing(unknown, number)
            stated = _POSE.to_poses(np.array([placed]))[0]
        find = self._frames.tool if kind == "UTOOL" else self._frames.work_object
        return find(number, stated)

    def _orders(self) -> tuple[tuple[int, int, int], ...]:
        """Which joints the turn numbers may be of; positions for which it matters are left as they are."""
        posed = [p for p in self._positions.values() if p.layout == POSE and not p.problem]
        turned = [p for p in posed if any(number.value for number in _turns(p))]
        stated = np.array([[n.value for n in _turns(p)] for p in turned], dtype=np.int64).reshape(-1, 3)
        flange = np.array([self._flange(p) for p in turned]).reshape(-1, 4, 4)
        taught = [p for p in self._positions.values() if p.layout == JOINTS and not p.problem]
        readings = np.deg2rad(np.array([[n.value for n in p.numbers] for p in taught], dtype=np.float64))
        readings = readings.reshape(-1, self._robot.joint_count)
        orders = turn_orders(stated, flange, readings, self._robot)
        for position in turned if len(orders) > 1 else ():
            if any(number.value for number in _turns(position)[:2]):
                self.found.keep([self._targets[position.number]], ORDER_UNKNOWN)
        return orders

    def _flange(self, position: Position) -> Floats:
        """base_from_flange (4, 4) as the controller has it; NaN where frame or tool are not known."""
        used = self._used.get(self._targets[position.number], set())
        environment = self.found.environments.all[next(iter(used))] if len(used) == 1 else None
        if environment is None or environment.tool.unknown or environment.work_object.unknown:
            return np.full((4, 4), np.nan)
        values = np.array([[number.value for number in position.numbers[: len("XYZWPR")]]])
        return environment.flange_poses(_POSE.to_poses(values)[0])


def _turns(position: Position) -> tuple[Number, ...]:
    return position.numbers[len("XYZWPR") + len(LETTERS) :]


def _options_at(text: str) -> int:
    """Where the options of a motion begin: behind its speed."""
    found = re.search(
        r"\d\s*(%|mm/sec|cm/min|inch/min|deg/sec|sec|msec)|WELD_SPEED|R\[\d+[^\]]*\]\s*(%|mm|sec)", text
    )
    return len(text) if found is None else found.start()


def _is_blended(text: str) -> bool:
    found = _BLEND.search(text)
    if found is None:
        return True
    return not (found.group(1).upper() == "FINE" or found.group(2) == "0")
