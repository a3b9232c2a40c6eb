"""Units of tables that are brought in: what headers say, and what is stated behind a column."""

from pathlib import Path

import pytest

from tests.import_support import COLUMNS, PLAIN, plan, write
from truearm.importing import import_table
from truearm.units import to_si, unit_in_header


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        *(("J1 [deg]", "deg"), ("J1(°)", "deg"), ("J1 in Degrees", "deg"), ("j1_rad", "rad")),
        *(("q1 [\u00ba]", "deg"), ("J1 [gon]", "gon"), ("J1 [Grad]", "grad"), ("q1 [mdeg]", "mdeg")),
        *(("x [ft]", "ft"), ("x feet", "ft"), ("x [1/10 mm]", "1/10 mm"), ("x (0.1mm)", "0.1mm")),
        *(("x [10^-3 in]", "10^-3 in"), ("q1 [deg/s]", "deg/s"), ("x [mm\u00b2]", "mm\u00b2")),
        *(("x [TCP]", ""), ("x [world]", ""), ("x [1/s]", ""), ("x (in world)", ""), ("x [TCP] [mm]", "mm")),
        *(("X (mm)", "mm"), ("X (mm) nominal", "mm"), ("X, mm", "mm"), ("X/m", "m"), ("dX [\u00b5m]", "um")),
        *(
            ("Z [in]", "in"),
            ("Z inch", "in"),
            ("J1", ""),
            ("X in", ""),
            ("arm", ""),
            ("x [1]", ""),
            ("mm", ""),
        ),
    ],
)
def test_units_in_headers_are_seen(header: str, unit: str) -> None:
    assert unit_in_header(header) == unit


def test_a_unit_behind_a_column_goes_before_that_of_its_name(tmp_path: Path) -> None:
    path = write(tmp_path, PLAIN.replace("px", "px (mm)"))
    stated = COLUMNS | {"x": "px (mm):m"}
    assert import_table(path, plan(columns=stated)).frame["x"].tolist() == [1000.0, 1500.0]
    agreed = COLUMNS | {"x": "px (mm)"}
    assert import_table(path, plan(columns=agreed)).frame["x"].tolist() == [1.0, 1.5]


@pytest.mark.parametrize(
    ("ours", "unit", "found"),
    [("sigma", "um", 45e-6), ("sigma", "cm", 0.45), ("q1", "mrad", 0.045), ("q1", "um", 45e-6)],
)
def test_a_column_is_of_a_unit_that_the_others_are_not(
    ours: str, unit: str, found: float, tmp_path: Path
) -> None:
    theirs = f"U [{unit}]"
    text = PLAIN.replace("-90,0,", "-90,1,").replace("J1" if ours == "q1" else "J2", theirs)
    path = write(tmp_path, text)
    columns = {"q1": "J1", "x": "px", "y": "py", "z": "pz"} | {ours: f"{theirs}:{unit}"}
    frame = import_table(path, plan(columns=columns)).frame
    name = "q1_m" if unit == "um" and ours == "q1" else ours
    assert frame[name][0] == (2.0 * found if ours == "q1" else found)


def test_units_of_columns_are_exact() -> None:
    assert [to_si(4.5, unit) for unit in ("um", "mm", "cm", "mrad")] == [4.5e-6, 4.5e-3, 4.5e-2, 4.5e-3]
