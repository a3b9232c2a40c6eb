"""The scale that an update compares with: that of the rows which constants and field were learned from."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truearm.calibration import Calibration
from truearm.errors import Notice, WorkError, count_of
from truearm.fits.known_scale import KnownScale
from truearm.lengths import length_mm
from truearm.measurements import Measurements
from truearm.rows.own_sigmas import sigmas_of_turns
from truearm.types import Floats
from truearm.units import MM_PER_METRE, MRAD_PER_RAD


def known_scale(calibration: Calibration) -> KnownScale:
    """What a calibration, or the one that it was updated from, was told by the rows of its fit.

    Raises:
        WorkError: If its file does not tell, and holds no calibration before it.
    """
    scale = calibration.constant.scale
    if scale is not None:
        return scale
    before = calibration.predecessor
    if before is None:
        raise WorkError("this calibration does not tell how well the scale of its errors is known")
    return known_scale(before)


def usual_sigma_m(calibration: Calibration) -> float:
    """What half of the calibration's rows state as their sigma, or less, m; zero where that is not known."""
    return known_scale(calibration).sigma_m or 0.0


def sigmas_m(calibration: Calibration, data: Measurements) -> Floats:
    """Sigma of each row (n,), m; where it states none that which was usual when the arm was calibrated."""
    return np.where(_silent(data), usual_sigma_m(calibration), _stated(data))


def stated_data(calibration: Calibration, data: Measurements) -> Measurements:
    """The rows, with the sigmas that they are taken to have."""
    turned = np.full(len(data), np.nan) if data.sigma_rad is None else data.sigma_rad
    usual = known_scale(calibration).sigma_rad
    return replace(
        data,
        sigma_m=sigmas_m(calibration, data),
        sigma_rad=np.where(np.isfinite(turned), turned, usual),
    )


def silent_rows(calibration: Calibration, data: Measurements) -> list[Notice]:
    """What rows that state no sigma are taken to have, where those of the calibration stated one."""
    return [*_silent_of_positions(calibration, data), *_silent_of_turns(calibration, data)]


def _silent_of_positions(calibration: Calibration, data: Measurements) -> list[Notice]:
    silent, usual = int(_silent(data).sum()), known_scale(calibration).sigma_m
    if usual == 0.0 or not silent:
        return []
    if usual is None:
        text = (
            f"{count_of(silent, 'row')} without a sigma, and the calibration's file does not say whether its "
            "rows had one: they are taken to have none. If they had, say how much in a column sigma_mm."
        )
    else:
        text = (
            f"{count_of(silent, 'row')} without a sigma, which the calibration's rows have: the "
            f"device is taken to scatter as it did then, by {length_mm(MM_PER_METRE * usual, 2)}. If it does "
            "not, say how much in a column sigma_mm."
        )
    return [Notice("sigma", text)]


def _silent_of_turns(calibration: Calibration, data: Measurements) -> list[Notice]:
    usual = known_scale(calibration).sigma_rad
    silent = int((data.oriented & (sigmas_of_turns(data) == 0.0)).sum()) if usual > 0.0 else 0
    if not (silent and calibration.selection.orientation):
        return []
    text = (
        f"{count_of(silent, 'row')} without a sigma of the orientation, which the calibration's rows have: "
        f"the device is taken to scatter as it did then, by {MRAD_PER_RAD * usual:.2g} mrad. If it does not, "
        "say how much in a column sigma_mrad."
    )
    return [Notice("sigma", text)]


def _stated(data: Measurements) -> Floats:
    """What each row states as its sigma (n,), m; NaN where it states none."""
    return np.full(len(data), np.nan) if data.sigma_m is None else data.sigma_m


def _silent(data: Measurements) -> NDArray[np.bool_]:
    """Which rows (n,) state no sigma."""
    return ~np.isfinite(_stated(data))
