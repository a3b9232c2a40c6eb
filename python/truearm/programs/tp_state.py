"""What stays until it is changed in a FANUC listing: current frames, frames that it sets, moved targets."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from truearm.programs.tp_calls import may_call

KINDS: Final = ("UFRAME", "UTOOL")
_NAMED: Final = re.compile("|".join(KINDS), re.IGNORECASE)
_SET: Final = re.compile(
    r"(?P<name>[\w$.]*(?P<kind>UFRAME|UTOOL)\w*)\s*"
    r"(?:\[(?P<index>(?:[^\[\]]|\[[^\[\]]*\])*)\]\s*)?(?:\.[\w$]+\s*)*=(?!=)(?=(?P<value>.*))",
    re.IGNORECASE,
)
_OF_GROUP: Final = re.compile(r"\s*GP(\d+)\s*:?", re.IGNORECASE)
_NUMBER: Final = re.compile(r"\s*(\d+)\s*(?::.*|\Z)")
_SYSTEM_INDEX: Final = re.compile(r"\s*(\d+)\s*(?:,(.*))?\Z")
_MOVED: Final = re.compile(r"\s*(TRACK|TOUCH\s+OFFSET|MP\s+OFFSET)\b\s*(END\b)?", re.IGNORECASE)
_LEAVING: Final = re.compile(r"\s*(IF|ELSE|ENDIF|FOR|ENDFOR|SELECT)\b|.*\bLBL\s*\[", re.IGNORECASE)
_CONVEYOR: Final = re.compile(r"\bLINE_TRACK_SCHEDULE_NUMBER\s*:\s*0*[1-9]")
OFFSET: Final = "an offset known at run time is added"
SENSED: Final = "the path is changed at run time by a sensor"
CONVEYED: Final = "the program follows a conveyor (LINE_TRACK)"


@dataclass
class Current:
    """What UFRAME_NUM and UTOOL_NUM are set to anywhere in the program, and frames that are redefined.

    Attributes:
        redefined: Line in which a frame is set, by kind and number; empty for one whose number is computed.
    """

    redefined: dict[tuple[str, str], int] = field(default_factory=dict)
    _numbers: dict[str, set[str]] = field(default_factory=lambda: {kind: set() for kind in KINDS})
    _late: dict[str, int] = field(default_factory=dict)
    _called: int = 0

    def read(self, line: int, text: str, *, straight: bool) -> None:
        """A statement of line `line`; `straight` where neither a motion nor a branch is before it."""
        for found in _SET.finditer(text) if _NAMED.search(text) is not None else ():
            self._set(line, found, straight=straight, alone=not text[: found.start()].strip())
        if may_call(text):
            self._called = self._called or line

    def _set(self, line: int, found: re.Match[str], *, straight: bool, alone: bool) -> None:
        """One assignment; `alone` where no condition is before it."""
        kind, name = found.group("kind").upper(), found.group("name").upper()
        index = found.group("index") or ""
        if name in {f"{kind}_NUM", kind}:
            group = _OF_GROUP.match(index)
            of, index = ("1", index) if group is None else (group.group(1), index[group.end() :])
        elif name in {f"$MN{kind}NUM", f"$MN{kind}"} and (system := _SYSTEM_INDEX.match(index)) is not None:
            of, index = system.group(1), system.group(2) or ""
        else:
            self._numbers[kind].add(found.group())
            self.redefined.setdefault((kind, ""), line)
            return
        if of == "1" and name.endswith("NUM"):
            value = _NUMBER.match(found.group("value"))
            if not straight and not self._numbers[kind]:
                self._late[kind] = line
            self._numbers[kind].add(value.group(1) if alone and value is not None else found.group())
        elif of == "1":
            number = _NUMBER.match(index)
            self.redefined.setdefault((kind, "" if number is None else number.group(1)), line)

    def number(self, kind: str) -> str:
        """The one number; empty if there are several, or one known at run time, or none."""
        found = self._numbers[kind]
        return next(iter(found)) if len(found) == 1 and next(iter(found)).isdigit() else ""

    def doubt(self, kind: str) -> str:
        """Why the number is not certain wherever a motion is; empty if it is."""
        name = f"{kind}_NUM"
        if not self.number(kind):
            return f"{name} is not one number throughout the program"
        if kind in self._late:
            line = self._late[kind]
            return f"{name} is set in line {line}, behind motions or branches that do not have it yet"
        return f"line {self._called} may call a program or macro that sets {name}" if self._called else ""

    def why_unknown(self, kind: str, number: str) -> str:
        """Why a frame is not the one that a frames file holds; empty if it is."""
        line = self.redefined.get((kind, number))
        if line is not None:
            return f"{kind}[{number}] is set in line {line} when the program runs"
        line = self.redefined.get((kind, ""))
        if line is None or number == "0":
            return ""
        return f"which {kind} is set in line {line} is known only when the program runs"


def moved_at(heading: str, statements: Iterable[tuple[int, str]]) -> dict[int, str]:
    """Why the targets of statements are moved when the program runs, by their offsets.

    Args:
        heading: What is before the statements.
        statements: Offset and text of each.
    """
    if _CONVEYOR.search(heading) is not None:
        return dict.fromkeys((at for at, _ in statements), CONVEYED)
    active, found, left, known = dict[str, str](), dict[int, str](), "", list[int]()
    for at, text in statements:
        known.append(at)
        mark = _MOVED.match(text)
        if mark is not None:
            word = mark.group(1).split()[0].upper()
            active.pop(word, "")
            if mark.group(2) is None:
                active[word] = SENSED if word == "TRACK" else OFFSET
        if active:
            found[at] = next(iter(active.values()))
            left = left or (found[at] if _LEAVING.match(text) is not None else "")
    return (dict.fromkeys(known, left) if left else {}) | found
