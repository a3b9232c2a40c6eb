"""Models of the arm as a whole: nominal, constant, outliers rejected, and the paper's schemes."""

from dataclasses import replace
from typing import Final, Literal

import numpy as np

from truearm.fits.fitting import fit_rows
from truearm.fits.models import CONSTANT, NOMINAL
from truearm.fits.schemes import FCMAC, REGIONS
from truearm.studies.accuracy.fitted import Fitted, FittedArm
from truearm.studies.accuracy.poses import Prepared

REJECTED_BEYOND: Final = 3.0
NORMAL_MAD: Final = 1.4826
ROUNDS: Final = 5


def fit_nominal(prepared: Prepared) -> Fitted:
    """The arm as its file describes it, with frame and target fitted."""
    return FittedArm(prepared.fits.models(prepared.task.arm)[NOMINAL])


def fit_constant_model(prepared: Prepared) -> Fitted:
    """One set of D-H parameters, by `truearm calibrate --model constant`."""
    return FittedArm(prepared.constant)


def fit_without_outliers(prepared: Prepared) -> Fitted:
    """Constants of the rows whose residual is usual, found again until none is left out anew.

    A row is left out where its residual is longer than the median by three standard deviations, as the median
    deviation tells them.
    """
    data, fits, left_out = prepared.train, prepared.fits, 0
    for _ in range(ROUNDS):
        size = np.linalg.norm(fits.constant.residuals.reshape(len(data), 3), axis=1)
        median = np.median(size)
        deviation = NORMAL_MAD * np.median(np.abs(size - median))
        usual = size <= median + REJECTED_BEYOND * deviation
        if usual.all():
            break
        left_out += int((~usual).sum())
        data = data.select(usual)
        fits = fit_rows(prepared.task, data)
    return FittedArm(fits.models(prepared.task.arm)[CONSTANT], {"left_out": left_out})


def fit_regions(prepared: Prepared) -> Fitted:
    """CEPs of regions of joint space, by `truearm calibrate --model regions`."""
    return _scheme(prepared, REGIONS)


def fit_fcmac(prepared: Prepared) -> Fitted:
    """The paper's network on CEPs of regions, by `truearm calibrate --model fcmac`."""
    return _scheme(prepared, FCMAC)


def _scheme(prepared: Prepared, name: Literal["regions", "fcmac"]) -> Fitted:
    task = replace(prepared.task, options=replace(prepared.task.options, model=name))
    fits = fit_rows(task, prepared.train)
    regions = 0 if fits.scheme is None else fits.scheme.details.regions
    return FittedArm(fits.models(task.arm)[name], {"regions": regions})
