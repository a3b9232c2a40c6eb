"""How places of a program are named in listings."""

from collections.abc import Sequence
from typing import Final

from truearm.programs.program import Listed, Program
from truearm.programs.source import Source

NAMED: Final = 10
LONGEST_NAME: Final = 120
"""Characters of a line that tell what is on it: a program may be one line."""
DIMENSIONS: Final = "arrays of more dimensions than one are not read"


def listed_target(program: Program, target: int, reason: str) -> Listed:
    """A target in a listing."""
    targets = program.targets
    file, at = int(targets.source[target]), int(targets.at[target])
    return listed_at(program.sources, (file, at), targets.names.get(target, ""), reason)


def listed_move(program: Program, move: int, reason: str) -> Listed:
    """The statement of a move in a listing."""
    place = int(program.moves.source[move]), int(program.moves.at[move])
    return listed_at(program.sources, place, "", reason)


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


def listed_at(sources: Sequence[Source], place: tuple[int, int], name: str, reason: str) -> Listed:
    """What stands at a file and an offset in a listing; what has no name is told by its line."""
    file, at = place
    line, column = sources[file].place(at)
    shown = name or " ".join(sources[file].line_text(line).split())
    return Listed(file, line, column, shown[:LONGEST_NAME], reason)
