"""Chapter: what an update found, and the errors of the calibration before it."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from truearm.errors import count_of
from truearm.judgement.validation import HEADINGS, STATISTICS, Validation
from truearm.reporting.facts import Facts
from truearm.reporting.numbers import fixed, listed, probability, signed
from truearm.reporting.parts import Part, Section, Table, Text
from truearm.update_words import (
    CHANGED_MEANWHILE,
    follows_words,
    found_otherwise,
    motion_name,
    of_known_world,
    untested_joints,
    untested_words,
)

VERDICTS: Final = {
    "holds": "No significant change was found.",
    "moved": "{tested} changed; all else still fits.",
    "field": "{estimated} do not explain what was measured: the calibration itself no longer fits.",
}


def since_update(facts: Facts) -> Section:
    """What changed, and how it was judged; nothing where there was no update."""
    title, told = "The update", facts.update
    if told is None:
        return Section(title, [])
    parts: list[Part] = [
        Text(_overall(facts, told)),
        _offsets(told, facts.calibration.groups),
        *_motions(told),
        _errors(told),
    ]
    return Section(title, [*parts, *_former(told, facts.best)])


def _overall(facts: Facts, told: Mapping[str, Any]) -> str:
    verdicts = CHANGED_MEANWHILE if facts.changed_meanwhile else VERDICTS
    tested, estimated = listed(told["tested"], "or").capitalize(), listed(told["estimated"]).capitalize()
    otherwise = "" if facts.changed_meanwhile else found_otherwise(told, tested)
    words = otherwise or verdicts[told["verdict"]].format(tested=tested, estimated=estimated)
    outliers = count_of(len(told["outliers"]), "row")
    left = f", {outliers} of them left out as outliers," if told["outliers"] else ""
    if told["verdict"] == "field" and not facts.changed_meanwhile and (base := of_known_world(told)):
        words = f"{words} {base}"
    if untested := untested_joints(told):
        words = f"{words} {untested}"
    change, rest = (probability(told[test]["p"]) for test in ("changed", "rest"))
    return (
        f"{words} From {count_of(told['n_poses'], 'pose')}{left} the update estimated "
        f"{listed(told['estimated'])}; all other parameters, constant and variable, are those of the "
        f"calibration before. Test for a change of {listed(told['tested'], 'or')}: p {change}. Test of the "
        f"residuals that remain: p {rest}. The two share the level of significance, "
        f"{100.0 * told['level']:g} %: each counts where p is below {told['level'] / 2.0:g}."
    )


def _offsets(told: Mapping[str, Any], groups: Sequence[str]) -> Table:
    rows = []
    for entry in told["offsets"]:
        name = f"joint {entry['joint']}"
        if not entry["told"]:
            why = f"confounded with the {entry['confounded']}" if entry["confounded"] else "not determined"
            rows.append([name, "kept", "", "", why])
            continue
        change = f"{signed(entry['change'])} {entry['unit']}"
        rows.append(
            [
                name,
                change,
                f"{entry['std']:.4f}",
                probability(entry["p"]),
                "significant" if entry["moved"] else "",
            ]
        )
    columns = ["", "change of offset", "standard error", "p", ""]
    follow = [entry for entry in told["offsets"] if entry.get("follows") is not None]
    says = " ".join(
        [untested_words(told, groups), *(follows_words(entry["joint"], entry["follows"]) for entry in follow)]
    ).strip()
    return Table("Joint offsets", columns, rows, says=says, left=(0, 4))


def _motions(told: Mapping[str, Any]) -> list[Table]:
    """Frames or base, and tools, as far as the calibration before knew them."""
    rows = [
        [motion_name(motion.get("part", name), motion["group"]), *_motion(motion)]
        for name, key in (("frame", "frames"), ("tool", "tools"))
        for motion in told[key]
    ]
    if not rows:
        return []
    columns = ["", "shift x, y, z, mm", "rotation x, y, z, deg", "p", ""]
    return [Table("Frame and tool, compared with the calibration before", columns, rows, left=(0, 1, 2, 4))]


def _motion(motion: Mapping[str, Any]) -> list[str]:
    if motion["kept"]:
        return ["", "", "", "kept"]
    shifts = "; ".join(", ".join(f"{value:+.3f}" for value in shift) for shift in motion["shift_mm"])
    turn = "" if motion["turn_deg"] is None else ", ".join(signed(value) for value in motion["turn_deg"])
    if motion["p"] is None:
        return [shifts, turn, "", "found anew, not tested"]
    return [shifts, turn, probability(motion["p"]), "significant" if motion["moved"] else ""]


def _errors(told: Mapping[str, Any]) -> Table:
    """The calibration before and the updated one at the poses of the update."""
    rows = [
        [name, *_cells(told[key]), *_cells(told[key], "mrad")]
        for name, key in (("before the update", "before"), ("updated", "after"))
    ]
    turned = [f"{name}, mrad" for name in HEADINGS] if "mean_mrad" in told["after"] else []
    return Table(
        "Errors at left-out poses, mm",
        ["calibration", *HEADINGS, *turned],
        rows,
        says="Each pose is predicted from the others. For the calibration before, they find only what is not "
        "tested for a change.",
        strong=[1],
    )


def _former(told: Mapping[str, Any], best: str) -> list[Table]:
    """Validation of the calibration before, on its own data."""
    former = told["former"]
    rows = [[name, *_cells(errors), *_cells(errors, "mrad")] for name, errors in former["holdout"].items()]
    turned = [f"{name}, mrad" for name in HEADINGS] if "mean_mrad" in former["holdout"][best] else []
    what = Validation.from_dict(former).poses_judged
    table = Table(
        f"Errors of the calibration before, on {what} of its own data, mm",
        ["model", *HEADINGS, *turned],
        rows,
        says="These are errors of the arm as it was then, all over the poses of the calibration before.",
        strong=[list(former["holdout"]).index(best)],
    )
    return [table]


def _cells(errors: Mapping[str, float], unit: str = "mm") -> list[str]:
    return [fixed(errors[f"{key}_{unit}"]) for key in STATISTICS if f"{key}_{unit}" in errors]
