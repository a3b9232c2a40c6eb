"""What a calibration may be told: the options of the command line, with the same defaults."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from numbers import Integral
from typing import Any, Final, Literal

from truearm.core_set import FIRST_TARGET, USES, Use
from truearm.defaults import NO_DRIFT
from truearm.errors import UsageError
from truearm.identified import Frame
from truearm.kinds import check_name, check_number
from truearm.parameters import PARALLEL_WITHIN_DEG
from truearm.scheme_options import SchemeOptions
from truearm.schemes import SCHEMES
from truearm.splitting import HoldoutRange, SplitRule

ModelName = Literal["variable", "constant", "regions", "cmac", "fcmac"]
Robust = Literal["none", "huber", "cauchy"]
Drifting = Literal["auto", "none"]

CHOICES: Final[Mapping[str, tuple[object, ...]]] = {
    "use": (None, *USES),
    "model": ("variable", "constant", *SCHEMES),
    "robust": ("none", "huber", "cauchy"),
    "drift": ("auto", NO_DRIFT),
    "frame": ("free", "world"),
    "degree": (2, 3),
}
WHOLE: Final = ("train_size", "seed", "judge_target")
NUMBERS: Final = ("holdout", "prior_mm", "prior_mrad", "parallel_within_deg")


@dataclass(frozen=True)
class Options:
    """How to calibrate.

    Attributes:
        split: Which rows train and which are held out.
        use: What of the measurements to use; None for all: targets, else pose, else position.
        model: "variable", "constant" for that alone, or a scheme of the paper: "regions", "cmac", "fcmac".
        robust: Loss of the constant fit.
        drift: "auto" to take out how set-ups moved while they were measured, where the rows show that they
            did; "none" to leave it in.
        refit: Whether the calibration is fitted to all rows after validation.
        features: Columns that the field depends on beside the joints.
        frame: "free" for an unknown world_from_base of each set-up; "world" for none and a base that is
            corrected like a link.
        judge_target: Measured target, from 1, at which errors are judged; one other than the first takes
            no part in the fit.
        degree: Degree of the memberships, 2 or 3.
        prior_mm: Standard deviation of the prior of lengths, before the evidence scales it.
        prior_mrad: The same of angles.
        parallel_within_deg: Angle between axes up to which beta is asked for in place of d.
        scheme: How the paper's schemes are fitted.
        repeatability_mm: Of the arm, to tell errors in parts of it; None where it is not known.
    """

    split: SplitRule = field(default_factory=SplitRule)
    use: Use | None = None
    model: ModelName = "variable"
    robust: Robust = "none"
    drift: Drifting = "auto"
    refit: bool = True
    features: tuple[str, ...] = ()
    frame: Frame = "free"
    judge_target: int = FIRST_TARGET
    degree: int = 2
    prior_mm: float = 2.0
    prior_mrad: float = 2.0
    parallel_within_deg: float = PARALLEL_WITHIN_DEG
    scheme: SchemeOptions = field(default_factory=SchemeOptions)
    repeatability_mm: float | None = None

    def __post_init__(self) -> None:
        for name, known in CHOICES.items():
            value = getattr(self, name)
            if value not in known:
                words = " or ".join(str(choice) for choice in known if choice is not None)
                raise UsageError(f'"{value}" is not known', where=name, rule=f"Either {words}")
        for name in ("prior_mm", "prior_mrad", "parallel_within_deg"):
            if not getattr(self, name) > 0.0:
                raise UsageError(f"{getattr(self, name)}", where=name, rule="It must be positive")

        if self.repeatability_mm is not None and not self.repeatability_mm > 0.0:
            raise UsageError(f"{self.repeatability_mm}", where="repeatability_mm", rule="It must be positive")
        if len(set(self.features)) < len(self.features):
            raise UsageError("a feature is named twice", where="features", rule="Each is named once")
        if self.features and self.model != "variable":
            raise UsageError(
                "features belong to what varies",
                where="features",
                way_out="Leave them out, or --model variable",
            )

    @property
    def prior(self) -> tuple[float, float, bool]:
        """Standard deviations of lengths (m) and angles (rad), and that the evidence scales them."""
        return self.prior_mm / 1e3, self.prior_mrad / 1e3, True

    @classmethod
    def of(cls, **given: Any) -> "Options":
        """Options from keywords: those of this class, of SplitRule and of SchemeOptions, side by side.

        Raises:
            UsageError: If there is no such option or a value breaks a rule.
        """
        parts = {"split": SplitRule.__dataclass_fields__, "scheme": SchemeOptions.__dataclass_fields__}
        known = {*cls.__dataclass_fields__, *parts["split"], *parts["scheme"]}
        for name in given:
            if name not in parts:
                check_name(name, list(known - set(parts)))
        _check_numbers(given)
        splitting = {name: given.pop(name) for name in SplitRule.__dataclass_fields__ if name in given}
        if isinstance(splitting.get("holdout_range"), str):
            splitting["holdout_range"] = HoldoutRange.parse(splitting["holdout_range"])
        for part, names in ((splitting, ("split_by",)), (given, ("features",))):
            part |= {name: _words(part[name]) for name in names if name in part}
        if "holdout" in splitting:
            splitting.setdefault("by_purpose", False)
        if splitting:
            given["split"] = SplitRule(**splitting)
        scheme = {name: given.pop(name) for name in parts["scheme"] if name in given}
        if scheme:
            given["scheme"] = SchemeOptions(
                **scheme
                | {name: tuple(scheme[name]) for name in ("scheme_joints", "cells") if name in scheme}
            )
        return cls(**given)

    def to_dict(self) -> dict[str, Any]:
        """JSON values, flat."""
        content = asdict(self)
        split: dict[str, Any] = content.pop("split")
        split["split_by"] = list(self.split.split_by)
        split["holdout_range"] = None if self.split.holdout_range is None else str(self.split.holdout_range)
        scheme: dict[str, Any] = content.pop("scheme")
        lists = {name: list(scheme[name]) for name in ("scheme_joints", "cells")}
        return split | content | scheme | lists | {"features": list(self.features)}


def _check_numbers(given: Mapping[str, Any]) -> None:
    for name in WHOLE:
        if given.get(name) is not None:
            check_number(given[name], name, Integral)
    for name in NUMBERS:
        if name in given:
            check_number(given[name], name)


def _words(value: Any) -> tuple[str, ...]:  # noqa: ANN401
    """Names given as one text with commas, or one by one."""
    return tuple(part.strip() for part in value.split(",")) if isinstance(value, str) else tuple(value)
