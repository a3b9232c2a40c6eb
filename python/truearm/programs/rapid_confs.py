r"""Where ConfJ and ConfL are off in a RAPID module, and where SingArea locks axis 4.

A motion behind ConfJ \Off or ConfL \Off goes to the configuration nearest to where the arm stands, whatever
the configuration data of its target says. Lines and arcs behind SingArea \LockAxis4 keep axis 4 at 0 or
180 deg, whatever orientation their target states. What is set stays until it is set again, through calls too.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from truearm.programs.rapid_instructions import SETTINGS
from truearm.programs.rapid_routines import READING

ON, OFF, START = "on", "off", "start"
"""What holds; START for what held at the routine's beginning."""
KINDS: Final = ("confj", "confl")
LOCKING: Final = "singarea"
ANYTIME: Final = frozenset({"trap", "func"})
MAIN: Final = "main"
KEEPING: Final = READING | {
    "close", "connect", "idelete", "idisable", "ienable", "isignaldi", "isignaldo", "isleep", "itimer",
    "iwatch", "open", "softact", "softdeact", "tpreadfk", "tpreadnum", "triggequip", "triggint", "triggio",
    "waitai", "waitdo", "waitgi", "waitgo", "write",
}  # fmt: skip
"""Instructions of the controller that set none of them; others may be routines of other modules."""
Values = frozenset[str]
NOTHING: Final[Values] = frozenset()
ANY: Final[Values] = frozenset({ON, OFF})


class _Step(NamedTuple):
    """What matters of a statement: its kind, a name, and the number of a motion."""

    kind: str
    name: str = ""
    number: int = 0


@dataclass
class _Routine:
    """A routine: its word, such as "proc", and its steps."""

    word: str
    steps: list[_Step] = field(default_factory=list)


class Confs:
    """Gathers what the statements of a module say, in the order of the text."""

    def __init__(self) -> None:
        self._routines: dict[str, _Routine] = {}
        self._here = _Routine("")
        self._handling = False
        self._anytime: set[str] = set()

    def begin(self, word: str, name: str) -> None:
        """A routine, or a module, begins."""
        self._here, self._handling = _Routine(word), False
        if word != "module":
            self._routines[name] = self._here

    def note(self, kind: str, name: str = "") -> None:
        """A step: "if", "loop", "else", "last" or "close" of a block; "label", "handler", "leave", "call"."""
        self._handling |= kind == "handler"
        self._here.steps.append(_Step(kind, name))

    def set(self, word: str, options: Iterable[str]) -> None:
        r"""One of SETTINGS, with the names of its options: on without any."""
        if self._handling or self._here.word in ANYTIME:
            self._anytime.add(word)
        self._here.steps.append(_Step(OFF if SETTINGS[word] in options else ON, word))

    def motion(self, kind: str, number: int) -> None:
        """A motion of which one of SETTINGS decides."""
        self._here.steps.append(_Step("motion", kind, number))

    def nearest(self) -> dict[int, bool]:
        """Motions that go to the nearest configuration, by number; False where that is not certain."""
        return {number: certain for kind in KINDS for number, certain in self._off(kind).items()}

    def locked(self) -> frozenset[int]:
        """Motions, by number, on which axis 4 may be locked."""
        return frozenset(self._off(LOCKING))

    def _off(self, kind: str) -> dict[int, bool]:
        """Motions for which `kind` is off, by number; False where it may be on as well."""
        if not any(step[:2] == (OFF, kind) for one in self._routines.values() for step in one.steps):
            return {}
        return {number: ON not in held for number, held in self._values(kind).items() if OFF in held}

    def _values(self, kind: str) -> dict[int, Values]:
        """What may hold at each motion that `kind` decides of."""
        ways = self._ways(kind)
        entries = self._entries(ways)
        return {
            number: ANY if kind in self._anytime else _given(held, entries[name])
            for name, way in ways.items()
            for number, held in way.motions.items()
        }

    def _ways(self, kind: str) -> dict[str, "_Way"]:
        """What may hold within each routine, with START for what holds at its beginning."""
        ways: dict[str, _Way] = {}
        behind, before = dict.fromkeys(self._routines, NOTHING), None
        while behind != before:
            before = behind
            ways = {name: _Way(one.steps, kind, behind) for name, one in self._routines.items()}
            behind = {name: way.end for name, way in ways.items()}
        return ways

    def _entries(self, ways: Mapping[str, "_Way"]) -> dict[str, Values]:
        """What may hold at the beginning of each routine: at its calls, or where none is in the module at
        those of others and behind routines of the module that others may call.
        """
        called = {name for way in ways.values() for name in way.calls}
        own = [name for name in ways if name not in called]
        left = [_given(ways[name].end, frozenset({ON})) for name in own if name != MAIN]
        entries = {name: NOTHING if name in called else frozenset({ON}).union(*left) for name in ways}
        entries |= {name: ANY for name, one in self._routines.items() if one.word == "trap"}
        if MAIN in entries:
            entries[MAIN] = frozenset({ON})
        before: dict[str, Values] = {}
        while entries != before:
            before = dict(entries)
            for name, way in ways.items():
                for callee, held in way.calls.items():
                    for begun in [callee] if callee in ways else own:
                        if begun != MAIN or callee == MAIN:
                            entries[begun] |= _given(held, entries[name])
        return entries


