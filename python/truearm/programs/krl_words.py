"""Words of KRL's motions."""

from collections.abc import Mapping
from typing import Final

from truearm.programs.tables import Motion, Via

MOTIONS: Final[Mapping[str, Motion]] = {
    "ptp": Motion.JOINT,
    "sptp": Motion.JOINT,
    "lin": Motion.LINEAR,
    "slin": Motion.LINEAR,
    "spl": Motion.LINEAR,
    "circ": Motion.CIRCULAR,
    "scirc": Motion.CIRCULAR,
}
VIAS: Final[Mapping[str, Via]] = {"circ": Via.BETWEEN, "scirc": Via.UNTOLD}
"""How arcs are turned where they pass their via points: $CIRC_MODE may make of SCIRC what it wants."""
RELATIVE: Final = frozenset(f"{word}_rel" for word in MOTIONS)
LINE_BLENDING: Final = frozenset({"c_dis", "c_ori", "c_vel", "c_spl"})
"""How lines are blended with their neighbours."""
BLENDING: Final = LINE_BLENDING | {"c_ptp"}
"""How any motion is."""
SPLINES: Final = frozenset({"spline", "ptp_spline"})
SPLINE_ENDS: Final = "endspline"
