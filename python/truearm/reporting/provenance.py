"""Chapter: where the numbers come from, so that the same data gives them again on any machine."""

import os
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from truearm.options import Options
from truearm.reporting.facts import Facts
from truearm.reporting.numbers import fixed
from truearm.reporting.parts import Part, Section, Table, Text


def provenance(facts: Facts) -> Section:
    """Data, options, version, seed and time."""
    calibration = facts.calibration
    parts: list[Part] = [_origin(facts), _options(calibration.options), *_outliers(facts)]
    parts += [Text(f"Notice: {notice}") for notice in facts.summary["notices"]]
    return Section("Provenance", parts)


def _origin(facts: Facts) -> Table:
    calibration, summary = facts.calibration, facts.summary
    robot, validation = calibration.robot, calibration.validation
    files = [] if calibration.rows is None else [Path(file).name for file in calibration.rows.data.files]
    fitted = summary["n_fitted"]
    rows = [
        ["arm", f"{robot.name}; {robot.source}"],
        ["measurements", ", ".join(files) or "left out of the file"],
        ["their SHA-256", summary["data_sha256"]],
        ["rows", f"{validation.n_train} trained, {validation.n_holdout} held out" + _fitted(fitted)],
        ["seed of the split", str(summary["options"]["seed"])],
        ["truearm", summary["version"]],
    ]
    if summary["seconds"]:
        times = ", ".join(f"{name} {seconds:.1f} s" for name, seconds in summary["seconds"].items())
        rows.append(["time of the fits", times])
    return Table("Origin", ["", "this report"], [*rows, ["page made", _now()]], left=(0, 1))


def _fitted(fitted: int | None) -> str:
    return "" if fitted is None else f"; the calibration in the file is fitted to {fitted}"


def _now() -> str:
    """The time in UTC; SOURCE_DATE_EPOCH sets it, for pages that are the same byte for byte."""
    stated = os.environ.get("SOURCE_DATE_EPOCH", "")
    moment = datetime.fromtimestamp(int(stated), UTC) if stated.isdigit() else datetime.now(UTC)
    return f"{moment:%Y-%m-%d %H:%M} UTC"


def _options(options: Options) -> Table:
    """All options, those that are not the defaults first."""
    used, usual = options.to_dict(), Options().to_dict()
    changed = [name for name in used if used[name] != usual[name]]
    names = [*changed, *(name for name in used if name not in changed)]
    return Table(
        "Options",
        ["option", "value"],
        [[name, _words(used[name])] for name in names],
        says=f"Those that differ from the defaults come first: {', '.join(changed) or 'none does'}.",
        left=(0, 1),
        strong=range(len(changed)),
    )


def _words(value: Any) -> str:  # noqa: ANN401
    if value is None:
        return "none"
    if isinstance(value, list):
        return ", ".join(map(str, value)) or "none"
    return str(value)


def _outliers(facts: Facts) -> list[Table]:
    """All outliers, the worst first."""
    found = facts.summary["outliers"]
    if not found:
        return []
    rows = [
        [str(entry["row"]), Path(entry["file"]).name, fixed(entry["distance_mm"]), f"{entry['score']:.1f}"]
        for entry in found
    ]
    fate = "taken out of" if facts.calibration.variable is not None else "kept in"
    table = Table(
        "Outliers",
        ["row", "file", "distance, mm", "score"],
        rows,
        says=f"They were {fate} the fit, never out of the held-out errors. A score above one is beyond "
        "belief.",
        left=(0, 1),
    )
    return [table]
