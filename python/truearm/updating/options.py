"""How a calibration is updated."""

from dataclasses import dataclass, fields
from typing import Final

from truearm.defaults import LEVEL, OFFSET_DEG, TOOL_MM
from truearm.errors import UsageError
from truearm.fits.core_set import Use
from truearm.kinds import check_values, settle

SIZES: Final = ("offset_deg", "offset_mm", "tool_mm", "tool_deg")


def threshold_of(level: float) -> float:
    """The level of each of the two tests, which share it."""
    return level / 2.0


@dataclass(frozen=True)
class UpdateOptions:
    """What may have moved, and how far: lengths and angles are from 1e-6 to 1e6.

    Attributes:
        offset_deg: Standard deviation of the change of a revolute joint's offset.
        offset_mm: The same of a prismatic joint.
        tool_mm: The same of each coordinate of the measured target in the flange frame, and of the base of a
            known world, whose turns are as uncertain as offsets.
        tool_deg: The same of the orientation of the target, about each axis.
        keep_frame: Whether the measuring device stands where it stood, or in a known world the base; else its
            frame is found anew, and the base compared.
        keep_tool: Whether the target sits where it sat.
        new_tool: Whether it is another target, or was taken off: what it shows of itself then says nothing.
        take_scale: Whether a common scale of all lengths, where one is found, is taken along.
        level: Share of the unchanged arms of which it may be said that something changed.
        use: What of the measurements to use, as in calibrate.
    """

    offset_deg: float = OFFSET_DEG
    offset_mm: float = 2.0
    tool_mm: float = TOOL_MM
    tool_deg: float = 1.0
    keep_frame: bool = False
    keep_tool: bool = False
    new_tool: bool = False
    take_scale: bool = False
    level: float = LEVEL
    use: Use | None = None

    def __post_init__(self) -> None:
        settle(self, numbers=(*SIZES, "level"), flags=("keep_frame", "keep_tool", "new_tool", "take_scale"))
        check_values(self, sizes=SIZES)
        if not 0.0 < self.level < 1.0:
            raise UsageError(f"{self.level}", where="level", rule="Between 0 and 1, such as 0.01")
        if self.keep_tool and self.new_tool:
            raise UsageError("the tool is kept, and it is new", rule="Give one of keep_tool and new_tool")

    @property
    def are_narrow(self) -> bool:
        """Internal: whether something may have moved less far than by default."""
        usual = {field.name: field.default for field in fields(self)}
        return any(getattr(self, name) < usual[name] for name in SIZES)

    @property
    def threshold(self) -> float:
        """The level of each of the two tests."""
        return threshold_of(self.level)
