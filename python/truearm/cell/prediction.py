"""Where the target is expected: from the frame as it is known, and from the calibration so far."""

from typing import Final

import numpy as np

from truearm.calibration import Calibration
from truearm.cell.cell_file import Cell
from truearm.cell.reading import Expected
from truearm.cell.session import Step
from truearm.types import Floats
from truearm.units import to_si

REACH_M: Final = 1.0
SIGMAS: Final = 4.0
LEAST_LIKELY_M: Final = 1e-3


class Prediction:
    """Predicts points of the target in the sensor's frame, and how far off they may be.

    The sensor is sent where the nominal arm has its target, in the frame of the cell file first, then in the
    registered one: ways of arm and table are tried under the same kinematics. Readings are judged by the
    calibration so far, as soon as there is one.

    Attributes:
        world_from_base: Where the base stands (4, 4), as well as is known; None where nothing is.
        is_registered: Whether that comes from contacts.
        radius_m: How far the target may be from where the nominal arm has it.
        turned_rad: By how much the tool may be turned from there; nothing once the frame is registered, when
            trying tells more.
        likely_m: How far a reading may be from what is predicted without being suspicious; infinite where
            nothing is known.
    """

    def __init__(self, cell: Cell) -> None:
        self._cell = cell
        world, process = cell.file.world, cell.file.process
        self.world_from_base: Floats | None = None if world is None else world.transform()
        self._seen = cell.target_seen_from(
            np.eye(4) if self.world_from_base is None else self.world_from_base
        )
        self.is_registered = False
        self.radius_m = to_si(process.expected_mm, "mm")
        self.turned_rad = 0.0
        if world is not None:
            self.turned_rad = float(np.radians(world.uncertain_deg))
            self.radius_m += to_si(world.uncertain_mm, "mm") + self.turned_rad * REACH_M
        self.likely_m = np.inf if world is None else self.radius_m
        self._registered_m = self.likely_m
        self._calibration: Calibration | None = None
        self._group = ""

    def register(self, world_from_base: Floats, residual_m: float) -> None:
        """Take over the registered frame."""
        self.world_from_base, self.is_registered, self.turned_rad = world_from_base, True, 0.0
        self._seen = self._cell.target_seen_from(world_from_base)
        expected = to_si(self._cell.file.process.expected_mm, "mm")
        self.radius_m = self.likely_m = self._registered_m = max(expected, SIGMAS * residual_m)

    def learn(self, calibration: Calibration, error_m: float) -> bool:
        """Take over a calibration, whose errors reach to `error_m` on poses it has not seen; whether it was.

        One that is worse than the registered frame alone, as after wrong readings, is not: it would let more
        of them pass.
        """
        likely_m = max(LEAST_LIKELY_M, self._cell.file.process.suspicious * error_m)
        if likely_m > self._registered_m:
            return False
        self._calibration, self._group, self.likely_m = calibration, calibration.groups[0], likely_m
        return True

    def expected(self, step: Step) -> Expected:
        """What the sensor is prepared for; where nothing is known, the middle of nowhere with no bound."""
        point, direction = self._seen(step.readings)
        if self.world_from_base is None:
            return Expected(step.readings, np.zeros(3), np.inf, direction, step.approach)
        return Expected(step.readings, point, self.radius_m, direction, step.approach, self.turned_rad)

    def point(self, expected: Expected) -> Floats:
        """The point (3,) by which a reading is judged."""
        if self._calibration is None:
            return expected.point_in_world
        return self._calibration.position(expected.readings, group=self._group, target=1)
