"""Outliers of a calibration, and what its models leave of the judged rows without them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

from truearm.errors import list_outliers
from truearm.judgement.validation import Validation
from truearm.outlier_fate import fate_of_outliers

if TYPE_CHECKING:
    from truearm.calibration import Calibration

ROWS_EXCHANGED: Final = "rows_exchanged"
TARGETS_EXCHANGED: Final = "targets_exchanged"
STATED_TOO_LARGE: Final = "stated_too_large"
EXCHANGED: Final = (ROWS_EXCHANGED, TARGETS_EXCHANGED)


@dataclass(frozen=True)
class Outliers:
    """Rows that are far off.

    Attributes:
        named: Which they are, in words.
        means_mm: Mean errors of the models on the judged rows without them; empty where none is judged.
        judged: Which of them are judged, in words.
        entries: Each with file, row and distance_mm.
        means_mrad: As means_mm, of the orientation; empty where it was not fitted.
        fate: What became of them in the fits, as fate_of_outliers has it.
        exchanged: Whether some were found to be exchanged, which notices name.
        stated_too_large: Whether rows state a sigma that is too large, which a notice says.
    """

    named: str
    means_mm: Mapping[str, float]
    judged: str = ""
    entries: Sequence[Mapping[str, Any]] = ()
    means_mrad: Mapping[str, float] = field(default_factory=dict)
    fate: str = ""
    exchanged: bool = False
    stated_too_large: bool = False

    @classmethod
    def of(cls, calibration: "Calibration") -> "Outliers":
        """Those of the rows that a calibration was fitted to."""
        rows = calibration.rows
        if rows is None:
            return NO_OUTLIERS
        found = rows.outliers()
        held = calibration.held
        means = {} if held is None else held.means_without_mm(found)
        turns = {} if held is None else held.turns_without_mrad(found)
        judged = held.among(found, calibration.model_name) if held is not None and means else []
        named, among = (list_outliers(each, rows.data.files) for each in (found, judged))
        kinds, fate = {notice.kind for notice in calibration.notices}, fate_of_outliers(calibration)
        exchanged, too_large = not kinds.isdisjoint(EXCHANGED), STATED_TOO_LARGE in kinds
        return cls(named, means, among, found, turns, fate, exchanged, too_large)

    @property
    def without(self) -> str:
        """What is said of errors without them, with a blank before it; empty where none is judged."""
        return " without the outliers among them" if self.means_mm else ""


NO_OUTLIERS: Final = Outliers("", {})


def judged_means_mm(validation: Validation, outliers: Outliers) -> dict[str, float]:
    """Mean errors of the models on the judged rows, without the outliers where these are known."""
    if outliers.means_mm:
        return dict(outliers.means_mm)
    return {name: found.position.mean for name, found in validation.holdout.items()}


def own_means_mm(calibration: "Calibration") -> dict[str, float]:
    """Mean errors of a calibration's models on its own held-out rows, without the outliers that it knows."""
    return judged_means_mm(calibration.validation, Outliers.of(calibration))


def known_mean_mm(calibration: "Calibration") -> float | None:
    """The mean error of the model that predicts among them; None where nothing was judged."""
    return own_means_mm(calibration).get(calibration.model_name)
