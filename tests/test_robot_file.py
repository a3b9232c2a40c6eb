"""Robot files that are wrong: the message names the file, the key and the rule."""

from pathlib import Path

import pytest

from truearm.errors import InputError
from truearm.robot import Robot

GOOD = """name = "arm"
convention = "standard"
length_unit = "mm"
angle_unit = "deg"
[base]
theta = 10.0
[[link]]
joint = "revolute"
d = 100.0
limits = [-90.0, 90.0]
[[link]]
joint = "revolute"
alpha = 90.0
[tool]
xyz = [0.0, 0.0, 10.0]
quaternion_wxyz = [1.0, 0.0, 0.0, 0.0]
[coupling]
matrix = [[1, 0], [0, 1]]
[payload]
mass_kg = 1.0
"""

BAD = {
    "not TOML": ("name =", "name = =", "not TOML: .*line 1"),
    "unknown key in a link": (
        "alpha = 90.0",
        "alhpa = 90.0",
        'unknown key "link 2, alhpa". Did you mean "alpha"',
    ),
    "unknown key at the top": (
        "convention",
        "convetion",
        'unknown key "convetion". Did you mean "convention"',
    ),
    "unknown key unlike any": ("mass_kg", "zzz", 'unknown key "payload, zzz". Known here: mass_kg, centre'),
    "missing key": ('length_unit = "mm"\n', "", 'key "length_unit" is missing. Either "m" or "mm"'),
    "missing joint": ('joint = "revolute"\nd', "d", 'key "link 1, joint" is missing. Either "revolute"'),
    "no links": ("[[link]]", "[[links]]", 'unknown key "links". Did you mean "link"'),
    "unknown unit": ('"mm"', '"cm"', 'length_unit: \'cm\' is not known. Must be "m" or "mm"'),
    "unknown convention": ('"standard"', '"craig"', "convention: 'craig' is not known. Must be \"standard\""),
    "unknown joint": ('"revolute"\nalpha', '"helical"\nalpha', "link 2, joint: 'helical' is not known"),
    "text for a number": (
        "alpha = 90.0",
        'alpha = "90"',
        "link 2, alpha: '90' cannot be used. Must be a number",
    ),
    "true for a number": (
        "alpha = 90.0",
        "alpha = true",
        "link 2, alpha: True cannot be used. Must be a number",
    ),
    "not a number": (
        "alpha = 90.0",
        "alpha = nan",
        "link 2, alpha: nan cannot be used. Must be a finite number",
    ),
    "limit that is no number": ("[-90.0, 90.0]", "[nan, 90.0]", "link 1, limits: nan to 90; the lower limit"),
    "infinite limits swapped": ("[-90.0, 90.0]", "[inf, 90.0]", "link 1, limits: inf to 90; the lower limit"),
    "names of another chain": (
        "[payload]",
        '[urdf]\nbase_link = "b"\ntip_link = "t"\njoints = ["j1"]\nlinks = ["l1", "l2"]\n[payload]',
        r"urdf\.joints has 1 names, it must have 2",
    ),
    "limits swapped": (
        "[-90.0, 90.0]",
        "[90.0, -90.0]",
        "link 1, limits: 90 to -90; the lower limit comes first",
    ),
    "one limit": ("[-90.0, 90.0]", "[90.0]", "link 1, limits: .*Must have 2 entries"),
    "three limits": ("[-90.0, 90.0]", "[1.0, 2.0, 3.0]", "link 1, limits: .*Must have 2 entries"),
    "limits not a list": ("[-90.0, 90.0]", "90.0", "link 1, limits: 90.0 cannot be used. Must be a list"),
    "direction true": ("alpha = 90.0", "direction = true", "link 2, direction: true is no direction"),
    "direction": ("alpha = 90.0", "direction = 2", "link 2, direction: 2 is not known. Must be 1 or -1"),
    "quaternion length": (
        "[1.0, 0.0, 0.0, 0.0]",
        "[1.0, 1.0, 0.0, 0.0]",
        "tool, quaternion_wxyz: length 1.41421, must be 1",
    ),
    "two notations": ("xyz = [0.0", "d = 1.0\nxyz = [0.0", 'tool: gives "d" beside xyz'),
    "coupling size": ("[[1, 0], [0, 1]]", "[[1, 0]]", "coupling.matrix must be 2 by 2"),
    "singular coupling": (
        "[[1, 0], [0, 1]]",
        "[[1, 1], [1, 1]]",
        "coupling: the coupling matrix is singular",
    ),
    "negative mass": (
        "mass_kg = 1.0",
        "mass_kg = -1.0",
        "payload, mass_kg: -1.0 cannot be used. Must be at least 0",
    ),
    "section for a value": ("[base]\ntheta = 10.0", "base = 3", "base: 3 cannot be used. Must be a section"),
    "empty name": ('"arm"', '""', "name: '' cannot be used. Must not be empty"),
    "number for the name": ('"arm"', "3", "name: 3 cannot be used. Must be text in quotes"),
    "degrees read as radians": (
        '"deg"',
        '"rad"',
        "arm.toml, link 2, alpha: 90 rad. No angle is beyond one turn. Check angle_unit",
    ),
    "millimetres read as metres": (
        '"mm"',
        '"m"',
        "arm.toml, link 1, d: 100 m. No link is longer than 50 m. Check length_unit",
    ),
}


def test_the_good_file_is_good() -> None:
    assert Robot.from_toml(GOOD, where="arm.toml").joint_count == 2


@pytest.mark.parametrize("case", BAD)
def test_bad_files_are_explained(case: str) -> None:
    old, new, message = BAD[case]
    assert old in GOOD
    with pytest.raises(InputError, match=message) as caught:
        Robot.from_toml(GOOD.replace(old, new), where="arm.toml")
    assert str(caught.value).startswith("arm.toml")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"PK\x03\x04rest", "a ZIP archive"),
        (b"\x00\x01\x02", "binary data"),
        (b"name = '\xff'", "line 1 holds bytes that are not UTF-8"),
        ("name".encode("utf-16"), "UTF-16 text"),
        (b"", 'key "name" is missing'),
    ],
)
def test_files_that_are_no_text(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "arm.toml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        Robot.load(path)
    assert str(caught.value).startswith(str(path))


def test_a_folder_of_the_same_name_hides_no_robot_of_the_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "ur10").mkdir()
    monkeypatch.chdir(tmp_path)
    assert Robot.load("ur10").name == "UR10"


def test_missing_file_and_directory(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        Robot.load(tmp_path / "none.toml")
    with pytest.raises(InputError, match="this is a directory"):
        Robot.load(tmp_path)
    with pytest.raises(InputError, match="no file of that name"):
        Robot.load("a" * 300)
