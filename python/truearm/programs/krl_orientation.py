"""Whether the arm takes a target's orientation on a line or an arc: what $ORI_TYPE tells of that in KRL."""

import re
from typing import Final, NamedTuple

KEPT: Final = (
    "the arm keeps the orientation that it comes with, and not the target's ($ORI_TYPE or ORI_TYP "
    "#CONSTANT): to have it corrected, store that orientation and set #VAR"
)
CHOSEN: Final = (
    "the controller chooses the orientation, and not the target ($ORI_TYPE or ORI_TYP #IGNORE): to have "
    "it corrected, store an orientation and set #VAR"
)
HEEDING: Final = frozenset({"var", "joint"})
MODES: Final = {"#constant": KEPT, "#ignore": CHOSEN} | {f"#{mode}": "" for mode in HEEDING}
LINE_DATA: Final = "ldat_act"
"""Holds the line data of an inline form."""
MODAL: Final = frozenset({"$ori_type", LINE_DATA})
"""What is assigned to tell it."""
USUAL: Final = "ldefault"
"""KUKA's own line data, whose orientation is #VAR."""
_NAMED: Final = re.compile(r"sori_typ\((\w+)\)")
_STATED: Final = re.compile(r"\bori_typ\s*(#?\w+)")


class Orientation(NamedTuple):
    """What is known of whether orientations count.

    Attributes:
        unheeded: Why the orientation of a target does not count; empty where it does. None for motions joint
            by joint, which heed it always.
        line_data: What BAS(#CP_PARAMS) makes of `unheeded`, by what LDAT_ACT holds; None where that leaves
            it as it is.
    """

    unheeded: str | None = ""
    line_data: str | None = None

    @classmethod
    def lost(cls, why: str) -> "Orientation":
        """One that is not known, and why: words that end a line of the listing."""
        return cls(f"$ORI_TYPE: {why}", f"$ORI_TYPE: {why}")

    def joined(self, other: "Orientation", why: str) -> "Orientation":
        """What is known where two branches meet; `why` if they differ."""
        lost = self.lost(why)
        return Orientation(*(a if a == b else c for a, b, c in zip(self, other, lost, strict=True)))

    def behind_bas(self, command: str) -> "Orientation":
        """What a command of BAS leaves of it: motion parameters of lines set it, INITMOV sets #VAR."""
        if command in {"cp_params", "cp_dat"} and self.line_data is not None:
            return self._replace(unheeded=self.line_data)
        return self._replace(unheeded="") if command == "initmov" else self


HEEDED: Final = Orientation()


def unheeded_in(mode: str) -> str:
    """Why the orientation of a target does not count in a mode, such as "#constant"; empty where it does."""
    return MODES.get(mode, "$ORI_TYPE: it is computed at run time")


def mode_of(line_data: str) -> str | None:
    """The mode that line data, written out in small letters, state; None where they state none."""
    found = _STATED.search(line_data)
    return None if found is None else found.group(1)


def named_in(value: str) -> str:
    """The line data that a motion's own $ORI_TYPE=SORI_TYP(..) takes it from; empty for another value."""
    found = _NAMED.fullmatch(value)
    return "" if found is None else found.group(1)
