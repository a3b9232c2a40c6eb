"""A self-contained page: one HTML file with its figures, its style and the plotting script."""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from html import escape
from typing import Any, Final

from truearm.reporting.parts import Figure, Head, Part, Section
from truearm.reporting.script import licence_notice, plotting_script
from truearm.reporting.style import DARK, LAYOUT, LIGHT

TEMPLATE: Final = "page.html.jinja"
OPTION: Final = re.compile(r"(?<![\w-])--[a-z][a-z-]*[a-z]")


def page(head: Head, sections: Sequence[Section], *, foot: str = "") -> str:
    """The HTML of a page, which needs no network, no other file and no server.

    Args:
        head: Its first screen.
        sections: Its chapters; those without parts are left out.
        foot: Last line.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined  # noqa: PLC0415

    environment = Environment(
        loader=PackageLoader("truearm.reporting"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["whole_options"] = _whole_options
    shown = [section for section in sections if section.parts]
    numbered, figures = _number_figures(shown)
    content = {"palettes": {"light": LIGHT, "dark": DARK}, "layout": LAYOUT, "figures": figures}
    return environment.get_template(TEMPLATE).render(
        head=head,
        sections=numbered,
        foot=foot,
        figures=_as_script(content),
        plotly=plotting_script() if figures else "",
        licence=licence_notice() if figures else "",
    )


def _whole_options(words: str) -> str:
    """HTML of words in which no line ends within the name of an option, as it may behind any hyphen."""
    return OPTION.sub(r"<code>\g<0></code>", escape(words))


def _number_figures(sections: Sequence[Section]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Sections for the template, each part with its kind and number; and the figures in order."""
    figures: list[dict[str, Any]] = []
    described = []
    for section in sections:
        parts = []
        for part in _without_gaps(section.parts):
            parts.append({"kind": type(part).__name__.lower(), "part": part, "number": len(figures)})
            if isinstance(part, Figure):
                figures.append(_content(part))
        described.append({"title": section.title, "parts": parts})
    return described, figures


def _without_gaps(parts: Sequence[Part]) -> list[Part]:
    """The same parts, where a figure that would stand alone in its row takes the row."""
    filled, in_row = list(parts), 0
    for k, part in enumerate(parts):
        is_half = isinstance(part, Figure) and not part.is_wide
        in_row = (in_row + 1) % 2 if is_half else 0
        follower = parts[k + 1] if k + 1 < len(parts) else None
        if (
            in_row == 1
            and isinstance(part, Figure)
            and (not isinstance(follower, Figure) or follower.is_wide)
        ):
            filled[k] = replace(part, is_wide=True)
    return filled


def _content(figure: Figure) -> dict[str, Any]:
    return {
        "traces": list(figure.traces),
        "layout": dict(figure.layout),
        "height": figure.height,
        "wide": figure.is_wide,
        "spatial": figure.is_spatial,
        "choices": [
            {"label": choice.label, "shown": list(choice.shown), "layout": dict(choice.layout)}
            for choice in figure.choices
        ],
    }


def _as_script(content: dict[str, Any]) -> str:
    """JSON that may stand in a script element."""
    text = json.dumps(content, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
