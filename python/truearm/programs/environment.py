"""What a motion statement is executed with: its tool, its work object, and offsets on its target."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from truearm.robot import Robot
from truearm.rotations import rigid_inverse, rigid_motion
from truearm.types import Transform


@dataclass(frozen=True, eq=False)
class Frame:
    """A tool (flange_from_tool) or a work object (base_from_object).

    Attributes:
        true: Transform (4, 4) as it is, in m; the one that compensation aims with.
        controller: What the controller computes with; the same unless a frames file re-identified it.
        name: As the program names it; empty for one that is written out.
        unknown: Why it is not known; the transforms mean nothing then.
        taught: Whether it was taught through a calibrated arm.
        covariance: Of its translation and of a small rotation vector, both along the axes of the flange or of
            the base (6, 6), SI; None where it is not known.
    """

    true: Transform
    controller: Transform
    name: str = ""
    unknown: str = ""
    taught: bool = False
    covariance: NDArray[np.float64] | None = None

    @classmethod
    def of(cls, transform: Transform, name: str = "") -> "Frame":
        """One that is as the controller believes it to be."""
        return cls(transform, transform, name)

    @classmethod
    def missing(cls, reason: str, name: str = "") -> "Frame":
        """One that is not known, and why: a sentence that ends the line of a listing."""
        return cls(np.eye(4), np.eye(4), name, reason)

    def then(self, inner: "Frame") -> "Frame":
        """A frame that is told in this one, told where this one is, if both are known; with its own name."""
        if self.unknown or inner.unknown:
            return Frame.missing(inner.unknown or self.unknown, inner.name)
        return Frame(
            self.true @ inner.true,
            self.controller @ inner.controller,
            inner.name,
            taught=self.taught or inner.taught,
            covariance=self._covariance_with(inner),
        )

    def _covariance_with(self, inner: "Frame") -> NDArray[np.float64] | None:
        """Covariance of a frame that is told in this one, as of `covariance`."""
        if self.covariance is None and inner.covariance is None:
            return None
        turn = self.true[:3, :3]
        moved = np.eye(6)
        moved[:3] = rigid_motion((turn @ inner.true[:3, 3])[None])[0]
        turned = np.kron(np.eye(2), turn)
        outer, own = (np.zeros((6, 6)) if one.covariance is None else one.covariance for one in (self, inner))
        covariance: NDArray[np.float64] = moved @ outer @ moved.T + turned @ own @ turned.T
        return covariance

    @property
    def mistaken(self) -> Transform | None:
        """Where a controller that takes the tool for `controller` has the flange: flange_from_flange (4, 4),
        the true one from that with the true tool. None where the two tools are the same.
        """
        if self.true.tobytes() == self.controller.tobytes():
            return None
        moved: Transform = self.controller @ rigid_inverse(self.true)
        return moved

    @property
    def key(self) -> tuple[bytes, bytes, str, bytes]:
        """Equal for frames that are the same."""
        known = b"" if self.covariance is None else self.covariance.tobytes()
        return self.true.tobytes(), self.controller.tobytes(), self.unknown, known


def author_of(robot: Robot, tool: Frame, displacement: Transform | None) -> Robot | None:
    """The arm that has the true tool where the author meant the tool; None where that is `robot`.

    The author's readings are those of `robot` with the controller's tool. An arm whose flange is shifted by
    what lies between the controller's tool and the true one, and whose base by what displaces the work
    object, has the true tool at the same place for the same readings.

    Args:
        robot: The programming model.
        tool: The tool.
        displacement: Of the work object, as in Environment; None for joint targets.
    """
    flange, base = robot.flange, robot.base
    if tool.mistaken is not None:
        flange = flange @ tool.mistaken
    elif displacement is None:
        return None
    if displacement is not None:
        base = displacement @ base
    return replace(robot, flange=flange, base=base, base_row=None)


IDENTITY = Frame.of(np.eye(4))


@dataclass(frozen=True, eq=False)
class Environment:
    """How a stored target becomes a place of the tool: work_object @ before @ stored @ after.

    Attributes:
        tool: flange_from_tool.
        work_object: base_from_object.
        before: Constant offset in the object's frame (RAPID Offs, PDispSet), (4, 4).
        after: Constant offset in the tool's frame (RAPID RelTool), (4, 4).
        problem: Why targets used in this environment cannot be changed at all, joint targets included
            (a stationary tool, external axes, an offset known at run time only for Cartesian ones).
        cartesian_problem: The same for Cartesian targets only.
        payload_kg: Mass that the program states for the load, if it does.
    """

    tool: Frame = IDENTITY
    work_object: Frame = IDENTITY
    before: Transform = field(default_factory=lambda: np.eye(4))
    after: Transform = field(default_factory=lambda: np.eye(4))
    problem: str = ""
    cartesian_problem: str = ""
    payload_kg: float | None = None

    @property
    def key(self) -> tuple[object, ...]:
        """Equal for environments that put a stored target at the same place with the same tool."""
        return (
            self.tool.key,
            self.work_object.key,
            self.before.tobytes(),
            self.after.tobytes(),
            self.problem,
            self.cartesian_problem,
            self.payload_kg,
        )

    @property
    def places_as_stored(self) -> bool:
        """Whether a target is placed where it is stored, without an offset."""
        return np.array_equal(self.before, np.eye(4)) and np.array_equal(self.after, np.eye(4))

    @property
    def displacement(self) -> Transform | None:
        """What moves a place in the work object from where the controller has it to where it truly is.

        base_from_base (4, 4); None where the controller has the object where it is.
        """
        here = self.work_object
        if here.true.tobytes() == here.controller.tobytes():
            return None
        moved: Transform = here.true @ rigid_inverse(here.controller)
        return moved

    def flange_poses(self, stored: Transform) -> Transform:
        """base_from_flange (n, 4, 4) that the controller makes of stored poses (n, 4, 4)."""
        outer = self.work_object.controller @ self.before
        inner = self.after @ rigid_inverse(self.tool.controller)
        poses: Transform = outer @ stored @ inner
        return poses

    def stored_poses(self, base_from_flange: Transform) -> Transform:
        """The stored poses (n, 4, 4) of which the controller makes poses (n, 4, 4) of the flange."""
        outer = rigid_inverse(self.work_object.controller @ self.before)
        poses: Transform = outer @ (base_from_flange @ self.tool.controller) @ rigid_inverse(self.after)
        return poses

    @property
    def why_not_poses(self) -> str:
        """Why a Cartesian target cannot be changed here; empty if it can."""
        return self.problem or self.cartesian_problem or self.tool.unknown or self.work_object.unknown


class Environments:
    """The environments of a program, each once.

    Attributes:
        all: They, by number.
    """

    def __init__(self) -> None:
        self.all: list[Environment] = []
        self._numbers: dict[tuple[object, ...], int] = {}

    def number(self, environment: Environment) -> int:
        """The number of an environment; a new one is added."""
        found = self._numbers.setdefault(environment.key, len(self.all))
        if found == len(self.all):
            self.all.append(environment)
        return found
