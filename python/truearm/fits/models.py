"""The models of an arm that are compared: nominal, constant, and one that varies."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from truearm._core import Field, Setup
from truearm.arrays import hold_read_only
from truearm.errors import UsageError
from truearm.fits.schemes import Scheme, add_ceps
from truearm.types import Floats

NOMINAL: Final = "nominal"
CONSTANT: Final = "constant"
VARIABLE: Final = "variable"


def leaves_noise(name: str) -> bool:
    """Whether what a model leaves is noise: what others leave holds what varies with the joints, too."""
    return name == VARIABLE


@dataclass(frozen=True, eq=False)
class ArmModel:
    """Parameters of the arm, with the set-ups that were fitted together with them.

    Attributes:
        constants: Absolute parameters (L, 5): rows of the identified chain; theta, d, a, alpha, beta.
        setup: Frames, targets and anchors of all set-ups.
        field: What is added to the constants, depending on the inputs; None where nothing is.
        scheme: One of the paper's schemes in place of a field; None where it is none.
    """

    constants: Floats
    setup: Setup
    field: Field | None = None
    scheme: Scheme | None = None

    def __post_init__(self) -> None:
        hold_read_only(self, "constants")

    def __copy__(self) -> "ArmModel":
        return self

    def __deepcopy__(self, _: object) -> "ArmModel":
        return self

    def __reduce__(self) -> tuple[object, ...]:
        raise UsageError(
            "a model of an arm is not pickled alone",
            rule="What varies in it needs the arm, which the calibration has",
            way_out="Send the calibration, and take calibration.models from that",
        )

    def parameters(self, inputs: Floats) -> Floats:
        """Absolute parameters at inputs (n, I), joint values and features: (n, L, 5)."""
        if self.scheme is not None:
            return add_ceps(self.constants, self.scheme.columns, self.scheme.ceps_at(inputs))
        if self.field is None:
            return np.repeat(self.constants[None], len(inputs), axis=0)
        return self.field.parameters(np.ascontiguousarray(inputs), self.constants)
