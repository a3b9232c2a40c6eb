"""Corrections of a stream of set-points, never applied or dropped at once."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from truearm._core import CoreError, Stream
from truearm.arrays import as_numbers
from truearm.compensation import Compensator
from truearm.defaults import DEADLINE_S, HOLD_S, RAMP_S
from truearm.errors import InputError, UsageError, list_names
from truearm.kinds import check_number, check_values, settle
from truearm.named_values import check_readings
from truearm.types import Floats
from truearm.units import MM_PER_METRE

if TYPE_CHECKING:
    from truearm import _core


@dataclass(frozen=True)
class StreamOptions:
    """How the correction of a stream may change.

    Attributes:
        rate_deg_s: Largest rate of a revolute joint's correction.
        rate_mm_s: The same of a prismatic joint.
        acceleration_deg_s2: Largest acceleration of a revolute joint's correction.
        acceleration_mm_s2: The same of a prismatic joint.
        ramp_s: How long the ramp takes from nothing to the whole correction.
        hold_s: How long the last correction is held where there is no good one.
        deadline_s: Longest time between two set-points.
    """

    rate_deg_s: float = 6.0
    rate_mm_s: float = 20.0
    acceleration_deg_s2: float = 120.0
    acceleration_mm_s2: float = 500.0
    ramp_s: float = RAMP_S
    hold_s: float = HOLD_S
    deadline_s: float = DEADLINE_S

    def __post_init__(self) -> None:
        names = [field.name for field in fields(self)]
        settle(self, numbers=names)
        check_values(self, positive=("ramp_s",))
        for name in names:
            value = getattr(self, name)
            if not value > 0.0:
                raise UsageError(
                    f"{value:g}", where=name, rule="It must be positive", way_out="inf switches it off"
                )

    def core(self) -> "_core.StreamOptions":
        """Internal: the core's options, SI."""
        return {
            "rate": [np.radians(self.rate_deg_s), self.rate_mm_s / MM_PER_METRE],
            "acceleration": [np.radians(self.acceleration_deg_s2), self.acceleration_mm_s2 / MM_PER_METRE],
            "ramp": self.ramp_s,
            "hold": self.hold_s,
            "deadline": self.deadline_s,
        }


@dataclass(frozen=True, eq=False)
class Streamed:
    """What became of a set-point.

    Attributes:
        q: Readings to command (N,), rad and m; None before the first good set-point.
        phase: "off", "rising", "on", "holding" or "falling".
        gain: Share of the correction that is aimed at, 0 to 1.
        lag: How far the applied correction is from the one aimed at: the largest of the joints, rad or m.
        fault: Why the correction is an older one; None where it is not.
    """

    q: Floats | None
    phase: str
    gain: float
    lag: float
    fault: str | None


class CorrectionStream:
    """Corrects the set-points of one robot, one after the other.

    Where a set-point is missing, not finite, late or refused, the last correction is held for a moment and
    then ramped down, until good set-points come again.

    Attributes:
        last: What became of the latest set-point.
    """

    def __init__(
        self,
        compensator: Compensator,
        options: StreamOptions | None = None,
        *,
        tool: ArrayLike | None = None,
    ) -> None:
        """Make a stream that is switched on, with nothing applied yet.

        Raises:
            UsageError: If an option is not positive.
        """
        self._features = compensator.named_features
        self._joints = compensator.programming.joint_count
        try:
            self._core = Stream(compensator.corrector(tool), (options or StreamOptions()).core())
        except CoreError as error:
            raise UsageError(str(error)) from None
        self.last = self.step(None, 0.0)

    def switch(self, on: bool) -> None:
        """Ramp the correction up or down from now on."""
        self._core.switch(on)

    @property
    def features(self) -> dict[str, float]:
        """Values of the features that the calibration depends on, in its order."""
        return dict(self._features)

    def set_features(self, values: Mapping[str, float]) -> None:
        """Take present values of features, such as a temperature, from the next set-point on.

        Features that are not among them stay as they are. NaN or infinity says that a
        value is not known: the last correction is then held and ramped down, until all are known again.

        Raises:
            UsageError: If the calibration depends on no such feature, or a value is no number. All features
                stay as they are then.
        """
        for name, value in values.items():
            if name not in self._features:
                raise UsageError(
                    f"{name!r} is no feature of the calibration",
                    rule=f"It depends on {list_names(list(self._features)) or 'none'}",
                )
            check_number(value, f"the feature {name!r}")
        self._features |= {name: float(value) for name, value in values.items()}

    def step(self, q: ArrayLike | None, elapsed_s: float) -> Streamed:
        """Correct the next set-point.

        Args:
            q: Readings (N,), or None where none came in time.
            elapsed_s: Time since the step before.

        Raises:
            InputError: If these are no numbers, or not one for each joint. Nothing has become of it then.
        """
        check_number(elapsed_s, "elapsed_s")
        readings = None if q is None else as_numbers(q, what="the readings of a set-point")
        check_readings(q, what="the readings of a set-point")
        if readings is not None and readings.shape != (self._joints,):
            raise InputError(
                f"the readings of a set-point have shape {readings.shape}",
                rule=f"One number for each of the {self._joints} joints: ({self._joints},)",
            )
        self.last = Streamed(*self._core.step(readings, list(self._features.values()), elapsed_s))
        return self.last
