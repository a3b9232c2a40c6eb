"""The truth of a virtual cell: where the pin really is, what the panel feels, and whether things meet."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from truearm.cell.cell_file import Cell
from truearm.cell.clearance import Clearance
from truearm.cell.panel import Panel
from truearm.cell.table_panel import TablePanel
from truearm.cell.virtual.state import ARM, COLLISIONS, CONTACTS, STOPPED, TABLE, Mover, Shared
from truearm.rotations import quaternion_from_rotation_vector, transform_from_parts
from truearm.simulation import Conditions, VirtualArm
from truearm.types import Floats
from truearm.units import to_si

ROOM_C: Final = 21.0
MOMENTS: Final = 12
DRAWN_FRAME, DRAWN_NOISE = 11, 12
TABLE_WAVES_PER_M: Final = 7.0
READ_OUT_COUNTS: Final = 0.1


@dataclass(frozen=True, eq=False)
class Touch:
    """A contact: how far the panel came, and the counts it shows."""

    way_m: float
    counts: Floats


def true_arm(cell: Cell) -> VirtualArm:
    """The arm that a virtual cell has in place of the nominal one.

    Raises:
        InputError: If [simulate.arm] describes none.
    """
    settings = cell.file.simulate
    content = dict(settings.arm or {}) | {"robot": cell.arm.to_toml()}
    content.setdefault("seed", settings.seed)
    return VirtualArm.from_dict(content, where="simulate, arm")


def true_frame(cell: Cell, truth: VirtualArm) -> Floats:
    """Where the base really stands (4, 4): the cell file's guess, off by what is asked for."""
    settings = cell.file.simulate
    if cell.file.world is None:
        return np.asarray(truth.world_from_base)
    rng = np.random.default_rng([settings.seed, DRAWN_FRAME])
    turn = np.radians(settings.frame_error_deg) * _direction(rng, 3)
    shift = to_si(settings.frame_error_mm, "mm") * _direction(rng, 3)
    off = transform_from_parts(np.zeros(3), quaternion_from_rotation_vector(turn[None])[0])
    off[:3, 3] = shift
    return np.asarray(cell.file.world.transform() @ off)


class World:
    """The virtual cell as it truly is, from one of its processes."""

    def __init__(self, cell: Cell, state: Path) -> None:
        self.cell, self.shared = cell, Shared(state)
        self.settings = cell.file.simulate
        self.truth = true_arm(cell)
        self.arm = Mover(self.shared, ARM, cell.arm.joint_count)
        self.table = Mover(self.shared, TABLE, 3)
        self.world_from_base = true_frame(cell, self.truth)
        self._seen = cell.target_seen_from(self.world_from_base)
        panel = cell.sensor.panel if isinstance(cell.sensor, TablePanel) else None
        self.clearance = None if panel is None else _clearance(cell, panel)

    def pin(self, now: float) -> tuple[Floats, Floats]:
        """The target (3,) and the direction of the tool (3,), in the world."""
        q = self.arm.at(now)[None]
        conditions = Conditions(approach=self.arm.last_direction()[None])
        base_from_target = self.truth.true_pose(q, tool=self.cell.flange_from_target, conditions=conditions)[
            0
        ]
        point = self.world_from_base @ base_from_target[:, 3]
        return point[:3], self._seen(q[0])[1]

    def touch(self, travel_m: float, now: float) -> Touch | None:
        """Bring the panel up by `travel_m` at the most; None if it feels nothing."""
        panel = self._sensor.panel
        point, direction = self.pin(now)
        seen = panel.seen(self._true_carriage(now), point)
        count, rng = self.shared.count(CONTACTS), self._noise(now)
        faults = self.settings.faults
        if not (0.0 <= seen[2] <= travel_m and panel.holds(seen)):
            return None
        if panel.angle(direction) < panel.least_angle_rad or rng.uniform() < faults.missed:
            return None
        seen[:2] += to_si(self.settings.panel_mm, "mm") * rng.normal(size=2)
        seen[0] += to_si(faults.drift_mm_per_contact, "mm") * count
        if rng.uniform() < faults.outlier:
            seen[:2] += to_si(faults.outlier_mm, "mm") * _direction(rng, 2)
        counts = np.rint(panel.counts_of(seen) / READ_OUT_COUNTS) * READ_OUT_COUNTS
        return Touch(float(seen[2]), np.clip(counts, 0.0, panel.counts))

    def tracked(self, now: float) -> Floats | None:
        """The target (3,) as a tracker sees it, m; None where it does not."""
        faults, rng = self.settings.faults, self._noise(now)
        count = self.shared.count(CONTACTS)
        point = self.pin(now)[0] + to_si(self.settings.tracker_mm, "mm") * rng.normal(size=3)
        point[0] += to_si(faults.drift_mm_per_contact, "mm") * count
        if rng.uniform() < faults.outlier:
            point += to_si(faults.outlier_mm, "mm") * _direction(rng, 3)
        return None if rng.uniform() < faults.missed else point

    def watch(self, now: float) -> None:
        """Look whether the motions under way will make link and column meet; then everything stops."""
        if self.clearance is None:
            return
        until = max(now, self.arm.ends(), self.table.ends())
        moments = np.linspace(now, until, MOMENTS)
        readings, carriages = (
            np.array([mover.at(moment) for moment in moments]) for mover in (self.arm, self.table)
        )
        if self.clearance.gaps(readings, carriages, self.world_from_base).min() < 0.0:
            self.shared.count(COLLISIONS)
            self.emergency_stop(now)

    def emergency_stop(self, now: float) -> None:
        """All that moves stands still, and nothing moves again."""
        self.arm.halt(now)
        self.table.halt(now)
        self.shared.set_flag(STOPPED, True)

    @property
    def _sensor(self) -> TablePanel:
        sensor = self.cell.sensor
        if not isinstance(sensor, TablePanel):
            raise TypeError("there is no panel in this cell")
        return sensor

    def _true_carriage(self, now: float) -> Floats:
        """Where the carriage really is when the table says where: each axis waves a little along its way."""
        carriage = self.table.at(now)
        phase = np.array([1.0, 2.0, 3.0]) + self.settings.seed
        waves = np.sin(2.0 * np.pi * TABLE_WAVES_PER_M * carriage + phase)
        return np.asarray(carriage + to_si(self.settings.table_mm, "mm") * waves)

    def _noise(self, now: float) -> np.random.Generator:
        """Random numbers of the next contact; of the place of the arm alone where asked for."""
        if self.settings.repeatable:
            place = np.rint(1e6 * (self.arm.at(now) + 10.0)).astype(np.int64)
            return np.random.default_rng([self.settings.seed, DRAWN_NOISE, *place.tolist()])
        with self.shared.locked() as values:
            return np.random.default_rng([self.settings.seed, DRAWN_NOISE, int(values[CONTACTS])])


def _clearance(cell: Cell, panel: Panel) -> Clearance:
    return Clearance(cell.arm, cell.flange_from_target, panel, cell.file.clearance)


def _direction(rng: np.random.Generator, size: int) -> Floats:
    vector = rng.normal(size=size)
    return np.asarray(vector / np.linalg.norm(vector))
