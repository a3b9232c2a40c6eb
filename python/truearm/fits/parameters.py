"""Which parameters of an arm are asked for, and what they are called."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from truearm.errors import UsageError, did_you_mean, list_names
from truearm.types import Floats

KINDS: Final = ("theta", "d", "a", "alpha", "beta")
THETA, D, A, ALPHA, BETA = range(5)
KIND_COUNT: Final = len(KINDS)
PARALLEL_WITHIN_DEG: Final = 5.0


def are_lengths(columns: Sequence[int] | range) -> NDArray[np.bool_]:
    """Which parameters, by index 5 * row + (theta, d, a, alpha, beta), are lengths and no angles."""
    return np.isin(np.asarray(columns) % KIND_COUNT, (D, A))


@dataclass(frozen=True)
class Candidates:
    """Parameters of a chain that a calibration may correct.

    Attributes:
        columns: Indices 5 * row + (theta, d, a, alpha, beta) into the chain's parameters, ascending.
        constant: Indices into `columns` of those asked for as constants.
        driven: Indices into `columns` of those that vary: all of moving links.
        names: Name of each column: kind and row, such as "d2"; row 0 is the base.
    """

    columns: tuple[int, ...]
    constant: tuple[int, ...]
    driven: tuple[int, ...]
    names: tuple[str, ...]

    def column(self, name: str) -> int:
        """Index into the chain's parameters of a name.

        Raises:
            UsageError: If there is no such candidate.
        """
        if name not in self.names:
            raise UsageError(
                f'there is no parameter "{name}"',
                rule=f"There are {list_names(self.names)}",
                way_out=did_you_mean(name, self.names),
            )
        return self.columns[self.names.index(name)]


def candidates(
    convention: str, joints: Sequence[str], table: Floats, parallel_within_deg: float = PARALLEL_WITHIN_DEG
) -> Candidates:
    """Candidates of a chain whose row 0 is the base if it is "fixed", and link 1 otherwise.

    A revolute link brings theta, d, a and alpha; beta in place of d where its axis and the neighbour's are
    within `parallel_within_deg` of parallel or anti-parallel. A prismatic one brings the two angles that
    turn it, and its d as a parameter that only varies. The base brings all five.

    Args:
        convention: "standard" or "modified".
        joints: "revolute", "prismatic" or "fixed" for each row.
        table: Nominal parameters (rows, 5).
        parallel_within_deg: Angle between axes up to which they count as parallel.
    """
    parallel = _parallel_rows(convention, joints, table, parallel_within_deg)
    kinds = [_kinds(joint, is_parallel=flag) for joint, flag in zip(joints, parallel, strict=True)]
    entries = [(row, kind) for row, chosen in enumerate(kinds) for kind in chosen]
    first = 0 if joints[0] == "fixed" else 1
    return Candidates(
        columns=tuple(KIND_COUNT * row + kind for row, kind in entries),
        constant=tuple(k for k, (row, kind) in enumerate(entries) if joints[row] != "prismatic" or kind != D),
        driven=tuple(k for k, (row, _) in enumerate(entries) if joints[row] != "fixed"),
        names=tuple(f"{KINDS[kind]}{row + first}" for row, kind in entries),
    )


def _kinds(joint: str, *, is_parallel: bool) -> tuple[int, ...]:
    if joint == "fixed":
        return THETA, D, A, ALPHA, BETA
    if joint == "prismatic":
        return (D, ALPHA, BETA) if is_parallel else (THETA, D, ALPHA)
    return (THETA, A, ALPHA, BETA) if is_parallel else (THETA, D, A, ALPHA)


def _parallel_rows(
    convention: str, joints: Sequence[str], table: Floats, within_deg: float
) -> NDArray[np.bool_]:
    """Rows whose alpha and beta stand between two joint axes that are (anti-)parallel.

    In the standard convention they turn the next row's axis against this one's, in the modified one this
    row's against the one before. At the other end of the chain there is no axis to be parallel to.
    """
    cosine = np.abs(np.cos(table[:, ALPHA]) * np.cos(table[:, BETA]))
    parallel = cosine >= np.cos(np.radians(within_deg))
    moving = np.array([joint != "fixed" for joint in joints])
    neighbour = np.zeros_like(moving)
    if convention == "standard":
        neighbour[:-1] = moving[1:]
    else:
        neighbour[1:] = moving[:-1]
    return np.asarray(parallel & moving & neighbour, dtype=np.bool_)
