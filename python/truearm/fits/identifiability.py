"""Which of the candidates the measurements determine, and in words what the others cannot be told from."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

from truearm._core import MeasurementSet, Problem, Setup, identifiability
from truearm.fits.identified import IdentifiedArm
from truearm.fits.parameters import KIND_COUNT, THETA, D

MAX_NAMED: Final = 4
SETUP: Final = "the place of device or target"
BASE: Final = "the place of the base"
IN_FRONT_OF_ITS_JOINT: Final = {"standard": (THETA, D), "modified": tuple(range(KIND_COUNT))}
"""Kinds of a row that move all that its joint carries alike, whatever its reading."""
Confounded = tuple[int, Sequence[tuple[int, float]], bool]


@dataclass(frozen=True)
class Identifiability:
    """What the data says about the arm's candidates for constants.

    `truearm.calibrate` makes one, `calibration.identifiability`.

    Attributes:
        parameters: How many were asked for.
        determined: Names of those the data determines.
        undetermined: Names of the others, which stay nominal.
        words: One sentence for each of the others: what it cannot be told from.
        total_rank: Rank of arm and set-up together.
        condition: 2-norm condition number of the determined ones and the set-up; columns in mm and 1/300 rad.
    """

    parameters: int
    determined: tuple[str, ...]
    undetermined: tuple[str, ...]
    words: tuple[str, ...]
    total_rank: int
    condition: float

    @property
    def rank(self) -> int:
        """How many the data determines."""
        return len(self.determined)

    def to_dict(self) -> dict[str, Any]:
        """JSON values."""
        content = {"parameters": self.parameters, "rank": self.rank}
        given = asdict(self)
        return content | {key: given[key] for key in given if key != "parameters"}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "Identifiability":
        """One from the JSON values of `to_dict`."""
        texts = {key: tuple(content[key]) for key in ("determined", "undetermined", "words")}
        return cls(
            parameters=content["parameters"],
            total_rank=content["total_rank"],
            condition=content["condition"],
            **texts,
        )


def identify(arm: IdentifiedArm, measured: MeasurementSet, setup: Setup) -> Identifiability:
    """Ask the measurements at the nominal arm, with the frames and targets that were fitted to it."""
    wanted = arm.candidates.constant
    columns = [arm.candidates.columns[k] for k in wanted]
    names = [arm.candidates.names[k] for k in wanted]
    problem = Problem(arm.flange_chain, measured, columns, arm.world_is_known)
    of_base = [not arm.world_is_known and _moves_all_alike(arm, column) for column in columns]
    determined, undetermined, total_rank, condition = identifiability(problem, arm.table, setup)
    return Identifiability(
        parameters=len(columns),
        determined=tuple(names[k] for k in determined),
        undetermined=tuple(names[k] for k, _, _ in undetermined),
        words=tuple(_sentence(names, entry, of_base=of_base[entry[0]]) for entry in undetermined),
        total_rank=total_rank,
        condition=condition,
    )


def _moves_all_alike(arm: IdentifiedArm, column: int) -> bool:
    """Whether a parameter is of the base or stands in front of the first joint: it moves the whole arm, which
    distances between its own points do not see.
    """
    row, kind = divmod(column, KIND_COUNT)
    return row == 0 or (row == 1 and kind in IN_FRONT_OF_ITS_JOINT[arm.robot.convention])


def _sentence(names: Sequence[str], entry: Confounded, *, of_base: bool) -> str:
    index, parts, with_setup = entry
    largest = sorted(parts, key=lambda part: -abs(part[1]))
    others = [names[k] for k, _ in largest]
    if not others and not with_setup:
        unseen = f"cannot be distinguished from {BASE}" if of_base else "hardly affected what was measured"
        return f"{names[index]} {unseen}."
    setup = [SETUP] if with_setup else []
    named = others[: MAX_NAMED - len(setup)] + setup
    told = " and ".join(part for part in (", ".join(named[:-1]), named[-1]) if part)
    return f"{names[index]} cannot be distinguished from {told}."
