"""A program's texts with other numbers in them and nothing else changed."""

from collections.abc import Mapping, Sequence

import numpy as np

from truearm._core import splice_numbers
from truearm.programs.encoding import Written
from truearm.programs.program import Program

Words = tuple[int, int, bytes]


def edited(program: Program, written: Written, inserted: Mapping[int, Sequence[Words]]) -> list[bytes]:
    """The bytes of each file of a program.

    Args:
        program: The program.
        written: Numbers to write.
        inserted: Further words by file: first byte, the byte behind the last, and what stands there.
    """
    targets = program.targets
    sources = np.repeat(targets.source, np.diff(targets.first))[written.places]
    lettered = _lettered(program)
    out = []
    for number, source in enumerate(program.sources):
        here = sources == number
        starts, ends = targets.starts[written.places[here]], targets.ends[written.places[here]]
        values, decimals, places = written.values[here], written.decimals[here], written.places[here]
        in_words = np.array([int(place) in lettered for place in places], dtype=bool) if lettered else None
        words = list(inserted.get(number, ()))
        if in_words is not None:
            words += [
                (int(start), int(end), lettered[int(place)][round(value)].encode("latin-1"))
                for start, end, place, value in zip(
                    starts[in_words], ends[in_words], places[in_words], values[in_words], strict=True
                )
            ]
            starts, ends, values, decimals = (
                column[~in_words] for column in (starts, ends, values, decimals)
            )
        order = np.argsort(starts, kind="stable")
        out.append(
            splice_numbers(
                source.text.encode("latin-1"),
                (starts[order], ends[order]),
                values[order],
                decimals[order],
                sorted(words),
            )
        )
    return out


def _lettered(program: Program) -> dict[int, tuple[str, ...]]:
    """Words of the numbers that are written as words, by place."""
    found: dict[int, tuple[str, ...]] = {}
    for number, layout in enumerate(program.layouts):
        words: Mapping[int, tuple[str, ...]] = getattr(layout, "words", {})
        for target in np.flatnonzero(program.targets.layout == number) if words else ():
            first = int(program.targets.first[target])
            found.update({first + column: known for column, known in words.items()})
    return found
