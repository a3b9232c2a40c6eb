"""How far an arm has moved away from its last calibration."""

import math
from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from truearm.calibration import Calibration
from truearm.doubts.outliers import known_mean_mm
from truearm.errors import InputError, WorkError
from truearm.fits.identified import Frame
from truearm.fits.models import CONSTANT
from truearm.fits.parameters import are_lengths
from truearm.fleet.gauge import as_placed_in
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.rows.evenly import some_rows
from truearm.types import Floats
from truearm.units import MM_PER_METRE, RADIANS_PER_DEGREE

SURE: Final = 2.0
"""A change of a position beyond so many standard deviations of both calibrations together is seen."""
MOST_POSES: Final = 200
"""Poses at the most at which standard deviations are asked for: they tell the share beyond within 4 %."""
FAR: Final = 0.1
"""Tables of one arm, rad and m, do not differ by so much, whoever wrote them down."""
MOVED: Final = 4.0
"""A parameter that changed by more standard errors moved; one unmoved arm in a thousand is suspected."""


def check_comparable(previous: Calibration, robot: Robot, frame: Frame, where: str) -> None:
    """Raise InputError if a calibration is of an arm with other joints, a table far from this or readings
    that mean something else, or its positions are in another frame.
    """
    known, way_out = previous.robot, "Correct previous of this arm"
    if known.joints != robot.joints:
        what, rule = f"with {known.joint_count} joints", f"The arm has {robot.joint_count}"
    elif (np.abs(known.table - robot.table) > FAR).any():
        what, rule = "whose Denavit-Hartenberg table is another", f"The arm is {robot.name}"
    elif not np.allclose(known.coupling, robot.coupling):
        what, rule = (
            "whose joints turn or are coupled otherwise",
            "Readings of the arm mean something else now",
        )
    elif previous.options.frame != frame:
        what, rule = f'made with frame "{previous.options.frame}"', f'The arm is calibrated with "{frame}"'
        way_out = f'Give this arm frame = "{previous.options.frame}", or leave its previous out'
    else:
        return
    raise InputError(
        f"this is a calibration of {known.name}, {what}", where=where, rule=rule, way_out=way_out
    )


def drift_of(previous: Calibration, now: Calibration, data: Measurements) -> dict[str, Any]:
    """What changed from one calibration of an arm to another, over the poses of `data`; JSON values.

    Positions are those of the tool of `now`'s robot file in its base frame, so that another tool or base
    there is no change of the arm. How uncertain their change is follows from both calibrations' standard
    deviations at some of the poses, where both know them.
    """
    change_m = _change_m(previous, now, data)
    worst = int(np.argmax(change_m))
    some = some_rows(np.arange(len(data)), MOST_POSES)
    uncertain_m = _uncertain(previous, now, data.select(some))
    return {
        "since_version": previous.version,
        "poses": len(data),
        "mean_mm": float(change_m.mean() * MM_PER_METRE),
        "max_mm": float(change_m[worst] * MM_PER_METRE),
        "max_row": int(data.rows[worst]),
        "max_file": str(data.sources[worst]),
        "std_mm": None if uncertain_m is None else float(np.median(uncertain_m) * MM_PER_METRE),
        "share_beyond": None if uncertain_m is None else float(np.mean(change_m[some] > SURE * uncertain_m)),
        "moved": list(_moved(previous, now)),
        "previous_mean_mm": known_mean_mm(previous),
        "previous_errors_of": previous.selection.errors_of,
    }


def _features(calibration: Calibration, data: Measurements) -> dict[str, Floats] | None:
    names = calibration.options.features
    missing = [name for name in names if name not in data.features]
    if missing:
        raise InputError(
            f'the last calibration depends on "{missing[0]}"',
            where=", ".join(data.files),
            rule="The measurements have no such column",
            way_out="Measure it again, or leave previous out",
        )
    return {name: data.features[name].to_numpy(dtype=np.float64) for name in names} or None


def _change_m(previous: Calibration, now: Calibration, data: Measurements) -> Floats:
    """How far positions (n,) moved, m."""
    q, tool, features = data.readings, _tool(previous, now.robot), _features(previous, data)
    before = as_placed_in(now, previous, q, tool, features).position(q, tool=tool, features=features)
    after = now.position(q, tool=_tool(now, now.robot), features=_features(now, data))
    if not now.arm.world_is_known:
        moved = now.robot.base @ np.linalg.inv(previous.robot.base)
        before = before @ moved[:3, :3].T + moved[:3, 3]
    return np.asarray(np.linalg.norm(after - before, axis=1))


def _tool(calibration: Calibration, robot: Robot) -> Floats:
    """The tool (4, 4) of a robot file from the flange of a calibration, whose file may have it elsewhere."""
    return np.asarray(np.linalg.inv(calibration.robot.flange) @ robot.flange @ robot.tool)


def _uncertain(previous: Calibration, now: Calibration, data: Measurements) -> Floats | None:
    """Standard deviation (n,) of the change, m: that of its length, as if both were independent."""
    stds = [_std(calibration, data, _tool(calibration, now.robot)) for calibration in (previous, now)]
    known = [std for std in stds if std is not None]
    return np.asarray(np.hypot(*known)) if len(known) == len(stds) else None


def _std(calibration: Calibration, data: Measurements, tool: Floats) -> Floats | None:
    """Standard deviation (n,) of positions, m, their coordinates together, or its bound where the rows were
    left out of the file; None where neither is known.
    """
    features = _features(calibration, data)
    try:
        stds = calibration.position_std(data.readings, tool=tool, features=features)
        return np.asarray(np.linalg.norm(stds, axis=1))
    except WorkError:
        if not calibration.has_conservative:
            return None
        return calibration.conservative_std(data.readings, tool=tool, features=features)[:, 0]


def _moved(previous: Calibration, now: Calibration) -> Iterator[dict[str, Any]]:
    """Constants that both determined and that changed beyond their standard errors, the surest first."""
    if previous.robot.convention != now.robot.convention:
        return
    old, new = _constants(previous), _constants(now)
    errors = {
        name: abs(new[name][0] - old[name][0]) / math.hypot(new[name][1], old[name][1])
        for name in new
        if name in old
    }
    for name in sorted(errors, key=lambda name: -errors[name]):
        if errors[name] > MOVED:
            value, _, is_length = new[name]
            change = value - old[name][0]
            unit = "mm" if is_length else "deg"
            size = change * MM_PER_METRE if is_length else change / RADIANS_PER_DEGREE
            yield {"name": name, "change": size, "unit": unit, "standard_errors": errors[name]}


def _constants(calibration: Calibration) -> dict[str, tuple[float, float, bool]]:
    """Value, standard error and whether it is a length, of the constants that were fitted, by name."""
    columns = dict(zip(calibration.arm.candidates.names, calibration.arm.candidates.columns, strict=True))
    values = np.ravel(calibration.models[CONSTANT].constants)
    errors = calibration.constant.standard_errors
    return {
        name: (float(values[columns[name]]), float(errors[k]), bool(are_lengths([columns[name]])[0]))
        for k, name in enumerate(calibration.constant.names)
    }
