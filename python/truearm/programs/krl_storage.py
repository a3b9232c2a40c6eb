"""What KRL stores under which name: points, frames, data of inline forms."""

import re
from collections.abc import Iterator
from itertools import pairwise
from typing import Final

from truearm.programs.krl_values import Named, Structure, line_reader, named, names_in, structure
from truearm.programs.lexing import Reader
from truearm.programs.listing import DIMENSIONS
from truearm.programs.source import Source

DECLARED: Final = re.compile(
    r"[ \t]*(?:(?:decl|global|const)[ \t]+)*(pos|e6pos|axis|e6axis|frame|fdat|struc|int|real|bool|char)"
    r"[ \t]+(?=[A-Za-z_$])",
    re.IGNORECASE,
)
HEADER: Final = re.compile(
    r"[ \t]*(global[ \t]+)?def(?:fct)?(?=[ \t])[^(\r\n;]*?[ \t]([\w$]+)[ \t]*(?=[(\r\n;]|$)", re.IGNORECASE
)
DECLARING: Final = re.compile(r"[ \t]*(?:(?:decl|global|const)[ \t]+)+(\w+[ \t]+)?", re.IGNORECASE)
ASSIGNING: Final = re.compile(r"[ \t]*[A-Za-z_$][\w$]*(?:[ \t]*\[[^\]\r\n]*\])?(?:\.\w+)*[ \t]*=(?!=)")
LATER: Final = re.compile(
    r"[ \t]*(?:global[ \t]+)?(?:trigger|interrupt)[ \t][^;\r\n]*?(?<![\w$])do[ \t]+", re.IGNORECASE
)
"""Where what an interrupt or a trigger does at some time begins."""
TARGET_KINDS: Final = frozenset({"pos", "e6pos", "axis", "e6axis"})
PREPARED: Final = frozenset({"fdat_act", "pdat_act", "ldat_act", "$h_pos"})
"""What is assigned as it is, without computing with it."""
WORLD_SET_BY: Final = ("$robroot", "$ersysroot", "$world")
"""What tells where the world is in the arm's base."""
COMPUTED: Final = "it is assigned at run time"
TWICE: Final = "it is assigned more than once"
PARAMETER: Final = "a routine is given a value of that name at run time"
NOT_HERE: Final = "it is not stored in this program"

Stored = tuple[int, Structure | None]


def lines(source: Source) -> Iterator[tuple[int, int]]:
    """Where each line begins and ends, a byte order mark left out."""
    yield from pairwise([source.first, *source.line_starts[1:], len(source.text)])


def is_data(source: Source) -> bool:
    """Whether a file is a data list."""
    return source.path.suffix.lower() == ".dat"


class KrlStorage:
    """All values that are written out, by name.

    Attributes:
        values: File and structure (None for one that is computed) of every assignment to a name.
        kinds: Types of declared names.
        initial: Names that have their value before the program runs.
        parameters: Names of what routines are given.
        read: Names that the program computes with.
        grids: Names of arrays of several dimensions.
        moved: Which of WORLD_SET_BY is set, and where, in words that end a listing; empty where none is.
    """

    def __init__(self) -> None:
        self.values: dict[str, list[Stored]] = {}
        self.kinds: dict[str, str] = {}
        self.initial: set[str] = set()
        self.parameters: set[str] = set()
        self.read: set[str] = set()
        self.grids: set[str] = set()
        self.moved = ""

    def gather(self, file: int, source: Source) -> None:
        """Take what a file stores.

        Raises:
            InputError: If a structure is not closed; names line and column.
        """
        for start, end in lines(source):
            header = HEADER.match(source.text, start, end)
            if header is not None:
                self._parameters(file, line_reader(source, header.end(), end))
                continue
            begins = DECLARED.match(source.text, start, end)
            if begins is not None:
                reader = line_reader(source, begins.end(), end)
                self._declared(file, begins.group(1).lower(), reader)
                continue
            later = LATER.match(source.text, start, end)
            if later is not None and ASSIGNING.match(source.text, later.end(), end):
                self._assigned_later(file, line_reader(source, later.end(), end))
                continue
            declaring = DECLARING.match(source.text, start, end)
            first = start if declaring is None else declaring.end()
            if ASSIGNING.match(source.text, first, end):
                self._assigned(file, line_reader(source, first, end), initial=is_data(source))

    def only(self, key: str) -> Stored:
        """File and value of a name that is assigned once; no value for any other."""
        found = self.values.get(key.lower(), [])
        return found[0] if len(found) == 1 else (0, None)

    def why_not(self, key: str) -> str:
        """Why the target under a name cannot be changed; empty if it can."""
        found = self.values.get(key)
        name = key.partition("[")[0]
        if name in self.parameters:
            return PARAMETER
        if name in self.grids:
            return DIMENSIONS
        if not found:
            return NOT_HERE
        if len(found) > 1:
            return TWICE
        value = found[0][1]
        return COMPUTED if value is None else value.problem()

    def elements(self, variable: Named) -> list[str]:
        """The names that a variable may stand for: several where an array is indexed at run time."""
        if variable.index == "?":
            return [key for key in self.values if key.startswith(f"{variable.name}[") and key[-2] != "?"]
        return [variable.key] if variable.key in self.values else []

    def _parameters(self, file: int, reader: Reader) -> None:
        """What a routine is given is known at run time."""
        while not reader.done:
            kind = reader.kind()
            name = reader.take().text.lower()
            if kind == "name":
                self.parameters.add(name)
                self.values.setdefault(name, []).append((file, None))
            if reader.accept(":"):
                reader.accept("in", "out")

    def _declared(self, file: int, kind: str, reader: Reader) -> None:
        while not reader.done:
            variable = named(reader)
            if variable is None:
                return
            self.kinds.setdefault(variable.name, kind)
            self._note(variable, reader)
            if reader.accept("="):
                self.initial.add(variable.key)
                self._keep(file, variable, reader)
            if not reader.accept(","):
                return

    def _assigned(self, file: int, reader: Reader, *, initial: bool) -> None:
        variable = named(reader)
        if variable is None:
            return
        self._note(variable, reader)
        if initial:
            self.initial.add(variable.key)
        if reader.accept("="):
            self._keep(file, variable, reader)
            return
        self.values.setdefault(variable.key, []).append((file, None))
        self.read |= names_in(reader.rest())

    def _assigned_later(self, file: int, reader: Reader) -> None:
        """What an interrupt or a trigger assigns: nobody knows when."""
        variable = named(reader)
        if variable is not None:
            self._note(variable, reader)
            self.values.setdefault(variable.key, []).append((file, None))
            self.read |= names_in(reader.rest())

    def _note(self, variable: Named, reader: Reader) -> None:
        if variable.several:
            self.grids.add(variable.name)
        if variable.name in WORLD_SET_BY and not self.moved:
            line, _ = reader.source.place(variable.at)
            self.moved = f"{variable.name.upper()} is set in line {line}, which moves the world"

    def _keep(self, file: int, variable: Named, reader: Reader) -> None:
        whole = reader.rest()
        value = structure(reader) if reader.peek() == "{" else None
        joined = value is None or reader.peek() == ":"
        if (joined or (value is not None and value.others)) and variable.name not in PREPARED:
            self.read |= names_in(whole)
        value = None if joined else value
        self.values.setdefault(variable.key, []).append((file, value))
