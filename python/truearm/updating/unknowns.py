"""What is estimated again: offsets of the joints, the base where the world is known, and set-ups."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.calibration import Calibration
from truearm.fits.core_set import Selection
from truearm.fits.fitting import Task
from truearm.fits.identified import IdentifiedArm
from truearm.fits.measured_parts import MeasuredParts
from truearm.fits.parameters import KIND_COUNT, KINDS, are_lengths
from truearm.measurements import Measurements
from truearm.types import Floats, Mask
from truearm.units import to_si
from truearm.updating.causes import Cause, Nothing
from truearm.updating.options import UpdateOptions
from truearm.updating.parts import offset_columns

OPEN: Final = 1.0
"""What is found anew is known to a metre and a radian, as in the fits."""
BASE: Final = "base_"
"""Names of the unknowns of the base begin so."""


@dataclass(frozen=True, eq=False)
class Unknowns:
    """u unknowns: of the arm first, then those of each set-up: frame, targets, orientation of the target.

    Those of the arm are offsets, the base where the world is known, and what else is asked for.

    Attributes:
        directions: Derivatives (5 L, a) of the chain's parameters by the a unknowns of the arm.
        arm_names: Their names: joint1 ..., then base_theta ..., then that of what else is asked for.
        std: Prior standard deviations (u,), m and rad; zero for what is kept.
        anew: Which are found anew (u,): they are not compared, and say nothing about what changed.
        frame: Which are of frames (u,).
        tool: Which are of targets and their orientation (u,).
        known: For each set-up of the update the number of the calibration's it may be compared with, or None.
        cause: What else is asked for.
    """

    directions: Floats
    arm_names: tuple[str, ...]
    std: Floats
    anew: Mask
    frame: Mask
    tool: Mask
    known: tuple[int | None, ...]
    cause: Cause

    @classmethod
    def of(
        cls, calibration: Calibration, task: Task, options: UpdateOptions, data: Measurements
    ) -> "Unknowns":
        """Those of an update of a calibration with measurements of a task."""
        arm = task.arm
        directions, names = arm_directions(arm)
        known = _known(calibration, task, data)
        groups = [setup_std(arm, task.selection, options, known=number is not None) for number in known]
        std = np.concatenate([[arm_std(arm, name, options) for name in names], *groups])
        frame = np.zeros(len(std), dtype=np.bool_)
        unlike = frame.copy()
        width = len(groups[0])
        for k, number in enumerate(known):
            first = len(names) + k * width
            frame[first : first + arm.frame_unknowns] = True
            unlike[first : first + width] = options.new_tool or number is None
        tool = ~frame
        tool[: len(names)] = False
        return cls(directions, names, std, (frame | unlike) & (std > 0.0), frame, tool, known, Nothing(arm))

    @property
    def arm(self) -> Mask:
        """Which are of the arm (u,)."""
        return ~(self.frame | self.tool)

    @property
    def free(self) -> Mask:
        """Which are estimated (u,)."""
        return np.asarray(self.std > 0.0)

    @property
    def base(self) -> Mask:
        """Which are of the base (u,), a row of the arm where the world is known."""
        found = np.zeros(len(self.std), dtype=np.bool_)
        found[: len(self.arm_names)] = [name.startswith(BASE) for name in self.arm_names]
        return found

    @property
    def caused(self) -> Mask:
        """Which are of what else is asked for (u,)."""
        found, last = np.zeros(len(self.std), dtype=np.bool_), len(self.arm_names)
        found[last - len(self.cause.std) : last] = True
        return found

    @property
    def parts(self) -> tuple[tuple[str, Mask], ...]:
        """What an offset may be confounded with, each with its unknowns (u,), as far as there are any."""
        named = (("frame", self.frame), ("base", self.base), ("tool", self.tool))
        return tuple((name, chosen) for name, chosen in named if chosen.any())

    @property
    def kept(self) -> tuple[str, ...]:
        """What of "frame", or in a known world "base", and "tool" is kept in all set-ups."""
        return tuple(name for name, chosen in self.parts if not self.std[chosen].any())

    def is_compared(self, own: NDArray[np.int64] | slice) -> bool:
        """Whether these unknowns are estimated, and not found anew."""
        return bool(self.free[own].all()) and not self.anew[own].any()

    @property
    def count_compared(self) -> int:
        """How many joints, bases, frames and tools are compared, at least one."""
        whole = np.arange(len(self.std))
        parts = [*whole[self.arm & ~self.base & ~self.caused][:, None], whole[self.base]]
        for number in range(len(self.known)):
            own = whole[self.group(number)]
            parts += [own[self.frame[own]], own[self.tool[own]]]
        return max(sum(self.is_compared(own) for own in parts if len(own)), 1)

    def holding(self, numbers: Iterable[int]) -> "Unknowns":
        """The same with some unknowns of the arm held where they were."""
        std = self.std.copy()
        std[list(numbers)] = 0.0
        return replace(self, std=std)

    def beside(self, cause: Cause) -> "Unknowns":
        """The same, with what else is asked for, where that was nothing."""
        count, last = len(cause.std), len(self.arm_names)
        place = [last] * count
        return replace(
            self,
            directions=np.hstack([self.directions, cause.kept]),
            arm_names=(*self.arm_names, *[cause.name] * count),
            std=np.insert(self.std, place, cause.std),
            anew=np.insert(self.anew, place, False),
            frame=np.insert(self.frame, place, False),
            tool=np.insert(self.tool, place, False),
            cause=cause,
        )

    def group(self, number: int) -> slice:
        """Where the unknowns of a set-up stand."""
        width = (len(self.std) - len(self.arm_names)) // len(self.known)
        first = len(self.arm_names) + number * width
        return slice(first, first + width)


def is_part_of(selection: Selection, known: Selection) -> bool:
    """Whether all that is selected took part in what is known."""
    return set(selection.targets) <= set(known.targets) and selection.orientation <= known.orientation


def counterpart(calibration: Calibration, group: str) -> int | None:
    """The calibration's set-up that one of the update is compared with: of that name, or the only one."""
    if group in calibration.groups:
        return calibration.groups.index(group)
    return 0 if len(calibration.groups) == 1 else None


