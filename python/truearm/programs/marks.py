"""The mark in a rewritten program: a comment that says it was rewritten, and with what."""

from typing import Final

from truearm._core import find_bytes
from truearm.errors import WorkError
from truearm.programs.program import Program

MARK: Final = "compensated by truearm"


def mark_text(version: str, data_hash: str) -> str:
    """What the comment says: who did it, and the first digits of the hash of the calibration's data."""
    return f"{MARK} {version}, calibration {data_hash[:12]}: do not compensate it again"


def refuse_marked(program: Program) -> None:
    """Refuse a program that holds a mark.

    Raises:
        WorkError: If it does; names file and line.
    """
    for source in program.sources:
        at = find_bytes(source.content, MARK.encode())
        if at is not None:
            line, _ = source.place(at)
            raise WorkError(
                "this program was compensated already",
                where=f"{source.path}, line {line}",
                rule="A correction on top of a correction misses by as much as none at all",
                way_out="Take the program as it was before; --force compensates it once more",
            )
