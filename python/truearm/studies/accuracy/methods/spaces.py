"""What distances between poses are measured in: joints, circles of joints, or the workspace."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from truearm.studies.accuracy.poses import Poses
from truearm.types import Floats

Kind = Literal["joints", "circles", "cartesian"]


@dataclass(frozen=True, eq=False)
class Space:
    """Coordinates of poses.

    Attributes:
        kind: "joints", each in its standard deviations; "circles", cosine and sine of joints that turn, so
            that a whole turn is none; "cartesian", the target's place in its standard deviation.
        middle: What is taken off.
        spread: What is divided by.
    """

    kind: Kind
    middle: Floats
    spread: Floats

    @classmethod
    def of(cls, kind: Kind, poses: Poses) -> "Space":
        """The space, scaled by poses."""
        values = _raw(kind, poses)
        spread = values.std(axis=0)
        if kind == "cartesian":
            spread = np.full_like(spread, np.sqrt(np.square(spread).mean()))
        elif kind == "circles":
            spread = np.ones_like(spread)
        return cls(kind, values.mean(axis=0), np.where(spread > 0.0, spread, 1.0))

    def coordinates(self, poses: Poses) -> Floats:
        """Coordinates (n, D)."""
        return np.asarray((_raw(self.kind, poses) - self.middle) / self.spread)


def _raw(kind: Kind, poses: Poses) -> Floats:
    if kind == "cartesian":
        return poses.points
    if kind == "joints":
        return poses.joints
    turning = poses.joints[:, poses.revolute]
    return np.hstack([np.cos(turning), np.sin(turning), poses.joints[:, ~poses.revolute]])
