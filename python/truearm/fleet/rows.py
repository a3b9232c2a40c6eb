"""One row an arm: what the table, the page and the files of the fleet say of it."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from truearm.errors import list_outliers
from truearm.fits.models import NOMINAL
from truearm.fleet.attention import ATTENTION, FAILED, GOOD, Reason, order, reasons
from truearm.fleet.fleet_file import Fleet
from truearm.fleet.keys import in_keys
from truearm.fleet.task import ArmMade
from truearm.workers import is_expected

DONE: Final = "done"
CSV_COLUMNS: Final = (
    "arm",
    "robot",
    "model",
    "rows",
    "held_out",
    "errors_of",
    "mean_mm",
    "p95_mm",
    "max_mm",
    "nominal_mean_mm",
    "nominal_max_mm",
    "noise_mm",
    "coverage_95",
    "outliers",
    "determined",
    "parameters",
)
CSV_DRIFT: Final = ("mean_mm", "max_mm", "std_mm", "share_beyond")

Row = dict[str, Any]


@dataclass(frozen=True)
class Judged:
    """An arm with its verdict.

    Attributes:
        row: Its results.
        reasons: Why it needs attention, the worst first.
    """

    row: Row
    reasons: tuple[Reason, ...]

    @property
    def verdict(self) -> str:
        """In one word: "good", "attention" or "failed"."""
        if self.row["status"] == FAILED:
            return FAILED
        return ATTENTION if self.reasons else GOOD

    @property
    def words(self) -> str:
        """In one sentence."""
        row = self.row
        if row["status"] == FAILED:
            return "It could not be calibrated."
        return (
            f"On {row['held_out']} held-out rows the mean {row['errors_of']} error is "
            f"{row['mean_mm']:.3f} mm and the largest {row['max_mm']:.3f} mm; with the nominal model they "
            f"are {row['nominal_mean_mm']:.3f} mm and {row['nominal_max_mm']:.3f} mm."
        )

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        attention = [{"kind": reason.kind, "words": reason.words} for reason in self.reasons]
        return {**self.row, "verdict": self.verdict, "words": self.words, "attention": attention}


def row_of_made(arm: str, made: ArmMade) -> Row:
    """The row of an arm that was calibrated."""
    summary = made.summary
    errors, before = summary["holdout"][made.model], summary["holdout"][NOMINAL]
    return {
        "arm": arm,
        "status": DONE,
        "robot": summary["robot"],
        "model": made.model,
        "rows": summary["n_train"] + summary["n_holdout"],
        "held_out": summary["n_holdout"],
        "errors_of": made.errors_of,
        **{key: errors[key] for key in ("mean_mm", "p95_mm", "max_mm")},
        "nominal_mean_mm": before["mean_mm"],
        "nominal_max_mm": before["max_mm"],
        "without_outliers_mm": made.means_mm[made.model],
        "nominal_without_outliers_mm": made.means_mm[NOMINAL],
        "noise_mm": summary["noise_mm"],
        "floor_mm": made.floor_mm,
        "coverage_95": summary["coverage_95"],
        "outliers": len(summary["outliers"]),
        "outliers_named": list_outliers(summary["outliers"], made.files),
        "determined": summary["identifiability"]["rank"],
        "parameters": summary["identifiability"]["parameters"],
        "drift": made.drift,
        "notices": [in_keys(notice["message"]) for notice in summary["notices"]],
        "undecided": in_keys(made.undecided),
        "grave": [in_keys(notice) for notice in made.grave],
    }


def row_of_failed(arm: str, error: Exception, earlier: Sequence[str] = ()) -> Row:
    """The row of an arm that could not be calibrated; `earlier` are names of results of an earlier run."""
    kind = type(error).__name__
    words = in_keys(str(error)) if is_expected(error) else f"{kind}: {error}"
    return {"arm": arm, "status": FAILED, "error": words, "kind": kind, "earlier": list(earlier)}


def judged(fleet: Fleet, rows: Sequence[Row]) -> list[Judged]:
    """All arms with their verdicts, those that need most attention first, then in the order of the file."""
    found = [Judged(row, tuple(reasons(row, rows, fleet.limits))) for row in rows]
    return sorted(found, key=lambda arm: order(arm.reasons))


def counts(arms: Sequence[Judged]) -> dict[str, int]:
    """How many arms there are of each verdict."""
    return {word: sum(arm.verdict == word for arm in arms) for word in (GOOD, ATTENTION, FAILED)}


def content(fleet: Fleet, arms: Sequence[Judged], version: str) -> dict[str, Any]:
    """The content of fleet.json."""
    return {
        "fleet": fleet.name,
        "version": version,
        "limits": fleet.limits.model_dump(),
        "counts": counts(arms),
        "arms": [arm.to_dict() for arm in arms],
    }


def table_of(arms: Sequence[Judged]) -> str:
    """The text of fleet.csv: a line an arm; drift and reasons behind the results."""
    lines = io.StringIO()
    writer = csv.writer(lines, lineterminator="\n")
    drift = [f"drift_{name}" for name in CSV_DRIFT]
    writer.writerow([*CSV_COLUMNS, *drift, "moved", "verdict", "attention"])
    for arm in arms:
        changed: Mapping[str, Any] = arm.row.get("drift") or {}
        moved = " ".join(entry["name"] for entry in changed.get("moved", ()))
        words = " ".join(reason.words for reason in arm.reasons)
        values = [arm.row.get(name) for name in CSV_COLUMNS] + [changed.get(name) for name in CSV_DRIFT]
        writer.writerow(["" if value is None else value for value in values] + [moved, arm.verdict, words])
    return lines.getvalue()
