"""What a calibration may be told: the options of the command line, with the same defaults."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Final, Literal, get_args

from truearm import kinds
from truearm.defaults import DEGREE, DRIFT, FIRST_TARGET, FRAME, MODEL, ROBUST
from truearm.errors import UsageError, list_names
from truearm.fits.core_set import USES, Use
from truearm.fits.identified import Frame
from truearm.fits.parameters import PARALLEL_WITHIN_DEG
from truearm.fits.scheme_options import SchemeOptions
from truearm.fits.schemes import FCMAC, NETWORKS
from truearm.rows.splitting import SplitRule
from truearm.units import MM_PER_METRE, MRAD_PER_RAD

ModelName = Literal["variable", "constant", "regions", "cmac", "fcmac"]
Robust = Literal["none", "huber", "cauchy"]
Drifting = Literal["auto", "none"]

CHOICES: Final[Mapping[str, tuple[object, ...]]] = {
    "use": (None, *USES),
    "model": get_args(ModelName),
    "robust": get_args(Robust),
    "drift": get_args(Drifting),
    "frame": get_args(Frame),
    "degree": (2, 3),
}
POSITIVE: Final = ("parallel_within_deg",)
SIZES: Final = ("prior_mm", "prior_mrad", "repeatability_mm")


@dataclass(frozen=True)
class CalibrationOptions:
    """How to calibrate.

    Attributes:
        split: Which rows train and which are held out.
        use: What of the measurements to use; None for all: targets, else pose, else position.
        model: "variable", "constant" for that alone, or a scheme of the paper: "regions", "cmac", "fcmac".
        robust: Loss of the constant fit.
        drift: "auto" to take out how set-ups moved while they were measured, where the rows show that they
            did; "none" to leave it in. Only with model "variable" is it looked for.
        refit: Whether the calibration is fitted to all rows after validation.
        features: Columns that the field depends on beside the joints.
        frame: "free" for an unknown world_from_base of each set-up; "world" for none and a base that is
            corrected like a link, in five of the six freedoms of a frame.
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
    model: ModelName = MODEL
    robust: Robust = ROBUST
    drift: Drifting = DRIFT
    refit: bool = True
    features: kinds.Names = kinds.Names(kinds.words, ())
    frame: Frame = FRAME
    judge_target: int = FIRST_TARGET
    degree: int = DEGREE
    prior_mm: float = 2.0
    prior_mrad: float = 2.0
    parallel_within_deg: float = PARALLEL_WITHIN_DEG
    scheme: SchemeOptions = field(default_factory=SchemeOptions)
    repeatability_mm: float | None = None

    def __post_init__(self) -> None:
        kinds.required(self.split, SplitRule, "the split")
        kinds.required(self.scheme, SchemeOptions, "the scheme")
        kinds.settle(self, whole=("judge_target", "degree"), numbers=(*POSITIVE, *SIZES), flags=("refit",))
        kinds.check_values(self, choices=CHOICES, positive=POSITIVE, sizes=SIZES)
        if self.model in NETWORKS:
            self.scheme.check_network(fuzzy=self.model == FCMAC)
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
        return self.prior_mm / MM_PER_METRE, self.prior_mrad / MRAD_PER_RAD, True

    @classmethod
    def of(cls, **given: Any) -> "CalibrationOptions":
        """Options from keywords: those of this class, of SplitRule and of SchemeOptions, side by side.

        A stated `holdout` comes before what poses were planned for, unless `by_purpose` is stated as well.

        Raises:
            UsageError: If there is no such option, a value breaks a rule, or a split or scheme is given as an
                object and by keywords.
        """
        parts: dict[str, type] = {"split": SplitRule, "scheme": SchemeOptions}
        names = {part: [each.name for each in fields(kind)] for part, kind in parts.items()}
        known = {*(each.name for each in fields(cls)), *names["split"], *names["scheme"]}
        for name in given:
            if name not in parts:
                kinds.check_name(name, list(known - set(parts)))
        for part, kind in parts.items():
            own = {name: given.pop(name) for name in names[part] if name in given}
            if own and part in given:
                raise UsageError(
                    f"{part} is given as an object, and {list_names(own)} by keyword",
                    rule=f"Give an object of {kind.__name__}, or keywords",
                )
            if "holdout" in own:
                own.setdefault("by_purpose", False)
            if own:
                given[part] = kind(**own)
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
