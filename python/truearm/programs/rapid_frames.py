"""Tools, work objects and loads of RAPID text: tooldata, wobjdata and loaddata."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm.programs.environment import Frame
from truearm.programs.frames import RAPID_WORLD, Frames
from truearm.programs.lexing import Token
from truearm.programs.rapid_data import Declarations
from truearm.programs.rapid_values import Aggregate, Value, pose_of, truth
from truearm.programs.tables import Number

STATIONARY: Final = "the tool stands still and the workpiece is on the arm (robhold)"
MOVED: Final = "the work object is moved by a mechanical unit (ufprog)"


@dataclass(frozen=True, eq=False)
class Found:
    """A frame, and why nothing can be changed with it, joint targets included."""

    frame: Frame
    problem: str = ""


class RapidFrames:
    """Looks tools and work objects up in the module and in the frames file."""

    def __init__(self, declarations: Declarations, frames: Frames) -> None:
        self._declarations, self._frames = declarations, frames
        self._world = frames.held("object", RAPID_WORLD) or Frame.of(np.eye(4), RAPID_WORLD)

    def tool(self, given: Sequence[Token]) -> Found:
        """The tool that an argument names."""
        name = given[0].text if len(given) == 1 else ""
        if name.lower() == "tool0":
            return Found(Frame.of(np.eye(4), "tool0"))
        value = self._value(name, "tooldata")
        if isinstance(value, str):
            return Found(self._missing("tool", name, value))
        if value is None:
            return Found(self._frames.tool(name))
        pose = pose_of(value.values[1]) if len(value.values) > 1 else None
        if pose is None:
            return Found(Frame.missing(f'tool "{name}" is not written out in numbers', name))
        problem = "" if truth(value.values[0]) is True else STATIONARY
        return Found(self._frames.tool(name, pose[1]), problem)

    def work_object(self, given: Sequence[Token]) -> Found:
        """The work object that an argument names; wobj0 without one."""
        name = given[0].text if len(given) == 1 else ""
        if not given or name.lower() == RAPID_WORLD:
            return Found(self._world)
        value = self._value(name, "wobjdata")
        if isinstance(value, str):
            return Found(self._missing("work object", name, value))
        if value is None:
            return Found(self._world.then(self._frames.work_object(name)))
        poses = [pose_of(part) for part in value.values[3:5]]
        if len(value.values) != 5 or poses[0] is None or poses[1] is None:
            return Found(Frame.missing(f'work object "{name}" is not written out in numbers', name))
        problem = "" if truth(value.values[0]) is False else STATIONARY
        if truth(value.values[1]) is not True:
            problem = problem or MOVED
        stated = poses[0][1] @ poses[1][1]
        return Found(self._world.then(self._frames.work_object(name, stated)), problem)

    def payload_kg(self, tool: Sequence[Token], total: Sequence[Token]) -> float | None:
        """The mass at the flange that a motion states: of its total load, or of its tool."""
        if len(total) == 1 and total[0].text.lower() != "load0":
            return self.load_kg(total)
        name = tool[0].text if len(tool) == 1 else ""
        stated = self._frames.payloads_kg.get(name.casefold())
        if stated is not None:
            return stated
        value = self._value(name, "tooldata")
        if not isinstance(value, Aggregate) or len(value.values) < 3:
            return None
        return _mass(value.values[2])

    def load_kg(self, given: Sequence[Token]) -> float | None:
        """The mass of a load; None where it is not known."""
        name = given[0].text if len(given) == 1 else ""
        if name.lower() == "load0":
            return 0.0
        value = self._value(name, "loaddata")
        return _mass(value) if isinstance(value, Aggregate) else None

    def _value(self, name: str, kind: str) -> Aggregate | str | None:
        """A declared value, why it does not hold, or None where it is not declared."""
        datum = self._declarations.data.get(name.lower())
        if datum is None:
            return None
        why = self._declarations.doubt(name.lower())
        if why or datum.kind != kind:
            return why or None
        return datum.value if isinstance(datum.value, Aggregate) else "is not written out in numbers"

    def _missing(self, what: str, name: str, why: str) -> Frame:
        return Frame.missing(f'{what} "{name}" {why}', name)


def _mass(value: Value) -> float | None:
    first = value.values[0] if isinstance(value, Aggregate) and value.values else None
    return first.value if isinstance(first, Number) and first.value >= 0.0 else None
