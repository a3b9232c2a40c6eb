"""Units of tables that are brought in: what headers say, and what is stated behind a column."""

from pathlib import Path

import pytest

from tests.import_support import COLUMNS, PLAIN, plan, write
from truearm.errors import UsageError
from truearm.importing import ImportPlan, import_table
from truearm.measurements import Measurements
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


def test_sigmas_of_axes_and_of_orientations_come_in(tmp_path: Path) -> None:
    header = "q1,x,y,z,qw,qx,qy,qz,sigma_x_mm,Uy,Uz,sigma_mrad"
    path = write(tmp_path, f"{header}\n0,1,2,3,1,0,0,0,0.1,0.2,0.3,4\n1,1,2,3,1,0,0,0,0.1,0.2,0.3,4\n")
    columns = {"sigma_y": "Uy:um", "sigma_z": "Uz"}
    asked = ImportPlan(columns=columns, joint_unit="rad", length_unit="mm")
    data = Measurements.from_dataframe(import_table(path, asked).frame)
    assert data.sigma_axes_m is not None
    assert data.sigma_axes_m[0].tolist() == pytest.approx([1e-4, 2e-7, 3e-4])
    assert data.sigma_rad is not None
    assert data.sigma_rad.tolist() == [4e-3, 4e-3]
    with pytest.raises(UsageError, match="Write --map sigma_rad=COLUMN:mrad"):
        import_table(path, ImportPlan(columns={"sigma_mrad": "Uy"}, joint_unit="rad", length_unit="mm"))
    with pytest.raises(UsageError, match='"sigma_rad" has one of the units mrad, rad, deg'):
        import_table(path, ImportPlan(columns={"sigma_rad": "Uy:mm"}, joint_unit="rad", length_unit="mm"))


def test_units_of_columns_are_exact() -> None:
    assert [to_si(4.5, unit) for unit in ("um", "mm", "cm", "mrad")] == [4.5e-6, 4.5e-3, 4.5e-2, 4.5e-3]


@pytest.mark.parametrize(
    ("text", "stated", "words"),
    [
        (
            "q1_deg,x_mm,y_mm,z_mm\ndeg,m,m,m\n10,1,2,3\n",
            None,
            '"x_mm" says mm, the row of units below it says m.* --map x=x_mm:mm or --map x=x_mm:m',
        ),
        (
            "q1_deg,x (mm),y_mm,z_mm\ndeg,m,mm,mm\n10,1,2,3\n",
            "m",
            r'"x \(mm\)" says mm, the row of units below it says m',
        ),
        ("q1_deg,x_in,y_in,z_in\n10,1,2,3\n", "mm", '"x_in" says in, --length-unit says mm.*x=x_in:in or'),
    ],
)
def test_names_of_columns_are_held_against_what_else_says_units(
    text: str, stated: str | None, words: str, tmp_path: Path
) -> None:
    path, columns = write(tmp_path, text + text.splitlines()[-1]), {}
    if "(mm)" in text:
        columns = {"x": "x (mm)"}
    with pytest.raises(UsageError, match=words):
        import_table(path, ImportPlan(columns=columns, length_unit=stated))
    names = text.partition("\n")[0].split(",")[1:]
    right = dict(zip("xyz", (f"{name}:m" for name in names), strict=True))
    assert import_table(path, ImportPlan(columns=right, length_unit=stated)).frame["x"].tolist() == [1.0, 1.0]


def test_inches_in_names_alone_are_taken(tmp_path: Path) -> None:
    path = write(tmp_path, "q1_deg,x_in,y_in,z_in\n10,1,2,3\n11,1,2,3\n")
    for stated in (None, "in"):
        frame = import_table(path, ImportPlan(length_unit=stated)).frame
        assert frame["x"].tolist() == [0.0254, 0.0254]
