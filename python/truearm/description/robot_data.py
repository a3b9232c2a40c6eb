"""The fields of a robot: nominal table, fixed transforms, coupling and limits, checked on the way in."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truearm.arrays import frozen, rigid
from truearm.description.dh_row import row_transform
from truearm.description.urdf_names import UrdfNames
from truearm.errors import InputError
from truearm.types import Floats

Convention = Literal["standard", "modified"]
Joint = Literal["revolute", "prismatic"]

MIN_COUPLING_DETERMINANT: Final = 1e-9
TRANSFORMS: Final = ("base", "flange", "tool")
SAME: Final = 1e-9
"""Elements of transforms that differ by less are equal: lengths in m and cosines."""
OPEN_REACH_M: Final = 0.5
"""How far from zero a joint that slides is taken to go where it has no limit."""


@dataclass(frozen=True)
class Payload:
    """What the arm carried: mass, and centre of gravity in the flange frame."""

    mass_kg: float
    centre_of_gravity_mm: tuple[float, float, float] | None = None


@dataclass(frozen=True, eq=False)
class RobotData:
    """The fields of a Robot, which describes them, checked on the way in."""

    name: str
    source: str
    convention: Convention
    joints: tuple[Joint, ...]
    table: Floats
    base: Floats
    flange: Floats
    tool: Floats
    base_row: Floats | None
    coupling: Floats
    limits: Floats
    payload: Payload | None = None
    urdf_names: UrdfNames | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise InputError(f"{self.name!r}", where="name", rule="The name is a text that is not empty")
        if not _is_unicode(self.name):
            raise InputError(
                f"{self.name!r}",
                where="name",
                rule="The name is text in Unicode, without halves of characters",
                way_out="Give another name",
            )
        n = len(self.joints)
        _check_known("convention", (self.convention,), get_args(Convention))
        _check_known("joints", self.joints, get_args(Joint))
        shapes = {"table": (n, 5), **dict.fromkeys(TRANSFORMS, (4, 4))}
        shapes |= {"coupling": (n, n), "limits": (n, 2)}
        for field, shape in shapes.items():
            value = _checked(field, getattr(self, field), shape)
            object.__setattr__(self, field, _rigid(field, value) if field in TRANSFORMS else value)
        if self.base_row is not None:
            object.__setattr__(self, "base_row", self._row_of_base(self.base_row))
        unordered = np.flatnonzero(~(self.limits[:, 0] < self.limits[:, 1]))
        if len(unordered):
            raise InputError(
                f"joint {unordered[0] + 1} has {self.limits[unordered[0]].tolist()}",
                where="limits",
                rule="The lowest reading comes first, then the highest; infinite where there is none",
            )
        if abs(np.linalg.det(self.coupling)) < MIN_COUPLING_DETERMINANT:
            raise InputError(
                "the coupling matrix is singular",
                where="coupling",
                rule="Every joint value must come from one set of readings only",
            )

    def _row_of_base(self, row: Floats) -> Floats | None:
        """The row (5,) that the base was given as; None where the base is another one by now."""
        row = _checked("base_row", row, (5,))
        made = row_transform(row, self.convention)
        return row if np.allclose(made, self.base, rtol=0.0, atol=SAME) else None

    @property
    def joint_count(self) -> int:
        """Number of joints, N."""
        return len(self.joints)

    @property
    def revolute(self) -> NDArray[np.bool_]:
        """Which joints turn (N,); the others slide."""
        return np.array([kind == "revolute" for kind in self.joints])

    def finite_limits(self, open_m: float = OPEN_REACH_M) -> tuple[Floats, Floats]:
        """Lowest and highest readings (N,); where there is no limit, half a turn or `open_m` from zero."""
        reach = np.where(self.revolute, np.pi, open_m)
        low, high = self.limits.T
        return np.where(np.isfinite(low), low, -reach), np.where(np.isfinite(high), high, reach)


def _is_unicode(text: str) -> bool:
    """Whether files can hold a text: half of a surrogate pair, as of names in other encodings, is no text."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _check_known(field: str, values: Sequence[str], known: tuple[str, ...]) -> None:
    for value in values:
        if value not in known:
            raise InputError(f'"{value}" is not known', where=field, rule=f"Either {' or '.join(known)}")


def _checked(field: str, value: ArrayLike, shape: tuple[int, ...]) -> Floats:
    array = np.asarray(value, dtype=np.float64)
    if array.shape != shape:
        raise InputError(f"shape {array.shape}", where=field, rule=f"The shape must be {shape}")
    if field != "limits" and not np.isfinite(array).all():
        raise InputError("NaN or infinite value", where=field, rule="All values must be finite")
    return frozen(array, *shape)


def _rigid(field: str, transform: Floats) -> Floats:
    exact, fault = rigid(transform[None])
    if fault is not None:
        raise InputError(f"no rigid motion: {fault.why}", where=field, rule=fault.rule, way_out=fault.way_out)
    return frozen(exact[0], 4, 4)
