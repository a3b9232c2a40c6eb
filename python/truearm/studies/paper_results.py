"""The whole study of the paper: results, page and pictures."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from truearm.stages import Stages, no_stages
from truearm.studies.claims import judged
from truearm.studies.division_picture import save_division
from truearm.studies.experiment import Plan, conduct
from truearm.studies.panels import save_panels
from truearm.studies.paper import Drawn, run
from truearm.studies.paper_page import page
from truearm.studies.statements import checked

PICTURED: dict[str, str] = {"figure6": "division_joint", "figure7": "division_sphere"}


@dataclass(frozen=True, eq=False)
class PaperStudy:
    """What the study found.

    Attributes:
        result: The content of paper.json.
        drawn: What is drawn, of the first seed.
    """

    result: dict[str, Any]
    drawn: dict[str, Drawn]

    @property
    def page(self) -> str:
        """The text of paper.md."""
        return page(self.result)


def conduct_study(
    seeds: Sequence[int],
    figures: Sequence[str],
    stages: Stages = no_stages,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
) -> PaperStudy:
    """Run figures over seeds, and hold them against the paper's statements and the figures to reach.

    Arguments and errors are those of :func:`truearm.studies.paper.run`.
    """
    result, drawn = run(seeds, figures, stages, scheduler=scheduler, workers=workers)
    each = result.pop("each_seed")
    result |= {"claims": judged(each), "statements": checked(result)}
    return PaperStudy(result, drawn)


def save_pictures(study: PaperStudy, directory: Path) -> list[Path]:
    """Draw panels and divisions into a directory; the files."""
    files = save_panels(study.drawn, directory)
    for name, stem in PICTURED.items():
        if name in study.drawn:
            made = study.drawn[name].made
            stopped = conduct(made.arm.seed, Plan(made.plan.kind, None, reading=made.plan.reading))
            files += save_division(stopped, made, directory / stem)
    return files
