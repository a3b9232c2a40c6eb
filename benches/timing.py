"""Timing and what is said of it: each benchmark gives comparisons and series, printed alike."""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field

REPEATS = 7
ENOUGH_SECONDS = 0.2


def seconds_of(work: Callable[[], object], repeats: int = REPEATS) -> float:
    """Median time of one call, s; short calls are repeated within each sample."""
    work()
    begin = time.perf_counter()
    work()
    once = time.perf_counter() - begin
    calls = max(1, int(ENOUGH_SECONDS / repeats / max(once, 1e-9)))
    return statistics.median(_sample(work, calls) for _ in range(repeats))


def seconds_once(work: Callable[[], object]) -> float:
    """Time of a single call, s, for work that takes seconds."""
    return _sample(work, 1)


def _sample(work: Callable[[], object], calls: int) -> float:
    begin = time.perf_counter()
    for _ in range(calls):
        work()
    return (time.perf_counter() - begin) / calls


@dataclass(frozen=True)
class Comparison:
    """One piece of work, done by us and by a peer that was checked to give the same answer."""

    work: str
    peer: str
    ours_s: float
    peer_s: float
    target: float | None = None

    @property
    def ratio(self) -> float:
        """How many times faster we are."""
        return self.peer_s / self.ours_s

    @property
    def verdict(self) -> str:
        """Whether the ratio that was to be reached has been."""
        if self.target is None:
            return ""
        return "reached" if self.ratio >= self.target else "missed"


@dataclass(frozen=True)
class Series:
    """How the time of one piece of work grows: labels and seconds."""

    work: str
    labels: list[str]
    seconds: list[float]


@dataclass(frozen=True)
class Results:
    """What a benchmark found."""

    title: str
    comparisons: list[Comparison] = field(default_factory=list)
    series: list[Series] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


def duration(seconds: float) -> str:
    """Three significant digits with the unit that suits them."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def markdown(results: Results) -> str:
    """The results as Markdown, for the terminal and for the documentation."""
    lines = [f"## {results.title}", ""]
    if results.comparisons:
        lines += [
            "| work | truearm | peer | peer takes | ratio | to reach | |",
            "|---|---|---|---|---|---|---|",
            *map(_row, results.comparisons),
            "",
        ]
    for series in results.series:
        lines += [
            f"| {series.work} | {' | '.join(series.labels)} |",
            "|---" * (len(series.labels) + 1) + "|",
            f"| time | {' | '.join(map(duration, series.seconds))} |",
            "",
        ]
    return "\n".join([*lines, *(f"{remark}\n" for remark in results.remarks)])


def _row(row: Comparison) -> str:
    target = "" if row.target is None else f"{row.target:g}"
    return (
        f"| {row.work} | {duration(row.ours_s)} | {row.peer} | {duration(row.peer_s)} "
        f"| {row.ratio:.3g} | {target} | {row.verdict} |"
    )
