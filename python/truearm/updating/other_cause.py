"""What else was at work where offsets, frames and tools do not explain what was measured, for people."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final, Literal

import numpy as np

from truearm.errors import Notice
from truearm.lengths import length_mm
from truearm.types import AXES
from truearm.units import MM_PER_METRE, MRAD_PER_RAD
from truearm.updating.causes import LOAD, SCALE, Cause, Load
from truearm.updating.explaining import Explanation

PPM: Final = 1e6
STEEL_PPM: Final = 12.0
ALUMINIUM_PPM: Final = 23.0
"""A kelvin."""
OTHER_SCALE: Final = "other_scale"
OTHER_LOAD: Final = "other_load"
LEAST_MRAD: Final = 0.01
"""Joints that give way by less are not named."""
DIGITS: Final = 2


INSTEAD: Final = {
    SCALE: "another common scale of all lengths, as of a warmer or cooler arm",
    LOAD: "another weight at the flange",
}


def instead_notices(causes: Sequence[Cause]) -> list[Notice]:
    """That something else may be at work than offsets or tools that moved."""
    if not causes:
        return []
    named = " or ".join(INSTEAD[cause.name] for cause in causes)
    text = (
        f"These rows do not tell what changed from {named}: if that was otherwise than when the arm was "
        "calibrated, measure as then before the update is used, or more poses."
    )
    return [Notice("may_be_otherwise", text)]


@dataclass(frozen=True)
class OtherCause:
    """Another scale or another load than when the arm was calibrated.

    `truearm.update` makes one where nothing less explains what was measured, `update.cause`.

    Attributes:
        name: "scale": all lengths in proportion, of the arm or the measuring device. "load": joints give way
            as under another weight at the flange.
        p: How often an arm without it shows as much.
        ppm: How much larger all lengths are, parts in a million; None of a load.
        std_ppm: Standard error of it.
        bent_mrad: How far each joint gives way downwards where its lever is longest, zero for those without
            one; None of a scale.
        mean_mm: How far it moves the target on average; None of a scale.
        taken: Whether the updated calibration has it.
    """

    name: Literal["scale", "load"]
    p: float
    ppm: float | None = None
    std_ppm: float | None = None
    bent_mrad: tuple[float, ...] | None = None
    mean_mm: float | None = None
    taken: bool = False

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        return asdict(self)

    @classmethod
    def of(cls, said: Explanation) -> "OtherCause | None":
        """Internal: that which an explanation asked for and has; None for nothing."""
        unknowns, found = said.unknowns, said.found
        own = np.flatnonzero(unknowns.caused)
        if not len(own):
            return None
        cause, values, p = unknowns.cause, found.state.arm[own], said.cause.p
        if not isinstance(cause, Load):
            std = float(np.sqrt(found.covariance[own[0], own[0]]))
            taken = bool(cause.kept.any())
            return cls(SCALE, p, ppm=PPM * float(values[0]), std_ppm=PPM * std, taken=taken)
        scene, bent = said.rows.scene, np.zeros(said.calibration.robot.joint_count)
        bent[cause.joints] = MRAD_PER_RAD * values
        turned = cause.passing(scene.task.arm, scene.data.readings) @ values
        moved = np.einsum("nmp,np->nm", scene.arm_jacobian(found.state)[:, :AXES], turned)
        mean_mm = float(MM_PER_METRE * np.linalg.norm(moved, axis=1).mean())
        return cls(LOAD, p, bent_mrad=tuple(bent.tolist()), mean_mm=mean_mm)

    def notice(self, *, has_rails: bool) -> Notice:
        """Internal: what it is, and what to do."""
        if self.name == SCALE:
            return Notice(OTHER_SCALE, self._scale_words(has_rails=has_rails))
        return Notice(OTHER_LOAD, self._load_words())

    def _scale_words(self, *, has_rails: bool) -> str:
        ppm, std = self.ppm or 0.0, self.std_ppm or 0.0
        way, warmth, warm = ("larger", "warmer", "warm") if ppm > 0.0 else ("smaller", "cooler", "cool")
        size = abs(ppm)
        said = (
            f"All lengths are {size:.0f} ppm {way} than when the arm was calibrated (standard error "
            f"{std:.0f} ppm), as of an arm that is {size / STEEL_PPM:.0f} K {warmth} (steel; "
            f"{size / ALUMINIUM_PPM:.0f} K: aluminium), or of a measuring device whose scale differs, as by "
            "its weather station or scale bar. These rows do not tell which: compare the temperatures, and "
            "measure a known length."
        )
        if self.taken:
            return f"{said} The update takes it along, as that of the arm."
        stays = "calibrate anew, since rails cannot be scaled" if has_rails else "update with --take-scale"
        return (
            f"{said} If the device is right and the arm works as {warm} as now, {stays}; if not, measure "
            "again when that is put right."
        )

    def _load_words(self) -> str:
        bent = np.array(self.bent_mrad)
        more, heavier = ("more", "heavier") if bent.sum() > 0.0 else ("less", "lighter")
        sizes = [(k + 1, abs(float(size))) for k, size in enumerate(bent) if abs(size) >= LEAST_MRAD]
        joints = ", ".join(f"joint {joint} by up to {size:.{DIGITS}f} mrad" for joint, size in sizes)
        return (
            f"The joints give way {more} than when the arm was calibrated, as under another weight at the "
            f"flange, a {heavier} one: {joints}, the target by "
            f"{length_mm(self.mean_mm or 0.0, DIGITS)} on average. Measure with the weight that the arm was "
            "calibrated with. To work with others, note the weight of all rows, old and new, in a column "
            "payload_kg, and calibrate from them together with --features payload_kg."
        )
