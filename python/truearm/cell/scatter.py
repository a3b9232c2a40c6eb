"""How far apart points may be by the standard deviations that an instrument states for them."""

import math
from collections.abc import Sequence
from functools import cache
from typing import Final

import numpy as np

from truearm.cell.cell_file import ProcessSection
from truearm.types import AXES, Floats
from truearm.units import MM_PER_METRE, to_si

AS_RARE_AS: Final = 4.0
"""A distance is explained up to one as rare as a normal value this many standard deviations off."""


@cache
def _most() -> float:
    """Length that three independent normal values of variance 1 exceed as rarely as one of them AS_RARE_AS.

    The square of the length has the chi-squared distribution with three degrees of freedom.
    """
    from scipy.special import gammainccinv  # noqa: PLC0415 - slow to import

    rare = math.erfc(AS_RARE_AS / math.sqrt(2.0))
    return math.sqrt(2.0 * float(gammainccinv(AXES / 2.0, rare)))


def explained_m(one_m: float, other_m: float) -> float:
    """How far apart two points may be, m, of which each coordinate has a standard deviation, m."""
    return _most() * math.hypot(one_m, other_m)


def weighted_mean(values: Sequence[Sequence[float]], sigmas_m: Sequence[float]) -> Floats:
    """Mean (m,) of what each reading says, of n readings (n, m) of these standard deviations, m.

    Each counts by 1/sigma^2, so that a coarse one adds what it tells and spoils nothing.
    """
    return np.average(np.asarray(values, dtype=np.float64), axis=0, weights=_weights(sigmas_m))


def sigma_of_mean_m(sigmas_m: Sequence[float]) -> float:
    """Standard deviation of each coordinate, m, of that mean of readings that have these, above zero."""
    return float(1.0 / math.sqrt(_weights(sigmas_m).sum()))


def _weights(sigmas_m: Sequence[float]) -> Floats:
    return np.asarray(1.0 / np.square(np.asarray(sigmas_m, dtype=np.float64)))


def told_coarse(sigma_m: float, process: ProcessSection) -> str:
    """Which limits of a cell file give way to what an instrument states, in words; empty where none does."""
    mean_m = sigma_of_mean_m([sigma_m] * process.contacts)
    agree_m, drift_m = explained_m(sigma_m, sigma_m), explained_m(mean_m, mean_m)
    wider = [
        f"{what} {MM_PER_METRE * explained:.3g} mm, not {key} = {stated_mm:g}"
        for what, explained, key, stated_mm in (
            ("readings of a pose agree within", agree_m, "agree_mm", process.agree_mm),
            ("the first contact may be off by", drift_m, "drift_mm", process.drift_mm),
        )
        if explained > to_si(stated_mm, "mm")
    ]
    if not wider:
        return ""
    stated = f"the instrument states a standard deviation of {MM_PER_METRE * sigma_m:.3g} mm"
    return f"{stated}: {', and '.join(wider)}"
