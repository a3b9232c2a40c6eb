"""A tool or a work object as it was found, and how well."""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from truearm.errors import Notice
from truearm.rotations import quaternion_from_matrix, rigid_inverse
from truearm.types import Floats
from truearm.units import MM_PER_METRE, MRAD_PER_RAD

Kind = Literal["tool", "object"]


@dataclass(frozen=True, eq=False)
class IdentifiedFrame:
    """A frame found from n touches or measured poses. SI units.

    Attributes:
        kind: "tool", flange_from_tool, or "object", base_from_object.
        transform: The frame (4, 4).
        covariance: Of its translation and of a small rotation vector, both along the axes of the flange or of
            the base (6, 6); zero where something was not determined but stated, such as the orientation of a
            tool whose tip touched a point.
        residuals: What each row leaves (n, 3), base frame.
        rows: Number of each row in its file (n,).
        noise_m: Standard deviation of a coordinate of a residual.
        freedom: By how many the coordinates of residuals outnumber the unknowns.
        how: What it was found from, in words.
        notices: What the user should know.
    """

    kind: Kind
    transform: Floats
    covariance: Floats
    residuals: Floats
    rows: NDArray[np.int64]
    noise_m: float
    freedom: int
    how: str
    notices: tuple[Notice, ...] = ()

    def __repr__(self) -> str:
        x, y, z = MM_PER_METRE * self.transform[:3, 3]
        return f"<IdentifiedFrame: {self.kind} at {x:.3f} {y:.3f} {z:.3f} mm, from {self.how}>"

    def told_in(self, outer: Floats) -> "IdentifiedFrame":
        """The frame told in another (4, 4) of the base, its covariance along the axes of that frame."""
        inward = rigid_inverse(outer)
        turned = np.kron(np.eye(2), inward[:3, :3])
        covariance = turned @ self.covariance @ turned.T
        return replace(self, transform=inward @ self.transform, covariance=covariance)

    @property
    def distances_mm(self) -> Floats:
        """Lengths of the residuals (n,), mm."""
        return np.asarray(np.linalg.norm(self.residuals, axis=1) * MM_PER_METRE)

    @property
    def std_mm(self) -> Floats:
        """Standard deviations of the translation (3,), mm."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[:3]) * MM_PER_METRE)

    @property
    def std_mrad(self) -> Floats:
        """Standard deviations of the rotation vector (3,), mrad."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[3:]) * MRAD_PER_RAD)

    def to_dict(self) -> dict[str, Any]:
        """JSON values: mm, mrad and quaternions w x y z."""
        return {
            "kind": self.kind,
            "how": self.how,
            "xyz_mm": (self.transform[:3, 3] * MM_PER_METRE).tolist(),
            "quaternion_wxyz": quaternion_from_matrix(self.transform[:3, :3]).tolist(),
            "std_mm": self.std_mm.tolist(),
            "std_mrad": self.std_mrad.tolist(),
            "covariance_mm_mrad": (self.covariance * MM_PER_METRE**2).tolist(),
            "noise_mm": self.noise_m * MM_PER_METRE,
            "freedom": self.freedom,
            "residuals_mm": self.distances_mm.tolist(),
            "rows": self.rows.tolist(),
        }
