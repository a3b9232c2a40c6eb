"""A virtual arm that errs as real arms do, and the virtual instrument that measures it.

It plays the part of the arm and the tracker where there is neither: in the demonstration, in tutorials,
in studies, in the virtual cell and in tests that need to know the truth.
"""

from truearm.simulation.imperfections import (
    Conditions,
    Deflection,
    Harmonic,
    Imperfections,
    JointError,
    Mass,
    Thermal,
    approach_in_sequence,
)
from truearm.simulation.virtual_arm import PAPER_PARAMETERS, VirtualArm

__all__ = [
    "PAPER_PARAMETERS",
    "Conditions",
    "Deflection",
    "Harmonic",
    "Imperfections",
    "JointError",
    "Mass",
    "Thermal",
    "VirtualArm",
    "approach_in_sequence",
]
