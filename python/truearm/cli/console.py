"""What commands share: printing for people and programs, and errors as exit statuses."""

import json
import os
import sys
from codecs import lookup
from collections.abc import Iterable, Sequence
from io import TextIOWrapper
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, Final

from truearm.errors import Notice, TruearmError, UsageError
from truearm.interrupts import INTERRUPTED

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

DONE: Final = 0
FAILED: Final = 1
USAGE: Final = 2
WIDTH: Final = 80


def open_what_is_closed() -> None:
    """Let streams that were closed when the program was started (2>&-) be empty ones that take everything.

    Python has none in their places then, and the next file that is opened would get the number of one.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            # Numbers are given from the lowest on, so that it is this one.
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open(mode, encoding="utf-8"))  # noqa: SIM115 - for good


def say_all() -> None:
    """Let stdout print any text: characters that its encoding has not are escaped, as on stderr."""
    if isinstance(sys.stdout, TextIOWrapper) and sys.stdout.errors in ("strict", "surrogateescape"):
        sys.stdout.reconfigure(errors="backslashreplace")


def say(text: str = "") -> None:
    """Print a line of result on stdout."""
    sys.stdout.write(f"{text}\n")


def say_wrapped(text: str) -> None:
    """Print a paragraph on stdout in lines of at most 80 columns."""
    say(fill(text, WIDTH))


def tell(text: str) -> None:
    """Print a line about the work on stderr, where it does not mix with results."""
    sys.stderr.write(f"{text}\n")


def suggest(*commands: str, when: str = "Try next:") -> None:
    """Name the commands that come next, if there are any, at the end of a command's results, one a line."""
    if not commands:
        return
    say(when)
    for command in commands:
        say(f"  {command}")


def warn(notices: Iterable[Notice]) -> None:
    """Print notices on stderr."""
    for notice in notices:
        tell(f"{_coloured('Warning:', 'yellow')} {notice}")


def on_terminal() -> bool:
    """Whether stderr is a terminal that can be written over."""
    return sys.stderr.isatty() and os.environ.get("TERM") != "dumb"


def print_json(value: Any, *, on_one_line: bool = False) -> None:  # noqa: ANN401
    """Print a value as JSON on stdout; NaN and infinity are errors of the caller."""
    escaped = lookup(sys.stdout.encoding or "utf-8").name != "utf-8"
    say(json.dumps(value, indent=None if on_one_line else 2, ensure_ascii=escaped, allow_nan=False))


def print_table(
    columns: Sequence[str], rows: Iterable[Sequence[str]], *, title: str = "", left: Sequence[int] = (0,)
) -> None:
    """Print a table of at most 80 columns on stdout, with numbers whole on a terminal of any width.

    Args:
        columns: Headings, with units.
        rows: Texts of each row.
        title: Line above it.
        left: Columns to set flush left; the others are flush right.
    """
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    lines = [list(columns), *map(list, rows)]
    table = Table(box=SIMPLE_HEAD, title=title or None, title_justify="left", pad_edge=False)
    for position, heading in enumerate(columns):
        table.add_column(Text(heading), justify="left" if position in left else "right")
    for line in lines[1:]:
        table.add_row(*(Text(cell) for cell in line))
    console = _console()
    if _narrowest(table) > console.width:
        table.padding = 0
    cells_of = list(zip(*lines, strict=True))
    least = [max((len(word) for cell in cells for word in cell.split()), default=0) for cells in cells_of]
    room = console.width - (_narrowest(table) - sum(least))
    for column, width in zip(table.columns, _widths(cells_of, least, room), strict=True):
        column.width = width
    console.width = max(console.width, _narrowest(table))
    console.print(table)


def _widths(cells_of: Sequence[Sequence[str]], least: Sequence[int], room: int) -> list[int]:
    """Widths of columns of cells, headings first: `least`, and what room is left for cells, then headings."""
    widths = list(least)
    for first in (1, 0):
        wanted = [
            max(map(len, cells[first:]), default=0) - width
            for cells, width in zip(cells_of, widths, strict=True)
        ]
        more = [max(each, 0) for each in wanted]
        left = min(max(room - sum(widths), 0), sum(more))
        widths = [width + each * left // max(sum(more), 1) for width, each in zip(widths, more, strict=True)]
    return widths


def _narrowest(table: "Table") -> int:
    """Columns of a terminal on which no word or number of a table is cut."""
    from rich.console import Console

    return Console(width=sys.maxsize).measure(table).minimum


def exit_status(error: BaseException) -> int | None:
    """Say an error on stderr; its exit status, or None if it is not one that people can act on."""
    if isinstance(error, TruearmError) or type(error).__module__ == "truearm._core":
        _tell_error(str(error))
        return USAGE if isinstance(error, UsageError) else FAILED
    if isinstance(error, OSError):
        place = f"{error.filename}: " if error.filename else ""
        _tell_error(f"{place}{error.strerror or error}.")
        return FAILED
    if isinstance(error, MemoryError):
        _tell_error("not enough memory for this; use fewer measurements.")
        return FAILED
    if isinstance(error, KeyboardInterrupt):
        tell("Interrupted.")
        return INTERRUPTED
    return None


def _tell_error(text: str) -> None:
    tell(f"{_coloured('Error:', 'red')} {text}")


def _coloured(word: str, colour: str) -> str:
    """The word in colour where stderr is a terminal and nobody asked for none (https://no-color.org)."""
    if not on_terminal() or os.environ.get("NO_COLOR"):
        return word
    from typer import style

    return style(word, fg=colour, bold=True)


def _console() -> "Console":
    from rich.console import Console

    console = Console(highlight=False)
    return Console(highlight=False, width=min(console.width, WIDTH))
