"""Routines of a RAPID module: their parameters, and what they may change of what they are given."""

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Final

from truearm.programs.lexing import Reader, Token
from truearm.programs.rapid_functions import NO_FUNCTIONS, PURE
from truearm.programs.rapid_values import split

BEGINNINGS: Final = frozenset({"proc", "func", "trap"})
ENDINGS: Final = frozenset({"endproc", "endfunc", "endtrap"})
BY_REFERENCE: Final = frozenset({"inout", "var", "pers"})
READING: Final = PURE | frozenset(
    {
        # Instructions whose targets are not followed, and which leave tools and work objects as they are.
        "arcc1",
        "arcc2",
        "arcl1",
        "arcl2",
        "arcmoveabsj",
        "arcmovec",
        "arcmovej",
        "arcmovel",
        "capc",
        "capl",
        "contactl",
        "dispc",
        "displ",
        "egmmovec",
        "egmmovel",
        "fcpress1lstart",
        "fcpressc",
        "fcpressend",
        "fcpressl",
        "paintc",
        "paintl",
        "searchc",
        "searchl",
        "setsysdata",
        "spotj",
        "spotl",
        "spotmj",
        "spotml",
        "triggabsj",
        "triggjios",
        "trigglios",
    }
)
"""Functions and instructions of the controller that change nothing of what they are given."""


@dataclass(frozen=True)
class Routine:
    """What begins a routine.

    Attributes:
        name: In small letters.
        parameters: Names of its parameters, in small letters.
        references: Those of them that stand for data of whoever calls it.
    """

    name: str
    parameters: frozenset[str] = frozenset()
    references: frozenset[str] = frozenset()


def begun(reader: Reader) -> Routine | None:
    """The routine that begins with the next token, which is taken with its parameters; None if none does."""
    word = reader.peek()
    named_at = 2 if word == "func" else 1
    if word not in BEGINNINGS or any(reader.kind(place) != "name" for place in range(1, named_at + 1)):
        return None
    for _ in range(named_at):
        reader.take()
    name = reader.take().text.lower()
    return Routine(name, *_parameters(reader)) if reader.peek() == "(" else Routine(name)


def given(found: Sequence[Token], receiver: str = "") -> Iterator[tuple[str, str]]:
    """Names, each behind the instruction, routine or function that it is given to.

    Args:
        found: Tokens of a statement.
        receiver: What those are given to that stand in no function's parentheses; empty for nothing.
    """
    receivers = [receiver]
    for place, token in enumerate(found):
        before = found[place - 1] if place > 0 else token
        if token.text == "(":
            called = before.text.lower() if before.kind == "name" else ""
            receivers.append(called if called and called not in NO_FUNCTIONS else receivers[-1])
        elif token.text == ")":
            receivers = receivers[:-1] or [receiver]
        elif receivers[-1] and is_variable(found, place):
            yield receivers[-1], token.text.lower()


def is_variable(found: Sequence[Token], place: int) -> bool:
    r"""Whether a token may be the name of a variable whose value is used: not that of a component (.trans) or
    an option (\WObj), nor of an array whose length alone is asked for, Dim(pa,1).
    """
    if found[place].kind != "name" or (place > 0 and found[place - 1].text in {".", "\\"}):
        return False
    around = [token.text.lower() for token in found[max(place - 2, 0) : place + 2]]
    return [*around[:2], *around[3:]] != ["dim", "(", ","]


def changed(
    gifts: Set[tuple[str, str]], routines: Mapping[str, Routine], assigned: Set[str]
) -> frozenset[str]:
    """Names that something may change that they are given to.

    Args:
        gifts: Names, each behind what it is given to.
        routines: The routines that are known, by name.
        assigned: Names that are assigned to.
    """
    given_to: dict[str, set[str]] = {}
    for receiver, name in gifts:
        given_to.setdefault(receiver, set()).add(name)
    having: dict[str, list[str]] = {}
    for routine in routines.values():
        for name in routine.references:
            having.setdefault(name, []).append(routine.name)
    pending = {receiver for receiver in given_to if receiver not in routines and receiver not in READING}
    pending.update(*(having.get(name, ()) for name in assigned))
    found: set[str] = set()
    while pending:
        fresh = given_to.pop(pending.pop(), set()) - found
        found |= fresh
        pending.update(*(having.get(name, ()) for name in fresh))
    return frozenset(found)


def _parameters(reader: Reader) -> tuple[frozenset[str], frozenset[str]]:
    """Names of parameters in parentheses, which are next, and of those that are given by reference."""
    inside: list[Token] = []
    level = 0
    while not reader.done:
        token = reader.take()
        level += (token.text == "(") - (token.text == ")")
        if level == 0:
            break
        inside.append(token)
    names, references = set(), set()
    for part in split(inside[1:], ",", "|"):
        words = [token.text.lower() for token in part if token.kind == "name"]
        if words:
            names.add(words[-1])
            references |= {words[-1]} if words[0] in BY_REFERENCE else set()
    return frozenset(names), frozenset(references)
