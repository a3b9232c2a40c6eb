"""The page of a fleet: a verdict an arm, what drifted, and which arms need attention, sorted first."""

from collections.abc import Collection, Sequence
from importlib.metadata import version
from typing import Any, Final
from urllib.parse import quote

from truearm.errors import count_of
from truearm.fits.core_set import DISTANCE
from truearm.fleet.attention import ATTENTION, FAILED, GOOD
from truearm.fleet.drift import SURE
from truearm.fleet.fleet_file import Fleet
from truearm.fleet.rows import Judged, counts
from truearm.reporting.charts import axis, legend, log_axis
from truearm.reporting.page import page
from truearm.reporting.parts import Card, Cell, Figure, Head, Section, Table, Text, Tone
from truearm.reporting.style import marker_of
from truearm.result_names import REPORT_NAME

TONES: Final[dict[str, Tone]] = {GOOD: "good", ATTENTION: "fair", FAILED: "bad"}
COLUMNS: Final = (
    "arm",
    "verdict",
    "robot",
    "held-out rows",
    "errors of",
    "mean, mm",
    "max, mm",
    "nominal mean, mm",
    "drift mean, mm",
    "drift max, mm",
    "why",
)
LEFT: Final = (0, 1, 2, 4, 10)
MARKS: Final = (("nominal", "nominal", "nominal_mean_mm"), ("variable", "calibrated", "mean_mm"))
"""Models, what they are called, and their errors in rows."""
OPEN: Final = "-open"
"""How symbols that are not filled end."""
SMALLEST: Final = 1e-4
"""In mm: smaller errors are drawn there."""
AROUND: Final = 1.3
"""Times the largest error, and parts of the smallest, that the axis goes to."""
FIRST: Final = 5
"""Arms that the first screen names."""
HEIGHT: Final = 380
"""Of figures, in pixels: names stand upright where arms are many."""
LONGEST: Final = 18
"""Characters of a name below a figure; the middle of a longer one is left out."""


def fleet_page(fleet: Fleet, arms: Sequence[Judged], reports: Collection[str]) -> str:
    """The HTML of fleet.html.

    Args:
        fleet: The fleet.
        arms: Its arms, those that need most attention first.
        reports: Names of the arms that have a report beside the page.
    """
    number = counts(arms)
    tone: Tone = "bad" if number[FAILED] else "fair" if number[ATTENTION] else "good"
    head = Head(
        title=fleet.name,
        about=count_of(len(arms), "arm"),
        verdict=in_words(number),
        tone=tone,
        cards=[
            Card(str(number[word]), "arm" if number[word] == 1 else "arms", word, TONES[word])
            for word in (GOOD, ATTENTION, FAILED)
        ],
        advice=_first(arms),
    )
    done = [arm for arm in arms if arm.verdict != FAILED]
    sections = [
        Section("Arms", [_table(arms, reports), *_notices(arms)]),
        Section("Errors and drift", [figure for figure in (_errors(done), _drift(done)) if figure]),
        Section("What the verdicts mean", [Text(words) for words in _meaning(fleet)]),
    ]
    return page(head, sections, foot=f"Made by truearm {version('truearm')}.")


def in_words(number: dict[str, int]) -> str:
    """How the fleet is, in one sentence."""
    total = sum(number.values())
    if number[GOOD] == total:
        return f"All {total} arms are good." if total > 1 else "The arm is good."
    parts = [f"{number[GOOD]} of {total} arms are good"]
    if number[ATTENTION]:
        parts.append(f"{number[ATTENTION]} {'needs' if number[ATTENTION] == 1 else 'need'} attention")
    if number[FAILED]:
        parts.append(f"{number[FAILED]} could not be calibrated")
    return ", ".join(parts) + "."


def _first(arms: Sequence[Judged]) -> list[tuple[str, str]]:
    """The arms that need most attention, with why, and how many more there are."""
    named = [(arm.row["arm"], arm.reasons[0].words) for arm in arms if arm.reasons]
    more = len(named) - FIRST
    need = "needs" if more == 1 else "need"
    rest = [(f"{count_of(more, 'more arm')} {need} attention.", "The table names them.")] if more > 0 else []
    return named[:FIRST] + rest


def _table(arms: Sequence[Judged], reports: Collection[str]) -> Table:
    return Table(
        "Arms, those that need attention first",
        COLUMNS,
        [_cells(arm, reports) for arm in arms],
        says="Errors are those of held-out rows. Those of distances, one coordinate of where the point is, "
        "are smaller than those of positions would be. Drift is how far predicted positions moved since the "
        "last calibration, over the poses of the data.",
        left=LEFT,
    )


def _cells(arm: Judged, reports: Collection[str]) -> list[str | Cell]:
    row, name = arm.row, arm.row["arm"]
    href = f"{quote(name)}/{REPORT_NAME}" if name in reports else ""
    drift: dict[str, Any] = row.get("drift") or {}
    numbers = [row.get(key) for key in ("mean_mm", "max_mm", "nominal_mean_mm")]
    numbers += [drift.get("mean_mm"), drift.get("max_mm")]
    return [
        Cell(name, href=href),
        Cell(arm.verdict, TONES[arm.verdict]),
        row.get("robot", ""),
        str(row.get("held_out", "")),
        row.get("errors_of", ""),
        *("" if value is None else f"{value:.3f}" for value in numbers),
        " ".join(reason.words for reason in arm.reasons),
    ]


