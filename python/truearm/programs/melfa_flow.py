"""In which order statements of a MELFA BASIC program can be executed: rather a way too many than one less.

Subroutines return to where they are called from, interrupts come anywhere behind where they are let in. Where
branches, loops and labels do not fit together, a program is taken to jump from anywhere to anywhere.
"""

import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

from truearm.programs.melfa_text import Statement, name_of

_JUMP: Final = re.compile(r"(?<![\w.])(GoTo|GoSub)\b(.*)", re.IGNORECASE)
_PLACE: Final = re.compile(r"\*\w+|(?<!\w)\d+(?!\w)")
_SHORT_JUMP: Final = re.compile(r"\s*(\*\w+|\d+)\s*\Z")
_HEADER: Final = re.compile(r"\s*(If|ElseIf)\b", re.IGNORECASE)
_LAST: Final = re.compile(r"\s*(GoTo\b|Return\b|Break\b|End\s*\Z)", re.IGNORECASE)
_CALL_ALONE: Final = re.compile(r"\s*GoSub\b", re.IGNORECASE)
_RETURN: Final = re.compile(r"\s*Return\b", re.IGNORECASE)
_INTERRUPT: Final = re.compile(r"\s*(Def\s+Act|On\s+Com)\b", re.IGNORECASE)
_INTERRUPTS: Final = (
    (re.compile(r"\s*Def\s+Act\b", re.IGNORECASE), re.compile(r"\s*Act\b", re.IGNORECASE)),
    (re.compile(r"\s*On\s+Com\b", re.IGNORECASE), re.compile(r"\s*Com\b", re.IGNORECASE)),
)
"""How interrupts are defined, and how they are let in."""
_FUNCTION: Final = re.compile(r"\s*(?:Function\b(?:\s+[A-Z]\b)?(?:\s+([A-Za-z]\w*))?|FEnd\b)", re.IGNORECASE)
"""What begins or ends a function; before its name is the letter of what it returns."""
_BLOCK: Final = re.compile(
    r"\s*(For|While|Select|Case|Default|Next|WEnd|End\s+Select|Break)\b", re.IGNORECASE
)
_CLOSING: Final = {"next": "for", "wend": "while", "endselect": "select", "endif": "if"}
_BELONGS_TO: Final = {**_CLOSING, "case": "select", "default": "select", "else": "if", "elseif": "if"}
_LOOPS: Final = frozenset({"for", "while"})


@dataclass
class _Block:
    """Statements that lead from one part of a branch or loop to another, the first and the last included."""

    word: str
    parts: list[int]
    breaks: list[int] = field(default_factory=list)


def functions(statements: Iterable[Statement]) -> set[str]:
    """The names of a program's functions."""
    found = [begun for one in statements if (begun := _FUNCTION.match(one.text)) is not None]
    return {begun.group(1) for begun in found if begun.group(1)}