class _Way:
    """What may hold along a routine.

    Attributes:
        motions: At motions, by number.
        calls: At calls, by the name of what is called.
        end: At its end.
    """

    def __init__(self, steps: list[_Step], kind: str, behind: Mapping[str, Values]) -> None:
        self.motions: dict[int, Values] = {}
        self.calls: dict[str, Values] = {}
        self.end = NOTHING
        self._kind, self._behind = kind, behind
        self._heads: dict[int, Values] = {}
        self._seen: Values = NOTHING
        known = None
        while known != (self._heads, self._seen):
            known = (dict(self._heads), self._seen)
            self._state: Values = frozenset({START})
            self._blocks: list[tuple[int, Values, list[Values]]] = []
            for place, step in enumerate(steps):
                self._take(place, step)
                self._seen |= self._state
            self.end |= self._state

    def _take(self, place: int, step: _Step) -> None:
        if step.kind in {"if", "loop"}:
            self._state |= self._heads.get(place, NOTHING)
            self._blocks.append((place if step.kind == "loop" else -1, self._state, [self._state]))
        elif step.kind in {"else", "last", "close"}:
            self._go_on(step.kind)
        elif step.kind == "label":
            self._state |= self._seen
        elif step.kind == "handler":
            self.end |= self._state
            self._state = self._seen | {START}
        elif step.kind == "leave":
            self.end |= self._state
            self._state = NOTHING
        elif step.kind in {ON, OFF} and step.name == self._kind:
            self._state = frozenset({step.kind}) if self._state else NOTHING
        elif step.kind == "call":
            self._call(step.name)
        elif step.kind == "motion" and step.name == self._kind:
            self.motions[step.number] = self._state

    def _go_on(self, kind: str) -> None:
        """Another branch begins, behind which nothing comes where it is the last one; or a block ends."""
        if not self._blocks:
            return
        head, before, ends = self._blocks[-1]
        if kind == "last" and before in ends:
            ends.remove(before)
        if kind != "close":
            ends.append(self._state)
            self._state = before
            return
        self._blocks.pop()
        if head >= 0:
            self._heads[head] = self._heads.get(head, NOTHING) | self._state
        self._state = self._state.union(*ends)

    def _call(self, name: str) -> None:
        if name in KEEPING:
            return
        self.calls[name] = self.calls.get(name, NOTHING) | self._state
        if name in self._behind:
            self._state = _given(self._behind[name], self._state)
        elif self._state:
            self._state = ANY


def _given(held: Values, start: Values) -> Values:
    """What holds where `start` is what held at the beginning."""
    return (held - {START}) | (start if START in held else NOTHING)
