"""Options of a calibration in words of people, with units."""

from collections.abc import Mapping
from typing import Any, Final

GENERAL: Final[Mapping[str, str]] = {
    "model": "model",
    "holdout": "share of the rows held out",
    "holdout_range": "joint range held out",
    "by_purpose": "poses planned to validate are held out",
    "split_by": "groups kept together in the split",
    "seed": "seed of the split",
    "train_size": "training rows of each file",
    "use": "measurements used",
    "judge_target": "target that errors are judged at",
    "robust": "loss of the constant fit",
    "drift": "movement of set-ups while measuring taken out",
    "refit": "fitted to all rows after validation",
    "frame": "frame",
    "prior_mm": "prior standard deviation of lengths, mm",
    "prior_mrad": "prior standard deviation of angles, mrad",
    "parallel_within_deg": "axes taken for parallel within, deg",
    "repeatability_mm": "stated repeatability, mm",
}
VARIABLE: Final[Mapping[str, str]] = {
    "features": "features that parameters vary with",
    "degree": "degree of the membership functions",
}
SCHEMES: Final[Mapping[str, str]] = {
    "scheme_joints": "joints that are divided",
    "demanded_mm": "accuracy that a region is not divided beyond, mm",
    "most_regions": "largest number of regions",
    "region_rows": "poses that a region needs",
    "halving": "axis of each halving",
    "region_ceps": "fit of the regional parameters",
    "train_on": "what the network learns from",
    "membership": "membership functions of the FCMAC",
    "composition": "how sensors are combined",
    "sigma_cells": "standard deviation of a Gaussian sensor, cells",
    "cells": "sensor cells of each joint",
    "active": "active sensors of each input",
    "rate": "learning rate",
    "normalise": "normalisation of the update rule",
    "tolerance_mm": "change at which training ends, mm",
    "epochs": "largest number of epochs",
    "table": "rows of the hash table",
}
NOT_LOOKED_FOR: Final = "not looked for: only what the variable model leaves shows it"
UNSET: Final[Mapping[str, str]] = {
    "train_size": "all that are not held out",
    "use": "several targets, else poses, else positions, as measured",
    "repeatability_mm": "not stated",
    "cells": "by the number of joints",
    "table": "one for each association cell",
}


def shown_options(model: str) -> dict[str, str]:
    """Options that bear on a model, with their words."""
    more = {"variable": VARIABLE, "constant": {}}.get(model, SCHEMES)
    return {**GENERAL, **more}


def in_words(name: str, value: Any) -> str:  # noqa: ANN401
    """The value of an option."""
    if value is None or value in ([], ()):
        return UNSET.get(name, "none")
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list | tuple):
        return ", ".join(map(str, value))
    return str(value).replace("_", " ") if name != "holdout_range" else str(value)
