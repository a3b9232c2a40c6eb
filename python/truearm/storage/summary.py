"""A calibration in numbers, for programs: the content of summary.json."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from truearm._core import ANGLE_ARM_M
from truearm.errors import in_json
from truearm.fits.details import left_m
from truearm.judgement.validation import mean_distance
from truearm.types import AXES, Floats
from truearm.units import MM_PER_METRE, MRAD_PER_RAD

if TYPE_CHECKING:
    from truearm.calibration import Calibration


WAVE: Final = "wave"
OWN: Final = "own"
FEWEST_RIPPLES: Final = 3.0
"""Fewer a turn are slow curves."""
LEAST_OF_A_RIPPLE: Final = 1.0
"""Curves whose length scale holds less than this angle (rad) of a ripple are as good as without ripples."""
AMPLITUDES: Final = (
    ("theta_mrad", MRAD_PER_RAD),
    ("other_angles_mrad", MRAD_PER_RAD),
    ("lengths_mm", MM_PER_METRE),
)


def summarise(calibration: "Calibration") -> dict[str, Any]:
    """The content of summary.json."""
    return {
        "robot": calibration.robot.name,
        **calibration.validation.to_dict(),
        "identifiability": calibration.identifiability.to_dict(),
        "noise_mm": noise_mm(calibration),
        "noise_floor_mm": distance_at_floor_mm(calibration),
        "scheme": None if calibration.scheme is None else calibration.scheme.to_dict(),
        "error_to_repeatability": error_to_repeatability(calibration),
        "outliers": [] if calibration.rows is None else calibration.rows.outliers(),
        "blocks": describe_blocks(calibration),
        "refit": calibration.options.refit,
        "n_fitted": None if calibration.rows is None else len(calibration.rows.data),
        "options": calibration.options.to_dict(),
        "data_sha256": calibration.data_hash,
        "version": calibration.version,
        "seconds": dict(calibration.seconds),
        "notices": in_json(calibration.notices),
        "update": None if calibration.revision is None else dict(calibration.revision.report),
    }


def error_to_repeatability(calibration: "Calibration") -> dict[str, float] | None:
    """Mean held-out position error of each model in parts of the arm's repeatability; None if not stated."""
    known = calibration.options.repeatability_mm
    if known is None:
        return None
    return {name: errors.position.mean / known for name, errors in calibration.validation.holdout.items()}


def noise_mm(calibration: "Calibration") -> float:
    """Standard deviation of a coordinate that the best model leaves unexplained, beside the rows' own sigma.

    A scheme has no noise of its own: what it leaves of held-out rows counts, since it may follow those that
    it was fitted to.
    """
    if calibration.scheme is not None:
        return _held_out_mm(calibration)
    return MM_PER_METRE * left_m(calibration.constant, calibration.variable)


def _held_out_mm(calibration: "Calibration") -> float:
    """Root mean square of a coordinate's error on held-out rows, without outliers, where these are known, and
    without what rows state as their sigma.
    """
    square = calibration.validation.holdout[calibration.model_name].position.rms ** 2 / AXES
    if calibration.held is not None and calibration.rows is not None:
        errors = MM_PER_METRE * calibration.held.errors[calibration.model_name].distance_m
        kept = errors[calibration.held.without(calibration.rows.outliers())]
        square = float(np.nanmean(np.square(kept if np.isfinite(kept).any() else errors))) / AXES
    stated = float(np.mean(np.square(stated_sigma_mm(calibration))))
    return math.sqrt(max(square - stated, 0.0))


def whole_noise_mm(calibration: "Calibration") -> float:
    """Standard deviation of a coordinate's noise, the rows' own sigma and what is left beside it, mm."""
    return float(np.mean(np.hypot(noise_mm(calibration), stated_sigma_mm(calibration))))


def distance_at_floor_mm(calibration: "Calibration") -> float:
    """Mean position error that the unexplained part, and the rows' own sigma, alone would leave, mm."""
    return mean_distance(whole_noise_mm(calibration), distances=calibration.selection.distances)


def saw_orientations(calibration: "Calibration") -> bool:
    """Whether rows hold orientations, used or not; not known of a calibration without its rows."""
    return calibration.rows is not None and calibration.rows.data.orientations is not None


def states_sigma(calibration: "Calibration") -> bool:
    """Whether rows say something of their own noise."""
    return bool(np.any(stated_sigma_mm(calibration)))


def stated_sigma_mm(calibration: "Calibration") -> Floats | float:
    """What rows (n,) say of their own noise, mm; zero where they say nothing."""
    rows = calibration.rows
    if rows is None or rows.data.sigma_m is None:
        return 0.0
    return MM_PER_METRE * rows.data.stated_sigma_m


