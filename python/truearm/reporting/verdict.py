"""The first screen: what was calibrated, a verdict in one sentence, and the errors of the models."""

from typing import Final

import numpy as np

from truearm.doubts.of_results import NEAR_MM, gains_nothing, helps
from truearm.errors import count_of
from truearm.fits.models import NOMINAL, leaves_noise
from truearm.judgement.validation import HEADINGS, STATISTICS, Statistics
from truearm.outlier_fate import taken_out
from truearm.reporting.facts import Facts
from truearm.reporting.numbers import fixed, listed, short
from truearm.reporting.parts import Card, Head, Table, Tone
from truearm.update_words import cause_words

GOOD: Final = 0.6
"""A calibration that leaves less than this part of the error is a good one."""


def head(facts: Facts, advice: list[tuple[str, str]]) -> Head:
    """The first screen of a report."""
    return Head(
        title=f"{facts.calibration.robot.name}: calibration report",
        about=about(facts),
        verdict=verdict(facts),
        tone=tone(facts),
        cards=cards(facts),
        table=table(facts),
        advice=advice,
    )


def about(facts: Facts) -> str:
    """The arm and the data in one line."""
    calibration, validation = facts.calibration, facts.calibration.validation
    used = calibration.selection
    if used.distances:
        what = "distances"
    elif used.orientation:
        what = "position and orientation"
    else:
        what = count_of(len(used.targets), "measured point") + " per pose"
    joints = count_of(len(facts.joints), "joint")
    if facts.update is not None:
        rows = f"updated with {count_of(validation.n_train, 'pose')}"
    else:
        rows = f"{validation.poses_trained}, {facts.poses_judged}"
        planned = count_of(validation.n_planned, "row")
        rows += f" ({planned} as planned)" if validation.n_planned else ""
    setups = f"{count_of(len(calibration.groups), 'set-up')} ({', '.join(calibration.groups)})"
    return f"{calibration.robot.name}, {joints}; {setups}, {what}; {rows}; {facts.best} model"


def verdict(facts: Facts) -> str:
    """What the calibration gained, on poses that took no part in what is judged there."""
    validation = facts.calibration.validation
    nominal, after = (validation.holdout[name].position for name in (NOMINAL, facts.best))
    before = nominal.mean, nominal.max
    if facts.update is not None:
        before = facts.update["before"]["mean_mm"], facts.update["before"]["max_mm"]
    numbers = short(after.mean, after.max, *before)
    poses = facts.poses_judged + (", each predicted from the others," if validation.left_out else "")
    said = (
        f"On {poses} the mean {facts.error} is {numbers[0]} mm and the largest {numbers[1]} mm; "
        f"{_former(facts)} they are {numbers[2]} mm and {numbers[3]} mm.{_without_outliers(facts)}"
    )
    if facts.is_spoilt_by_rows:
        return f"{said} Single rows are far off: correct them or leave them out, and calibrate again."
    if facts.gains_nothing:
        if facts.mean_mm(NOMINAL) >= NEAR_MM and not leaves_noise(facts.best):
            start, why = gains_nothing(facts.best)
            return f"{said} {start}. {why}"
        return f"{said} There is nothing to gain: the arm is where its table has it, as far as they tell."
    if facts.undecided:
        return f"{said} So few do not tell whether the calibration helps: measure more poses."
    if facts.is_of_no_help:
        return f"{said} The calibration does not help: do not use it until the reason is found."
    return f"{said}{_changed(facts)}"


def _changed(facts: Facts) -> str:
    """What of the measurements or of the arm is not as it was, with a blank before it."""
    if facts.changed_meanwhile:
        return " What was measured changed meanwhile: put that right first."
    if facts.update is not None and facts.update["verdict"] == "field":
        return " The calibration no longer fits the arm: measure again and calibrate."
    found = "" if facts.update is None else cause_words(facts.update)
    return f" {found}" if found else ""


def _is_otherwise(facts: Facts) -> bool:
    """Whether the update found another scale or load, which the calibration does not have."""
    cause = None if facts.update is None else facts.update.get("cause")
    return cause is not None and not cause["taken"]


def _without_outliers(facts: Facts) -> str:
    """The errors without outliers among the judged poses; empty where none is, or nobody knows which are."""
    if not facts.leaves_outliers_out:
        return ""
    kept = [facts.kept_errors_mm(name) for name in (facts.best, NOMINAL)]
    numbers = short(*(float(found(errors)) for errors in kept for found in (np.nanmean, np.nanmax)))
    return (
        f" Without the outliers among them, {facts.outliers.judged}, they are {numbers[0]} mm and "
        f"{numbers[1]} mm; {_former(facts)} {numbers[2]} mm and {numbers[3]} mm.{_turned_without(facts)}"
    )


def _turned_without(facts: Facts) -> str:
    """The orientation errors without the outliers; empty where none was measured."""
    if not facts.outliers.means_mrad:
        return ""
    mean, former = short(*_turns_mrad(facts))
    return f" The mean orientation error without them is {mean} mrad, {_former(facts)} {former} mrad."


