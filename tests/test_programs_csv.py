"""Paths as CSV: joints, poses, seeds, units, and that numbers alone are changed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.program_tools import read, reasons, rewritten, says, skeleton, survives
from truearm.errors import InputError
from truearm.programs.csv_path import CsvPath
from truearm.robot import Robot
from truearm.rotations import quaternion_from_matrix

CSV = CsvPath()
SHIFT = np.deg2rad([0.11, -0.07, 0.05, 0.03, -0.02, 0.09])
Q = np.array([0.3, -1.3, 1.4, -1.7, -1.5, 0.4]) + 0.05 * np.arange(5)[:, None]


@pytest.fixture(scope="module")
def robot():
    return Robot.load("ur10e")


def joints(q, unit="", decimals=6):
    head = ",".join(f"q{k + 1}{unit}" for k in range(q.shape[1]))
    return "\n".join([head, *(",".join(f"{value:.{decimals}f}" for value in row) for row in q)]) + "\n"


def poses(robot, q, seeds=True):
    head = "name,x_mm,y_mm,z_mm,qw,qx,qy,qz,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg"
    rows = [head]
    for number, (row, pose) in enumerate(zip(q, robot.pose(q), strict=True)):
        values = [*(1e3 * pose[:3, 3]), *quaternion_from_matrix(pose[:3, :3])]
        seed = [f"{value:.1f}" for value in np.rad2deg(row)] if seeds or number == 0 else [""] * 6
        rows.append(",".join([f'"p, {number}"', *(f"{value:.8f}" for value in values), *seed]))
    return "\n".join(rows) + "\n"


@pytest.mark.parametrize(("unit", "factor"), [("", 1.0), ("_rad", 1.0), ("_deg", 180.0 / np.pi)])
def test_joints_are_corrected_in_their_unit(robot, unit, factor):
    result = rewritten(CSV, joints(Q * factor, unit), robot, by=SHIFT)
    assert result.changed.all()
    assert np.abs(result.nominal - Q).max() < 1e-6
    again = np.array([line.split(",") for line in result.contents[0].decode().splitlines()[1:]], dtype=float)
    assert np.abs(again / factor - Q - SHIFT).max() < 1e-6


@pytest.mark.parametrize("seeds", [True, False])
def test_poses_are_corrected_on_the_branch_of_their_seed(robot, seeds):
    text = poses(robot, Q, seeds)
    result = rewritten(CSV, text, robot, by=SHIFT)
    assert reasons(result) == []
    posed = result.program.targets.layout == 1
    assert np.abs(result.nominal[posed] - Q).max() < 1e-7
    again = says(CSV, result.contents[0], robot)[posed]
    assert np.abs(again - Q - SHIFT).max() < 1e-7


def seven(poses, q, seeds):
    """A path of an arm with seven joints: poses (n, 4, 4), with joints beside all of them or the first."""
    rows = [",".join(["x", "y", "z", "qw", "qx", "qy", "qz", *(f"q{k + 1}" for k in range(7))])]
    for number, (row, pose) in enumerate(zip(q, poses, strict=True)):
        values = [*pose[:3, 3], *quaternion_from_matrix(pose[:3, :3])]
        seed = [f"{value:.9f}" for value in row] if seeds or number == 0 else [""] * 7
        rows.append(",".join([*(f"{value:.9f}" for value in values), *seed]))
    return "\n".join(rows) + "\n"


def test_poses_far_from_their_seed_or_out_of_reach_are_listed():
    robot = Robot.load("kuka-iiwa-7")
    q = np.tile(np.deg2rad([-40.0, 30.0, 20.0, -60.0, 10.0, 50.0, -30.0]), (3, 1))
    poses, seeds = robot.pose(q), q.copy()
    poses[1, :3, 3] *= 5.0
    seeds[2, [0, 3]] += np.deg2rad([120.0, -40.0])
    result = rewritten(CSV, seven(poses, seeds, True), robot, by=np.full(7, 1e-3))
    assert np.isfinite(result.nominal[result.changed]).all()
    why = [reason for _, _, reason in reasons(result)]
    assert len(why) == 2
    assert any("does not reach it" in each for each in why)
    assert any("infinitely many ways" in each for each in why)


@pytest.mark.parametrize("seeds", [True, False])
def test_seeds_tell_of_the_elbow_of_an_arm_with_seven_joints(seeds):
    robot = Robot.load("kuka-iiwa-7")
    low, high = np.deg2rad([[-40, 30, 20, -60, 10, 50, -30], [50, 60, -30, -90, 40, 20, 60]])
    q = low + (high - low) * np.linspace(0.0, 1.0, 12)[:, None]
    result = rewritten(CSV, seven(robot.pose(q), q, seeds), robot, by=np.full(7, 1e-3))
    assert reasons(result) == []
    posed = result.program.targets.layout == 1
    found = result.nominal[posed]
    np.testing.assert_allclose(robot.pose(found), robot.pose(q), atol=1e-7)
    if seeds:
        np.testing.assert_allclose(found, q, atol=1e-6)
    assert np.abs(np.diff(found, axis=0)).max() < 0.3, "without seeds the elbow goes on from where it was"


def test_a_byte_order_mark_stays_first_and_what_was_written_is_read_again(robot):
    text = "\ufeff".encode().decode("latin-1") + joints(Q)
    result = rewritten(CSV, text, robot, by=SHIFT, mark="compensated")
    assert result.changed.all()
    written = result.contents[0].decode("latin-1")
    assert written.startswith(text[:3] + "# compensated\n" + text[3:8])
    assert np.abs(says(CSV, written, robot) - Q - SHIFT).max() < 1e-6


def test_numbers_in_quotes_are_numbers(robot):
    rows = joints(Q).splitlines()
    quoted = "\n".join([rows[0], *(",".join(f'"{one}"' for one in row.split(",")) for row in rows[1:])])
    result = rewritten(CSV, quoted, robot, by=SHIFT)
    assert result.contents[0].decode().replace('"', "") == rewritten(
        CSV, joints(Q), robot, by=SHIFT
    ).contents[0].decode().rstrip("\n")


def test_lines_that_end_in_cr_alone_are_told(robot):
    with pytest.raises(InputError, match="CR alone"):
        read(CSV, joints(Q).replace("\n", "\r"), robot)


def test_without_a_seed_the_branch_is_not_certain(robot):
    text = "\n".join(",".join(line.split(",")[-13:-6]) for line in poses(robot, Q).splitlines())
    result = rewritten(CSV, text, robot, by=SHIFT)
    assert not result.changed.any()
    assert "several configurations" in reasons(result)[0][2]


def test_rotation_vectors_in_metres(robot):
    from scipy.spatial.transform import Rotation

    rows = ["q1,q2,q3,q4,q5,q6,x,y,z,rx_deg,ry_deg,rz_deg"]
    for row, pose in zip(Q, robot.pose(Q), strict=True):
        turn = np.rad2deg(Rotation.from_matrix(pose[:3, :3]).as_rotvec())
        rows.append(",".join(f"{value:.7f}" for value in [*row, *pose[:3, 3], *turn]))
    result = rewritten(CSV, "\n".join(rows), robot, by=SHIFT)
    posed = result.program.targets.layout == 1
    assert result.changed[posed].all()
    assert np.abs(says(CSV, result.contents[0], robot)[posed] - Q - SHIFT).max() < 1e-6


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_numbers_alone_are_changed(robot, ending):
    text = ("# Bahn 1, 5.0 \u00b0\n" + poses(robot, Q)).replace("\n", ending).encode("latin-1")
    result = rewritten(CSV, text, robot, by=SHIFT)
    assert skeleton(result.contents[0]) == skeleton(text)
    old, new = text.split(ending.encode()), result.contents[0].split(ending.encode())
    assert old[:2] == new[:2]
    assert [line.split(b",")[0:2] for line in old[2:]] == [line.split(b",")[0:2] for line in new[2:]]


def test_the_mark_is_a_remark(robot):
    marked = rewritten(CSV, joints(Q), robot, by=SHIFT, mark="compensated by truearm 1").contents[0]
    assert marked.startswith(b"# compensated by truearm 1\nq1,")
    assert len(read(CSV, marked, robot).targets) == len(Q)


BAD = {
    "a,b\n1,2\n": r"line 1, column 1: there are neither all joints nor a whole pose",
    "q1,q2\n1,2\n": r"line 1, column 1: there are joints \[1, 2\], and the arm has 6",
    "q1,q2,q3,q4,q5,q6\n1,2,3,4,5\n": r"line 2, column 1: there are 5 fields, and 6 in the header",
    "q1,q2,q3,q4,q5,q6\n1,2,3,nan,5,6\n": r'line 2, column 7: "nan" in column "q4" is no number',
    "q1,q2,q3,q4,q5,q6\n1,2,,4,5,6\n": r'line 2, column 1: there is nothing in column "q3"',
    "x,y,z,qw,qx,qy,qz\n1,0,0,1,0,0,0\n1,0,0,0,0,0,0\n": "line 3, column 1: the quaternion .* length 0",
    "x,y,z,qw,qx,qy,qz\n1,0,0,1,0,0,0\n1,0,0,0.5,0,0,0\n": "has length 0.5. Orientations are unit",
    "x,y,z,qw,qx,qy,qz\n1,0,0,0.8,0.8,0,0\n": "line 2, column 1: .* has length 1.13137",
    "q1,q2,q3,q4,q5,q6\n": r"line 1, column 1: there are no rows below the header",
    "": r"line 1, column 1: the file is empty",
}


@pytest.mark.parametrize("text", BAD)
def test_bad_tables_are_errors_with_their_place(robot, text):
    with pytest.raises(InputError, match=BAD[text]):
        read(CSV, text, robot)


@settings(max_examples=60)
@given(st.data())
def test_mutilated_paths_end_in_a_listing_or_an_error(robot, data):
    sample = poses(robot, Q)
    start = data.draw(st.integers(0, len(sample)))
    end = data.draw(st.integers(start, min(len(sample), start + 60)))
    put = data.draw(st.text(st.sampled_from(',"\n #0.5-eq1x'), max_size=12))
    assert survives(CSV, sample[:start] + put + sample[end:], robot)


def test_a_byte_order_mark_stays_in_front(robot):
    text = joints(Q).encode("utf-8-sig")
    result = rewritten(CSV, text, robot, by=SHIFT)
    assert result.changed.all()
    assert result.contents[0].startswith(text[:5])


@pytest.mark.parametrize(
    ("head", "words"),
    [
        ("q1_mm,q2,q3,q4,q5,q6", "q1_mm: joint 1 is revolute"),
        ("q1,q2,q3,q4,q5,q6,q1_deg", '"q1" and "q1_deg" say the same'),
        ("x,y,z,rx,ry,rz,q1,q2,q3,q4,q5,q6,x_mm", '"x" and "x_mm" say the same'),
        ("x_mm,y,z,x_mm,rx,ry,rz", '"x_mm" and "x_mm" say the same'),
        ("x,y,z,rx,ry,rz,rz_deg", '"rz" and "rz_deg" say the same'),
        ("x,y,z,qw,qx,qy,qz,qw", '"qw" and "qw" say the same'),
        ("x,y,z,qw,qx,qy,qz,rx_deg,ry,rz", "qw, qx, qy, qz and rx_deg, ry, rz both say how"),
        ("x,y,z,rx,ry,rz,qw", "qw and rx, ry, rz both say how"),
        ("q1,q2,q3,q4,q5,q6,x_mm,y_mm,z_mm", "x_mm, y_mm, z_mm make no whole pose"),
        ("q1,q2,q3,q4,q5,q6,x,y,z,rx,ry", "x, y, z, rx, ry make no whole pose"),
        ("q1,q2,q3,q4,q5,q6,qw,qx,qy,qz", "qw, qx, qy, qz make no whole pose"),
        ("q1;q2;q3;q4;q5;q6", "separated by semicolons"),
    ],
)
def test_columns_that_cannot_be_are_refused(robot, head, words):
    row = ",".join("0.1" for _ in head.split(","))
    with pytest.raises(InputError, match=words):
        read(CSV, f"{head}\n{row}\n", robot)
