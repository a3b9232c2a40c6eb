"""Recursive division of a workspace, section 4.2 of the paper, whose poses are measured on demand."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from truearm import kinds
from truearm._core import CoreError, Regions, divide
from truearm.errors import InputError, UsageError, WorkError
from truearm.files import read_text, write_whole
from truearm.fits.core_set import known_setup
from truearm.fits.identified import IdentifiedArm
from truearm.planning.choosing import CRITERIA, Criterion, check_some
from truearm.planning.workspace import Workspace
from truearm.types import Floats

if TYPE_CHECKING:
    from truearm import _core
    from truearm._core import MeasuringOptions


INTEGER_ARRAYS: Final = ("axis", "child")
FORMAT: Final = "truearm division 1"
COUNTS: Final = ("most_regions", "poses", "candidates", "tests")
KNOWN: Final[Mapping[str, tuple[str, ...]]] = {
    "halving": ("longest", "best"),
    "order": ("worst", "breadth"),
    "criterion": CRITERIA,
}
LARGEST_SEED: Final = 2**64 - 1


@dataclass(frozen=True)
class DivisionOptions:
    """How a space is divided and measured.

    Attributes:
        accuracy_m: A region whose test points all err less is not divided.
        most_regions: Leaves at the most; the largest errors are divided first with the order "worst".
        limit: A region whose condition number of M stays above is not divided further.
        poses: Measured in each region to identify its CEPs.
        candidates: From which these are chosen, as many at the least.
        tests: Further poses that judge the region.
        halving: Axis of each halving: the "longest" side in parts of the whole, or the "best" of all.
        order: "breadth" first, or the "worst" region first.
        criterion: What the choice of poses looks at.
        seed: Of the draw of candidates.
    """

    accuracy_m: float = 0.1e-3
    most_regions: int = 110
    limit: float = 1e4
    poses: int = 20
    candidates: int = 100
    tests: int = 10
    halving: Literal["longest", "best"] = "longest"
    order: Literal["worst", "breadth"] = "breadth"
    criterion: Criterion = "kappa"
    seed: int = 0

    def __post_init__(self) -> None:
        kinds.settle(self, whole=(*COUNTS, "seed"), numbers=("accuracy_m", "limit"))
        kinds.check_values(
            self, choices=KNOWN, positive=(*COUNTS, "limit"), not_negative=("accuracy_m", "seed")
        )
        if self.seed > LARGEST_SEED:
            raise UsageError(f"{self.seed}", where="seed", rule=f"At most {LARGEST_SEED}")
        if self.candidates < self.poses:
            raise UsageError(
                f"{self.candidates}, to choose {self.poses} poses from",
                where="candidates",
                rule="The poses of a region are some of its candidates",
                way_out="Give more candidates, or fewer poses",
            )

    def core(self, low: Floats, high: Floats) -> tuple["_core.DivisionOptions", "MeasuringOptions"]:
        """Internal: the core's options of the division, and of its measuring."""
        division: _core.DivisionOptions = {
            "low": low,
            "high": high,
            "accuracy": self.accuracy_m,
            "regions": self.most_regions,
            "halving": self.halving,
            "order": self.order,
            "poses": self.poses,
            "limit": self.limit,
            "seed": self.seed,
        }
        measuring: MeasuringOptions = {
            "candidates": self.candidates,
            "tests": self.tests,
            "criterion": self.criterion,
            "passes": EXCHANGE_PASSES,
            "orientation": False,
        }
        return division, measuring


EXCHANGE_PASSES: Final = 2


