"""How places of a program are named in listings."""

from collections.abc import Sequence
from typing import Final

from truearm.programs.program import Listed, Program

NAMED: Final = 10
DIMENSIONS: Final = "arrays of more dimensions than one are not read"


def listed_target(program: Program, target: int, reason: str) -> Listed:
    """A target in a listing."""
    targets = program.targets
    file, at = int(targets.source[target]), int(targets.at[target])
    return _listed(program, file, at, targets.names.get(target, ""), reason)


def listed_move(program: Program, move: int, reason: str) -> Listed:
    """The statement of a move in a listing."""
    return _listed(program, int(program.moves.source[move]), int(program.moves.at[move]), "", reason)


def describe(program: Program, listed: Sequence[Listed], most: int = NAMED) -> str:
    """Lines of text about the first of `listed`."""
    lines = [
        f"  {program.sources[one.file].path.name}, line {one.line}, {shortened(one.name)}: {one.reason}"
        for one in listed[:most]
    ]
    if len(listed) > most:
        lines.append(f"  and {len(listed) - most} more")
    return "\n".join(lines)


def shortened(name: str, most: int = 40) -> str:
    """A name or statement in at most `most` characters."""
    return name if len(name) <= most else f"{name[: most - 3]}..."


def _listed(program: Program, file: int, at: int, name: str, reason: str) -> Listed:
    source = program.sources[file]
    line, column = source.place(at)
    return Listed(file, line, column, name or source.line_text(line).strip(), reason)
