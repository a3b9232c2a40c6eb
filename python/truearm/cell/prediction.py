"""Where the target is expected: from the frame as it is known, and from the calibration so far."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.calibration import Calibration
from truearm.cell.cell_file import Cell
from truearm.cell.reading import Expected
from truearm.cell.session import Step
from truearm.units import to_si

Floats = NDArray[np.float64]

REACH_M: Final = 1.0
SIGMAS: Final = 4.0
LEAST_RADIUS_M: Final = 1e-3


class Prediction:
    """Predicts points of the target in the sensor's frame, and how far off they may be.

    First from the guess of the cell file, then from the registered frame and the nominal arm, then from the
    calibration so far.
    """

    def __init__(self, cell: Cell) -> None:
        self._cell = cell
        world, process = cell.file.world, cell.file.process
        self.world_from_base: Floats | None = None if world is None else world.transform()
        self.radius_m = to_si(process.expected_mm, "mm")
        if world is not None:
            turned = np.radians(world.uncertain_deg) * REACH_M
            self.radius_m += to_si(world.uncertain_mm, "mm") + float(turned)
        self.is_registered = False
        self._calibration: Calibration | None = None
        self._group = ""

    def register(self, world_from_base: Floats, residual_m: float) -> None:
        """Take over the registered frame."""
        self.world_from_base, self.is_registered = world_from_base, True
        expected = to_si(self._cell.file.process.expected_mm, "mm")
        self.radius_m = max(expected, SIGMAS * residual_m)

    def learn(self, calibration: Calibration, error_m: float) -> None:
        """Take over a calibration, whose errors reach to `error_m` on poses it has not seen."""
        self._calibration, self._group = calibration, calibration.groups[0]
        self.radius_m = max(LEAST_RADIUS_M, self._cell.file.process.suspicious * error_m)

    def expected(self, step: Step) -> Expected:
        """What the sensor is prepared for; where nothing is known, the middle of nowhere with no bound."""
        nominal, direction = self._cell.target_in_base(step.readings)
        if self.world_from_base is None:
            return Expected(step.readings, np.zeros(3), np.inf, direction)
        turn, shift = self.world_from_base[:3, :3], self.world_from_base[:3, 3]
        point = turn @ nominal + shift
        if self._calibration is not None:
            point = self._calibration.position(step.readings, group=self._group, target=1)
        return Expected(step.readings, point, self.radius_m, turn @ direction)