def _turns_mrad(facts: Facts) -> tuple[float, float]:
    """Mean orientation errors without the outliers, mrad: of the model that predicts, and nominally."""
    turns = facts.outliers.means_mrad
    return turns[facts.best], turns[NOMINAL]


def _former(facts: Facts) -> str:
    """What the errors are compared with."""
    return "with the nominal model" if facts.update is None else "with the calibration before the update"


def tone(facts: Facts) -> Tone:
    """How good that is."""
    before, after = facts.mean_mm(NOMINAL), facts.mean_mm()
    if facts.undecided:
        return "fair"
    if facts.is_spoilt_by_rows or not helps(before, after):
        return "bad"
    if facts.update is not None and facts.update["verdict"] == "field":
        return "bad"
    doubted = facts.mostly_refused or facts.changed_meanwhile or _is_otherwise(facts)
    return "good" if after < GOOD * before and not doubted else "fair"


def cards(facts: Facts) -> list[Card]:
    """The numbers that matter most."""
    validation, summary = facts.calibration.validation, facts.summary
    before, after = (validation.holdout[name].position for name in (NOMINAL, facts.best))
    was = before.mean if facts.update is None else facts.update["before"]["mean_mm"]
    mean, p95, former = short(after.mean, after.p95, was)
    found = [
        Card(mean, "mm", f"mean error on {facts.those_judged}; {_former(facts)} {former}", tone(facts)),
        *_card_without_outliers(facts),
    ]
    if several := validation.n_holdout_poses > 1:
        found.append(Card(p95, "mm", f"95 % of the {facts.those_judged} have a smaller error"))
    tells_noise = not (facts.is_of_no_help or facts.changed_meanwhile)
    if leaves_noise(facts.best) and tells_noise:
        floor = facts.floor_mm
        together = " on all targets together" if len(facts.calibration.selection.targets) > 1 else ""
        of = (
            "of what the model does not explain"
            if facts.leaves_more_than_noise
            else "that noise alone would leave"
        )
        found.append(Card(*_short_mm(floor), f"mean error {of}{together}"))
    ratios = summary["error_to_repeatability"]
    if ratios is not None:
        found.append(Card(f"{ratios[facts.best]:.1f}", "times", "the stated repeatability: the mean error"))
    if validation.coverage_95 is not None and tells_noise and several:
        share = f"{100 * validation.coverage_95:.1f}"
        found.append(Card(share, "%", "of the held-out coordinates lie within their 95 % intervals"))
    return found


def _card_without_outliers(facts: Facts) -> list[Card]:
    if not facts.leaves_outliers_out:
        return []
    mean, former = short(facts.mean_mm(), facts.mean_mm(NOMINAL))
    without = f"without the outliers among them; {_former(facts)}"
    found = [Card(mean, "mm", f"mean error {without} {former}")]
    if facts.outliers.means_mrad:
        mean, former = short(*_turns_mrad(facts))
        found.append(Card(mean, "mrad", f"mean orientation error {without} {former}"))
    return found


def _short_mm(value: float) -> tuple[str, str]:
    return short(value)[0], "mm"


def table(facts: Facts) -> Table:
    """Errors of all models: position, and orientation where it was measured."""
    errors = facts.calibration.validation.holdout
    rows = [[name, *_cells(found.position)] for name, found in errors.items()]
    units = ["mm"]
    turned = {name: found.orientation for name, found in errors.items()}
    for name, found in turned.items():
        if found is not None:
            rows.append([f"{name}, mrad", *_cells(found)])
            units = ["mm", "orientation in mrad"]
    of = "Distance errors" if facts.calibration.selection.distances else "Errors"
    return Table(
        f"{of} on {facts.poses_judged}, {listed(units)}",
        ["model", *HEADINGS],
        rows,
        says=_found_from(facts),
        strong=[list(errors).index(facts.best)],
    )


def _found_from(facts: Facts) -> str:
    """What each model had fitted, and to which poses."""
    if facts.calibration.validation.left_out:
        return (
            "Each pose is predicted from the others: with every model they give frame and target, and the "
            "joint offsets of all but the nominal one."
        )
    drift = facts.calibration.validation.drift
    moved = "" if drift is None else f" {drift.words}"
    return f"Frame and target of each model were fitted to the same training poses.{moved}{_outliers(facts)}"


def _outliers(facts: Facts) -> str:
    """Which fits are without the outliers; empty where none was taken out."""
    if not taken_out(facts.calibration):
        return ""
    return (
        " Outliers were taken out of the fit of what varies, and of constants, frame and target where they "
        "bend these; the errors hold those that were held out."
    )


def _cells(found: Statistics) -> list[str]:
    values = [getattr(found, name) for name in STATISTICS]
    return [fixed(value) if np.isfinite(value) else "" for value in values]
