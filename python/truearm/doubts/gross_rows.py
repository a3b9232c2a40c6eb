"""Rows of an evaluation that are off by more than the calibration and the other rows allow."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from truearm.calibration import Calibration
from truearm.errors import Notice, WorkError, list_outliers
from truearm.fits.core_set import first_measured
from truearm.fits.fitting import Task
from truearm.fits.models import ArmModel
from truearm.judgement.held_rows import HeldRows
from truearm.judgement.judging import model_inputs
from truearm.judgement.validation import row_errors
from truearm.measurements import Measurements
from truearm.rotations import rigid_motion
from truearm.rows.leaving_out import left_out
from truearm.storage.summary import noise_mm
from truearm.types import AXES, Floats, Rows
from truearm.units import MM_PER_METRE

Entry = dict[str, Any]

FAR_ROWS: Final = "far_rows"
OUTLIERS: Final = "outliers"
FAR: Final = 8.0
"""Times what the calibration expects: in another set-up, on another day, ordinary errors are larger."""
UNUSUAL: Final = 9.0
"""Times the median of the others: errors have tails, and none reaches so far."""
FAINT: Final = 1e-9
"""What a direction that no row tells counts for, as a share of what all of them tell."""
RULE: Final = (
    f"more than {UNUSUAL:g} times the median of the others and {FAR:g} times what the calibration expects "
    "there (standard deviation and noise)"
)


@dataclass(frozen=True, eq=False)
class Expected:
    """What a model says of measured rows (n) in a set-up.

    Attributes:
        task: The set-ups of the rows, and what of them is used.
        calibration: What is judged.
        model: Its model, with the set-ups of `task.groups`.
        data: The rows.
        finds_tool: Whether the target on the tool is found in these set-ups.
        finds_frame: Whether their frames are.
    """

    task: Task
    calibration: Calibration
    model: ArmModel
    data: Measurements
    finds_tool: bool
    finds_frame: bool

    @cached_property
    def parameters(self) -> Floats:
        """Parameters of the arm at the rows (n, L, 5)."""
        return self.model.parameters(model_inputs(self.task.arm, self.data, self.task.options.features))

    @cached_property
    def errors(self) -> Floats:
        """Measured minus predicted (n, 3) at the first target of each row, base frame, m; NaN where none."""
        task, setup = self.task, self.model.setup
        return row_errors(task.arm, self.data, task.selection, task.groups, self.parameters, setup).position

    @cached_property
    def tools(self) -> Floats:
        """Points (n, 3) on the flange at which the rows are judged, m."""
        numbers = [self.task.groups.index(name) for name in self.data.group]
        return self.model.setup.targets[numbers, first_measured(self.data, self.task.selection)]

    @cached_property
    def jacobian(self) -> Floats:
        """Derivatives (n, 3, p) of these targets by motions of base and tool, as far as they are found.

        Each target has its own place on the tool.
        """
        joints = self.task.arm.robot.joints_from_readings(self.data.readings)
        flange = self.task.arm.flange_chain.pose(joints, np.ascontiguousarray(self.parameters))
        turned = flange[:, :3, :3]
        points = flange[:, :3, 3] + np.einsum("nij,nj->ni", turned, self.tools)
        parts = [rigid_motion(points)] if self.finds_frame else []
        if self.finds_tool:
            by_target = np.zeros((len(points), len(self.task.selection.targets), AXES, AXES))
            by_target[np.arange(len(points)), first_measured(self.data, self.task.selection)] = turned
            parts.append(by_target.transpose(0, 2, 1, 3).reshape(len(points), AXES, -1))
        return np.concatenate(parts, axis=2) if parts else np.empty((len(points), AXES, 0))

    def lengths_m(self, rows: Rows) -> Floats:
        """Root mean square lengths (m,) of the errors that the calibration expects at rows, m.

        Its standard deviation there, what it leaves unexplained, and the row's own sigma. Where it does not
        know the first, the bound of it; where there is none either, the others alone.
        """
        own = self.data.stated_sigma_m[rows]
        noise = noise_mm(self.calibration) / MM_PER_METRE
        squares = AXES * (noise**2 + own**2)
        kinds, kind = np.unique(self.tools[rows], axis=0, return_inverse=True)
        for number, tool in enumerate(kinds):
            alike = kind.ravel() == number
            squares[alike] += self._variances(rows[alike], tool)
        return np.asarray(np.sqrt(squares))

    def _variances(self, rows: Rows, tool: Floats) -> Floats:
        """Variances (m,) of a tool's position at rows, coordinates together, m^2, or what bounds them."""
        readings, names = self.data.readings[rows], self.task.options.features
        features = {name: self.data.features[name].to_numpy()[rows] for name in names}
        try:
            std = self.calibration.position_std(readings, tool=tool, features=features)
        except WorkError:
            if not self.calibration.has_conservative:
                return np.zeros(len(rows))
            std = self.calibration.conservative_std(readings, tool=tool, features=features)[:, :1]
        return np.asarray(np.square(std).sum(axis=1))

    def measured(self, errors: Floats) -> Iterator[Rows]:
        """The rows of each set-up whose errors (n, 3) are known."""
        seen = np.isfinite(errors).all(axis=1)
        for name in self.task.groups:
            yield np.flatnonzero(seen & (self.data.group == name))


