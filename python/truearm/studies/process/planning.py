"""Which poses the experiment measures: twenty in each region, and others that judge it."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm._core import Regions
from truearm.cell.cell_file import Cell
from truearm.cell.movemaster import readings_of, tenths
from truearm.cell.ordering import paper_order
from truearm.cell.poses_file import Poses
from truearm.cell.virtual.world import true_arm
from truearm.fits.identified import IdentifiedArm
from truearm.planning.dividing import DividedSpace, DivisionOptions, divide_space
from truearm.planning.workspace import Workspace
from truearm.simulation import PAPER_PARAMETERS
from truearm.studies.process.setting import DEMANDED_MM, Setting, cell_text, space
from truearm.studies.setting import CANDIDATES, FREE_TO_STOP
from truearm.tables.columns import VALIDATE
from truearm.types import Floats
from truearm.units import to_si

PLANNED: Final = 0
"""Seed of the draw of poses: the same for all arms."""
TRAIN: Final = "train"
TEST: Final = VALIDATE


@dataclass(frozen=True, eq=False)
class Planned:
    """The divided space and its poses in the order of measuring.

    Attributes:
        regions: The tree.
        kappa: Condition number of M of each node.
        poses: Twenty of each leaf with the purpose "train", its test points with "validate".
        leaf: To which leaf each belongs (n,).
        in_all: Poses of parents counted too.
    """

    regions: Regions
    kappa: Floats
    poses: Poses
    leaf: NDArray[np.int64]
    in_all: int


def plan_experiment(setting: Setting) -> Planned:
    """Divide into the wanted number of regions and choose their poses.

    The longest side is halved, breadth first, whatever was measured: so all poses are known beforehand, and
    are measured in the paper's order in one session. They are whole tenths of a degree, where the arm ends.
    """
    found, readings = _divided(setting, 0.0, setting.regions)
    nodes, counts, tests = (np.array(column) for column in zip(*found.batches, strict=True))
    kept = np.repeat(np.isin(nodes, found.regions.leaves), counts)
    reached = np.array([readings_of(tenths(each)) for each in readings[kept]])
    order = paper_order(space().robot.position(reached))
    purposes = np.where(np.repeat(tests, counts)[kept], TEST, TRAIN)[order]
    poses = Poses(reached[order], np.zeros(len(order), dtype=np.int64), tuple(purposes.tolist()))
    leaf = np.repeat(nodes, counts)[kept][order].astype(np.int64)
    return Planned(found.regions, found.kappa, poses, leaf, found.measured)


def regions_that_suffice(setting: Setting) -> int:
    """How many regions there are when the division stops by itself, each within the demanded accuracy."""
    found, _ = _divided(setting, to_si(DEMANDED_MM, "mm"), FREE_TO_STOP)
    return len(found.regions.leaves)


def _divided(setting: Setting, accuracy_m: float, most: int) -> tuple[DividedSpace, Floats]:
    """A division and all readings (n, N) that it asked for."""
    arm = true_arm(Cell.from_toml(cell_text(setting)))
    workspace = Workspace(space(), arm.true_position)
    options = DivisionOptions(
        accuracy_m=accuracy_m,
        most_regions=most,
        poses=setting.poses,
        candidates=CANDIDATES,
        tests=setting.tests,
        seed=PLANNED,
    )
    found = divide_space(IdentifiedArm(space().robot, "world"), workspace, PAPER_PARAMETERS, options)
    return found, np.concatenate(workspace.readings)