def describe_blocks(calibration: "Calibration") -> list[dict[str, Any]]:
    """Name, joints (from 1), features, length scales, amplitudes and number of cells of each block.

    Length scales are in rad for revolute joints, m for prismatic ones, and in the features' own units; a wave
    has cycles a turn of its joint instead, or a period in mm where that slides. Amplitudes are prior standard
    deviations; a wave's is what it reaches. Curves of joints have ripples, about how many a turn, where their
    prior, which joints share, knows of any.
    """
    field, details = calibration.model.field, calibration.variable
    if field is None or details is None:
        return []
    return [_describe(block, calibration, details.hyper) for block in field.blocks()]


def _describe(
    block: dict[str, Any], calibration: "Calibration", hyper: dict[str, list[float]]
) -> dict[str, Any]:
    joints, name = calibration.robot.joint_count, block["name"]
    lengths = _lengths(name, block["axes"], hyper)
    scales = [axis[1] for axis in block["axes"]]
    found: dict[str, Any] = {"name": name}
    first = next(iter(block["inputs"]), joints)
    slides = first < joints and calibration.robot.joints[first] == "prismatic"
    if name == WAVE:
        found |= _wave(scales[0], float(math.sqrt(2.0) * block["weights"].std()), slides=slides)
        scales = []
    else:
        found["amplitudes"] = _amplitudes(name, hyper, slides=slides)
    if name == OWN and block["axes"][0][0] and (ripples := _ripples(hyper)) is not None:
        found["ripples"] = ripples
    cells = 1
    for axis in block["axes"]:
        cells *= axis[4]
    if "reading" in block:
        found["over_reading"] = True
    return found | {
        "joints": [k + 1 for k in block["inputs"] if k < joints],
        "features": [calibration.options.features[k - joints] for k in block["inputs"] if k >= joints],
        "lengths": [length / scale for length, scale in zip(lengths, scales, strict=True)],
        "cells": cells,
        "parameters": len(block["outputs"]),
    }


def _wave(phase: float, reached: float, *, slides: bool) -> dict[str, Any]:
    """Cycles a turn or period in mm, and amplitude, of a wave of so much phase by its joint's value."""
    if slides:
        period = MM_PER_METRE * math.tau / phase
        return {"period_mm": period, "amplitudes": {"lengths_mm": reached * MM_PER_METRE}}
    return {"cycles": phase, "amplitudes": {"theta_mrad": reached * MRAD_PER_RAD}}


def waves_in_words(waves: Sequence[Mapping[str, Any]], spec: str = ".4g") -> str:
    """Of waves of one joint as :func:`describe_blocks` has them: "202 cycles a turn", "a period of 20 mm"."""
    cycles = sorted(wave["cycles"] for wave in waves if "cycles" in wave)
    if cycles:
        return f"{', '.join(format(each, spec) for each in cycles)} cycles a turn"
    periods = sorted(wave["period_mm"] for wave in waves)
    return f"a period of {', '.join(format(each, spec) for each in periods)} mm"


def _ripples(hyper: dict[str, list[float]]) -> float | None:
    """Cycles a turn that curves of joints ripple with; None where they hardly do or none are known."""
    cycles, length = ((hyper.get(name) or [0.0])[0] for name in ("own_cycles", "own_length"))
    return cycles if cycles >= FEWEST_RIPPLES and cycles * length >= LEAST_OF_A_RIPPLE else None


def _lengths(name: str, axes: Sequence[Any], hyper: dict[str, list[float]]) -> list[float]:
    """Length scales of a block's axes; none where it has no cells."""
    if not axes or name == WAVE:
        return []
    turns = axes[0][0]
    of_lines = None if turns else hyper.get(f"{name}_line_length")
    return hyper.get(f"{name}_lengths") or (of_lines or hyper[f"{name}_length"]) * len(axes)


def _amplitudes(name: str, hyper: dict[str, list[float]], *, slides: bool) -> dict[str, float]:
    """Prior standard deviations of a block; `slides` tells whether its first joint moves along its axis."""
    if name == "sag":
        return {"theta_mrad_per_m": hyper["sag"][0] * MRAD_PER_RAD}
    if name == OWN and slides:
        return {"lengths_mm": hyper[OWN][0] * ANGLE_ARM_M * MM_PER_METRE}
    values = hyper.get(f"{name}_amplitudes") or hyper[name]
    return {key: value * unit for (key, unit), value in zip(AMPLITUDES, values, strict=False)}
