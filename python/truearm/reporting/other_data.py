"""Chapter: the same models judged on other measurements."""

from truearm.reporting.facts import Facts
from truearm.reporting.held_errors import cumulative, histogram
from truearm.reporting.numbers import count_of, fixed, short
from truearm.reporting.parts import Part, Section, Table
from truearm.reporting.verdict import HEADINGS, STATISTICS
from truearm.units import MM_PER_METRE


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
        f"{count_of(found.n_frame, 'row')} found frame and tool"
        if found.n_frame
        else "frame and tool were kept"
    )
    table = Table(
        f"{', '.join(facts.other_names)}: {count_of(found.n_judged, 'row')} judged, mm",
        ["model", *HEADINGS],
        rows,
        says=f"{how}. The {facts.best} model misses by {here} mm on average, {there} mm on the poses held "
        "out of its own data.",
        strong=[list(errors).index(facts.best)],
    )
    parts: list[Part] = [table]
    if found.rows is not None:
        lengths = {name: MM_PER_METRE * e.distance_m for name, e in found.rows.errors.items()}
        parts += [histogram(lengths), cumulative(lengths)]
    return Section(title, parts)
