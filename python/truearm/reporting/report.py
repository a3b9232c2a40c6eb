"""The report of a calibration: what its chapters are, and the page."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from truearm.calibration import Calibration
from truearm.evaluation import Evaluation
from truearm.reporting.advice import MOST, Advice, advise
from truearm.reporting.corrections import compensation
from truearm.reporting.facts import Facts
from truearm.reporting.held_errors import held_errors
from truearm.reporting.known import Known, known
from truearm.reporting.other_data import not_met, other_data
from truearm.reporting.page import page
from truearm.reporting.parameters_chapter import parameters
from truearm.reporting.parts import Figure, Section
from truearm.reporting.provenance import provenance
from truearm.reporting.quiver import quiver
from truearm.reporting.repeats import repeats
from truearm.reporting.since_update import since_update
from truearm.reporting.trust import trust
from truearm.reporting.varying import varying
from truearm.reporting.verdict import head, verdict
from truearm.stages import Stages, no_stages

Chapter = tuple[str, Callable[[Facts], Section]]


@dataclass(frozen=True)
class Report:
    """A report.

    Attributes:
        html: The page.
        verdict: Its first sentence.
        advice: What would help most next.
        figures: Title and sentence of each figure.
        other: Errors on the other measurements, with their "files"; None without any.
    """

    html: str
    verdict: str
    advice: tuple[Advice, ...]
    figures: tuple[tuple[str, str], ...]
    other: Mapping[str, Any] | None = None

    def to_dict(self) -> dict[str, Any]:
        """JSON values of all but the page."""
        return {
            "verdict": self.verdict,
            "advice": [
                {"kind": advice.kind, "words": f"{advice.name} {advice.words}"} for advice in self.advice
            ],
            "figures": [{"title": title, "says": says} for title, says in self.figures],
            "other": None if self.other is None else dict(self.other),
        }


def report(
    calibration: Calibration,
    other: Evaluation | None = None,
    *,
    other_names: tuple[str, ...] = (),
    stages: Stages = no_stages,
) -> Report:
    """The report of a calibration, one HTML page that needs nothing else.

    Args:
        calibration: What to report.
        other: Its errors on other measurements, which get a chapter of their own.
        other_names: Names of these.
        stages: Told what is being done.
    """
    facts = Facts(calibration, other, other_names)
    with stages("working out standard deviations"):
        certain = known(facts)
    advice = (*not_met(facts), *advise(facts, certain))[:MOST]
    sections: list[Section] = []
    for name, chapter in _chapters(certain):
        with stages(f"writing the report: {name}"):
            sections.append(chapter(facts))
    with stages("writing the report: page"):
        first = head(facts, [(entry.name, entry.words) for entry in advice])
        html = page(first, sections, foot=f"Made by truearm {calibration.version}.")
    figures = [part for section in sections for part in section.parts if isinstance(part, Figure)]
    says = tuple((figure.title, figure.says) for figure in figures)
    told = None if other is None else {"files": list(other_names), **other.to_dict()}
    return Report(html, verdict(facts), advice, says, told)


def _chapters(certain: Known | None) -> list[Chapter]:
    """What each chapter is about and what makes it, in their order."""
    return [
        ("the update", since_update),
        ("errors", _errors),
        ("other measurements", other_data),
        ("parameters", parameters),
        ("what varies", varying),
        ("where to trust it", lambda facts: trust(facts, certain)),
        ("repeated poses", repeats),
        ("compensation", compensation),
        ("provenance", provenance),
    ]


def _errors(facts: Facts) -> Section:
    """The chapter of errors with arrows in space behind its distributions."""
    section, figure = held_errors(facts), quiver(facts)
    if figure is None:
        return section
    parts = list(section.parts)
    return Section(section.title, [*parts[:2], figure, *parts[2:]])
