"""A calibration: an arm's identified parameters, what they predict, and how good that is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from truearm._core import Chain, Conservative
from truearm.arrays import as_rows, hold_read_only
from truearm.certainty.conservative import conservative_of
from truearm.certainty.uncertainty import ConstantSpread, SetupPlace, Spread, UpdatedSpread, VariableSpread
from truearm.certainty.variation import variation_std
from truearm.errors import Notice, WorkError, count_of
from truearm.files import as_path, write_whole
from truearm.fits.core_set import Selection
from truearm.fits.details import ConstantDetails, VariableDetails
from truearm.fits.endpoints import Endpoint, at_target, at_tool
from truearm.fits.fitted_rows import FittedRows
from truearm.fits.identifiability import Identifiability
from truearm.fits.identified import IdentifiedArm
from truearm.fits.measured_parts import MeasuredParts
from truearm.fits.models import CONSTANT, ArmModel
from truearm.fits.options import CalibrationOptions
from truearm.fits.scheme_fitting import SchemeDetails
from truearm.inputs import Features, feature_columns
from truearm.judgement.held_rows import HeldRows
from truearm.judgement.validation import Validation
from truearm.kinds import content_bytes, words
from truearm.lengths import length_mm
from truearm.limits import Task
from truearm.revision import Revision
from truearm.robot import Robot
from truearm.solving import solve
from truearm.storage import calibration_content
from truearm.storage.calibration_file import calibration_bytes, parse_calibration, read_calibration
from truearm.storage.summary import summarise
from truearm.types import AXES, Floats


@dataclass(frozen=True, eq=False, repr=False)
class Calibration:
    """Identified parameters of an arm. SI units; parameters in the order links, theta, d, a, alpha, beta.

    `calibrate`, `load` and `from_bytes` make one.

    Joint readings `q` are (n, N), or (N,) for one, and results have the same leading dimension. Where the
    calibration was fitted with features, predictions need `features`: a number, or one for each pose, by
    name, also as a DataFrame. Without `group`, positions and poses are those of the robot file's tool, or of
    `tool`, in the robot's base frame. With `group` they are those of the measured `target`, or of `tool`, in
    that set-up's world. Copying and pickling go by the content of a calibration file.

    Attributes:
        robot: The nominal arm.
        options: How it was calibrated.
        groups: Names of the set-ups.
        selection: What of the measurements was used.
        measured: How many rows of each set-up hold it.
        models: The fitted models by name: "nominal", "constant" and, if fitted, one that varies.
        identifiability: Which parameters the measurements determined.
        constant: More about the constant model.
        variable: More about the variable model; None where there is none.
        validation: Errors on rows that took no part in fitting.
        rows: The rows it was fitted to; None where they were left out of the file.
        held: The held-out rows with their errors; None where they were left out of the file.
        data_hash: SHA-256 of all measurements that were given.
        version: Version of truearm that made it.
        notices: What the user should know.
        seconds: Time of the fits that were validated; empty for a calibration that was read.
        scheme: More about one of the paper's schemes; None where it is none.
        stored_conservative: Bounds of the standard deviation as the file held them.
        fitted_spread: The posterior as the fit left it; None for a calibration that was read.
        revision: What an update changed, with the calibration before it; None where there was none. Then
            `rows` are those of the update.
        file: Content of the file it was read from; None for one that was not.
    """

    robot: Robot
    options: CalibrationOptions
    groups: tuple[str, ...]
    selection: Selection
    measured: MeasuredParts
    models: Mapping[str, ArmModel]
    identifiability: Identifiability
    constant: ConstantDetails
    variable: VariableDetails | None
    validation: Validation
    rows: FittedRows | None
    data_hash: str
    version: str
    notices: tuple[Notice, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)
    scheme: SchemeDetails | None = None
    held: HeldRows | None = None
    stored_conservative: Conservative | None = None
    fitted_spread: Spread | None = None
    revision: Revision | None = None
    file: bytes | None = None

    def __post_init__(self) -> None:
        hold_read_only(self, "models", "seconds")

    @classmethod
    def load(cls, path: str | Path) -> "Calibration":
        """Read a calibration file.

        Raises:
            InputError: If there is no such file, it is a pipe or a device, is none of ours, is cut short or
                altered, or has a layout that this version does not know.
        """
        return cls.from_bytes(read_calibration(as_path(path)), where=str(path))

    @classmethod
    def from_bytes(cls, data: bytes | bytearray | memoryview, *, where: str) -> "Calibration":
        """The calibration of a file's content; `where` is named in errors, which are those of `load`.

        Raises:
            UsageError: If these are no bytes.
        """
        file = content_bytes(data, "the content of a calibration file")
        arrays, content = parse_calibration(file, where)
        return cls(**calibration_content.unpack(arrays, content, where=where), file=file)

    def __repr__(self) -> str:
        joints, judged = self.robot.joint_count, self.validation
        held = judged.holdout.get(self.model_name)
        error = f", {length_mm(held.position.mean, 3)} mean on {judged.judged} rows" if held else ""
        far = 0 if self.rows is None else len(self.rows.outliers())
        outliers = f", {count_of(far, 'outlier')}" if far else ""
        rows = f"{judged.n_rows} rows{outliers}{error}"
        return f"<Calibration of {self.robot.name}: {self.model_name}, {joints} joints, {rows}>"

    def __reduce__(self) -> tuple[object, ...]:
        content = self.to_bytes()
        file = content if self.file == content else self.file
        return _restored, (type(self), content, dict(self.seconds), file)

    def without_rows(self) -> "Calibration":
        """This one as a file without the measurements holds it, with the bounds of the standard deviation."""
        bounds = self.conservative if self.has_conservative else None
        revision = None if self.revision is None else self.revision.stripped()
        left_out: dict[str, Any] = dict.fromkeys(("rows", "held", "file", "fitted_spread"))
        return replace(self, stored_conservative=bounds, revision=revision, **left_out)

    def save(self, path: str | Path, *, with_rows: bool = True) -> None:
        """Write a calibration file, completely or not at all.

        Args:
            path: Where to.
            with_rows: Whether to keep the measurements; without them a variable model has no exact
                standard deviations, but keeps their bounds.
        """
        write_whole(as_path(path), self.to_bytes(with_rows=with_rows))

    def to_bytes(self, *, with_rows: bool = True) -> bytes:
        """What `save` writes."""
        return calibration_bytes(*calibration_content.pack(self, with_rows=with_rows))

    @cached_property
    def arm(self) -> IdentifiedArm:
        """The arm with what of it was identified."""
        return IdentifiedArm(self.robot, self.options.frame, self.options.parallel_within_deg)

    @cached_property
    def predecessor(self) -> "Calibration | None":
        """The calibration before the update; None where there was no update.

        Raises:
            WorkError: If it was left out of the file.
        """
        if self.revision is None:
            return None
        return Calibration.from_bytes(self.revision.before(self.robot.name), where="the calibration before")

    @property
    def learned_from(self) -> FittedRows | None:
        """The rows that constants and field were learned from; None where they were left out of the file."""
        if self.revision is None:
            return self.rows
        known = None if self.revision.file is None else self.predecessor
        return None if known is None else known.learned_from

    @property
    def model(self) -> ArmModel:
        """The model that predicts: the one that varies if there is one."""
        return self.models[self.model_name]

    @property
    def model_name(self) -> str:
        """Its name."""
        return self.options.model if self.options.model in self.models else CONSTANT

    @property
    def summary(self) -> dict[str, Any]:
        """What `truearm calibrate` writes to summary.json."""
        return summarise(self)

    def parameters(self, q: ArrayLike, *, features: Features | None = None) -> Floats:
        """Absolute parameters of the links, (n, N, 5), or (N, 5) for one reading.

        With frame "world" the base is corrected too: they go with `base`, and not with the robot's own.
        """
        rows, single = self._readings(q)
        found = self.model.parameters(self.field_inputs(rows, features))[:, self.arm.links]
        return found[0] if single else found

    def base(self, q: ArrayLike, *, features: Features | None = None) -> Floats:
        """Transforms (n, 4, 4) before the first link, or (4, 4) for one reading, m.

        They are the robot's `base`, but with frame "world": there the base is found like a link, and varies
        in the paper's schemes alone. `replace(robot, table=parameters, base=base)` is the arm at a reading.
        """
        rows, single = self._readings(q)
        found = self.arm.bases(self.model.parameters(self.field_inputs(rows, features)))
        return found[0] if single else found

    def position(
        self,
        q: ArrayLike,
        *,
        tool: ArrayLike | None = None,
        group: str | int | None = None,
        target: int | None = None,
        features: Features | None = None,
    ) -> Floats:
        """Predicted points, (n, 3), m; where set-ups moved while they were measured, with their mean frame.

        Args:
            q: Readings.
            tool: Transform (4, 4) from flange to tool, or a point (3,) in the flange frame.
            group: Name of the set-up whose world is meant, of one with a number for its name also that.
            target: Measured target, from 1; by default the first that the set-up measured.
            features: Features by name.

        Raises:
            WorkError: If the target was not measured in the set-up.
        """
        end = self._endpoint(tool, group, target)
        rows, single = self._readings(q)
        points = self._chain(end.flange_from_end).position(*self._at(rows, features))
        if end.world_from_base is not None:
            points = points @ end.world_from_base[:3, :3].T + end.world_from_base[:3, 3]
        return points[0] if single else points

    def pose(
        self,
        q: ArrayLike,
        *,
        tool: ArrayLike | None = None,
        group: str | int | None = None,
        target: int | None = None,
        features: Features | None = None,
    ) -> Floats:
        """Predicted poses, (n, 4, 4); arguments as for position.

        Raises:
            WorkError: If the target, or its orientation, was not measured in the set-up.
        """
        end = self._endpoint(tool, group, target).oriented()
        rows, single = self._readings(q)
        poses = self._chain(end.flange_from_end).pose(*self._at(rows, features))
        if end.world_from_base is not None:
            poses = end.world_from_base @ poses
        return poses[0] if single else poses

    def parameter_jacobian(
        self,
        q: ArrayLike,
        pose: bool = False,
        *,
        tool: ArrayLike | None = None,
        features: Features | None = None,
    ) -> Floats:
        """Derivatives at the calibrated parameters with respect to those of the links, link by link.

        Returns:
            (n, 3, 5 N), or (n, 6, 5 N) with `pose`: translation, then the rotation vector in the base frame.
        """
        rows, single = self._readings(q)
        first = 5 * (self.arm.links.start or 0)
        found = self._jacobian(rows, features, tool, pose=pose)[:, :, first:]
        return found[0] if single else found

    def position_std(
        self,
        q: ArrayLike,
        *,
        tool: ArrayLike | None = None,
        group: str | int | None = None,
        target: int | None = None,
        features: Features | None = None,
    ) -> Floats:
        """Standard deviation of each coordinate that `position` gives for the same arguments, (n, 3), m.

        Along the axes of the base frame, for base and tool as the device saw them in the set-up with the
        surest rows; or with a group or a target in that set-up's world, as its own rows tell it. Where the
        arm's own base and flange are no target tells; work objects and tools found through the calibrated arm
        take it over. Noise of a measurement is no part, but of a model with constants alone all is that they
        leave beside the rows' own sigma: noise that is not stated, they cannot tell apart.
        """
        return self._std(q, self._endpoint(tool, group, target), features, pose=False)

    def pose_std(
        self,
        q: ArrayLike,
        *,
        tool: ArrayLike | None = None,
        group: str | int | None = None,
        target: int | None = None,
        features: Features | None = None,
    ) -> Floats:
        """As `position_std`, of position and rotation vector of `pose`, (n, 6), m and rad.

        Where the orientation of a target was measured, how it is turned on the flange is seen as well.

        Raises:
            WorkError: If the target, or its orientation, was not measured in the set-up.
        """
        return self._std(q, self._endpoint(tool, group, target).oriented(), features, pose=True)

    def solve(
        self,
        base_from_tool: ArrayLike,
        seed: ArrayLike,
        *,
        tool: ArrayLike | None = None,
        task: Task = "pose",
        features: Mapping[str, float] | None = None,
    ) -> Floats:
        """Inverse kinematics of the calibrated arm: readings for poses, near a seed and on its branch.

        Args:
            base_from_tool: Targets (n, 4, 4), or (4, 4) for one.
            seed: Readings (n, N), near which the solution of each target is looked for; or (N,), near which
                that of the first is, and of each other one near the one before.
            tool: Transform (4, 4) from flange to tool, or a point (3,); the robot file's by default.
            task: "pose": position and orientation; "axis": position and the tool's z axis; "position". Where
                the arm has more joints than that needs, the change from the seed is small.
            features: Features by name.

        Returns:
            Readings (n, N), or (N,) for one pose.

        Raises:
            WorkError: If a pose is not reached within the joint limits, or on another branch than the seed's.
            InputError: If targets, seed or tool are not finite numbers of these shapes, or not rigid.
        """
        return solve(self, base_from_tool, seed, tool=tool, task=task, features=features)

    def conservative_std(
        self, q: ArrayLike, *, tool: ArrayLike | None = None, features: Features | None = None
    ) -> Floats:
        """Bounds of the standard deviation of position and rotation, (n, 2), m and rad.

        The first is a bound of the root of the sum of the variances of x, y and z, the second of those of the
        rotation vector. They are never below what `pose_std` says: the second is a few percent above, the
        first mostly one and a half to four times as large for variable models. For constants it is up to 1.5
        times for a tool within 0.2 m of the middle of what was measured, twice at 0.5 m, three times at 1 m.
        They cost about a thousandth; controllers judge by them, and compensation where something varies.

        Raises:
            WorkError: If the file has neither bounds nor the rows to work them out from.
        """
        rows, single = self._readings(q)
        found = self.conservative.std(self.field_inputs(rows, features))
        found[:, 0] += np.linalg.norm(at_tool(self.robot, tool)[:3, 3] - self._bounded_point) * found[:, 1]
        return found[0] if single else found

    @property
    def has_conservative(self) -> bool:
        """Whether bounds of the standard deviation are there or can be worked out."""
        if self.scheme is not None:
            return False
        return self.stored_conservative is not None or self.rows is not None or self.variable is None

    @cached_property
    def conservative(self) -> Conservative:
        """Bounds of the standard deviation: those of the file, or worked out, which takes a few seconds."""
        return self.stored_conservative or conservative_of(self)

    @cached_property
    def _bounded_point(self) -> Floats:
        """The point (3,) of the flange's frame whose position is bounded, m."""
        return np.array(self.conservative.content()["centre"])

    def pose_variances(
        self, q: ArrayLike, tool: ArrayLike | None, features: Features | None
    ) -> tuple[Floats, Floats, Floats]:
        """Internal: inputs (n, I) of readings, variances (n, 6) of a tool's pose now and before measuring.

        They are in the base frame, m^2 and rad^2.
        """
        rows, _ = self._readings(q)
        jacobian = self._jacobian(rows, features, tool, pose=True)
        covariance = self._covariance(rows, features, Endpoint(at_tool(self.robot, tool)), jacobian)
        inputs = self.field_inputs(rows, features)
        return inputs, np.einsum("nii->ni", covariance), self.spread.prior(inputs, jacobian)

    def variation_std(
        self, q: ArrayLike, names: Sequence[str] | str, *, features: Features | None = None
    ) -> Floats:
        """Standard deviation of how much parameters differ from their means over the readings, SI.

        How parameters vary is known better than their level, which frame and target may take over.

        Args:
            q: Readings (n, N); of one alone nothing differs.
            names: Names of the c parameters, such as "theta2", one by one or as one text with commas.
            features: Features by name.

        Returns:
            (n, c), or (c,) for readings (N,); rad and m.

        Raises:
            UsageError: If there is no such parameter.
            WorkError: If the rows were left out of the file, or the model does not tell.
        """
        return variation_std(self, q, words(names, "names"), features)

    def _std(self, q: ArrayLike, end: Endpoint, features: Features | None, *, pose: bool) -> Floats:
        rows, single = self._readings(q)
        jacobian = self._jacobian(rows, features, end.flange_from_end, pose=pose)
        covariance = self._covariance(rows, features, end, jacobian)
        if end.world_from_base is not None:
            turn = np.kron(np.eye(jacobian.shape[1] // 3), end.world_from_base[:3, :3])
            covariance = turn @ covariance @ turn.T
        found: Floats = np.sqrt(np.maximum(np.einsum("nii->ni", covariance), 0.0))
        return found[0] if single else found

    def _covariance(self, rows: Floats, features: Features | None, end: Endpoint, jacobian: Floats) -> Floats:
        """Covariance (n, m, m) of an end's position, or pose, as the device saw base and target."""
        flanges = self.pose(rows, tool=np.eye(4), features=features)
        moved = end.motions(flanges, pose=jacobian.shape[1] > AXES)
        place = SetupPlace.at(self, end)
        return self.spread.covariance(self.field_inputs(rows, features), jacobian, moved, place)

    def _jacobian(
        self, rows: Floats, features: Features | None, tool: ArrayLike | None, *, pose: bool
    ) -> Floats:
        chain = self._chain(at_tool(self.robot, tool))
        return chain.parameter_jacobian(*self._at(rows, features), pose=pose)

    @cached_property
    def spread(self) -> Spread:
        """What is uncertain about the arm's parameters.

        Raises:
            WorkError: If it is not known: the rows were left out of the file, or a scheme does not tell it.
        """
        if self.fitted_spread is not None:
            return self.fitted_spread
        if self.scheme is not None:
            raise WorkError(
                "standard deviations are not known",
                rule=f"The scheme {self.model_name} does not tell them",
                way_out="Calibrate with --model variable or constant",
            )
        if self.variable is None:
            return ConstantSpread.of(self)
        if self.predecessor is not None:
            return UpdatedSpread.of(self, self.predecessor.spread)
        return VariableSpread.of(self)

    def _readings(self, q: ArrayLike) -> tuple[Floats, bool]:
        return as_rows(q, self.robot.joint_count, what=f"joint readings of {self.robot.name}")

    def field_inputs(self, rows: Floats, features: Features | None) -> Floats:
        """Internal: inputs (n, I) of the field at readings (n, N), joint values and then features."""
        columns = feature_columns(features, self.options.features, len(rows))
        values = self.robot.values_of(rows)
        return np.hstack([values, columns]) if columns.shape[1] else values

    def _at(self, rows: Floats, features: Features | None) -> tuple[Floats, Floats]:
        """Joint values (n, N) and parameters (n, L, 5) of readings."""
        inputs = self.field_inputs(rows, features)
        return np.ascontiguousarray(inputs[:, : self.robot.joint_count]), self.model.parameters(inputs)

    def _endpoint(self, tool: ArrayLike | None, group: str | int | None, target: int | None) -> Endpoint:
        if group is None and target is None:
            return Endpoint(at_tool(self.robot, tool))
        return at_target(self, tool, group, target)

    def _chain(self, flange_from_end: Floats) -> Chain:
        return self.arm.chain(self.robot.flange @ flange_from_end)


def _restored(
    kind: type[Calibration], content: bytes, seconds: Mapping[str, float], file: bytes | None
) -> Calibration:
    """A calibration that was pickled: what its file holds, and how long its fits took."""
    found = kind.from_bytes(content, where="a pickled calibration")
    return replace(found, seconds=seconds, file=file)
