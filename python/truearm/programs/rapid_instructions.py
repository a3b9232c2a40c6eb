"""What RAPID's instructions do, as far as their names tell it: which move the arm, and how."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from truearm.programs.tables import Motion

STRAIGHT: Final = (Motion.LINEAR,)
ARC: Final = (Motion.VIA, Motion.CIRCULAR)


@dataclass(frozen=True)
class Instruction:
    """A motion: how it goes, and where among its arguments zone and tool stand."""

    motions: tuple[Motion, ...]
    zone: int
    tool: int


def _kinds() -> Mapping[str, Instruction]:
    found = {"moveabsj": Instruction((Motion.JOINT,), 2, 3)}
    for ending in ("", "do", "ao", "go", "sync"):
        found[f"movej{ending}"] = Instruction((Motion.JOINT,), 2, 3)
        found[f"movel{ending}"] = Instruction(STRAIGHT, 2, 3)
        found[f"movec{ending}"] = Instruction(ARC, 3, 4)
    found |= {
        "triggj": Instruction((Motion.JOINT,), 3, 4),
        "triggl": Instruction(STRAIGHT, 3, 4),
        "triggc": Instruction(ARC, 4, 5),
    }
    for ending in ("", "start", "end"):
        found[f"arcl{ending}"] = Instruction(STRAIGHT, 4, 5)
        found[f"arcc{ending}"] = Instruction(ARC, 5, 6)
    return found


INSTRUCTIONS: Final = _kinds()
HARMLESS: Final = frozenset(
    {
        "set",
        "reset",
        "setdo",
        "setgo",
        "setao",
        "pulsedo",
        "waittime",
        "waitdi",
        "waituntil",
        "waitrob",
        "tpwrite",
        "tperase",
        "accset",
        "velset",
        "singarea",
        "cirpathmode",
        "confj",
        "confl",
        "clkstart",
        "clkstop",
        "clkreset",
        "motionsup",
        "gripload",
    }
)
SETTINGS: Final = {"confj": "off", "confl": "off", "singarea": "lockaxis4"}
"""Of these what decides how targets are meant, and the option with which they mean something else."""
COUNTING: Final = frozenset({"incr", "decr", "add", "clear"})
"""Harmless but for what they are given."""
MOVING: Final = ("move", "search", "trigg", "arc", "spot", "disp", "paint")
"""How the names of instructions begin that may move the arm."""
_SHAPED: Final = re.compile(rf"(?:{'|'.join(MOVING)})(?:abs|m)?([jlc])(?:start|end|sync|[dag]o|ios|\d+)*")
_SHAPES: Final = {"j": Motion.JOINT, "l": Motion.LINEAR, "c": Motion.CIRCULAR}


def motions_named(word: str) -> tuple[Motion, ...]:
    """How an instruction that is not known here moves the arm, by the letter J, L or C of its name.

    None where it has no such letter, as set-ups (TriggIO), moves of external axes (MoveExtJ) and routines.

    Args:
        word: Its name, in small letters.
    """
    found = _SHAPED.fullmatch(word)
    return () if found is None else (_SHAPES[found.group(1)],)
