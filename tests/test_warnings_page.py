"""The page of warnings names every kind of notice, by words that are printed."""

import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import truearm

PACKAGE = Path(truearm.__file__).parent
PAGE = Path(__file__).resolve().parents[1] / "docs" / "reference" / "warnings.md"
CHOSEN = {
    "truearm.drifting": {"drift", "another_place"},
    "truearm.doubts.exchanged": {"rows_exchanged", "targets_exchanged"},
    "truearm.doubts.slips": {"target_slipped", "joint_moved", "setup_turned", "scale_differs"},
    "truearm.doubts.moved_words": {"joints_moved", "links_grew"},
    "truearm.doubts.uneven_setups": {"uneven_setups", "uneven_turns"},
}
"""Kinds of notices that a variable holds, by the module that makes these."""
PASSED_ON = ("notice.kind", "slip.notice.kind", 'content["kind"]')
"""Kinds of notices that repeat another one."""


def sources() -> dict[str, str]:
    """The texts of the package, by module."""
    paths = sorted(PACKAGE.rglob("*.py"))
    modules = [".".join(("truearm", *path.relative_to(PACKAGE).with_suffix("").parts)) for path in paths]
    return {module: path.read_text() for module, path in zip(modules, paths, strict=True)}


def kinds_in_the_code() -> Iterator[str]:
    for module, text in sources().items():
        for first in re.findall(r"""\bNotice\(\s*([\w.\[\]"']+),""", text):
            if first.startswith('"'):
                yield first.strip('"')
            elif first not in PASSED_ON:
                known = vars(importlib.import_module(module))
                yield from {known[first]} if first in known else CHOSEN[module]


def test_every_kind_of_notice_is_on_the_page_and_no_other():
    named = re.findall(r"\*\*[^*]+\*\*\s\(`(\w+)`\)", PAGE.read_text())
    assert set(named) == set(kinds_in_the_code())


def test_the_words_of_the_page_are_printed():
    texts = re.sub(r'"\s*\n\s*f?"', "", "\n".join(sources().values())).replace("\\'", "'")
    for words in re.findall(r"\*\*([^*]+)\*\*", PAGE.read_text()):
        for part in words.split("..."):
            assert part.strip() in texts, f"{words}: {part.strip()!r} is printed by nothing"
