"""Tables of others and the plans that bring them in."""

from pathlib import Path
from typing import Any

from truearm.importing import ImportPlan
from truearm.tables.raw_tables import Marks

PLAIN = "J1,J2,px,py,pz\n90,45,1000,2000,3000\n-90,0,1500,2500,3500\n"
COLUMNS = {"q1": "J1", "q2": "J2", "x": "px", "y": "py", "z": "pz"}


def write(folder: Path, text: str, encoding: str = "utf-8") -> Path:
    path = folder / "raw.txt"
    path.write_bytes(text.encode(encoding))
    return path


def plan(**changes: Any) -> ImportPlan:
    """The plan of PLAIN with changes, those of its marks among them."""
    marks = {name: changes.pop(name) for name in Marks.__dataclass_fields__ if name in changes}
    given = {"columns": COLUMNS, "joint_unit": "deg", "length_unit": "mm", **changes}
    return ImportPlan(**given, marks=Marks(**marks))
