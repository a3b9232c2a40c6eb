"""What a fit found beside the parameters themselves."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Final

from truearm._core import ConstantFit
from truearm.arrays import HoldsReadOnly, hold_read_only
from truearm.fits.known_scale import KnownScale
from truearm.lengths import length_mm
from truearm.types import Floats


@dataclass(frozen=True, eq=False)
class ConstantDetails(HoldsReadOnly):
    """About the constant model.

    `truearm.calibrate` makes one, `calibration.constant`.

    Attributes:
        names: Names of the constants that were fitted, in the order of the covariance.
        covariance: Of these constants, then of the set-up's unknowns, (u, u), SI, as if what constants leave
            were noise, which shots of a pose share as far as they agree.
        standard_errors: Of these constants, (k,), SI, with what they imitate of a fitted field.
        noise_m: Noise of positions (or distances) beside the rows' own sigma, what is not modelled included.
        noise_rad: The same of orientations.
        prior_scale: Factor on the priors' standard deviations that the evidence chose.
        iterations: Steps of the last minimisation.
        reason: Why it ended.
        scale: How well the rows tell the scale of standard deviations; None in updated files of earlier
            versions, where the calibration before tells.
    """

    names: tuple[str, ...]
    covariance: Floats = field(repr=False)
    standard_errors: Floats
    noise_m: float
    noise_rad: float
    prior_scale: float
    iterations: int
    reason: str
    scale: KnownScale | None = None

    def __post_init__(self) -> None:
        hold_read_only(self, "covariance", "standard_errors")

    @classmethod
    def of(
        cls,
        names: tuple[str, ...],
        fit: ConstantFit,
        covariance: Floats,
        standard_errors: Floats,
        scale: KnownScale,
    ) -> "ConstantDetails":
        """Internal: those of a fit."""
        noise_m, noise_rad = fit.noise
        return cls(
            names=names,
            covariance=covariance,
            standard_errors=standard_errors,
            noise_m=noise_m,
            noise_rad=noise_rad,
            prior_scale=fit.prior_scale,
            iterations=fit.iterations,
            reason=str(fit.reason),
            scale=scale,
        )


@dataclass(frozen=True, eq=False)
class VariableDetails:
    """About the variable model.

    `truearm.calibrate` makes one, `calibration.variable`.

    Attributes:
        hyper: Hyper-parameters by name; amplitudes in rad and m, length scales in rad or parts of the range;
            "up" is the direction in the base frame that the sag block takes for up.
        evidence: Logarithm of the evidence at its maximum, on the rows that found it.
        evaluations: How often it was evaluated to find that, rough searches that this one began at included.
        inflation: Factor on standard deviations that makes them agree with left-out residuals.
        unexplained_m: Standard deviation of a position's coordinate that is left: noise, and what the joints
            miss anew at every pose, where they were measured.
        feature_ranges: How far the values of each feature reached.
        feature_lowest: From where on; None in files of earlier versions.
    """

    hyper: dict[str, list[float]]
    evidence: float
    evaluations: int
    inflation: float
    unexplained_m: float
    feature_ranges: tuple[float, ...]
    feature_lowest: tuple[float, ...] | None = None


def left_m(constant: ConstantDetails, variable: VariableDetails | None) -> float:
    """Standard deviation of a position's coordinate that the model that predicts leaves, m."""
    return constant.noise_m if variable is None else variable.unexplained_m


ANOTHER_PLACE: Final = "another_place"
FARTHEST_SLIP_MM: Final = 20.0
"""What gives way when it is touched moves by less; what moves farther stands elsewhere and is turned, too."""


@dataclass(frozen=True)
class Jump:
    """A displacement of a set-up at once.

    `truearm.calibrate` makes one, as values of `calibration.validation.drift.jumps`.

    Attributes:
        between: The two measured rows between which it came, in words.
        mm: How far.
        poses_change: Whether the poses change there as well, from one sort to another.
    """

    between: str
    mm: float
    poses_change: bool = False

    @property
    def is_another_place(self) -> bool:
        """Whether it is farther than anything slips: instrument or target was put elsewhere."""
        return self.mm > FARTHEST_SLIP_MM

    @property
    def words(self) -> str:
        """How far, and where."""
        where = ", where the poses change as well" if self.poses_change else ""
        return f"{length_mm(self.mm, 2)} of it at once, between {self.between}{where}"


@dataclass(frozen=True)
class DriftDetails:
    """What the set-ups moved while they were measured, which was taken out of the measurements.

    `truearm.calibrate` makes one, `calibration.validation.drift`.

    Attributes:
        moved_mm: How far apart each set-up that moved has been, at the most.
        left_in_mean_mm: Mean held-out position error of each model with the drift left in.
        jumps: Where each set-up moved at once.
    """

    moved_mm: Mapping[str, float]
    left_in_mean_mm: Mapping[str, float]
    jumps: Mapping[str, tuple[Jump, ...]] = field(default_factory=dict)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> "DriftDetails":
        """From the values of `to_dict`, or of one that knew no jumps."""
        jumps = {
            group: tuple(Jump(**jump) for jump in found) for group, found in values.get("jumps", {}).items()
        }
        return cls(values["moved_mm"], values["left_in_mean_mm"], jumps)

    @property
    def slips(self) -> dict[str, list[Jump]]:
        """Of each set-up the jumps that no change of the poses explains; set-ups without any are left out."""
        found = {group: [jump for jump in own if not jump.poses_change] for group, own in self.jumps.items()}
        return {group: own for group, own in found.items() if own}

    @property
    def other_places(self) -> dict[str, list[Jump]]:
        """Of each set-up the jumps to another place of instrument or target; only set-ups with some.

        Poses that change as well do not explain so much.
        """
        found = {group: [jump for jump in own if jump.is_another_place] for group, own in self.jumps.items()}
        return {group: own for group, own in found.items() if own}

    def way(self, group: str) -> str:
        """How far a set-up moved, and what of it at once."""
        parts = [length_mm(self.moved_mm[group], 2), *(jump.words for jump in self.jumps.get(group, ()))]
        return ", ".join(parts)

    @property
    def words(self) -> str:
        """What was taken out, and what the errors would be without that."""
        spans = "; ".join(f"{group} moved by {self.way(group)}" for group in self.moved_mm)
        means = ", ".join(f"{name} {mean:.3f}" for name, mean in self.left_in_mean_mm.items())
        return (
            f"What the set-up moved while it was measured is taken out ({spans}). With it left in, the means "
            f"are {means} mm."
        )

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return asdict(self)
