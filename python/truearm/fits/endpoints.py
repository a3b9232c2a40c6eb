"""The point or frame that a prediction is of: the robot's tool, another tool, or a measured target."""

from dataclasses import dataclass
from numbers import Integral
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from truearm.arrays import as_numbers, check_finite, rigid
from truearm.errors import InputError, UsageError, WorkError, did_you_mean, list_names
from truearm.kinds import check_number, name
from truearm.robot import Robot
from truearm.rotations import rigid_motion
from truearm.types import Floats

if TYPE_CHECKING:
    from truearm.calibration import Calibration


@dataclass(frozen=True, eq=False)
class Endpoint:
    """What is predicted, and in which frame.

    Attributes:
        flange_from_end: Transform (4, 4).
        world_from_base: Transform (4, 4), or None for the base frame.
        has_orientation: Whether the rotation of `flange_from_end` means anything.
        turn_is_fitted: Whether that rotation was found by the fit, from a target's measured orientation.
        group: Number of the set-up whose world it is, from 0; None for the base frame.
        target: Place of the target that it is among those that were fitted; None for a tool.
    """

    flange_from_end: Floats
    world_from_base: Floats | None = None
    has_orientation: bool = True
    turn_is_fitted: bool = False
    group: int | None = None
    target: int | None = None

    def oriented(self) -> "Endpoint":
        """This one, of which the orientation is asked for.

        Raises:
            WorkError: If that is not known.
        """
        if self.has_orientation:
            return self
        raise WorkError(
            "the orientation of the target on the tool is not known",
            rule="It was not measured",
            way_out="Ask for its position, or give a tool",
        )

    def motions(self, flanges: Floats, *, pose: bool) -> Floats:
        """How the end moves with base and tool as the device saw them, see SetupPlace.motion.

        Args:
            flanges: base_from_flange (n, 4, 4).
            pose: Whether its rotation vector is asked for as well.

        Returns:
            Derivatives (n, 3, 9), or (n, 6, 9) of a pose; (n, 6, 12) where the target's turn was fitted.
        """
        turned = flanges[:, :3, :3]
        points = flanges[:, :3, 3] + turned @ self.flange_from_end[:3, 3]
        moved = np.concatenate([rigid_motion(points), turned], axis=2)
        if not pose:
            return moved
        turns = np.broadcast_to(np.eye(3, moved.shape[2], 3), moved.shape)
        moved = np.concatenate([moved, turns], axis=1)
        if not self.turn_is_fitted:
            return moved
        own = np.concatenate([np.zeros_like(turned), turned @ self.flange_from_end[:3, :3]], axis=1)
        return np.concatenate([moved, own], axis=2)


def at_tool(robot: Robot, tool: ArrayLike | None) -> Floats:
    """flange_from_tool (4, 4) of the robot's own tool, or of `tool`: a transform (4, 4) or a point (3,).

    Raises:
        InputError: If it is neither, or no rigid motion.
    """
    if tool is None:
        return robot.tool
    given = as_numbers(tool, what="the entries of the tool")
    check_finite(given.reshape(1, -1), what="the entries of the tool")
    if given.shape == (3,):
        transform = np.eye(4)
        transform[:3, 3] = given
        return transform
    if given.shape != (4, 4):
        raise InputError(
            f"the tool has shape {given.shape}",
            rule="A transform (4, 4) from flange to tool, or a point (3,) in the flange frame, m",
        )
    exact, fault = rigid(given[None])
    if fault is not None:
        raise InputError(f"the tool is no rigid motion: {fault.why}", rule=fault.rule, way_out=fault.way_out)
    found: Floats = exact[0]
    return found


def at_target(
    calibration: "Calibration", tool: ArrayLike | None, group: str | int | None, target: int | None
) -> Endpoint:
    """A measured target, or a tool, in the world of a set-up.

    Args:
        calibration: Knows the set-ups.
        tool: A tool instead of a target.
        group: Name of the set-up; may be None where there is one.
        target: Measured target from 1; by default the first that was measured in the set-up.

    Raises:
        UsageError: If there is no such set-up or target.
        WorkError: If the target was not measured in the set-up.
    """
    number = _only_group(calibration) if group is None else group_number(calibration, group)
    setup, selection = calibration.model.setup, calibration.selection
    world_from_base = None if selection.distances else setup.frames[number]
    if tool is not None:
        if target is not None:
            raise UsageError("a tool and a target were given", rule="A prediction is of one of them")
        return Endpoint(at_tool(calibration.robot, tool), world_from_base, group=number)
    known = [k + 1 for k in selection.targets] or [1]
    held = calibration.measured.targets[number]
    if target is not None:
        check_number(target, "target", Integral)
    wanted = known[calibration.measured.first(number)] if target is None else target
    if wanted not in known:
        raise UsageError(f"there is no target {wanted}", rule=f"Targets {known} were fitted")
    place = known.index(wanted)
    if not held[place]:
        raise WorkError(
            f"target {wanted} was not measured in the set-up {list_names([calibration.groups[number]])}",
            rule="Where it is on the tool there no other set-up tells",
            way_out="Ask for a target that was, or give a tool",
        )
    transform = np.eye(4)
    transform[:3, 3] = setup.targets[number, place]
    turned = bool(calibration.measured.orientations[number])
    if turned:
        transform[:3, :3] = setup.rotations[number]
    return Endpoint(transform, world_from_base, turned, turn_is_fitted=turned, group=number, target=place)


def group_number(calibration: "Calibration", group: str | int) -> int:
    """Number from 0 of the set-up of a name.

    Raises:
        UsageError: If there is none.
    """
    wanted, groups = name(group, "group"), calibration.groups
    if wanted not in groups:
        raise UsageError(
            f'there is no set-up "{wanted}"',
            rule=f"The calibration knows {list_names(groups)}",
            way_out=did_you_mean(wanted, groups),
        )
    return groups.index(wanted)


def _only_group(calibration: "Calibration") -> int:
    if len(calibration.groups) > 1:
        knows = f"The calibration knows {list_names(calibration.groups)}"
        raise UsageError("no group is named", rule=knows)
    return 0
