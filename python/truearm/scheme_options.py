"""How the paper's schemes are fitted: options of `truearm calibrate --model regions|cmac|fcmac`."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

from truearm import kinds
from truearm.errors import UsageError
from truearm.units import MM_PER_METRE

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


@dataclass(frozen=True)
class SchemeOptions:
    """The paper's schemes in passive mode.

    Attributes:
        scheme_joints: Joints, from 1, whose values are divided into regions and index the network.
        demanded_mm: A region is not divided further where no row that judges it errs more.
        most_regions: Number of regions at the most.
        region_rows: Rows that a region needs.
        halving: Axis of each halving: "longest" side, or "best", the one that helps most.
        region_ceps: "shrunk" towards the parent as the rows tell, or "least_squares" as in the paper.
        train_on: Networks learn by (A5) from "ceps" of regions, or from "measurements", kept smooth.
        membership: Of the FCMAC: "gaussian" as in the paper, or "bspline".
        composition: "min" as in the paper, or "product".
        sigma_cells: Standard deviation of a Gaussian sensor, in cells.
        cells: Sensor cells of each joint; 17, 11, 11 with three joints as in the paper, else 7.
        active: Sensors of each input that are active, c.
        rate: Learning rate of (A5).
        normalise: "printed", or "squares" to meet a pattern with one update at a rate of one.
        tolerance_mm: Training ends when no CEP differs more, angles at 0.3 m.
        epochs: Or after so many runs through the patterns.
        table: Rows of the hash table in place of a row for each association cell.
    """

    scheme_joints: tuple[int, ...] = MAJOR_JOINTS
    demanded_mm: float = 0.1
    most_regions: int = 110
    region_rows: int = 20
    halving: Literal["longest", "best"] = "longest"
    region_ceps: Literal["shrunk", "least_squares"] = "shrunk"
    train_on: Literal["ceps", "measurements"] = "ceps"
    membership: Literal["gaussian", "bspline"] = "gaussian"
    composition: Literal["min", "product"] = "min"
    sigma_cells: float = 0.5
    cells: tuple[int, ...] = ()
    active: int = 3
    rate: float = 0.5
    normalise: Literal["printed", "squares"] = "printed"
    tolerance_mm: float = 1e-3
    epochs: int = 2000
    table: int | None = None

    def __post_init__(self) -> None:
        kinds.settle(self, whole=WHOLE, numbers=("sigma_cells", "rate", "tolerance_mm", "demanded_mm"))
        kinds.check_values(self, choices=KNOWN, positive=POSITIVE, not_negative=("demanded_mm",))
        for name in ("scheme_joints", "cells"):
            object.__setattr__(self, name, kinds.whole_numbers(getattr(self, name), name))
        if not self.scheme_joints or len(set(self.scheme_joints)) < len(self.scheme_joints):
            raise UsageError(f"{list(self.scheme_joints)}", where="scheme_joints", rule="Each joint once")
        if self.cells and len(self.cells) != len(self.scheme_joints):
            raise UsageError(
                f"{len(self.cells)} numbers", where="cells", rule="One for each of scheme_joints"
            )

    @property
    def sensor_cells(self) -> tuple[int, ...]:
        """Sensor cells of each joint."""
        if self.cells:
            return self.cells
        count = len(self.scheme_joints)
        return (17, 11, 11) if count == len(MAJOR_JOINTS) else (7,) * count

    def network(self, *, fuzzy: bool) -> dict[str, Any]:
        """Options of the core's network: the FCMAC, or the CMAC whose inputs are quantised."""
        return {
            "membership": self.membership if fuzzy else "quantised",
            "sigma": self.sigma_cells,
            "composition": self.composition,
            "table": self.table,
        }

    @property
    def training(self) -> dict[str, Any]:
        """Options of the core's training by (A5), without the columns."""
        return {
            "rate": self.rate,
            "normalise": self.normalise,
            "tolerance": self.tolerance_mm / MM_PER_METRE,
            "epochs": self.epochs,
        }
