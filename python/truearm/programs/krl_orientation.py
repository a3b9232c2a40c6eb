"""Whether the arm takes a target's orientation on a line or an arc: what $ORI_TYPE tells of that in KRL."""

import re
from collections.abc import Container, Iterable, Sequence
from typing import Final, NamedTuple

from truearm.programs.tables import Motion

KEPT: Final = (
    "the arm keeps the orientation that it comes with, and not the target's ($ORI_TYPE or ORI_TYP "
    "#CONSTANT): to have it corrected, store that orientation and set #VAR"
)
CHOSEN: Final = (
    "the controller chooses the orientation, and not the target ($ORI_TYPE or ORI_TYP #IGNORE): to have "
    "it corrected, store an orientation and set #VAR"
)
WRIST: Final = (
    "the arc turns the axes of the wrist evenly, and not the tool ($ORI_TYPE or ORI_TYP #JOINT), which is "
    "not followed: to have its via point corrected, set #VAR"
)
COMPUTED: Final = "$ORI_TYPE: it is computed at run time"
BEHIND: Final = ": set $ORI_TYPE=#VAR behind it"
VAR, JOINT = "#var", "#joint"
HEEDING: Final = (VAR, JOINT)
"""Modes in which orientations count."""
MODES: Final = {"#constant": KEPT, "#ignore": CHOSEN} | dict.fromkeys(HEEDING, "")
"""Why the orientation of a target does not count in a mode; empty where it does."""
LINE_DATA: Final = "ldat_act"
"""Holds the line data of an inline form."""
MODAL: Final = frozenset({"$ori_type", LINE_DATA})
"""What is assigned to tell it."""
USUAL: Final = "ldefault"
"""KUKA's own line data, whose orientation is #VAR."""
_NAMED: Final = re.compile(r"sori_typ\((\w+)\)")
_STATED: Final = re.compile(r"\bori_typ\s*(#?\w+)")
_MENTIONED: Final = re.compile(
    r"(?<!\w)(?:(ori|circ)_type?[ \t]*=?[ \t]*(?:s(?:ori|circ)_typ[ \t]*\([ \t]*(\w+)|(#?\w*))"
    r"|ldat_act[ \t]*=[ \t]*(\w+))",
    re.IGNORECASE,
)


class Orientation(NamedTuple):
    """What is known of whether orientations count.

    Attributes:
        mode: One of MODES, #JOINT where it may be #VAR too; or why it is not known, words that end a line of
            the listing. None for motions joint by joint, which heed orientations always.
        line_data: What BAS(#CP_PARAMS) makes of `mode`, by what LDAT_ACT holds; None where that leaves it.
        set_at: Where `mode` was set, file and offset; None at the start, and where ways from several meet.
        elsewhere: What routines that are not in the files may set; None for anything.
    """

    mode: str | None = VAR
    line_data: str | None = None
    set_at: tuple[int, int] | None = None
    elsewhere: str | None = None

    @property
    def unheeded(self) -> str | None:
        """Why the orientation of a target does not count; empty where it does, None joint by joint."""
        return None if self.mode is None else MODES.get(self.mode, self.mode)

    def why_not(self, motion: Motion) -> str:
        """Why the target of a motion is not corrected for how the tool is turned there; empty if it is."""
        return WRIST if motion == Motion.VIA and self.mode == JOINT else self.unheeded or ""

    def lost(self, why: str) -> "Orientation":
        """One that may have been set by what is not followed, and why: words that end a listing."""
        if self.elsewhere is not None:
            prepared = self.line_data and _either(self.line_data, self.elsewhere, why)
            return self.perhaps(self.elsewhere, why)._replace(line_data=prepared)
        return Orientation(f"$ORI_TYPE: {why}", f"$ORI_TYPE: {why}")

    def perhaps(self, mode: str, why: str) -> "Orientation":
        """One that may have been set to a mode besides; `why` if it counts in one of the two only."""
        return self._replace(mode=_either(self.mode, mode, why))

    def joined(self, other: "Orientation", why: str) -> "Orientation":
        """What is known where two branches meet; `why` if they differ."""
        return Orientation(
            _either(self.mode, other.mode, why),
            _either(self.line_data, other.line_data, why),
            self.set_at if self.set_at == other.set_at else None,
            self.elsewhere,
        )

    def unprepared(self, why: str) -> "Orientation":
        """One of which is not known what BAS(#CP_PARAMS) makes of it."""
        return self._replace(line_data=self.lost(why).line_data)

    def overruled(self, before: "Orientation", again: "Orientation") -> bool:
        """Whether a mode that comes from before a loop is another one when that comes round again."""
        inherited = self.set_at is None or self.set_at == before.set_at
        return inherited and self.mode is not None and before.mode != again.mode

    def behind_bas(self, command: str, at: tuple[int, int]) -> "Orientation":
        """What a command of BAS leaves of it: motion parameters of lines set it, INITMOV sets #VAR."""
        if command in {"cp_params", "cp_dat"} and self.line_data is not None:
            return self._replace(mode=self.line_data, set_at=at)
        return self._replace(mode=VAR, set_at=at) if command == "initmov" else self


HEEDED: Final = Orientation()


def _either(one: str | None, other: str | None, why: str) -> str | None:
    """A mode that is one of two."""
    if one == other:
        return one
    return JOINT if one in HEEDING and other in HEEDING else f"$ORI_TYPE: {why}"


class Mentioned(NamedTuple):
    """What the files of a program say of orientations, wherever they do.

    Attributes:
        elsewhere: As of Orientation: nothing but the modes that the files themselves set is expected of
            routines that are not in them, if orientations count in these; otherwise anything.
        on_path: Whether $CIRC_TYPE may be another one than #BASE.
    """

    elsewhere: str | None
    on_path: bool

    @classmethod
    def of(cls, texts: Iterable[str], stored: Container[str]) -> "Mentioned":
        """What texts say; `stored` are the names of line data, among others, in small letters."""
        modes, arcs = {VAR}, set[str]()
        for found in (one for text in texts for one in _MENTIONED.finditer(text)):
            if ";" in found.string[found.string.rfind("\n", 0, found.start()) + 1 : found.start()]:
                continue
            kind, own, mode, prepared = (part and part.lower() for part in found.groups())
            name = own or prepared
            if name is None or (name != USUAL and name not in stored):
                (arcs if kind == "circ" else modes).add(name or mode)
        elsewhere = JOINT if JOINT in modes else VAR
        return cls(elsewhere if modes <= {*HEEDING} else None, bool(arcs - {"#base"}))


def mode_in(told: str) -> str:
    """The mode that is told, such as "#constant", or why it is not known."""
    return told if told in MODES else COMPUTED


def set_in(words: Sequence[str]) -> str | None:
    """The mode that an assignment sets, whose tokens are in small letters; None for one not written out."""
    mode = "".join(words[-2:])
    return mode if mode in MODES and words[-3:-2] == ["="] else None


def mode_of(line_data: str) -> str | None:
    """The mode that line data, written out in small letters, state; None where they state none."""
    found = _STATED.search(line_data)
    return None if found is None else found.group(1)


def named_in(value: str) -> str:
    """The line data that a motion's own $ORI_TYPE=SORI_TYP(..) takes it from; empty for another value."""
    found = _NAMED.fullmatch(value)
    return "" if found is None else found.group(1)
