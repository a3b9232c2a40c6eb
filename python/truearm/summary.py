"""A calibration in numbers, for programs: the content of summary.json."""

import math
from typing import TYPE_CHECKING, Any, Final

from truearm.units import MM_PER_METRE

if TYPE_CHECKING:
    from truearm.calibration import Calibration

MRAD_PER_RAD: Final = 1e3
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
        "notices": [str(notice) for notice in calibration.notices],
        "update": None if calibration.revision is None else dict(calibration.revision.report),
    }


def error_to_repeatability(calibration: "Calibration") -> dict[str, float] | None:
    """Mean held-out position error of each model in parts of the arm's repeatability; None if not stated."""
    known = calibration.options.repeatability_mm
    if known is None:
        return None
    return {name: errors.position.mean / known for name, errors in calibration.validation.holdout.items()}


def noise_mm(calibration: "Calibration") -> float:
    """Standard deviation of a coordinate that the best model leaves unexplained."""
    details = calibration.variable
    return MM_PER_METRE * (calibration.constant.noise_m if details is None else details.unexplained_m)


def describe_blocks(calibration: "Calibration") -> list[dict[str, Any]]:
    """Name, joints (from 1), features, length scales, amplitudes and number of cells of each block.

    Length scales are in rad for revolute joints, m for prismatic ones, and in the features' own units; a wave
    has cycles a turn of its joint instead. Amplitudes are prior standard deviations; a wave's is what it
    reaches. Curves of joints have ripples, about how many a turn, where their prior, which joints share,
    knows of any.
    """
    field, details = calibration.model.field, calibration.variable
    if field is None or details is None:
        return []
    return [_describe(block, calibration, details.hyper) for block in field.blocks()]


def _describe(
    block: dict[str, Any], calibration: "Calibration", hyper: dict[str, list[float]]
) -> dict[str, Any]:
    joints, name = calibration.robot.joint_count, block["name"]
    lengths = _lengths(block, hyper)
    scales = [axis[1] for axis in block["axes"]]
    found: dict[str, Any] = {"name": name}
    if name == WAVE:
        found["cycles"], scales = scales[0], []
    if name == OWN and block["axes"][0][0] and (ripples := _ripples(hyper)) is not None:
        found["ripples"] = ripples
    cells = 1
    for axis in block["axes"]:
        cells *= axis[4]
    return found | {
        "joints": [k + 1 for k in block["inputs"] if k < joints],
        "features": [calibration.options.features[k - joints] for k in block["inputs"] if k >= joints],
        "lengths": [length / scale for length, scale in zip(lengths, scales, strict=True)],
        "amplitudes": _amplitudes(block, hyper),
        "cells": cells,
        "parameters": len(block["outputs"]),
    }


def _ripples(hyper: dict[str, list[float]]) -> float | None:
    """Cycles a turn that curves of joints ripple with; None where they hardly do or none are known."""
    cycles, length = ((hyper.get(name) or [0.0])[0] for name in ("own_cycles", "own_length"))
    return cycles if cycles >= FEWEST_RIPPLES and cycles * length >= LEAST_OF_A_RIPPLE else None


def _lengths(block: dict[str, Any], hyper: dict[str, list[float]]) -> list[float]:
    """Length scales of a block's axes; none where it has no cells."""
    name, axes = block["name"], len(block["axes"])
    if not axes or name == WAVE:
        return []
    return hyper.get(f"{name}_lengths") or hyper[f"{name}_length"] * axes


def _amplitudes(block: dict[str, Any], hyper: dict[str, list[float]]) -> dict[str, float]:
    name = block["name"]
    if name == WAVE:
        return {"theta_mrad": float(math.sqrt(2.0) * block["weights"].std()) * MRAD_PER_RAD}
    if name == "sag":
        return {"theta_mrad_per_m": hyper["sag"][0] * MRAD_PER_RAD}
    values = hyper.get(f"{name}_amplitudes") or hyper[name]
    return {key: value * unit for (key, unit), value in zip(AMPLITUDES, values, strict=False)}
