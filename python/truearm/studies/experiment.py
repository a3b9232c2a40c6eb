"""One virtual arm, divided and measured: the rows that all schemes are given."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Protocol

import numpy as np

from truearm._core import Problem, Regions, Setup
from truearm.defaults import PAPER_POSES
from truearm.fits.core_set import known_setup, measured_points
from truearm.fits.identified import IdentifiedArm
from truearm.planning.dividing import DivisionOptions, divide_space, named_columns
from truearm.planning.pool import PoolOptions, needed_pool
from truearm.planning.spaces import Space
from truearm.planning.workspace import Workspace
from truearm.robot import Robot
from truearm.simulation import PAPER_PARAMETERS
from truearm.studies.setting import (
    CANDIDATES,
    CELLS,
    DEMANDED_M,
    FREE_TO_STOP,
    MAIN_READING,
    MEMBERSHIPS,
    NOISE_MM,
    TEST_POINTS,
    WORKSPACE_POSES,
    Kind,
    Reading,
    paper_arm,
    space_of,
)
from truearm.types import Floats
from truearm.units import to_si

WORKSPACE_SEED: Final = 7


class KnownArm(Protocol):
    """An arm of which it is known how it really is."""

    @property
    def robot(self) -> Robot:
        """The arm as it is meant to be."""

    @property
    def seed(self) -> int:
        """What it was drawn from."""

    def true_position(self, q: Floats) -> Floats:
        """Where the tool really is (n, 3) at readings (n, N), in the frame that measurements are in."""


@dataclass(frozen=True)
class Plan:
    """What is simulated.

    Attributes:
        kind: Which space is divided.
        regions: Number of regions that is forced; None to stop where the demanded accuracy is met.
        noisy: Whether measurements have the paper's 3 % of noise.
        reading: How the errors are read.
    """

    kind: Kind = "joint"
    regions: int | None = None
    noisy: bool = False
    reading: Reading = MAIN_READING


@dataclass(frozen=True, eq=False)
class Experiment:
    """A divided space with the measurements of its regions.

    Attributes:
        plan: What was asked for.
        arm: The arm that was measured.
        space: The space.
        regions: The tree.
        node_error_m: Largest error at the test points of each node.
        node_kappa: Condition number of M of each node.
        readings: Of the rows that identify the regions, (n, N).
        points: Measured there (n, 3), in the world.
        measured: How many poses were measured in all, parents and test points counted.
    """

    plan: Plan
    arm: KnownArm
    space: Space
    regions: Regions
    node_error_m: Floats
    node_kappa: Floats
    readings: Floats
    points: Floats
    measured: int

    @cached_property
    def identified(self) -> IdentifiedArm:
        """The arm with its base as a row of its own."""
        return IdentifiedArm(self.arm.robot, "world")

    @cached_property
    def columns(self) -> list[int]:
        """The fifteen parameters of section 6."""
        return named_columns(self.identified, PAPER_PARAMETERS)

    @cached_property
    def setup(self) -> Setup:
        """The device's frame is the world; the measured point is the tool."""
        return known_setup(self.arm.robot.tool[:3, 3])

    @cached_property
    def features(self) -> Floats:
        """Coordinates (n, D) of the rows."""
        return self.space.coordinates(self.readings)

    @cached_property
    def problem(self) -> Problem:
        """The rows and the fifteen unknowns."""
        values = self.arm.robot.joints_from_readings(self.readings)
        measured = measured_points(values, self.points)
        return Problem(self.identified.flange_chain, measured, self.columns, world_is_known=True)

    @cached_property
    def sensors(self) -> list[tuple[float, float, int, int]]:
        """Sensor layer of the paper's network: low, high, cells and c of each input."""
        cells = CELLS[self.plan.kind]
        ends = zip(self.space.low.tolist(), self.space.high.tolist(), cells, strict=True)
        return [(low, high, count, MEMBERSHIPS) for low, high, count in ends]

    @cached_property
    def workspace(self) -> Floats:
        """Readings (3000, N) all over the space, to judge at."""
        options = PoolOptions(seed=(self.arm.seed, WORKSPACE_SEED))
        return needed_pool(self.space, WORKSPACE_POSES, options).readings

    def without(self, node: int) -> "Experiment":
        """The same without the rows of one leaf."""
        kept = self.regions.find(self.features) != node
        return replace(self, readings=self.readings[kept], points=self.points[kept])


def conduct(seed: int, plan: Plan) -> Experiment:
    """Divide the space of one virtual arm and keep what was measured in the leaves."""
    arm, space = paper_arm(seed, plan.reading), space_of(plan.kind)
    rng = np.random.default_rng([seed, 11])
    noise_m = to_si(NOISE_MM, "mm") if plan.noisy else 0.0

    def measure(readings: Floats) -> Floats:
        return np.asarray(arm.true_position(readings) + noise_m * rng.normal(size=(len(readings), 3)))

    workspace = Workspace(space, measure)
    forced = plan.regions is not None
    options = DivisionOptions(
        accuracy_m=0.0 if forced else DEMANDED_M,
        most_regions=plan.regions if plan.regions is not None else FREE_TO_STOP,
        poses=PAPER_POSES,
        candidates=CANDIDATES,
        tests=TEST_POINTS,
        seed=seed,
    )
    found = divide_space(IdentifiedArm(arm.robot, "world"), workspace, PAPER_PARAMETERS, options)
    readings, points = np.concatenate(workspace.readings), np.concatenate(workspace.points)
    is_leaf = found.identifying_rows()
    return Experiment(
        plan=plan,
        arm=arm,
        space=space,
        regions=found.regions,
        node_error_m=found.error_m,
        node_kappa=found.kappa,
        readings=readings[is_leaf],
        points=points[is_leaf],
        measured=found.measured,
    )
