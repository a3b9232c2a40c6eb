"""Words of KRL's motions."""

from collections.abc import Mapping
from typing import Final

from truearm.programs.tables import Motion

MOTIONS: Final[Mapping[str, Motion]] = {
    "ptp": Motion.JOINT,
    "sptp": Motion.JOINT,
    "lin": Motion.LINEAR,
    "slin": Motion.LINEAR,
    "spl": Motion.LINEAR,
    "circ": Motion.CIRCULAR,
    "scirc": Motion.CIRCULAR,
}
RELATIVE: Final = frozenset(f"{word}_rel" for word in MOTIONS)
LINE_BLENDING: Final = frozenset({"c_dis", "c_ori", "c_vel", "c_spl"})
"""How lines are blended with their neighbours."""
BLENDING: Final = LINE_BLENDING | {"c_ptp"}
"""How any motion is."""
SPLINES: Final = frozenset({"spline", "ptp_spline"})
SPLINE_ENDS: Final = "endspline"
