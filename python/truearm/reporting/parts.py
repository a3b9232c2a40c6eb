"""What pages are made of: text, tables and figures, in sections."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

Tone = Literal["", "good", "fair", "bad"]
Trace = Mapping[str, Any]


@dataclass(frozen=True)
class Text:
    """A paragraph.

    Attributes:
        words: Plain text.
        is_note: Whether it stands back, in small letters.
    """

    words: str
    is_note: bool = False


@dataclass(frozen=True)
class Cell:
    """A cell of a table that is more than text.

    Attributes:
        text: What it shows.
        tone: How good or bad that is; shown as a colour and a mark.
        href: Where it leads; nowhere if empty.
    """

    text: str
    tone: Tone = ""
    href: str = ""


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        title: What it is of.
        columns: Headings, with units.
        rows: Cells of each row.
        says: What to see in it; nothing if empty.
        left: Columns set flush left; the others are numbers.
        strong: Rows that stand out.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str | Cell]]
    says: str = ""
    left: Sequence[int] = (0,)
    strong: Sequence[int] = ()


@dataclass(frozen=True)
class Choice:
    """One of several states of a figure.

    Attributes:
        label: What the button says.
        shown: For each trace whether it is shown.
        layout: Layout of plotly.js, on top of the figure's.
    """

    label: str
    shown: Sequence[bool]
    layout: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Figure:
    """A figure, drawn by plotly.js.

    Attributes:
        title: What it is of.
        says: A sentence of what to see, worked out from the data.
        traces: Traces of plotly.js. A colour is a name of the palette, such as "@constant".
        layout: Layout of plotly.js, on top of the page's; axes have titles with units.
        height: In pixels.
        is_wide: Whether it takes the width of the page; half of it otherwise.
        choices: States to choose from; the first is shown, and the first two are printed.
    """

    title: str
    says: str
    traces: Sequence[Trace]
    layout: Mapping[str, Any] = field(default_factory=dict)
    height: int = 320
    is_wide: bool = False
    choices: Sequence[Choice] = ()

    @property
    def is_spatial(self) -> bool:
        """Whether it needs WebGL."""
        return any(trace["type"] in ("scatter3d", "mesh3d", "surface", "cone") for trace in self.traces)


Part = Text | Table | Figure


@dataclass(frozen=True)
class Section:
    """A chapter of a page.

    Attributes:
        title: Its heading.
        parts: What it holds, in order.
    """

    title: str
    parts: Sequence[Part]


@dataclass(frozen=True)
class Card:
    """A number that the first screen shows large: the value, its unit and what it is."""

    value: str
    unit: str
    label: str
    tone: Tone = ""


@dataclass(frozen=True)
class Head:
    """The first screen.

    Attributes:
        title: Heading and title of the page.
        about: One line beneath it: what this is of.
        verdict: One sentence.
        tone: How good or bad it is.
        cards: Large numbers.
        table: Table beneath them; None for none.
        advice: What would help most, the most first: a few words, then a sentence.
    """

    title: str
    about: str
    verdict: str = ""
    tone: Tone = ""
    cards: Sequence[Card] = ()
    table: Table | None = None
    advice: Sequence[tuple[str, str]] = ()
