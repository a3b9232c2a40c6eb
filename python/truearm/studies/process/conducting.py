"""The experiment conducted: the session measured, all schemes fitted to it, and judged on paths."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from truearm.cell.accepted import accepted_table
from truearm.cell.cell_file import Cell
from truearm.cell.measuring import Progress
from truearm.cell.session import Session
from truearm.cell.summary import summary_of
from truearm.cell.virtual.measuring import measure_virtually
from truearm.cell.virtual.world import true_arm, true_frame
from truearm.errors import WorkError
from truearm.planning.pool import PoolOptions, needed_pool
from truearm.robot import Robot
from truearm.rotations import rigid_inverse
from truearm.simulation import VirtualArm
from truearm.stages import Stages
from truearm.studies.experiment import Experiment, Plan
from truearm.studies.metrics import Trace, along, sizes, trace
from truearm.studies.paper import Drawn
from truearm.studies.process.following import followed
from truearm.studies.process.planning import TEST, TRAIN, Planned, plan_experiment, regions_that_suffice
from truearm.studies.process.setting import (
    DEMANDED_MM,
    SECONDS_A_MEASUREMENT,
    Setting,
    cell_text,
    path,
    random_paths,
    space,
)
from truearm.studies.schemes import Kept, Scheme, all_schemes
from truearm.studies.setting import WORKSPACE_POSES
from truearm.types import Floats
from truearm.units import MM_PER_METRE

Result = dict[str, Any]

RANDOM_PATHS: Final = 10
PATHS_DRAWN: Final = 13
SECONDS_AN_HOUR: Final = 3600.0
SESSION: Final = "session.db"


@dataclass(frozen=True, eq=False)
class ArmInCell:
    """The virtual arm as the registered frame shows it.

    Attributes:
        truth: The arm.
        registered_from_base: Where its base really is (4, 4) in the frame that was registered.
    """

    truth: VirtualArm
    registered_from_base: Floats

    @property
    def robot(self) -> Robot:
        """See KnownArm."""
        return self.truth.robot

    @property
    def seed(self) -> int:
        """See KnownArm."""
        return self.truth.seed

    def true_position(self, q: Floats) -> Floats:
        """See KnownArm."""
        turn, shift = self.registered_from_base[:3, :3], self.registered_from_base[:3, 3]
        return np.asarray(self.truth.true_position(q) @ turn.T + shift)


@dataclass(frozen=True, eq=False)
class Measured:
    """What the session brought.

    Attributes:
        made: The regions with the rows that identify them, in the registered frame.
        readings: Test points: where the arm was (n, N).
        points: What was measured there (n, 3), in the registered frame, m.
        facts: Numbers of the session.
    """

    made: Experiment
    readings: Floats
    points: Floats
    facts: Mapping[str, float]


def conduct_experiment(
    setting: Setting, directory: Path, report: Callable[[Progress], None], stages: Stages
) -> tuple[Result, Drawn]:
    """Measure in the virtual cell, fit all schemes and judge them: the results, and what is drawn.

    Args:
        setting: How large it is.
        directory: Where the session is kept; one that is there is continued.
        report: Told of the progress of measuring.
        stages: Called with the name of each stage of the rest.
    """
    with stages("planning the poses"):
        plan = plan_experiment(setting)
    measure_virtually(cell_text(setting), plan.poses, directory / SESSION, report)
    found = measured(setting, plan, directory / SESSION)
    with stages("fitting the schemes"):
        schemes = all_schemes(found.made, Kept())
    with stages("judging them on paths"):
        figure, drawn = _figure(found, schemes)
        facts = {**found.facts, "regions_that_suffice": float(regions_that_suffice(setting))}
        result = {"figure10": figure, "paths": _paths(found.made, schemes), "session": facts}
    return result, drawn


def measured(setting: Setting, plan: Planned, path_of_session: Path) -> Measured:
    """What a session that is done brought.

    Raises:
        WorkError: If too little of it could be measured.
    """
    cell = Cell.from_toml(cell_text(setting))
    truth = true_arm(cell)
    with Session(path_of_session, writing=False) as session:
        table, summary, known = accepted_table(session), summary_of(session), session.registration()
    if known is None or table.empty:
        raise WorkError("nothing was measured", where=str(path_of_session))
    registered_from_world = rigid_inverse(known[0])
    turn, shift = registered_from_world[:3, :3], registered_from_world[:3, 3]
    readings = table[[f"q{j + 1}" for j in range(truth.robot.joint_count)]].to_numpy()
    points = table[["x", "y", "z"]].to_numpy() @ turn.T + shift
    purpose = table["purpose"].to_numpy()
    used, tests = purpose == TRAIN, purpose == TEST
    leaves = np.asarray(plan.regions.leaves)
    made = Experiment(
        plan=Plan("cartesian", setting.regions, noisy=True),
        arm=ArmInCell(truth, registered_from_world @ true_frame(cell, truth)),
        space=space(),
        regions=plan.regions,
        node_error_m=np.full(len(plan.kappa), np.nan),
        node_kappa=plan.kappa,
        readings=np.ascontiguousarray(readings[used]),
        points=np.ascontiguousarray(points[used]),
        measured=plan.in_all,
    )
    facts = {
        "regions": float(len(leaves)),
        "poses": float(setting.poses),
        "condition_median": float(np.nanmedian(plan.kappa[leaves])),
        "measurements": float(used.sum()),
        "test_points": float(tests.sum()),
        "skipped": float(len(summary["skipped"])),
        "contacts": float(summary["readings"]),
        "registration_mm": float(known[1]),
        "hours": used.sum() * SECONDS_A_MEASUREMENT / SECONDS_AN_HOUR,
        "hours_in_all": summary["measured"] * SECONDS_A_MEASUREMENT / SECONDS_AN_HOUR,
    }
    return Measured(made, readings[tests], points[tests], facts)


def _figure(found: Measured, schemes: Mapping[str, Scheme]) -> tuple[Result, Drawn]:
    """Every scheme on the path of Figure 10, over the space, and at the test points of the regions."""
    made, traces, result = found.made, {}, {}
    workspace = needed_pool(made.space, WORKSPACE_POSES, PoolOptions(seed=made.arm.seed)).readings
    (readings, _), box = made.space.readings(path()), space()
    for name, scheme in schemes.items():
        traces[name] = followed(made, box, scheme, path())
        result[name] = {
            "path": _along(made, traces[name], readings),
            "workspace": sizes(trace(made, scheme, workspace).size_mm),
            "tests": _tests(found, scheme),
        }
    return result, Drawn(made, readings, traces)


def _paths(made: Experiment, schemes: Mapping[str, Scheme]) -> Result:
    """Every scheme on straight paths between random points."""
    rng = np.random.default_rng([made.arm.seed, PATHS_DRAWN])
    points, box = np.concatenate(random_paths(RANDOM_PATHS, rng)), space()
    result: Result = {}
    for name, scheme in schemes.items():
        each = np.split(followed(made, box, scheme, points).size_mm, RANDOM_PATHS)
        means = [float(np.nanmean(size_mm)) for size_mm in each]
        result[name] = {
            "mean_mm": float(np.mean(means)),
            "worst_mean_mm": max(means),
            "worst_to_best": max(means) / min(means),
        }
    return result


def _along(made: Experiment, found: Trace, readings: Floats) -> dict[str, float]:
    """Sizes and jumps along a path, of the points that were reached."""
    kept = np.isfinite(found.size_mm)
    part = Trace(found.errors_mm[kept], found.parameters[kept])
    return {
        **along(made, part, readings[kept]),
        "least_mm": float(part.size_mm.min()),
        "unreached": float((~kept).sum()),
    }


def _tests(found: Measured, scheme: Scheme) -> dict[str, float]:
    """Errors as measured at the regions' test points, and in how many regions all meet the demand."""
    made = found.made
    missed_mm = MM_PER_METRE * (found.points - made.arm.true_position(found.readings))
    errors_mm = np.linalg.norm(missed_mm + trace(made, scheme, found.readings).errors_mm, axis=1)
    leaf = made.regions.find(made.space.coordinates(found.readings))
    worst = [float(errors_mm[leaf == node].max()) for node in np.unique(leaf)]
    return {**sizes(errors_mm), "regions_within": float(np.mean(np.array(worst) <= DEMANDED_MM))}