def gross_frame_rows(found: Expected) -> list[Notice]:
    """A notice of rows that found a set-up and that the others contradict, each with its distance.

    Args:
        found: The rows that found the set-ups, the model in set-ups that single rows do not govern.
    """
    far = dict[int, float]()
    if found.finds_frame or found.finds_tool:
        for rows in found.measured(found.errors):
            far |= _contradicted(found, rows)
    if not far:
        return []
    entries = _entries(found.data, far)
    what = " and ".join(["frame"] * found.finds_frame + ["tool"] * found.finds_tool)
    text = (
        f"Among the rows that found {what} some lie far from where the others put them, {RULE}, and spoil "
        f"the errors: {_named(entries, found.data)}. Take them out, or let more rows find the frame "
        "(--frame-rows)."
    )
    return [Notice(FAR_ROWS, text, tuple(entry["row"] for entry in entries))]


def gross_judged_rows(found: Expected, frame: Expected, held: HeldRows) -> list[Entry]:
    """Gross errors among judged rows, the farthest first: file, row and distance_mm of each.

    Args:
        found: The judged rows, the model in the set-ups it is judged in.
        frame: The rows that found these set-ups, in the same ones.
        held: The judged rows with the errors that are published.
    """
    errors = held.errors[found.calibration.model_name].position
    far = dict[int, float]()
    for rows in found.measured(errors):
        if not len(rows):
            continue
        in_frame = frame.jacobian[frame.data.group == found.data.group[rows[0]]]
        lengths = widened(errors[rows], found.jacobian[rows], in_frame)
        usual = float(np.median(lengths))
        for place in np.flatnonzero(lengths > UNUSUAL * usual):
            row = int(rows[place])
            if lengths[place] > FAR * found.lengths_m(np.array([row]))[0]:
                far[row] = float(np.linalg.norm(errors[row]))
    return _entries(found.data, far)


def gross_rows_told(entries: Sequence[Entry], data: Measurements, held: HeldRows) -> list[Notice]:
    """A notice of the gross errors among judged rows, with the errors without them."""
    if not entries:
        return []
    said = ", ".join(f"{name} {mean:.3f}" for name, mean in held.means_without_mm(entries).items())
    text = (
        f"Outliers among the rows that were judged, {RULE}: {_named(entries, data)}. Mean error "
        f"without them: {said} mm. They count in all other errors: look at them, or take them out."
    )
    return [Notice(OUTLIERS, text, tuple(entry["row"] for entry in entries))]


def _contradicted(found: Expected, rows: Rows) -> dict[int, float]:
    """Rows of one set-up that are far off in a fit to the others, and how far, m.

    The farthest is taken out first, and what is usual is told by a fit without it, until none is far: a row
    that is off draws the fit to itself and away from the others.
    """
    errors, jacobian = found.errors[rows], found.jacobian[rows]
    jacobian = jacobian[:, :, jacobian.any(axis=(0, 1))]
    kept = np.ones(len(rows), dtype=np.bool_)
    while AXES * kept.sum() - jacobian.shape[2] > AXES:
        lengths = left_out(errors[kept], jacobian[kept]).lengths
        worst, length = int(np.flatnonzero(kept)[lengths.argmax()]), float(lengths.max())
        kept[worst] = False
        usual = float(np.median(left_out(errors[kept], jacobian[kept]).lengths))
        if length <= UNUSUAL * usual or length <= FAR * found.lengths_m(rows[[worst]])[0]:
            kept[worst] = True
            break
    columns = jacobian[kept].reshape(-1, jacobian.shape[2])
    moved = np.linalg.lstsq(columns, errors[kept].ravel(), rcond=None)[0]
    distances = np.linalg.norm(errors - jacobian @ moved, axis=1)
    return {int(rows[k]): float(distances[k]) for k in np.flatnonzero(~kept)}


def widened(errors: Floats, jacobian: Floats, in_frame: Floats) -> Floats:
    """Lengths (n,) of errors (n, 3), in units in which what `in_frame` (m, 3, p) leaves uncertain is noise.

    Where few rows found frame and tool, both are uncertain, at some places much more than at others.
    """
    told = np.einsum("nki,nkj->ij", in_frame, in_frame)
    told += FAINT * np.trace(told) * np.eye(len(told))
    spread = np.eye(AXES) + jacobian @ np.linalg.inv(told) @ jacobian.transpose(0, 2, 1)
    return np.asarray(
        np.sqrt(np.einsum("ni,ni->n", errors, np.linalg.solve(spread, errors[..., None])[..., 0]))
    )


def _entries(data: Measurements, far: dict[int, float]) -> list[Entry]:
    """File, row and distance_mm of each, the farthest first."""
    return [
        {"file": str(data.sources[k]), "row": int(data.rows[k]), "distance_mm": MM_PER_METRE * far[k]}
        for k in sorted(far, key=lambda k: -far[k])
    ]


def _named(entries: Sequence[Entry], data: Measurements) -> str:
    return list_outliers(entries, data.files)
