"""Write docs/reference/cli.md from what `truearm COMMAND --help` prints."""

import contextlib
import io
import os
import sys
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path

from truearm.cli import COMMANDS, main
from truearm.cli.entry import Entry

PAGE = Path(__file__).parent / "reference" / "cli.md"
HEAD = """# Command line

This page is what `truearm --help` and `truearm COMMAND --help` print.

Exit status: 0 done; 1 the work could not be done, with what, why and what to try on stderr; 2 wrong usage;
130 interrupted. Results go to stdout, progress and warnings to stderr; with `--json` stdout is JSON and
nothing else.
"""


def page() -> str:
    """The page as it has to be."""
    return "\n".join([HEAD, _section([]), *_sections([], COMMANDS)])


def _sections(words: list[str], entries: Sequence[Entry]) -> Iterator[str]:
    """A section for each command, behind that of the command that it belongs to."""
    for entry in entries:
        yield _section([*words, entry.name])
        below = getattr(import_module(entry.module), "COMMANDS", ())
        yield from _sections([*words, entry.name], below)


def _section(words: list[str]) -> str:
    title = " ".join(["truearm", *words])
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        status = main([*words, "--help"])
    if status != 0:
        raise RuntimeError(f"{title} ended with status {status}")
    return f"## {title}\n\n```text\n{printed.getvalue().strip()}\n```\n"


if __name__ == "__main__":
    os.environ["COLUMNS"] = "80"
    PAGE.write_text(page())
    sys.stdout.write(f"written to {PAGE}\n")