def _known(calibration: Calibration, task: Task, data: Measurements) -> tuple[int | None, ...]:
    """For each set-up of the update its counterpart; None where that lacks what was measured now."""
    wanted, fitted = task.selection, calibration.selection
    if not is_part_of(wanted, fitted):
        return (None,) * len(task.groups)
    now = MeasuredParts.of(data, wanted, task.groups).held(range(len(wanted.targets)))
    then = calibration.measured.held([fitted.targets.index(target) for target in wanted.targets])
    numbers = [counterpart(calibration, group) for group in task.groups]
    return tuple(
        None if number is None or (now[k] & ~then[number]).any() else number
        for k, number in enumerate(numbers)
    )


def arm_directions(arm: IdentifiedArm) -> tuple[Floats, tuple[str, ...]]:
    """Derivatives (5 L, a) of the chain's parameters by offsets of readings and the base; their names."""
    columns = offset_columns(arm)
    names = [f"joint{k + 1}" for k in range(len(columns))]
    base = list(range(KIND_COUNT)) if arm.world_is_known else []
    found = np.zeros((arm.table.size, len(columns) + len(base)))
    found[columns, : len(columns)] = arm.robot.coupling
    found[base, len(columns) + np.arange(len(base))] = 1.0
    return found, (*names, *(f"{BASE}{KINDS[kind]}" for kind in base))


def arm_std(arm: IdentifiedArm, name: str, options: UpdateOptions) -> float:
    """Prior standard deviation of one of the arm's unknowns, rad or m; zero for what is kept.

    The base of a known world may turn as offsets do, and shift as the tool does: it is compared.
    """
    if name.startswith(BASE):
        is_length = are_lengths([KINDS.index(name.removeprefix(BASE))])[0]
        moved = to_si(options.tool_mm, "mm") if is_length else to_si(options.offset_deg, "deg")
        return 0.0 if options.keep_frame else moved
    prismatic = arm.robot.joints[int(name.removeprefix("joint")) - 1] == "prismatic"
    return to_si(options.offset_mm, "mm") if prismatic else to_si(options.offset_deg, "deg")


def setup_std(arm: IdentifiedArm, selection: Selection, options: UpdateOptions, *, known: bool) -> Floats:
    """Prior standard deviations (W,) of the unknowns of a set-up; zero for what is kept.

    Args:
        arm: The arm.
        selection: What is measured.
        options: What may have moved.
        known: Whether the calibration knows the set-up's tool.
    """
    frame = np.full(arm.frame_unknowns, 0.0 if options.keep_frame else OPEN)
    points = np.full(3 * len(selection.targets), to_si(options.tool_mm, "mm"))
    turn = np.full(3 if selection.orientation else 0, to_si(options.tool_deg, "deg"))
    tool = np.concatenate([points, turn])
    if options.new_tool or not known:
        tool[:] = OPEN
    return np.concatenate([frame, np.zeros_like(tool) if options.keep_tool else tool])
