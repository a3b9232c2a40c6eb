"""The compiled core. Private: the package's modules wrap it."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, TypedDict, final, type_check_only

import numpy as np
from numpy.typing import NDArray

__version__: str

ANGLE_ARM_M: float
"""Metres that a radian counts where lengths and angles are compared."""

STILL_M: float
"""Way of a slide, m, up to which it stands still."""

NORMAL_95: float
"""95 % of a standard normal variable lies within this."""

def same_poses(joints: NDArray[np.float64], group: NDArray[np.int64]) -> NDArray[np.int64]:
    """For each row (n,) the first of those of its group that were measured at its pose.

    Args:
        joints: Joint values (n, N), rad or m; those of one pose lie within 3e-4 of one another's.
        group: Number of each row's set-up (n,).

    Raises:
        CoreError: If the lengths differ.
    """

class CoreError(ValueError):
    """The core refused its input; the message says the value, the rule and the way out."""

@final
class Chain:
    """A serial chain: base, L links with J joints, end.

    Parameters are ordered by link, within a link theta, d, a, alpha, beta (rad and m); joint values are
    Denavit-Hartenberg ones, added to theta (revolute) or d (prismatic) of their links. Arrays are float64 and
    C-contiguous. `parameters` are absolute: the links' own (None), (L, 5) for all poses, or (n, L, 5).
    Results go to `out` if it is given, which costs far less than a large new array. `threads` bounds the
    threads used (None: all); the result does not depend on it.

    Raises:
        CoreError: A shape does not fit, an array is not contiguous, a transform is not rigid.
    """

    def __init__(
        self,
        convention: str,
        joints: Sequence[str],
        links: NDArray[np.float64],
        base: NDArray[np.float64],
        end: NDArray[np.float64],
    ) -> None:
        """Make a chain.

        Args:
            convention: "standard", A = Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta), or "modified",
                A = Rx(alpha) Tx(a) Ry(beta) Rz(theta) Tz(d).
            joints: For each link "revolute", "prismatic" or "fixed".
            links: (L, 5) parameters.
            base: (4, 4) transform before the first link.
            end: (4, 4) transform after the last link: flange and tool.
        """

    @property
    def joint_count(self) -> int:
        """J, the number of links that are not fixed."""

    def position(
        self,
        q: NDArray[np.float64],
        parameters: NDArray[np.float64] | None = None,
        out: NDArray[np.float64] | None = None,
        threads: int | None = None,
    ) -> NDArray[np.float64]:
        """Origin of the end in the base frame, (n, 3), of joint values q, (n, J)."""

    def pose(
        self,
        q: NDArray[np.float64],
        parameters: NDArray[np.float64] | None = None,
        out: NDArray[np.float64] | None = None,
        threads: int | None = None,
    ) -> NDArray[np.float64]:
        """base_from_end, (n, 4, 4), of joint values q, (n, J)."""

    def parameter_jacobian(
        self,
        q: NDArray[np.float64],
        parameters: NDArray[np.float64] | None = None,
        pose: bool = False,
        out: NDArray[np.float64] | None = None,
        threads: int | None = None,
    ) -> NDArray[np.float64]:
        """Derivative with respect to all parameters, (n, 3, 5 L), or (n, 6, 5 L) with `pose`.

        Rows 0 to 2 are the position, 3 to 5 the rotation vector w in the base frame: R becomes exp(w) R.
        """

    def joint_jacobian(
        self,
        q: NDArray[np.float64],
        parameters: NDArray[np.float64] | None = None,
        pose: bool = False,
        out: NDArray[np.float64] | None = None,
        threads: int | None = None,
    ) -> NDArray[np.float64]:
        """Derivative with respect to the joint values, (n, 3, J), or (n, 6, J) with `pose`; rows as above."""

@final
class Inverse:
    """All inverse kinematics of a plain arm; readings (N,), limits included.

    Raises:
        CoreError: A shape does not fit, a target is not rigid, a seed is not finite.
    """

    def __init__(
        self,
        chain: Chain,
        coupling: NDArray[np.float64],
        back: NDArray[np.float64],
        limits: NDArray[np.float64],
    ) -> None:
        """Look at an arm.

        Args:
            chain: Base to flange.
            coupling: (N, N) joint values from readings.
            back: (N, N) its inverse.
            limits: (N, 2) lowest and highest reading, infinite where there is none.
        """

    @property
    def method(self) -> str:
        """One of "spherical wrist", "three parallel axes" and "numeric"."""

    def solutions(self, target: NDArray[np.float64], turns: bool = False) -> NDArray[np.float64]:
        """Readings (k, N) that reach a target (4, 4); with `turns` all that differ by whole turns."""

    def all(self, targets: NDArray[np.float64]) -> tuple[NDArray[np.float64], list[int]]:
        """Readings (sum of k, N) that reach targets (n, 4, 4), target by target, and each one's k."""

    def near(self, targets: NDArray[np.float64], seeds: NDArray[np.float64]) -> NDArray[np.float64]:
        """Readings (n, N) nearest to the seeds (n, N); NaN where a target is not reached."""

    def branches(self, readings: NDArray[np.float64]) -> list[tuple[bool, bool, bool | None] | None]:
        """For each row whether the wrist is in front, the elbow up and the wrist flipped."""

