"""Chapter: the same models judged on other measurements."""

from truearm.doubts import OF_NO_USE
from truearm.errors import count_of
from truearm.evaluation import Evaluation
from truearm.reporting.facts import Facts
from truearm.reporting.held_errors import cumulative, histogram
from truearm.reporting.numbers import fixed, short
from truearm.reporting.parts import Part, Section, Table
from truearm.reporting.verdict import HEADINGS, STATISTICS
from truearm.units import MM_PER_METRE


def _no_help(found: Evaluation) -> str:
    """A warning where the calibration is of no use there."""
    if all(notice.kind not in OF_NO_USE for notice in found.notices):
        return ""
    return " On these measurements the calibration does not help."


def other_data(facts: Facts) -> Section:
    """Errors on measurements of another day or set-up; nothing where there are none."""
    found = facts.other
    title = "On other measurements"
    if found is None:
        return Section(title, [])
    errors = found.errors
    rows = [[name, *(fixed(getattr(e.position, key)) for key in STATISTICS)] for name, e in errors.items()]
    now = errors[facts.best].position.mean
    held = facts.calibration.validation.holdout[facts.best].position.mean
    here, there = short(now, held)
    how = (
        f"Frame and tool were found from {count_of(found.n_frame, 'other row')}"
        if found.n_frame
        else "Frame and tool were kept"
    )
    table = Table(
        f"{', '.join(facts.other_names)}: {count_of(found.n_judged, 'row')} judged, mm",
        ["model", *HEADINGS],
        rows,
        says=f"{how}. The mean error of the {facts.best} model is {here} mm here, and {there} mm on the "
        f"{facts.judged} poses of its own data.{_no_help(found)}",
        strong=[list(errors).index(facts.best)],
    )
    parts: list[Part] = [table]
    if found.rows is not None:
        lengths = {name: MM_PER_METRE * e.distance_m for name, e in found.rows.errors.items()}
        parts += [histogram(lengths), cumulative(lengths)]
    return Section(title, parts)
