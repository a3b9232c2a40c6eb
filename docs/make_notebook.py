"""Write examples/calibrate_from_csv.ipynb from the cells of the script of that name."""

import json
import re
import sys
from pathlib import Path
from typing import Any

SCRIPT = Path(__file__).resolve().parents[1] / "examples" / "calibrate_from_csv.py"
PAGE = SCRIPT.with_suffix(".ipynb")
CELL = re.compile(r"^# %% ", re.MULTILINE)


def page() -> str:
    """The notebook as it has to be."""
    title, *cells = CELL.split(SCRIPT.read_text())
    content = [_words(0, "# " + title.strip().strip('"'))]
    for number, cell in enumerate(cells, 1):
        words, _, code = cell.partition("\n")
        content += [_words(number, words), _code(number, code.strip())]
    language = {"display_name": "Python 3", "language": "python", "name": "python3"}
    notebook = {"cells": content, "metadata": {"kernelspec": language}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(notebook, indent=1) + "\n"


def _words(number: int, text: str) -> dict[str, Any]:
    return {"cell_type": "markdown", "id": f"words-{number}", "metadata": {}, "source": _lines(text)}


def _code(number: int, text: str) -> dict[str, Any]:
    found: dict[str, Any] = {"execution_count": None, "id": f"code-{number}", "metadata": {}, "outputs": []}
    return {"cell_type": "code", **found, "source": _lines(text)}


def _lines(text: str) -> list[str]:
    return text.splitlines(keepends=True)


if __name__ == "__main__":
    PAGE.write_text(page())
    sys.stdout.write(f"written to {PAGE}\n")
