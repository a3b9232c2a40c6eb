"""Write docs/reference/c-header.md from the comments and declarations of the C header."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

PAGE = Path(__file__).parent / "reference" / "c-header.md"
HEADER = Path(__file__).resolve().parents[1] / "crates" / "capi" / "include" / "truearm.h"
HEAD = """# C header

Everything that [`truearm.h`](../../crates/capi/include/truearm.h) declares; this page is made from it.
What the library promises and how it is linked is in [C library](c-library.md).
"""
WHY = "a part of the header"
PARTS = {"#define": "Constants", "enum": "Status", "typedef": "Types", "": "Functions"}


def page() -> str:
    """The page as it has to be."""
    lines, part = [HEAD], ""
    for comment, declaration in declarations(HEADER.read_text()):
        kind = next(kind for kind in PARTS if declaration.startswith(kind))
        if PARTS[kind] != part:
            part = PARTS[kind]
            lines.append(f"## {part}\n")
        lines.append(
            f"### {name_of(declaration)}\n\n{words(comment)}\n\n```c shown: {WHY}\n{declaration}\n```\n"
        )
    return "\n".join(lines)


def declarations(header: str) -> Iterator[tuple[str, str]]:
    """Comment and text of each declaration that has a comment."""
    directives = re.compile(r"^#(?!define TRUEARM_ABI).*\n( +: int32_t\n)?", re.MULTILINE)
    plain = directives.sub("", header.split("*/", 1)[1])
    for found in re.finditer(r"(?:^//.*\n)+", plain, re.MULTILINE):
        comment = re.sub(r"^// ?", "", found[0], flags=re.MULTILINE).strip()
        yield comment, _declaration(plain[found.end() :])


def _declaration(text: str) -> str:
    """What stands at the beginning: up to its semicolon outside of braces, or the line of a constant."""
    if text.startswith("#"):
        return text.splitlines()[0]
    depth = 0
    for place, letter in enumerate(text):
        depth += {"{": 1, "}": -1}.get(letter, 0)
        if letter == ";" and depth == 0:
            return re.sub(r"\n *\{", " {", text[: place + 1])
    raise ValueError(f"no declaration ends in: {text[:60]}")


def name_of(declaration: str) -> str:
    """What is declared."""
    if declaration.startswith("typedef"):
        return str(re.findall(r"(truearm_\w+);", declaration)[-1])
    form = r"(truearm_\w+)\(" if declaration.endswith(");") else r"((?:TRUEARM|truearm)_\w+)"
    return str(re.findall(form, declaration)[0])


def words(comment: str) -> str:
    """A comment as a paragraph of the page; what it says of safety is what the caller has to see to."""
    return comment.replace("# Safety\n", "The caller ensures that ").replace("\n\n\n", "\n\n")


if __name__ == "__main__":
    PAGE.write_text(page())
    sys.stdout.write(f"written to {PAGE}\n")
