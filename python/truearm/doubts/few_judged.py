"""Whether so few poses were judged that they do not tell if a calibration helps."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from truearm.doubts.of_results import LARGE_MM, NO_HELP, SURE, WOULD_FIT, these_first
from truearm.doubts.outliers import EXCHANGED, NO_OUTLIERS, STATED_TOO_LARGE, Outliers
from truearm.errors import Notice, count_of
from truearm.fits.models import NOMINAL
from truearm.judgement.held_rows import HeldRows
from truearm.judgement.validation import FEW_HELD
from truearm.lengths import length_mm

if TYPE_CHECKING:
    from truearm.calibration import Calibration

UNDECIDED: Final = "undecided"
KNOWN_REASONS: Final = {*EXCHANGED, *WOULD_FIT, STATED_TOO_LARGE}
"""Notices of why a calibration does not help: more poses of the same kind would not."""


@dataclass(frozen=True, eq=False)
class FewJudged:
    """Rows that were judged, of which a calibration that does not help may be a matter of chance.

    Attributes:
        held: The rows with their errors; None where they are not known, which leaves nothing to chance.
        poses: How many poses they are of.
        which: What they are called: "held-out", "left-out" or "judged".
        best: Name of the model that predicts.
        outliers: Rows that are far off, if any are known; they take no part.
    """

    held: HeldRows | None
    poses: int
    which: str
    best: str
    outliers: Outliers = NO_OUTLIERS

    def may_be_chance(self, after_mm: float) -> bool:
        """Whether other poses may as well show that a calibration helps, which leaves `after_mm` on average.

        Errors of the two models differ by less than two standard errors of the mean difference over poses.
        Gross errors are no matter of poses.
        """
        if self.held is None or self.poses >= FEW_HELD or after_mm >= LARGE_MM:
            return False
        ahead, error = self.held.lead_mm(NOMINAL, self.best, self.outliers.entries)
        return abs(ahead) <= SURE * error

    @property
    def words(self) -> str:
        """What is to be said then: "5 held-out poses do not tell whether the calibration helps"."""
        do = "does" if self.poses == 1 else "do"
        return f"{count_of(self.poses, f'{self.which} pose')} {do} not tell whether the calibration helps"

    def told(self, notices: Sequence[Notice], before_mm: float, after_mm: float, what: str) -> list[Notice]:
        """The notices, the one that a calibration does not help replaced where that may be chance.

        Args:
            notices: What speaks against the calibration; where they name a reason, it is not chance.
            before_mm: Error of the nominal model.
            after_mm: That of its own.
            what: What these are, such as "mean error".
        """
        kinds = {notice.kind for notice in notices}
        if NO_HELP not in kinds or kinds & KNOWN_REASONS or not self.may_be_chance(after_mm):
            return list(notices)
        first = f" {these_first(self.outliers)}" if self.outliers.named else ""
        text = (
            f"{self.words}: the {what}{self.outliers.without} is {length_mm(after_mm, 4)}, that of the "
            f"nominal model {length_mm(before_mm, 4)}, and they differ by no more than chance may make of so "
            f"few. Measure more poses before it is used.{first}"
        )
        return [Notice(UNDECIDED, text) if notice.kind == NO_HELP else notice for notice in notices]


def is_of_a_range(calibration: "Calibration") -> bool:
    """Whether a range of a joint was held out, so that no draw decided which poses were judged."""
    return calibration.options.split.holdout_range is not None and not calibration.validation.left_out


def few_in_words(calibration: "Calibration") -> str:
    """What is said where so few were judged that others would give other errors; empty elsewhere."""
    validation = calibration.validation
    if not (validation.few and is_of_a_range(calibration)):
        return validation.few
    return (
        f"The errors above come from {validation.poses_judged}, which --holdout-range "
        f"{calibration.options.split.holdout_range} holds out: a larger share would judge it on more."
    )