class Ways:
    """The ways through a program.

    Args:
        statements: Its statements, in the order of the text.
    """

    def __init__(self, statements: Sequence[Statement]) -> None:
        self._statements = statements
        self._fits = not any(_FUNCTION.match(one.text) for one in statements)
        self._places: dict[str, list[int]] = {}
        self._line_ends = self._find_lines()
        self._blocks: list[_Block] = []
        self._passed_by: dict[int, int] = {}
        self._find_blocks()
        self._called = {place: found for place in range(len(statements)) if (found := self._calls(place))}
        self._within: list[list[int]] = [list(self._local(place)) for place in range(len(statements))]
        for block in self._blocks:
            self._join(block)
        self._next = self._with_calls()
        self._interrupt()
        if not self._fits:
            self._jump_anywhere(range(len(statements)), range(len(statements)))

    def jumped_to(self) -> set[int]:
        """Labels, and statements that a jump tells by the number of their line."""
        told = {name for one in self._statements for name in self._told(one) if not name.startswith("*")}
        labels = {place for name, found in self._places.items() if name.startswith("*") for place in found}
        return labels | {place for name in told for place in self._places.get(name, ())}

    def behind(self, starts: Iterable[int], until: Collection[int] = ()) -> set[int]:
        """Statements that can be executed behind some, those included at which that ends."""
        first = [place for start in starts for place in self._next[start]]
        return _reached(first, self._next, until)

    def from_start(self, until: Collection[int] = ()) -> set[int]:
        """Statements that can be executed from the first one on, those included at which that ends."""
        return _reached([0] if self._statements else [], self._next, until)

    def _find_lines(self) -> list[int]:
        """For each statement where the next line begins; where labels and line numbers are is noted."""
        ends, end = [0] * len(self._statements), len(self._statements)
        for place in reversed(range(len(self._statements))):
            one, ends[place] = self._statements[place], end
            if one.part == 0:
                end = place
                if one.number is not None:
                    self._places.setdefault(str(one.number), []).append(place)
                if one.text.lstrip().startswith("*"):
                    self._places.setdefault(name_of(one.text), []).append(place)
        return ends

    def _find_blocks(self) -> None:
        """Branches of several lines, and loops."""
        open_ = list[_Block]()
        for place in range(len(self._statements)):
            word = self._structure(place)
            if word in _BELONGS_TO:
                self._fits &= bool(open_) and open_[-1].word == _BELONGS_TO[word]
                if open_ and word in _CLOSING:
                    self._close(open_.pop(), place)
                elif open_:
                    open_[-1].parts.append(place)
            elif word == "break":
                self._fits &= bool(open_)
                for block in open_:
                    block.breaks.append(place)
            elif word:
                open_.append(_Block(word, [place]))
        self._fits &= not open_

    def _structure(self, place: int) -> str:
        """The word by which a statement is part of a branch of several lines or a loop; empty without."""
        one = self._statements[place]
        block = _BLOCK.match(one.text)
        if block is not None:
            return name_of(block.group(1))
        headers = [found.group(1).casefold() for each in self._before(place) if (found := self._header(each))]
        if one.lead == "then" and not one.text.strip() and self._line_ends[place] == place + 1:
            return "" if headers[-1:] == ["elseif"] else "if"
        header = self._header(place)
        if header is not None and header.group(1).casefold() == "elseif":
            return "elseif"
        return one.lead if one.lead in {"else", "endif"} and not headers else ""

    def _header(self, place: int) -> re.Match[str] | None:
        return _HEADER.match(self._statements[place].text)

    def _before(self, place: int) -> range:
        """The statements before one in its line."""
        return range(place - self._statements[place].part, place)

    def _close(self, block: _Block, place: int) -> None:
        block.parts.append(place)
        if block.word == "if":
            self._passed_by |= dict.fromkeys(block.parts[1:-1], place)
        self._blocks.append(block)

    def _join(self, block: _Block) -> None:
        """Ways between the parts of a block: those that a condition, the end of a case or a Break takes."""
        if block.word == "if":
            for place, behind in pairwise(block.parts):
                self._within[place] += [] if self._statements[place].lead == "else" else [behind]
        else:
            self._within[block.parts[0]] += block.parts[1:]
        if block.word in _LOOPS:
            self._within[block.parts[-1]].append(block.parts[0])
        for place in (*block.breaks, *(block.parts[1:-1] if block.word == "select" else ())):
            self._within[place].append(block.parts[-1])

    def _told(self, one: Statement) -> list[str]:
        """The labels and line numbers that a statement jumps to."""
        jump, short = _JUMP.search(one.text), _SHORT_JUMP.match(one.text)
        if jump is not None:
            return [name_of(name) for name in _PLACE.findall(jump.group(2))]
        return [name_of(short.group(1))] if short is not None and one.lead in {"then", "else"} else []

    def _targets(self, place: int) -> list[int]:
        """The statements that one jumps to."""
        one = self._statements[place]
        told = self._told(one)
        self._fits &= all(name in self._places for name in told) and (
            bool(told) or not _JUMP.search(one.text)
        )
        return [target for name in told for target in self._places.get(name, ())]

    def _is_call(self, place: int) -> bool:
        jump = _JUMP.search(self._statements[place].text)
        return jump is not None and jump.group(1).casefold() == "gosub"

    def _calls(self, place: int) -> list[int]:
        """Where the subroutines begin that a statement calls, those of interrupts left out."""
        interrupt = _INTERRUPT.match(self._statements[place].text)
        return self._targets(place) if interrupt is None and self._is_call(place) else []

    def _local(self, place: int) -> Iterator[int]:
        """What is executed next in the same routine, subroutines stepped over."""
        one = self._statements[place]
        if not self._is_call(place) and _INTERRUPT.match(one.text) is None:
            yield from self._targets(place)
        jumps = one.lead in {"then", "else"} and _SHORT_JUMP.match(one.text) is not None
        if _LAST.match(one.text) is None and not jumps:
            yield from self._fallen_to(place)
        if self._header(place) is not None:
            behind = range(place + 1, self._line_ends[place])
            yield from (each for each in behind if self._statements[each].lead in {"then", "else"})
            if not self._has_else(place):
                yield from self._line_end(place)

    def _has_else(self, place: int) -> bool:
        """Whether each condition of a line has an Else there."""
        line = self._statements[place - self._statements[place].part : self._line_ends[place]]
        headers = [one for one in line if _HEADER.match(one.text) is not None]
        return len(headers) == len([one for one in line if one.lead == "else"])

    def _fallen_to(self, place: int) -> Iterator[int]:
        """The statement behind one; behind a branch of a line the next line."""
        following = place + 1
        if following < self._line_ends[place] and self._statements[following].lead != "else":
            yield following
        else:
            yield from self._line_end(place)

    def _line_end(self, place: int) -> Iterator[int]:
        """The next line; behind a branch of several lines what is behind all of them."""
        end = self._line_ends[place]
        if end < len(self._statements):
            yield self._passed_by.get(end, end)

    def _with_calls(self) -> list[list[int]]:
        """Ways through the whole program: into subroutines and interrupts and back from them."""
        following = [list(found) for found in self._within]
        callers: dict[int, list[int]] = {}
        for place, entries in self._called.items():
            alone = _CALL_ALONE.match(self._statements[place].text) is not None
            following[place] = list(entries) if alone else [*entries, *self._within[place]]
            for entry in entries:
                callers.setdefault(entry, []).append(place)
        for entry, places in callers.items():
            returned_to = [target for place in places for target in self._within[place]]
            for place in self._returns(entry):
                following[place] += returned_to
        return following

    def _returns(self, entry: int) -> list[int]:
        """Where a subroutine ends."""
        found = _reached([entry], self._within)
        return [place for place in found if _RETURN.match(self._statements[place].text) is not None]

    def _interrupt(self) -> None:
        """Ways to the subroutines of interrupts, and back from them, wherever these may come."""
        starts, entries = list[int](), list[int]()
        for defining, enabling in _INTERRUPTS:
            defined = self._matching(defining)
            entries += [entry for place in defined for entry in self._targets(place)]
            starts += (self._matching(enabling) or defined) if defined else []
        interrupted = _reached([*starts, *entries] if starts else [], self._next)
        self._jump_anywhere(interrupted, entries)
        returns = [place for entry in entries for place in self._returns(entry)]
        self._jump_anywhere(returns, interrupted)

    def _matching(self, pattern: re.Pattern[str]) -> list[int]:
        return [place for place, one in enumerate(self._statements) if pattern.match(one.text) is not None]

    def _jump_anywhere(self, starts: Iterable[int], ends: Iterable[int]) -> None:
        """Ways from each of some statements to each of others."""
        middle = len(self._next)
        self._next.append(list(ends))
        for place in starts:
            self._next[place].append(middle)


def _reached(
    first: Iterable[int], following: Sequence[Sequence[int]], until: Collection[int] = ()
) -> set[int]:
    """All that some, and what follows them, lead to; nothing follows `until`."""
    left, found = list(first), set[int]()
    while left:
        place = left.pop()
        if place not in found:
            found.add(place)
            left += following[place] if place not in until else ()
    return found