@final
class Clearance:
    """Gaps between an arm's links and tool and what a table carries, m; negative where they meet.

    Links are capsules between the ends of their chains, the column is one too; of the tool, the lines
    between its points stay out of the plate. Rows are joint values (J,) of the arm, places (3,) of the
    carriage.

    Raises:
        CoreError: A shape does not fit, there is no row, a number is not finite, a step is not above 0.
    """

    def __init__(
        self,
        links: Sequence[Chain],
        tool: Sequence[Chain],
        column: tuple[Sequence[float], Sequence[float], float],
        plate: tuple[Sequence[float], Sequence[Sequence[float]], Sequence[float], float],
    ) -> None:
        """Take over the sizes of both.

        Args:
            links: Base to the end of each link that has a length.
            tool: Base to each point that the tool goes straight between.
            column: Its begin, seen from the carriage, and the way to its end (3,); its radius and a link's
                together.
            plate: Corner of the panel (3,), seen from the carriage; unit vectors of rows, of columns and out
                of the face; its size along rows and columns; how far the plate reaches beyond.
        """

    def gaps(
        self,
        joints: NDArray[np.float64],
        carriages: NDArray[np.float64],
        table_from_base: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Gaps (n, 2) of links and tool, with arm (n, J) and carriage (n, 3) at one place after another."""

    def least(
        self,
        arm: tuple[NDArray[np.float64], float],
        table: tuple[NDArray[np.float64], float],
        table_from_base: NDArray[np.float64],
    ) -> tuple[float, float]:
        """Least gap of the links and of the tool, however fast arm and carriage go along their ways.

        Ways are straight between stops (s, J) and (p, 3); each comes with the step at which it is looked at.
        """

@type_check_only
class MeasuredArrays(TypedDict):
    """Measurements of n poses.

    Attributes:
        joints: Denavit-Hartenberg joint values (n, J).
        group: Number of each pose's set-up (n,), from 0.
        targets: In world (n, T, 3).
        rotations: world_from_target (n, 3, 3), or None.
        sigma: Of a position's components along x, y and z of world, m, and of an orientation's, rad (n, 4).
        weight: Of each pose (n,).
        distances: In place of targets: pose, whether to an anchor, number of the anchor or other pose, m.
    """

    joints: NDArray[np.float64]
    group: NDArray[np.int64]
    targets: NDArray[np.float64]
    rotations: NDArray[np.float64] | None
    sigma: NDArray[np.float64]
    weight: NDArray[np.float64]
    distances: Sequence[tuple[int, bool, int, float]]

@final
class MeasurementSet:
    """Measurements of n poses, as the estimators read them. SI units; NaN where nothing was measured.

    Raises:
        CoreError: Lengths do not fit, a joint value or a sigma is not finite, an index is out of range.
    """

    def __init__(self, arrays: MeasuredArrays) -> None: ...
    @property
    def rows_per_pose(self) -> int:
        """m: three rows of residuals a target, then three of the orientation if it was measured."""

@final
class Setup:
    """Unknowns of G set-ups: world_from_base, targets in the flange frame, flange_from_target; A anchors."""

    def __init__(
        self,
        frames: NDArray[np.float64],
        targets: NDArray[np.float64],
        rotations: NDArray[np.float64],
        anchors: NDArray[np.float64],
    ) -> None:
        """Set-ups from (G, 4, 4), (G, T, 3), (G, 3, 3) and (A, 3)."""

    @property
    def frames(self) -> NDArray[np.float64]:
        """world_from_base of each group, (G, 4, 4)."""

    @property
    def targets(self) -> NDArray[np.float64]:
        """Target points in the flange frame, (G, T, 3), m."""

    @property
    def rotations(self) -> NDArray[np.float64]:
        """flange_from_target, (G, 3, 3)."""

    @property
    def anchors(self) -> NDArray[np.float64]:
        """Fixed points in the base frame, (A, 3), m."""

@final
class Problem:
    """What is to be identified from what; columns are indices 5 * link + (theta, d, a, alpha, beta)."""

    def __init__(
        self,
        chain: Chain,
        measurements: MeasurementSet,
        columns: Sequence[int],
        world_is_known: bool = False,
    ) -> None:
        """Make a problem.

        Args:
            chain: It ends at the flange.
            measurements: What was measured.
            columns: Parameters that are unknowns, ascending.
            world_is_known: Whether there is no world_from_base.
        """

@final
class ConstantFit:
    """Constants and set-up, with what is needed to judge them."""

    @property
    def parameters(self) -> NDArray[np.float64]:
        """Absolute parameters, (L, 5)."""

    @property
    def setup(self) -> Setup:
        """Frames, targets and anchors."""

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Of all unknowns, (u, u): the problem's columns, then the set-up's."""

    @property
    def noise(self) -> tuple[float, float]:
        """Of positions or distances (m) and of orientations (rad), beside the rows' own sigma."""

    @property
    def prior_scale(self) -> float:
        """Factor on the prior's standard deviations."""

    @property
    def residuals(self) -> NDArray[np.float64]:
        """Of all rows, (n m,), or of distances (d,); base frame."""

    @property
    def weights(self) -> NDArray[np.float64]:
        """Weights (n,) that a robust loss gave."""

    @property
    def iterations(self) -> int:
        """Steps of the last minimisation."""

    @property
    def reason(self) -> str:
        """Why it ended."""

@final
class FieldFit:
    """Constants, field and set-up, fitted together."""

    @property
    def parameters(self) -> NDArray[np.float64]:
        """Constants: absolute parameters, (L, 5)."""

    @property
    def field(self) -> Field:
        """What is added to the constants."""

    @property
    def setup(self) -> Setup:
        """Frames and targets."""

    @property
    def hyper(self) -> dict[str, list[float]]:
        """Hyper-parameters by name."""

    @property
    def evidence(self) -> float:
        """Logarithm of the evidence and the hyper-parameters' priors at the maximum."""

    @property
    def evaluations(self) -> int:
        """Evaluations of the evidence."""

    @property
    def residuals(self) -> NDArray[np.float64]:
        """Of all rows, (n, m), base frame."""

    @property
    def scores(self) -> NDArray[np.float64]:
        """Squared standardised leave-one-out residuals over the squared limit, (n,); outliers exceed one."""

    @property
    def distances(self) -> NDArray[np.float64]:
        """Length of each pose's leave-one-out residual at the first target, (n,), m."""

    @property
    def inflation(self) -> float:
        """Factor on standard deviations that makes them agree with leave-one-out residuals."""

    @property
    def weights(self) -> NDArray[np.float64]:
        """Weight of each pose in the fit, (n,): one, or next to nothing for outliers."""

    @property
    def constant_covariance(self) -> NDArray[np.float64]:
        """Covariance (P, P) of the constants of the problem's columns, whatever varies beside them."""

    @property
    def stood_aside(self) -> int:
        """Poses, shots of one counted once, that were judged but not fitted: others stood for them."""

    @property
    def posterior(self) -> Posterior:
        """What the rows leave uncertain."""

    @property
    def outliers(self) -> list[int]:
        """Poses taken out of the fit."""

@final
class Field:
    """A bank of blocks: inputs in, corrections of the parameters out."""

    def __init__(
        self, input_count: int, parameter_count: int, blocks: Sequence[dict[str, Any]], nominal: Chain
    ) -> None:
        """A bank from blocks as `blocks` gives them, of the arm whose nominal chain is given."""

    @property
    def input_count(self) -> int:
        """I: joints, then features."""

    @property
    def parameter_count(self) -> int:
        """5 L."""

    @property
    def cell_count(self) -> int:
        """Association cells of all blocks."""

    def blocks(self) -> list[dict[str, Any]]:
        """The blocks, each with name, inputs, axes, outputs and weights (cells, outputs).

        An axis is (is an angle, scale, origin, spacing, count, closed, degree).
        """

    def parameters(self, inputs: NDArray[np.float64], constants: NDArray[np.float64]) -> NDArray[np.float64]:
        """Absolute parameters (n, L, 5) at inputs (n, I): constants (L, 5) and what is added to them."""

@type_check_only
class BoundsPlan(TypedDict):
    """What the tables of bounds are over.

    Attributes:
        angles: Whether each of I inputs is one.
        ranges: Lowest and highest value of each.
        together: Inputs that are tabulated together as well.
        largest: Bounds that are never exceeded, (2,).
        centre: The point (3,) whose position is meant, in the flange's frame, m.
    """

    angles: Sequence[bool]
    ranges: Sequence[tuple[float, float]]
    together: Sequence[int]
    largest: Sequence[float]
    centre: Sequence[float]

@type_check_only
class BoundsContent(TypedDict):
    """All of bounds but tables and factor.

    Attributes:
        level: (2,).
        largest: Bounds that are never exceeded, (2,).
        ranges: Lowest and highest value of each input; None for any.
        looseness: Median ratio to exact values, (2,).
        centre: As in BoundsPlan.
    """

    level: list[float]
    largest: list[float]
    ranges: list[list[float] | None]
    looseness: list[float]
    centre: list[float]

@final
class Conservative:
    """Bounds of the standard deviation of the flange: roots of the sums of variances.

    Position (m), then rotation vector (rad). A point at the distance r from the flange deviates by the first
    plus r times the second at most.
    """

    def __init__(
        self,
        content: Mapping[str, Any],
        blocks: Sequence[dict[str, Any]],
        leverage: tuple[Chain, NDArray[np.float64]] | None = None,
    ) -> None:
        """Bounds from what `content`, `blocks` and, with the chain to the flange, `factor` gave.

        The content has the keys of BoundsContent, and may have others.
        """

    @staticmethod
    def fit(
        plan: BoundsPlan,
        fitted: tuple[NDArray[np.float64], NDArray[np.float64]],
        fresh: tuple[NDArray[np.float64], NDArray[np.float64]],
        chain: Chain | None = None,
    ) -> Conservative:
        """Fit to exact values, and raise the fit by what fresh ones show.

        Args:
            plan: What the tables are over.
            fitted: Inputs (n, I) and exact values (n, 2).
            fresh: The same at other configurations.
            chain: To the flange, of the joint values that are the first inputs; the bound of the position is
                then a multiple of how far uncertain constants move the centre.

        Raises:
            CoreError: Values are not positive or not finite, or shapes do not fit.
        """

    def factor(self) -> NDArray[np.float64] | None:
        """Standard deviations of constants, base and tool together (5 L + 9, 8); None without a chain.

        The first bound is a multiple of the norm of the centre's motion by them times this.
        """

    def content(self) -> BoundsContent:
        """All but tables and factor."""

    def blocks(self) -> list[dict[str, Any]]:
        """The tables, as Field.blocks."""

    def std(self, inputs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Position and rotation at inputs (n, I): (n, 2)."""

@final
class Posterior:
    """What the rows leave uncertain about constants and field, for known hyper-parameters."""

    def __init__(
        self,
        problem: Problem,
        parameters: NDArray[np.float64],
        setup: Setup,
        options: FieldOptions,
    ) -> None:
        """The posterior, linearised at parameters (L, 5) and set-up; options as for fit_field."""

    def covariance(
        self,
        inputs: NDArray[np.float64],
        jacobian: NDArray[np.float64],
        setup: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Covariance (n, m, m) of jacobian (n, m, P), by the problem's columns, times parameters.

        With `setup` (n, m, s), by the unknowns of all set-ups, their part is added.
        """

    def joint_covariance(
        self,
        inputs: NDArray[np.float64],
        jacobian: NDArray[np.float64],
        setup: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Covariance (n m, n m) of the rows of all configurations together; arguments as for `covariance`."""

    def cross_covariance(
        self,
        first: int,
        inputs: NDArray[np.float64],
        jacobian: NDArray[np.float64],
        setup: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Covariance (k m, (n - k) m) of the rows of the `first` k configurations with those of the others.

        Inputs, Jacobian and set-up are of all n, as for `covariance`.
        """

    @property
    def shot_variance(self) -> NDArray[np.float64]:
        """Variance of what shots of a pose differ by beside what they state, (2,): positions m^2, then
        orientations rad^2.
        """

    def first_shots(self, count: int) -> NDArray[np.uint64]:
        """For each of the first `count` residuals (n, m), counted row by row, the place of the first one of
        its pose, of whatever shot, (count,); its own where it took no part.
        """

    def repeatability(self, jacobian: NDArray[np.float64]) -> NDArray[np.float64]:
        """Covariance (n, m, m) of what joints miss anew at every pose, carried to jacobian (n, m, P)."""

    def prior(self, inputs: NDArray[np.float64], jacobian: NDArray[np.float64]) -> NDArray[np.float64]:
        """Variances (n, m) of jacobian (n, m, P) times parameters before any measurement."""

    def measurement_covariance(
        self,
        problem: Problem,
        parameters: NDArray[np.float64],
        setup: Setup,
        inputs: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Covariance (n, m, m) of the residuals of new measurements, base frame: arm, set-up and noise.

        Args:
            problem: The new measurements, with the columns and groups of the fit.
            parameters: The calibrated parameters there (n, L, 5).
            setup: Of the fit.
            inputs: Joint values and features there (n, I).
        """

@final
class ArmModel:
    """An arm as somebody believes it to be: where readings put its flange."""

    def __init__(
        self,
        chain: Chain,
        constants: NDArray[np.float64],
        coupling: NDArray[np.float64],
        field: Field | None = None,
        feature_count: int = 0,
        covariance: tuple[Sequence[int], NDArray[np.float64]] | None = None,
        bounds: Conservative | None = None,
    ) -> None:
        """Make a model.

        Args:
            chain: It ends at the flange.
            constants: Absolute parameters (L, 5).
            coupling: Joint values from readings (N, N).
            field: What is added to the constants, over joint values and features.
            feature_count: Features of the field.
            covariance: Ascending parameter indices (P) and their covariance (P, P), or (P + 9, P + 9) with
                those of the motion of the base (translation, rotation vector) and of the tool (translation in
                the flange's frame) as a device saw them behind them.
            bounds: Bounds of the standard deviation, in place of a covariance.
        """

@type_check_only
class CorrectorBounds(TypedDict):
    """How far a correction may go; SI, infinite for no bound.

    Attributes:
        joints: Lowest and highest readings, (N, 2), or (0, 2) for none.
        largest_angle: Largest change of a revolute joint's reading.
        largest_slide: Largest change of a prismatic joint's reading.
        largest_shift: Largest shift of the tool.
        largest_turn: Largest turn of the tool.
        largest_std: Largest standard deviation of the tool's position.
        shift_change: Largest change of the shift along a path, m per m.
        turn_change: Largest change of the turn along a path, rad per rad.
        residual: How far from its target the tool may stay.
        residual_turn: How far it may stay turned from it.
    """

    joints: NDArray[np.float64]
    largest_angle: float
    largest_slide: float
    largest_shift: float
    largest_turn: float
    largest_std: float
    shift_change: float
    turn_change: float
    residual: float
    residual_turn: float

@type_check_only
class CorrectorOptions(CorrectorBounds):
    """What a correction is to meet, and its bounds.

    Attributes:
        task: "pose", "axis" or "position".
        moving: Ascending joints from 0 that may change, or None for all.
    """

    task: str
    moving: Sequence[int] | None

@final
class Corrector:
    """Finds readings for which the calibrated model puts the tool where the programming model puts it."""

    def __init__(
        self,
        calibrated: ArmModel,
        programming: ArmModel,
        tool: NDArray[np.float64],
        options: CorrectorOptions,
    ) -> None:
        """Make a corrector.

        Args:
            calibrated: What the arm is.
            programming: What the program was written for.
            tool: flange_from_tool (4, 4).
            options: Task and bounds.

        Raises:
            CoreError: If the models have different joints or an option breaks a rule.
        """

    @staticmethod
    def usual() -> dict[str, float]:
        """The bounds of `options` where nothing is stated, but for those of joints."""

    def path(
        self, readings: NDArray[np.float64], features: Sequence[float], threads: int | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], list[tuple[int, int, str]]]:
        """Correct readings (n, N). Honours Ctrl-C; the result does not depend on the threads.

        Returns:
            Corrected readings (n, N), NaN where refused; residual (m, rad), size of the correction (m, rad)
            and standard deviation (m), (n, 5); refused waypoints from 0, each with number and words for why.
        """

    def one(
        self, readings: NDArray[np.float64], features: Sequence[float]
    ) -> tuple[NDArray[np.float64], tuple[int, str] | None]:
        """Correct readings (N,): corrected ones, NaN if refused; then number and words for why."""

@type_check_only
class StreamOptions(TypedDict):
    """How a stream's correction changes.

    Attributes:
        rate: Largest, of revolute and of prismatic joints, rad/s and m/s.
        acceleration: The same, rad/s^2 and m/s^2.
        ramp: How long the ramp takes, s.
        hold: How long the last correction is held, s.
        deadline: Longest time between two set-points, s.
    """

    rate: Sequence[float]
    acceleration: Sequence[float]
    ramp: float
    hold: float
    deadline: float

@final
class Stream:
    """Corrects set-points one after the other; the correction changes with bounded rate and acceleration.

    Where a set-point is missing, not finite, late or refused, the last correction is held, then ramped down.
    """

    def __init__(self, corrector: Corrector, options: StreamOptions) -> None:
        """Make a stream that is switched on.

        Args:
            corrector: Corrects single set-points.
            options: Bounds and times.

        Raises:
            CoreError: An option is not positive.
        """

    @staticmethod
    def usual() -> StreamOptions:
        """The options where nothing is stated."""

    def switch(self, on: bool) -> None:
        """Ramp the correction up or down from now on."""

    def step(
        self, readings: NDArray[np.float64] | None, features: Sequence[float], elapsed: float
    ) -> tuple[NDArray[np.float64] | None, str, float, float, str | None]:
        """The next set-point (N,), `elapsed` seconds after the one before.

        Returns:
            What to command, None before the first finite set-point; "off", "rising", "on", "holding" or
            "falling"; the share of the correction that is aimed at; how far the applied one is from it; and
            why it is an older one, if it is.
        """

@final
class Solver:
    """Finds readings for poses, near a seed."""

    def __init__(self, model: ArmModel, tool: NDArray[np.float64], options: CorrectorOptions) -> None:
        """Make a solver for flange_from_tool (4, 4); options as for Corrector."""

    def solve(
        self,
        poses: NDArray[np.float64],
        seed: NDArray[np.float64],
        features: Sequence[float],
        threads: int | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], list[tuple[int, int, str]]]:
        """Readings for base_from_tool (n, 4, 4).

        Args:
            poses: Targets.
            seed: Readings (n, N) for each, or (N,) for the first; each other one starts from the one before.
            features: Values of the model's features.
            threads: Bound on the threads used.

        Returns:
            Readings (n, N), NaN where there is no solution; residuals in m and rad (n, 2); those without, as
            for Corrector.path.
        """

@type_check_only
class ConstantOptions(TypedDict):
    """How constants are fitted.

    Attributes:
        prior: Standard deviation of lengths (m), of angles (rad), whether the evidence scales them; or None.
        noise: Of positions and orientations (m, rad), or None to estimate it.
        robust: "huber", "cauchy", "none" or None.
        start: A set-up to begin at, or None.
        parameters: Of a fixed arm (L, 5) or (n, L, 5), where the search begins with columns (L, 5), or None.
        threads: At the most, or None for all.
    """

    prior: tuple[float, float, bool] | None
    noise: tuple[float, float] | None
    robust: str | None
    start: Setup | None
    parameters: NDArray[np.float64] | None
    threads: int | None

def fit_constant(problem: Problem, options: ConstantOptions) -> ConstantFit:
    """Fit constants and set-up.

    Args:
        problem: With no columns, frames and targets are fitted alone.
        options: How to fit.

    Raises:
        CoreError: Measurements are too few or too alike.
    """

@type_check_only
class FieldOptions(TypedDict):
    """How a field is fitted.

    Attributes:
        determined: Indices into the problem's columns of the constants that the poses determine.
        driven: Indices into the problem's columns of what the field varies.
        features: Values of the F features (n, F).
        feature_ranges: How far each reaches.
        payloads: Features, from 0, that are loads on the flange.
        coupling: Joint values from readings (J, J).
        degree: Of the splines, 2 or 3.
        prior: As for fit_constant.
        hyper: Hyper-parameters to keep, or None to find them.
        near: A fit to nearly the same rows, at whose hyper-parameters the search begins, or None.
        contested: Whether a search from nothing stands against that one.
        rough: Whether those of a search on a part of the rows are enough.
        threads: At the most, or None for all.
    """

    determined: Sequence[int]
    driven: Sequence[int]
    features: NDArray[np.float64]
    feature_ranges: Sequence[float]
    payloads: Sequence[int]
    coupling: NDArray[np.float64]
    degree: int
    prior: tuple[float, float, bool]
    hyper: dict[str, list[float]] | None
    near: FieldFit | None
    contested: bool
    rough: bool
    threads: int | None

def fit_field(problem: Problem, constant: ConstantFit, options: FieldOptions) -> FieldFit:
    """Fit constants, field and set-up together. Honours Ctrl-C.

    Args:
        problem: Over all candidates.
        constant: The constants' fit, over those that are determined.
        options: How to fit.

    Weights of the measurements between zero and one are where the search begins; after it every row is judged
    by the others. Rows of weight zero take no part.

    Raises:
        CoreError: Values are far outside the model, options or the constants' fit are another problem's, or
            nothing was measured or is driven.
    """

def find_drift(
    progress: NDArray[np.float64],
    residual: NDArray[np.float64],
    weight: NDArray[np.float64],
    wanted: NDArray[np.float64],
    most_steps: int,
) -> tuple[NDArray[np.float64], float, list[float], float]:
    """How a set-up moved while it was measured.

    Args:
        progress: When each row was measured, parts of the session (n,).
        residual: What is left of it (n, 3), m.
        weight: What its noise variance is divided by (n,), positive.
        wanted: When to tell how far it had moved (t,).
        most_steps: How often it may have moved at once.

    Returns:
        Displacements (t, 3), m, whose mean over the measured rows is zero; standard deviation of a
        coordinate that is left at weight one, m; when it moved at once, ascending, in the middle between two
        rows (s,); logarithm of the evidence over that of no drift.

    Raises:
        CoreError: There are fewer than two rows, or a value is not finite, or a weight not positive.
    """

def identifiability(
    problem: Problem, parameters: NDArray[np.float64], setup: Setup
) -> tuple[list[int], list[tuple[int, list[tuple[int, float]], bool]], int, float]:
    """Which columns the poses determine.

    Returns:
        Determined indices into the problem's columns; for each of the others its index, the (index, part) it
        is confounded with and whether the set-up takes part; rank of arm and set-up; their condition number.
    """

def residuals(problem: Problem, parameters: NDArray[np.float64], setup: Setup) -> NDArray[np.float64]:
    """Measured minus predicted (n, m), base frame, zero where not measured; of distances (d, 1).

    Args:
        problem: Its columns do not matter.
        parameters: (L, 5), or (n, L, 5) where they vary.
        setup: Frames, targets and anchors.
    """

def find_bytes(text: bytes, word: bytes) -> int | None:
    """Where `word` stands in `text` for the first time; None if it does not."""

def scan_lines(
    text: bytes,
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Lines of a program's text and where all their numbers are.

    Digits within names are no numbers; a sign belongs to its number unless something that it could be
    subtracted from stands before it. Lines end with a line feed.

    Returns:
        First byte of each line and the length of the text (l + 1,); for each line which of the different
        lines it is, numbers apart (l,); for each different line the first that is so (k,); for each line its
        first number, and how many there are (l + 1,); and the first byte of each number (m,).

    Raises:
        CoreError: The text has 2 GiB or more.
    """

def read_numbers(
    text: bytes, starts: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.int16]]:
    """What numbers say that begin at `starts` (n, k), as `scan_lines` finds them.

    Returns:
        Of each the byte behind the last, the value, and the digits behind the point, at most 400; (n, k).

    Raises:
        CoreError: At one of the places no number begins.
    """

def splice_numbers(
    text: bytes,
    spans: tuple[NDArray[np.int32], NDArray[np.int32]],
    values: NDArray[np.float64],
    decimals: NDArray[np.int16],
    words: list[tuple[int, int, bytes]],
) -> bytes:
    """`text` with other numbers and words in it; every other byte stays.

    Args:
        text: The text.
        spans: First byte, and the byte behind the last, of what the numbers replace, in order, (m,) each.
        values: The numbers, (m,). A number that replaces one with a "+" gets one.
        decimals: Digits behind the point, (m,).
        words: First byte, the byte behind the last, and what replaces them, in order; an empty span inserts.

    Raises:
        CoreError: Spans do not fit the text or overlap, or a number is not finite.
    """

def linearise(
    problem: Problem, parameters: NDArray[np.float64], setup: Setup
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Derivatives with respect to the problem's columns, (n, m, P), and residuals, (n, m), base frame.

    The set-up is held; rows where nothing was measured are zero.

    Args:
        problem: Of points or poses, not of distances.
        parameters: (L, 5), or (n, L, 5) where they vary.
        setup: Frames and targets.
    """

def setup_jacobian(problem: Problem, parameters: NDArray[np.float64], setup: Setup) -> NDArray[np.float64]:
    """Derivatives (n, m, W) of the prediction with respect to the unknowns of each pose's own set-up.

    These are shift and turn of world_from_base from the right (unless the world is known), the targets'
    points in the flange frame, and the turn of flange_from_target from the right (if it was measured). Base
    frame.
    """

def step_setup(problem: Problem, setup: Setup, step: NDArray[np.float64]) -> Setup:
    """The set-up after a step (G, W) of the unknowns of `setup_jacobian`."""

@type_check_only
class Candidates(TypedDict):
    """Poses that could be measured, m entries each.

    Attributes:
        noise: Covariance of each measurement (c, m, m).
        points: Where they are (c, 3), m.
        apart: Distance that they are chosen at from one another, as long as there are such, m.
    """

    noise: NDArray[np.float64]
    points: NDArray[np.float64]
    apart: float

def choose_informative(
    covariance: NDArray[np.float64], candidates: Candidates, count: int
) -> tuple[list[int], list[float]]:
    """Candidates, one after the other, that leave the targets the least variance. Honours Ctrl-C.

    Args:
        covariance: (c m + t, c m + t) of what c candidates would show, m entries each, then of t targets.
        candidates: What can be measured.
        count: How many.

    Returns:
        Indices, and the sum of the targets' variances before the first choice and after each.
    """

def choose_telling(
    changed: NDArray[np.float64],
    unchanged: NDArray[np.float64],
    candidates: Candidates,
    count: int,
) -> tuple[list[int], list[float]]:
    """Candidates, one after the other, that tell most about what may have changed. Honours Ctrl-C.

    Args:
        changed: Covariance (c m, c m) of what the candidates would show if the changes have happened.
        unchanged: The same without them.
        candidates: As for `choose_informative`.
        count: How many.

    Returns:
        Indices, and the information about the changes, nat, before the first choice and after each.
    """

@type_check_only
class NetworkOptions(TypedDict):
    """What a network is.

    Attributes:
        membership: "gaussian" (A3), "bspline" (degree c - 1, c from 2 to 4) or "quantised" (the CMAC).
        sigma: Of "gaussian", in cells.
        composition: "min" or "product".
        table: Rows of a hash table, or None for a row of weights for each association cell.
    """

    membership: str
    sigma: float
    composition: str
    table: int | None

@type_check_only
class TrainingRule(TypedDict):
    """How a network is trained by rule (A5), whatever its outputs are.

    Attributes:
        rate: Above 0 and below 2.
        normalise: "printed" for w += rate mu (CEP - CEP') or "squares" for that times sum(mu) / sum(mu^2).
        tolerance: Largest difference allowed in m, angles at 0.3 m.
        epochs: At the most.
    """

    rate: float
    normalise: str
    tolerance: float
    epochs: int

@type_check_only
class TrainingOptions(TrainingRule):
    """The rule, and what the outputs are.

    Attributes:
        columns: Parameter indices (P,), 5 * link + (theta, d, a, alpha, beta): they tell angles from lengths.
    """

    columns: Sequence[int]

@type_check_only
class NetworkFitOptions(TypedDict):
    """How a network is fitted to measurements.

    Attributes:
        columns: As in TrainingOptions.
        targets: Of a pose: three rows each, and behind them three of the orientation if it was measured.
        scales: Standard deviations in m (angles at 0.3 m) of the noise, of second differences of weights
            along an input, and of what has none; None to find them by maximum marginal likelihood.
        threads: At the most, or None for all.
    """

    columns: Sequence[int]
    targets: int
    scales: tuple[float, float, float] | None
    threads: int | None

@final
class Network:
    """A CMAC or FCMAC of I inputs and P outputs, after section 5 and the appendix of the paper.

    Every input has a sensor: cells at equal distances between its ends, of which the c with the largest
    grades are active. An association cell combines one cell of each sensor; the output is the centroid (A4)
    of the weights of the A active ones. Inputs beyond a sensor's range count as its nearest end. Association
    cells are numbered with the last input running fastest. A network does not change: training and fitting
    make new ones.

    Raises:
        CoreError: A number is out of its range, a shape does not fit, a value is not finite.
    """

    def __init__(
        self, sensors: Sequence[tuple[float, float, int, int]], outputs: int, options: NetworkOptions
    ) -> None:
        """A network whose weights are zero.

        Args:
            sensors: For each input its lower and upper end, number of cells, and c, 1 to 8.
            outputs: P.
            options: Its cells and their composition.
        """

    @property
    def sensors(self) -> list[tuple[float, float, int, int]]:
        """For each input its lower and upper end, number of cells, and c."""

    @property
    def outputs(self) -> int:
        """P."""

    @property
    def sensor_cells(self) -> int:
        """Cells of all sensors."""

    @property
    def cell_count(self) -> int:
        """Association cells, whether or not they share rows of weights."""

    @property
    def active_count(self) -> int:
        """A, the product of all c."""

    @property
    def table_size(self) -> int:
        """Rows of weights."""

    @property
    def weights(self) -> NDArray[np.float64]:
        """(table_size, P)."""

    def with_weights(self, weights: NDArray[np.float64]) -> Network:
        """The same network with other weights (table_size, P)."""

    def active(self, s: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Active association cells and their excitation, (n, A) each, of inputs (n, I)."""

    def output(
        self, s: NDArray[np.float64], out: NDArray[np.float64] | None = None, threads: int | None = None
    ) -> NDArray[np.float64]:
        """Outputs (n, P) of inputs (n, I); into `out` if it is given. `threads` does not change them."""

    def train(self, s: NDArray[np.float64], ceps: NDArray[np.float64], options: TrainingOptions) -> Training:
        """Train by rule (A5) on wanted CEPs (k, P) at inputs (k, I); weights start at the mean CEPs.

        Honours Ctrl-C.

        Args:
            s: Inputs.
            ceps: m and rad.
            options: How to train.
        """

    def train_on_measurements(
        self,
        s: NDArray[np.float64],
        jacobian: NDArray[np.float64],
        residual: NDArray[np.float64],
        options: TrainingOptions,
        targets: int = 1,
    ) -> Training:
        """Train by rule (A5) on rows as `linearise` gives them. Honours Ctrl-C.

        The smallest change of CEPs that explains what is left of a pose's residual stands for CEP - CEP';
        angles count at 0.3 m. Outputs are what is to be added to the parameters of the linearisation.

        Args:
            s: Inputs (n, I).
            jacobian: (n, m, P).
            residual: (n, m).
            options: As for `train`; the tolerance is that of residuals.
            targets: As in NetworkFitOptions.
        """

    def fit(
        self,
        s: NDArray[np.float64],
        jacobian: NDArray[np.float64],
        residual: NDArray[np.float64],
        options: NetworkFitOptions,
    ) -> NetworkFit:
        """Fit the weights to rows as `linearise` gives them, with a roughness penalty. Honours Ctrl-C.

        Args:
            s: Inputs (n, I).
            jacobian: (n, m, P).
            residual: (n, m); n m is 12000 at most.
            options: How to fit.
        """

@final
class Training:
    """A trained network and how training went."""

    @property
    def network(self) -> Network:
        """The network."""

    @property
    def epochs(self) -> int:
        """Runs through all patterns."""

    @property
    def converged(self) -> bool:
        """Whether every difference is within the tolerance."""

    @property
    def reason(self) -> str:
        """Why training ended, in words."""

    @property
    def largest(self) -> float:
        """Largest difference left, m; angles at 0.3 m."""

    @property
    def rms(self) -> float:
        """Root mean square of the differences left, m; angles at 0.3 m."""

    @property
    def cells_excited(self) -> int:
        """Association cells that the patterns excite."""

    @property
    def collisions(self) -> int:
        """How many of them share their row of weights with another one."""

@final
class NetworkFit:
    """A network fitted to measurements."""

    @property
    def network(self) -> Network:
        """The network."""

    @property
    def scales(self) -> tuple[float, float, float]:
        """Standard deviations of noise, second differences and level, m."""

    @property
    def residual(self) -> NDArray[np.float64]:
        """What the network leaves of the residuals, (n, m)."""

@type_check_only
class ChoiceOptions(TypedDict):
    """How poses are chosen from a pool.

    Attributes:
        columns: Parameter indices (P,).
        criterion: "kappa", "d" (determinant) or "o1" to "o5".
        limit: Of kappa(M), or None.
        given: Jacobians (k, m, P) of poses that are measured anyway, or None.
        start: Candidates (count,) to exchange from, or None.
        passes: Runs through the chosen poses at the most.
    """

    columns: Sequence[int]
    criterion: str
    limit: float | None
    given: NDArray[np.float64] | None
    start: NDArray[np.int64] | None
    passes: int

@final
class Choice:
    """Chosen poses and what the choice gained. Indices are those of `observability`."""

    @property
    def chosen(self) -> list[int]:
        """Indices into the pool, ascending."""

    @property
    def before(self) -> dict[str, float]:
        """Indices of the start, or of candidates taken evenly from the pool."""

    @property
    def after(self) -> dict[str, float]:
        """Indices of the chosen poses."""

    @property
    def exchanges(self) -> int:
        """Exchanges made."""

    @property
    def well_conditioned(self) -> bool:
        """Whether kappa is finite and within the limit; else the pool cannot be well conditioned."""

def choose_poses(jacobian: NDArray[np.float64], count: int, options: ChoiceOptions) -> Choice:
    """Choose poses from a pool by exchange. Honours Ctrl-C.

    Args:
        jacobian: The candidates' (N, m, P), m and rad, m from 3 to 6.
        count: How many to choose.
        options: Criterion, limit, and where to begin.

    Raises:
        CoreError: A number is out of its range, a shape does not fit, a value is not finite.
    """

def observability(
    jacobian: NDArray[np.float64], columns: Sequence[int], targets: int = 1
) -> dict[str, float]:
    """Indices of poses with Jacobians (n, m, P): three rows for each target, then three of an orientation.

    They are of the matrix M in mm (orientations at 300 mm) per mm and 1/300 rad.

    Returns:
        kappa, the condition number of M; kappa_normal, that of M^t M, equation (4) as meant; o1 (Borm and
        Menq), o2 (Driels and Pathre), o3 (Nahvi, Hollerbach and Hayward), o4 (Nahvi and Hollerbach), o5 (Sun
        and Hollerbach); log_det of M^t M.
    """

def non_negative_least_squares(
    columns: NDArray[np.float64], target: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The x (n,), none of it negative, that makes columns (m, n) times x come nearest to the target (m,).

    After Lawson and Hanson, Solving Least Squares Problems (1974), chapter 23. What depends on columns in use
    stays at zero, and so do columns shorter than 1e-8 of the longest one.

    Raises:
        CoreError: If the columns are not of as many rows as the target, or an entry is not finite.
    """

def independent_columns(jacobian: NDArray[np.float64], columns: Sequence[int]) -> list[int]:
    """Positions of the columns of a Jacobian (n, m, P) that none before them can stand for, ascending.

    Args:
        jacobian: m and rad.
        columns: A parameter of each one's kind (P,).
    """

@final
class Regions:
    """A tree of boxes in F features: the divided workspace. Region 0 is the whole; halves follow their whole.

    A tree does not change: what divides it further makes a new one. Points outside the workspace count as
    the nearest ones of it.
    """

    def __init__(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
        """One region between two corners (F,)."""

    @staticmethod
    def from_arrays(arrays: Mapping[str, NDArray[Any]]) -> Regions:
        """The tree that `arrays` was asked of."""

    def arrays(self) -> dict[str, NDArray[Any]]:
        """What to save.

        low and high (F,), axis (N,), along which a region is halved, and child (N,), the number of its lower
        half; -1 for leaves.
        """

    @property
    def count(self) -> int:
        """N, regions of all sizes."""

    @property
    def leaves(self) -> NDArray[np.int64]:
        """Numbers of the regions that are not halved, ascending."""

    @property
    def parents(self) -> NDArray[np.int64]:
        """Of which region each is a half, (N,); -1 for the whole."""

    @property
    def depths(self) -> NDArray[np.int64]:
        """How many times the workspace was halved to get each, (N,)."""

    @property
    def low(self) -> NDArray[np.float64]:
        """Lower corners, (N, F)."""

    @property
    def high(self) -> NDArray[np.float64]:
        """Upper corners, (N, F)."""

    def find(self, features: NDArray[np.float64]) -> NDArray[np.int64]:
        """Numbers of the leaves (n,) of points (n, F)."""

    def neighbours(self, leaf: int) -> list[int]:
        """Leaves that share a face with a leaf."""

    def halve(self, leaf: int, axis: int) -> Regions:
        """The tree with a leaf halved along an axis."""

    def evenly(self, leaves: int) -> Regions:
        """The tree halved to so many leaves, the largest first along their longest side."""

@final
class RegionalFit:
    """CEPs of all regions of a tree."""

    @property
    def ceps(self) -> NDArray[np.float64]:
        """What is added to the parameters, (N, P); NaN where there are none."""

    @property
    def kappa(self) -> NDArray[np.float64]:
        """Condition number of the rows in each region, (N,)."""

    @property
    def poses(self) -> NDArray[np.int64]:
        """Poses in each region, (N,)."""

    @property
    def noise(self) -> float | None:
        """Noise in m that shrinking found."""

    @property
    def prior(self) -> NDArray[np.float64]:
        """Standard deviation in m of a half's CEPs about its whole's, by depth from 1 on."""

@type_check_only
class RegionalOptions(TypedDict):
    """How CEPs of regions are estimated.

    Attributes:
        method: "least_squares", in each region alone, or "shrunk", towards the region it is half of.
        prior: Standard deviation in m of that step, or None to find it from the measurements.
    """

    method: str
    prior: float | None

def regional_ceps(
    regions: Regions,
    problem: Problem,
    parameters: NDArray[np.float64],
    setup: Setup,
    features: NDArray[np.float64],
    options: RegionalOptions,
) -> RegionalFit:
    """Estimate the CEPs of every region, of all sizes, from the measurements in it; the set-up is held.

    Args:
        regions: The tree.
        problem: The measurements and the CEPs' columns.
        parameters: Those that CEPs are added to, (L, 5).
        setup: Frames and targets.
        features: Of each measurement, (n, F).
        options: How to estimate.
    """

def fill_without_data(regions: Regions, ceps: NDArray[np.float64]) -> NDArray[np.float64]:
    """CEPs (N, P) with the mean of the neighbours' in leaves where they are NaN."""

@final
class Division:
    """A divided workspace."""

    @property
    def regions(self) -> Regions:
        """The tree."""

    @property
    def ceps(self) -> NDArray[np.float64]:
        """Least-squares CEPs of every region, (N, P); NaN where it is inaccessible."""

    @property
    def kappa(self) -> NDArray[np.float64]:
        """Condition number of the poses they were identified from, (N,)."""

    @property
    def error(self) -> NDArray[np.float64]:
        """Largest error at a test point, (N,), m; NaN where there is none."""

    @property
    def ended(self) -> list[str | None]:
        """Why each leaf is one; None for regions that are halved."""

    @property
    def batches(self) -> list[tuple[int, int, bool]]:
        """Region, number of poses and whether they are test points, in the order of measuring."""

    @property
    def measurements(self) -> int:
        """Poses that were measured, test points and those of halved regions included."""

class Workspace(Protocol):
    """An arm and its instrument, as a division sees them."""

    def candidates(
        self, low: NDArray[np.float64], high: NDArray[np.float64], count: int, seed: int, /
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Joint values (k, J) and features (k, F) of up to `count` poses of a box that can be measured."""

    def measure(self, q: NDArray[np.float64], /) -> MeasurementSet:
        """Measure poses with joint values (k, J), all of one group."""

@type_check_only
class DivisionOptions(TypedDict):
    """How a workspace is divided.

    Attributes:
        low: Lower corner (F,) of the workspace.
        high: Its upper corner (F,).
        accuracy: The demanded one in m.
        regions: Leaves at the most.
        halving: "longest" side or "best" axis.
        order: "worst" or "breadth" first.
        poses: Of a region; where rows are given, the least that it needs.
        limit: Of kappa(M).
        seed: Of what is drawn.
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    accuracy: float
    regions: int
    halving: str
    order: str
    poses: int
    limit: float
    seed: int

@type_check_only
class MeasuringOptions(TypedDict):
    """What is measured in each region.

    Attributes:
        candidates: Poses to choose from.
        tests: Poses to judge by.
        criterion: As for `choose_poses`.
        passes: As for `choose_poses`.
        orientation: Whether it is measured.
    """

    candidates: int
    tests: int
    criterion: str
    passes: int
    orientation: bool

def divide(
    chain: Chain,
    columns: Sequence[int],
    parameters: NDArray[np.float64],
    setup: Setup,
    workspace: Workspace,
    options: DivisionOptions,
    measuring: MeasuringOptions,
) -> Division:
    """Divide a workspace that is measured on demand, steps 1 to 4 of section 4.2 of the paper.

    Args:
        chain: It ends at the flange.
        columns: Parameters that CEPs belong to.
        parameters: Those that CEPs are added to, (L, 5).
        setup: Frame and target of the one set-up.
        workspace: Called on the calling thread; what it raises ends the division.
        options: Corners, accuracy, numbers and order.
        measuring: What is measured in each region.

    Raises:
        CoreError: The whole workspace has too few or ill-conditioned poses, or a number is out of range.
    """

def divide_rows(
    problem: Problem,
    parameters: NDArray[np.float64],
    setup: Setup,
    features: NDArray[np.float64],
    judges: NDArray[np.bool_],
    options: DivisionOptions,
) -> Division:
    """Divide a workspace by measurements that were made already.

    Args:
        problem: The measurements and the CEPs' columns.
        parameters: Those that CEPs are added to, (L, 5).
        setup: Frames and targets.
        features: Of each measurement, (n, F).
        judges: Which of them judge and take no part in any fit, (n,).
        options: As for `divide`.
    """
