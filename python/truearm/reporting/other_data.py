"""Chapter: the same models judged on other measurements."""

from typing import Final

import numpy as np

from truearm.doubts.as_calibrated import NOT_AS_CALIBRATED
from truearm.doubts.at_once import STEP_KINDS
from truearm.doubts.few_judged import UNDECIDED
from truearm.doubts.of_results import OF_NO_USE
from truearm.evaluation import Evaluation
from truearm.judgement.validation import HEADINGS, STATISTICS
from truearm.reporting.advice import Advice
from truearm.reporting.facts import ROWS, Facts
from truearm.reporting.held_errors import cumulative, histogram
from truearm.reporting.numbers import fixed, short
from truearm.reporting.parts import Part, Section, Table
from truearm.solving import FEATURE_RANGE
from truearm.units import MM_PER_METRE

WORTH_A_LOOK: Final = (FEATURE_RANGE, *OF_NO_USE, UNDECIDED, NOT_AS_CALIBRATED, *STEP_KINDS)


def not_met(facts: Facts) -> list[Advice]:
    """What to do first where the calibration is of no use on the other measurements, features are beyond what
    was learnt, the arm is not as it was, or something slipped meanwhile; empty elsewhere.
    """
    notices = () if facts.other is None else facts.other.notices
    why = [notice.message for notice in notices if notice.kind in WORTH_A_LOOK]
    words = f"Of {', '.join(facts.other_names)}: {' '.join(why)}"
    return (
        [Advice("other_measurements", "Look at the other measurements first.", words, np.inf)] if why else []
    )


def _no_help(found: Evaluation) -> str:
    """A sentence, with a blank before it, where the calibration is of no use on the other measurements, or
    misses them for another reason.
    """
    kinds = {notice.kind for notice in found.notices}
    if kinds & set(OF_NO_USE):
        return " On these measurements the calibration does not help."
    if UNDECIDED in kinds:
        return " So few poses do not tell whether the calibration helps."
    if kinds & set(STEP_KINDS):
        return " What was measured changed meanwhile."
    return (
        " The arm, its tool or the set-up is not as it was calibrated." if NOT_AS_CALIBRATED in kinds else ""
    )


def other_data(facts: Facts) -> Section:
    """Errors on measurements of another day or set-up; nothing where there are none."""
    found = facts.other
    title = "On other measurements"
    if found is None:
        return Section(title, [])
    errors = found.errors
    rows = [[name, *(fixed(getattr(e.position, key)) for key in STATISTICS)] for name, e in errors.items()]
    now = errors[facts.best].position.mean
    here, there = short(now, facts.mean_mm())
    apart = facts.outliers.without
    verb = "was" if len(found.finds) == 1 else "were"
    how = (
        f"{' and '.join(found.finds).capitalize()} {verb} found from others, {found.frame_in_words}"
        if found.n_frame and found.finds
        else "Frame and tool were kept"
    )
    no_help = _no_help(found)
    table = Table(
        f"{', '.join(facts.other_names)}: {found.judged_in_words} judged, mm",
        ["model", *HEADINGS],
        rows,
        says=f"{how}. The mean error of the {facts.best} model is {here} mm here, and {there} mm on the "
        f"{facts.those_judged} of its own data{apart}.{no_help}",
        strong=[list(errors).index(facts.best)],
    )
    parts: list[Part] = [table]
    if found.rows is not None:
        lengths = {name: MM_PER_METRE * e.distance_m for name, e in found.rows.errors.items()}
        parts += [histogram(lengths, ROWS), cumulative(lengths, ROWS)]
    return Section(title, parts)
