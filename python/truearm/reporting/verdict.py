"""The first screen: what was calibrated, a verdict in one sentence, and the errors of the models."""

from typing import Final

import numpy as np

from truearm.doubts import helps
from truearm.models import NOMINAL
from truearm.reporting.facts import Facts
from truearm.reporting.floor import distance_at_floor_mm
from truearm.reporting.numbers import count_of, fixed, listed, short
from truearm.reporting.parts import Card, Head, Table, Tone
from truearm.validation import Statistics

GOOD: Final = 0.6
"""A calibration that leaves less than this part of the error is a good one."""
STATISTICS: Final = ("mean", "rms", "p95", "p99", "max")
HEADINGS: Final = ("mean", "RMS", "95 %", "99 %", "max")


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
        what = count_of(len(used.targets), "measured point") + " a pose"
    joints = count_of(len(facts.joints), "joint")
    rows = f"{validation.n_train} poses trained, {validation.n_holdout} were held out"
    setups = f"{count_of(len(calibration.groups), 'set-up')} ({', '.join(calibration.groups)})"
    return f"{calibration.robot.name}, {joints}; {setups}, {what}; {rows}; model: {facts.best}"


def verdict(facts: Facts) -> str:
    """What the calibration gained, on poses it has never seen."""
    validation = facts.calibration.validation
    before, after = (validation.holdout[name].position for name in (NOMINAL, facts.best))
    numbers = short(after.mean, after.max, before.mean, before.max)
    poses = count_of(validation.n_holdout, "pose")
    start = (
        f"On {poses} it has never seen, the arm now misses by {numbers[0]} mm on average and {numbers[1]} mm"
    )
    said = f"{start} at most; before {numbers[2]} and {numbers[3]}."
    if not helps(before.mean, after.mean):
        return f"{said} The calibration does not help: do not use it before the reason is found."
    return said


def tone(facts: Facts) -> Tone:
    """How good that is."""
    validation = facts.calibration.validation
    before, after = (validation.holdout[name].position.mean for name in (NOMINAL, facts.best))
    if not helps(before, after):
        return "bad"
    return "good" if after < GOOD * before else "fair"


def cards(facts: Facts) -> list[Card]:
    """The numbers that matter most."""
    validation, summary = facts.calibration.validation, facts.summary
    before, after = (validation.holdout[name].position for name in (NOMINAL, facts.best))
    mean, p95, was = short(after.mean, after.p95, before.mean)
    found = [
        Card(mean, "mm", f"mean error on unseen poses; before {was}", tone(facts)),
        Card(p95, "mm", "95 of 100 unseen poses are within"),
        Card(*_short_mm(distance_at_floor_mm(facts)), "mean error that noise alone would leave"),
    ]
    ratios = summary["error_to_repeatability"]
    if ratios is not None:
        found.append(Card(f"{ratios[facts.best]:.1f}", "times", "mean error over the stated repeatability"))
    if validation.coverage_95 is not None:
        share = f"{100 * validation.coverage_95:.1f}"
        found.append(Card(share, "%", "of held-out coordinates lie within their 95 % intervals"))
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
            rows.append([f"{name}, orientation in mrad", *_cells(found)])
            units = ["mm", "orientation in mrad"]
    judged = count_of(facts.calibration.validation.n_holdout, "held-out pose")
    return Table(
        f"Errors on {judged}, {listed(units)}",
        ["model", *HEADINGS],
        rows,
        says="Each model found frame and target on the same training poses.",
        strong=[list(errors).index(facts.best)],
    )


def _cells(found: Statistics) -> list[str]:
    values = [getattr(found, name) for name in STATISTICS]
    return [fixed(value) if np.isfinite(value) else "" for value in values]
