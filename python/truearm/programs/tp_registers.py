"""Frames that a FANUC listing states itself: position registers set to constants, frames set to registers."""

import re
from math import isfinite, nan
from typing import Final

from truearm.programs.tp_calls import may_leave

Placed = tuple[float, float, float, float, float, float]

_OF_ONE: Final = r"\[\s*(?:GP1\s*:\s*)?(\d{1,9})\s*(?::[^\[\],]*)?"
_CONSTANT: Final = r"\(?\s*([+-]?(?:\d+\.?\d*|\.\d+))\s*\)?"
_ELEMENT: Final = re.compile(
    rf"\s*PR{_OF_ONE},\s*(\d{{1,9}})\s*(?::[^\[\]]*)?\]\s*=\s*{_CONSTANT}\s*", re.IGNORECASE
)
_FRAME: Final = re.compile(rf"\s*(UFRAME|UTOOL){_OF_ONE}\]\s*=\s*PR{_OF_ONE}\]\s*", re.IGNORECASE)
_REGISTER: Final = re.compile(rf"\s*PR{_OF_ONE}[\],].*", re.IGNORECASE)
_ANY_REGISTER: Final = re.compile(r"\s*PR\s*\[", re.IGNORECASE)
_MAY_SET: Final = re.compile(
    r"\s*(?!\s|(R|SR|F|M|DO|RO|AO|GO|SO|UO|WO|TIMER)\[|(UFRAME_NUM|UTOOL_NUM|OVERRIDE|\$WAITTMOUT"
    r"|LINEAR_MAX_SPEED|JOINT_MAX_SPEED|WAIT|SKIP)\b).*=",
    re.IGNORECASE,
)
"""What may set a register or a frame: any assignment but to what surely is none, in a motion too."""
AXES: Final = range(1, 7)


class StatedFrames:
    """What frames are set to by the statements read so far, one after the other.

    A frame is known where its register was set to six constants, X Y Z W P R, and nothing since may have
    changed either: a branch, a label, a called program or macro, or a statement that is not known, ends it.
    """

    def __init__(self) -> None:
        self._registers: dict[int, dict[int, float]] = {}
        self._frames: dict[tuple[str, str], Placed] = {}

    def read(self, text: str) -> None:
        """The next statement, without strings and remarks."""
        if (element := _ELEMENT.fullmatch(text)) is not None:
            number, axis, value = element.groups()
            self._registers.setdefault(int(number), {})[int(axis)] = float(value)
        elif (frame := _FRAME.fullmatch(text)) is not None:
            self._set((frame.group(1).upper(), frame.group(2).lstrip("0")), int(frame.group(3)))
        elif (register := _REGISTER.fullmatch(text)) is not None:
            self._registers.pop(int(register.group(1)), None)
        elif _ANY_REGISTER.match(text) is not None:
            self._registers.clear()
        elif may_leave(text) or _MAY_SET.match(text) is not None:
            self._registers.clear()
            self._frames.clear()

    def of(self, kind: str, number: str) -> Placed | None:
        """X Y Z (mm) and W P R (deg) of UFRAME or UTOOL of that number; None where it is not known."""
        return self._frames.get((kind, number.lstrip("0")))

    def _set(self, frame: tuple[str, str], register: int) -> None:
        held = self._registers.get(register, {})
        self._frames.pop(frame, None)
        if all(isfinite(held.get(axis, nan)) for axis in AXES):
            x, y, z, w, p, r = (held[axis] for axis in AXES)
            self._frames[frame] = (x, y, z, w, p, r)
