"""Chapter: where the numbers come from, so that the same data gives them again on any machine."""

import os
from datetime import UTC, datetime
from typing import Any

from truearm.defaults import NO_DRIFT
from truearm.errors import count_of, short_names
from truearm.fits.models import VARIABLE
from truearm.fits.options import CalibrationOptions
from truearm.outlier_fate import fate_of_outliers, taken_out
from truearm.reporting.facts import Facts
from truearm.reporting.numbers import fixed
from truearm.reporting.option_words import NOT_LOOKED_FOR, in_words, shown_options
from truearm.reporting.parts import Part, Section, Table, Text


def provenance(facts: Facts) -> Section:
    """Data, options, version, seed and time."""
    parts: list[Part] = [_origin(facts), _options(facts), *_outliers(facts)]
    parts += [Text(f"Notice: {notice['message']}") for notice in facts.summary["notices"]]
    return Section("Provenance", parts)


def _origin(facts: Facts) -> Table:
    calibration, summary = facts.calibration, facts.summary
    robot = calibration.robot
    fitted = summary["n_fitted"]
    rows = [
        ["arm", robot.name],
        *([["source of the nominal parameters", robot.source]] if robot.source else []),
        ["measurements", ", ".join(short_names(facts.files).values()) or "left out of the file"],
        ["SHA-256 of the measurements", summary["data_sha256"]],
        ["rows", _rows(facts, fitted)],
        ["truearm", summary["version"]],
    ]
    if summary["seconds"]:
        times = ", ".join(f"{name} {seconds:.1f} s" for name, seconds in summary["seconds"].items())
        rows.append(["duration of the fits", times])
    return Table("Origin", ["", "value"], [*rows, ["report written", _now()]], left=(0, 1))


def _rows(facts: Facts, fitted: int | None) -> str:
    """How many rows had which part."""
    validation = facts.calibration.validation
    if facts.update is not None:
        return f"updated with {validation.n_train}; learned from those of the calibration before the update"
    said = f"{count_of(validation.n_train, 'training row')}, {validation.n_holdout} held out"
    if fitted is None:
        return said
    without = taken_out(facts.calibration)
    but = f" but for {count_of(without, 'outlier')}" if without else ""
    return f"{said}; the calibration in the file is fitted to {fitted}{but}"


def _now() -> str:
    """The time in UTC; SOURCE_DATE_EPOCH sets it, for pages that are the same byte for byte."""
    stated = os.environ.get("SOURCE_DATE_EPOCH", "")
    moment = datetime.fromtimestamp(int(stated), UTC) if stated.isdigit() else datetime.now(UTC)
    return f"{moment:%Y-%m-%d %H:%M} UTC"


def _options(facts: Facts) -> Table:
    """The options that bear on the model, those that are not the defaults first."""
    options = facts.calibration.options
    used, usual = options.to_dict(), CalibrationOptions().to_dict()
    words = shown_options(options.model)
    changed = [name for name in words if used[name] != usual[name]]
    names = [*changed, *(name for name in words if name not in changed)]
    says = (
        "Options that differ from the defaults come first, in bold." if changed else "All are the defaults."
    )
    return Table(
        "Options",
        ["option", "value"],
        [[words[name], _value(facts, name, used[name])] for name in names],
        says=says,
        left=(0, 1),
        strong=range(len(changed)),
    )


def _value(facts: Facts, name: str, value: Any) -> str:  # noqa: ANN401
    """The value of an option; of rows held out whether they were drawn or planned, of drift whether the model
    lets it be looked for.
    """
    former = facts.calibration.validation.to_dict() if facts.update is None else facts.update["former"]
    planned = former.get("n_planned") or 0
    if name == "by_purpose" and value:
        return f"yes, {count_of(planned, 'row')}" if planned else "none was"
    if name == "holdout" and planned:
        whole = planned >= former["n_holdout"]
        return "not drawn" if whole else f"{value}, drawn in files without such poses"
    if name == "drift" and value != NO_DRIFT and facts.calibration.options.model != VARIABLE:
        return NOT_LOOKED_FOR
    return in_words(name, value)


def _outliers(facts: Facts) -> list[Table]:
    """All outliers, the worst first."""
    found = facts.summary["outliers"]
    if not found:
        return []
    names = short_names(facts.files)
    turned = any("turn_mrad" in entry for entry in found)
    rows = [
        [
            str(entry["row"]),
            names[entry["file"]],
            fixed(entry["distance_mm"]),
            *([fixed(entry["turn_mrad"]) if "turn_mrad" in entry else ""] if turned else []),
            f"{entry['score']:.1f}",
        ]
        for entry in found
    ]
    fate = fate_of_outliers(facts.calibration)
    table = Table(
        "Outliers",
        ["row", "file", "distance, mm", *(["turn, mrad"] if turned else []), "score"],
        rows,
        says=f"They were {fate}; the held-out errors include them. Scores are squared standardised "
        "residuals over the limit: above one is an outlier.",
        left=(0, 1),
    )
    return [table]
