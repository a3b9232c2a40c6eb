"""Write docs/reference/cli.md from what `truearm COMMAND --help` prints."""

import contextlib
import io
import os
import sys
from pathlib import Path

from truearm.cli import COMMANDS, main

PAGE = Path(__file__).parent / "reference" / "cli.md"
HEAD = """# Command line

This page is what `truearm --help` and `truearm COMMAND --help` print.

Exit status: 0 done; 1 the work could not be done, with what, why and what to try on stderr; 2 wrong usage;
130 interrupted. Results go to stdout, progress and warnings to stderr; with `--json` stdout is JSON and
nothing else.
"""


def page() -> str:
    """The page as it has to be."""
    parts = [HEAD, _section("truearm", ["--help"])]
    parts += [_section(f"truearm {entry.name}", [entry.name, "--help"]) for entry in COMMANDS]
    return "\n".join(parts)


def _section(title: str, arguments: list[str]) -> str:
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        status = main(arguments)
    if status != 0:
        raise RuntimeError(f"truearm {' '.join(arguments)} ended with status {status}")
    return f"## {title}\n\n```text\n{printed.getvalue().strip()}\n```\n"


if __name__ == "__main__":
    os.environ["COLUMNS"] = "80"
    PAGE.write_text(page())
    sys.stdout.write(f"written to {PAGE}\n")
