"""How the paper's schemes are fitted: options of `truearm calibrate --model regions|cmac|fcmac`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

from truearm import kinds
from truearm.errors import UsageError
from truearm.units import MM_PER_METRE

if TYPE_CHECKING:
    from truearm._core import NetworkOptions, TrainingRule

MAJOR_JOINTS: Final = (1, 2, 3)
WHOLE: Final = ("most_regions", "region_rows", "active", "epochs", "table")
POSITIVE: Final = (*WHOLE, "sigma_cells", "rate", "tolerance_mm")
KNOWN: Final[Mapping[str, tuple[str, ...]]] = {
    "region_ceps": ("shrunk", "least_squares"),
    "train_on": ("ceps", "measurements"),
    "membership": ("gaussian", "bspline"),
    "composition": ("min", "product"),
    "halving": ("longest", "best"),
    "normalise": ("printed", "squares"),
}

MOST_ACTIVE: Final = 8
MOST_ACTIVE_TOGETHER: Final = 2**14
MOST_ROWS: Final = 2**24
MOST_HASHED: Final = 2**64 - 1
NARROWEST_CELLS: Final = 0.05
SPLINES: Final = (2, 3, 4)
RATE_BELOW: Final = 2.0
"""What networks of the core can be."""


@dataclass(frozen=True)
class SchemeOptions:
    """The paper's schemes in passive mode.

    Attributes:
        scheme_joints: Joints, from 1, whose values are divided into regions and index the network.
        demanded_mm: A region is not divided further where no row that judges it errs more.
        most_regions: Number of regions at the most.
        region_rows: Poses that a region needs; shots of a pose are one row.
        halving: Axis of each halving: "longest" side, or "best", the one that helps most.
        region_ceps: "shrunk" towards the parent as the rows tell, or "least_squares" as in the paper.
        train_on: Networks learn by (A5) from "ceps" of regions, or from "measurements", kept smooth.
        membership: Of the FCMAC: "gaussian" as in the paper, or "bspline".
        composition: "min" as in the paper, or "product".
        sigma_cells: Standard deviation of a Gaussian sensor, in cells; 0.05 at the least.
        cells: Sensor cells of each joint, more than `active`; 17, 11, 11 with three joints as in the paper,
            else 7.
        active: Sensors of each input that are active, c, 8 at the most.
        rate: Learning rate of (A5), below 2.
        normalise: "printed", or "squares" to meet a pattern with one update at a rate of one.
        tolerance_mm: Training ends when no CEP differs more, angles at 0.3 m.
        epochs: Or after so many runs through the patterns.
        table: Rows of the hash table in place of a row for each association cell.
    """

    scheme_joints: kinds.Numbers = kinds.Numbers(kinds.whole_numbers, MAJOR_JOINTS)
    demanded_mm: float = 0.1
    most_regions: int = 110
    region_rows: int = 20
    halving: Literal["longest", "best"] = "longest"
    region_ceps: Literal["shrunk", "least_squares"] = "shrunk"
    train_on: Literal["ceps", "measurements"] = "ceps"
    membership: Literal["gaussian", "bspline"] = "gaussian"
    composition: Literal["min", "product"] = "min"
    sigma_cells: float = 0.5
    cells: kinds.Numbers = kinds.Numbers(kinds.whole_numbers, ())
    active: int = 3
    rate: float = 0.5
    normalise: Literal["printed", "squares"] = "printed"
    tolerance_mm: float = 1e-3
    epochs: int = 2000
    table: int | None = None

    def __post_init__(self) -> None:
        kinds.settle(self, whole=WHOLE, numbers=("sigma_cells", "rate", "tolerance_mm", "demanded_mm"))
        kinds.check_values(self, choices=KNOWN, positive=POSITIVE, not_negative=("demanded_mm",))
        if not self.scheme_joints or len(set(self.scheme_joints)) < len(self.scheme_joints):
            raise UsageError(f"{list(self.scheme_joints)}", where="scheme_joints", rule="Each joint once")
        if self.cells and len(self.cells) != len(self.scheme_joints):
            raise UsageError(
                f"{len(self.cells)} numbers", where="cells", rule="One for each of scheme_joints"
            )

    @property
    def sensor_cells(self) -> tuple[int, ...]:
        """Internal: sensor cells of each joint."""
        if self.cells:
            return self.cells
        count = len(self.scheme_joints)
        return (17, 11, 11) if count == len(MAJOR_JOINTS) else (7,) * count

    def check_network(self, *, fuzzy: bool) -> None:
        """Internal: check what a network is made of and trained with: an FCMAC if fuzzy, else a CMAC.

        Raises:
            UsageError: If there is no such network.
        """
        self._check_cells()
        shape, sigma = self.membership if fuzzy else "", self.sigma_cells
        narrow = f"At least {NARROWEST_CELLS}: narrower cells excite nothing"
        _check(shape != "gaussian" or sigma >= NARROWEST_CELLS, "sigma_cells", f"{sigma:g}", narrow)
        splines = "2 (linear), 3 (quadratic) or 4 (cubic) of a B-spline"
        _check(shape != "bspline" or self.active in SPLINES, "active", f"{self.active}", splines)
        steps = self.train_on == "ceps"
        diverges = f"Below {RATE_BELOW:g}, or training diverges"
        _check(not steps or self.rate < RATE_BELOW, "rate", f"{self.rate:g}", diverges)

    def _check_cells(self) -> None:
        cells, active, inputs = self.sensor_cells, self.active, len(self.scheme_joints)
        _check(active <= MOST_ACTIVE, "active", f"{active}", f"1 to {MOST_ACTIVE}")
        _check(min(cells) > active, "cells", f"{list(cells)}", f"Each above active, which is {active}")
        together = f"{active} of each of {inputs} inputs make {active**inputs} association cells"
        at_once = f"At most {MOST_ACTIVE_TOGETHER} are active at once"
        _check(active**inputs <= MOST_ACTIVE_TOGETHER, "active", together, at_once, "Lower active")
        most, way_out = MOST_HASHED, "Give fewer"
        if self.table is None:
            most, way_out = MOST_ROWS, "Give fewer, or the size of a hash table (table=20011)"
        count = math.prod(cells)
        association = f"{list(cells)} make {count} association cells"
        _check(count <= most, "cells", association, f"At most {most}", way_out)
        _check((self.table or 1) <= MOST_ROWS, "table", f"{self.table}", f"1 to {MOST_ROWS}")

    def network(self, *, fuzzy: bool) -> "NetworkOptions":
        """Internal: options of the core's network: the FCMAC, or the CMAC whose inputs are quantised."""
        return {
            "membership": self.membership if fuzzy else "quantised",
            "sigma": self.sigma_cells,
            "composition": self.composition,
            "table": self.table,
        }

    @property
    def training(self) -> "TrainingRule":
        """Internal: options of the core's training by (A5), without the columns."""
        return {
            "rate": self.rate,
            "normalise": self.normalise,
            "tolerance": self.tolerance_mm / MM_PER_METRE,
            "epochs": self.epochs,
        }


def _check(holds: bool, where: str, what: str, rule: str, way_out: str = "") -> None:
    if not holds:
        raise UsageError(what, where=where, rule=rule, way_out=way_out)