def _notices(arms: Sequence[Judged]) -> list[Table]:
    """What should be known of arms beside the reasons for attention; nothing where there is nothing."""
    rows = [
        [arm.row["arm"], notice]
        for arm in arms
        for notice in arm.row.get("notices", ())
        if notice not in {reason.words for reason in arm.reasons}
    ]
    return [Table("What else should be known", ("arm", "notice"), rows, left=(0, 1))] if rows else []


def _errors(arms: Sequence[Judged]) -> Figure | None:
    if not arms:
        return None
    kinds = {
        of: [arm for arm in arms if arm.row["errors_of"] == of]
        for of in dict.fromkeys(arm.row["errors_of"] for arm in arms)
    }
    traces = [
        _mean_errors(of if len(kinds) > 1 else "", alike, mark)
        for of, alike in kinds.items()
        for mark in MARKS
    ]
    worst = {of: max(alike, key=lambda arm: float(arm.row["mean_mm"])).row for of, alike in kinds.items()}
    shown = [y for trace in traces for y in trace["y"]]
    error = log_axis("mean error, mm (logarithmic)", min(shown) / AROUND, max(shown) * AROUND)
    layout = {"xaxis": _names([arm.row["arm"] for arm in arms]), "yaxis": error}
    return Figure(
        "Mean held-out error of each arm",
        " ".join(
            f"The largest {of} error is that of {row['arm']}: {row['mean_mm']:.3f} mm."
            for of, row in worst.items()
        ),
        traces,
        {**layout, **legend()},
        height=HEIGHT,
        is_wide=True,
    )


def _mean_errors(of: str, arms: Sequence[Judged], mark: tuple[str, str, str]) -> dict[str, Any]:
    """Mean errors of arms; `of` says what of where some are of positions and others of distances."""
    model, label, key = mark
    return {
        "type": "scatter",
        "mode": "markers",
        "name": f"{label}, {of}" if of else label,
        "x": [arm.row["arm"] for arm in arms],
        "y": [max(float(arm.row[key]), SMALLEST) for arm in arms],
        "marker": {
            "color": f"@{model}",
            "symbol": _other_filling(marker_of(model)) if of == DISTANCE else marker_of(model),
            "size": 10,
        },
    }


def _other_filling(symbol: str) -> str:
    """The symbol of the same form, open where it is filled, and filled where it is open."""
    return symbol.removesuffix(OPEN) if symbol.endswith(OPEN) else symbol + OPEN


def _drift(arms: Sequence[Judged]) -> Figure | None:
    known = [(arm.row["arm"], arm.row["drift"]) for arm in arms if arm.row["drift"] is not None]
    if not known:
        return None
    names = [name for name, _ in known]
    bars = {
        "type": "bar",
        "name": "mean change",
        "x": names,
        "y": [drift["mean_mm"] for _, drift in known],
        "marker": {"color": "@variable"},
    }
    unsure = {
        "type": "scatter",
        "mode": "markers",
        "name": f"{SURE:g} standard deviations of both",
        "x": names,
        "y": [None if drift["std_mm"] is None else SURE * drift["std_mm"] for _, drift in known],
        "marker": {"color": "@ink", "symbol": "line-ew-open", "size": 24, "line": {"width": 2}},
    }
    name, most = max(known, key=lambda entry: float(entry[1]["mean_mm"]))
    layout = {"xaxis": _names(names), "yaxis": axis("change, mm", rangemode="tozero")}
    return Figure(
        "Change of predicted positions since the last calibration",
        f"{name} changed most: {most['mean_mm']:.3f} mm on average. A change below its line, "
        f"{SURE:g} standard deviations of both calibrations together, is not significant.",
        [bars, unsure],
        {**layout, **legend()},
        height=HEIGHT,
        is_wide=True,
    )


def _names(names: Sequence[str]) -> dict[str, Any]:
    """An axis of arms, whose ticks are their names with the middle of long ones left out."""
    half = LONGEST // 2
    short = [name if len(name) <= LONGEST else f"{name[:half]}…{name[-half + 1 :]}" for name in names]
    return axis("arm", type="category", tickvals=list(names), ticktext=short)


def _meaning(fleet: Fleet) -> list[str]:
    stated = fleet.limits.model_dump(exclude_none=True)
    limits = ", ".join(f"{name} = {value:g}" for name, value in stated.items())
    return [
        "An arm needs attention if its calibration does not help, if data or table are doubtful or leave "
        "frame and target open, if it moved since its last calibration by more than the uncertainty of both, "
        "if its error exceeds a limit, is more than twice what it was or far above that of its kind, if many "
        "of its rows are outliers, or if its 95 % intervals hold too few held-out coordinates.",
        f"Limits of the fleet file: {limits or 'none'}.",
    ]