@dataclass(frozen=True, eq=False)
class DividedSpace:
    """A divided space with the representative CEPs of its regions.

    Attributes:
        regions: The tree; its leaves are found in time that grows with its depth.
        names: Names of the coordinates.
        parameters: Names of the P parameters that the CEPs correct, in the arm's order.
        ceps: CEPs of each node beside the nominal parameters (nodes, P), m and rad; NaN without data.
        kappa: Condition number of M of each node, rows mm, columns per mm and per 1/300 rad.
        error_m: Largest error of each node's test points.
        ended: Why each leaf is one; empty for what was divided.
        batches: Node, number of poses and whether they are test points, in the order of measuring.
    """

    regions: Regions
    names: tuple[str, ...]
    parameters: tuple[str, ...]
    ceps: Floats
    kappa: Floats
    error_m: Floats
    ended: tuple[str, ...]
    batches: tuple[tuple[int, int, bool], ...] = ()

    @property
    def measured(self) -> int:
        """Poses that were measured, parents and test points counted."""
        return sum(count for _, count, _ in self.batches)

    def identifying_rows(self) -> NDArray[np.bool_]:
        """Which of the measured poses identify a leaf, in the order of measuring.

        Raises:
            WorkError: If the batches, and with them the order, are not known.
        """
        if not self.batches:
            raise WorkError(
                "this division does not tell in which order its regions were measured",
                rule="Its batches tell that, and there are none",
            )
        nodes, counts, tests = (np.array(column) for column in zip(*self.batches, strict=True))
        return np.asarray(np.repeat(np.isin(nodes, self.regions.leaves) & ~tests, counts), dtype=np.bool_)

    def save(self, path: str | Path) -> None:
        """Write as JSON, completely or not at all."""
        content = {
            "format": FORMAT,
            "names": self.names,
            "parameters": self.parameters,
            "regions": {name: values.tolist() for name, values in self.regions.arrays().items()},
            **{name: _nullable(getattr(self, name)) for name in ("ceps", "kappa", "error_m")},
            "ended": self.ended,
            "batches": self.batches,
        }
        write_whole(Path(path), json.dumps(content, allow_nan=False) + "\n")

    @classmethod
    def load(cls, path: str | Path) -> "DividedSpace":
        """Read what `save` wrote.

        Raises:
            InputError: If there is no such file, or it is none of ours.
        """
        try:
            content = json.loads(read_text(Path(path)))
            return cls._of(content)
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise InputError(
                f"this is no division: {error}", where=str(path), rule="Files that DividedSpace.save wrote"
            ) from None

    @classmethod
    def _of(cls, content: Mapping[str, Any]) -> "DividedSpace":
        if content["format"] != FORMAT:
            raise ValueError(f'its format is "{content["format"]}"')
        arrays = {
            name: np.array(values, dtype=np.int64 if name in INTEGER_ARRAYS else np.float64)
            for name, values in content["regions"].items()
        }
        numbers = {
            name: np.array(content[name], dtype=np.float64).reshape(len(content["kappa"]), -1)
            for name in ("ceps", "kappa", "error_m")
        }
        return cls(
            Regions.from_arrays(arrays),
            tuple(content["names"]),
            tuple(content["parameters"]),
            numbers["ceps"],
            numbers["kappa"][:, 0],
            numbers["error_m"][:, 0],
            tuple(content["ended"]),
            tuple((node, count, test) for node, count, test in content["batches"]),
        )


def divide_space(
    arm: IdentifiedArm,
    workspace: Workspace,
    parameters: Sequence[str],
    options: DivisionOptions | None = None,
) -> DividedSpace:
    """Divide a space whose poses are measured as they are needed.

    Args:
        arm: The arm with its base as a row (frame "world"): the device's frame is where the base is known.
        workspace: The space, its rules, and the callable that measures.
        parameters: Names of the parameters that are identified in each region.
        options: Accuracy, numbers and order.

    Raises:
        InputError: If a name is not a parameter of the arm, or measuring gives another shape than asked for.
        UsageError: If no parameter is named, or one twice.
        WorkError: If the whole space has too few poses that can be measured, or they tell too little.
    """
    kinds.required(arm, IdentifiedArm, "the arm")
    chosen, space = kinds.chosen(DivisionOptions, options, {}), workspace.space
    names = kinds.words(parameters, "parameters")
    check_some(names, "parameters")
    division, measuring = chosen.core(space.low, space.high)
    setup = known_setup(arm.robot.tool[:3, 3])
    columns = named_columns(arm, names)
    name_of = dict(zip(arm.candidates.columns, arm.candidates.names, strict=True))
    try:
        found = divide(arm.flange_chain, columns, arm.table, setup, workspace, division, measuring)
    except CoreError as error:
        raise WorkError(str(error)) from error
    return DividedSpace(
        found.regions,
        space.names,
        tuple(name_of[column] for column in columns),
        found.ceps,
        found.kappa,
        found.error,
        tuple(reason or "" for reason in found.ended),
        tuple(found.batches),
    )


def named_columns(arm: IdentifiedArm, names: Sequence[str]) -> list[int]:
    """Columns of parameters by name, in the arm's order.

    Raises:
        InputError: If the arm has no such parameter to identify.
    """
    known = dict(zip(arm.candidates.names, arm.candidates.columns, strict=True))
    unknown = [name for name in names if name not in known]
    if unknown:
        raise InputError(f'there is no parameter "{unknown[0]}"', rule=f"There are {', '.join(known)}")
    return sorted(known[name] for name in names)


def _nullable(values: Floats) -> list[Any]:
    """Nested lists, with None where there is no number."""
    kept = values.astype(object)
    kept[~np.isfinite(values)] = None
    found: list[Any] = kept.tolist()
    return found
