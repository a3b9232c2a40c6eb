"""Measurements against the robot they are said to be of."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from truearm.description.library import library_names
from truearm.doubts.plausibility import FAR_FACTOR, check_against
from truearm.errors import InputError
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.rotations import quaternion_from_matrix
from truearm.types import Floats
from truearm.units import LengthUnit

WORLD = np.array([3.0, -2.0, 0.5])


def readings(robot: Robot, count: int = 40, seed: int = 0, share: float = 0.9) -> Floats:
    low, high = np.clip(robot.limits, -np.pi, np.pi).T
    middle, half = (low + high) / 2, share * (high - low) / 2
    return np.random.default_rng(seed).uniform(middle - half, middle + half, (count, robot.joint_count))


def table(robot: Robot, q: Floats, scale: float = 1.0) -> pd.DataFrame:
    """What a device somewhere in the cell would see of the tool."""
    columns = dict(zip([f"q{k + 1}" for k in range(robot.joint_count)], q.T, strict=True))
    points = scale * (robot.position(q) + WORLD)
    return pd.DataFrame({**columns, **dict(zip("xyz", points.T, strict=True))})


@pytest.mark.parametrize("name", library_names())
def test_right_data_passes_in_every_unit(name: str) -> None:
    robot = Robot.load(name)
    q = readings(robot)
    assert check_against(Measurements.from_dataframe(table(robot, q)), robot) == []
    in_mm = Measurements.from_dataframe(table(robot, q, 1000.0), length_unit="mm")
    assert check_against(in_mm, robot) == []


@pytest.mark.parametrize("name", library_names())
def test_millimetres_read_as_metres(name: str) -> None:
    robot = Robot.load(name)
    data = Measurements.from_dataframe(table(robot, readings(robot), 1000.0), name="mm.csv")
    with pytest.raises(
        InputError, match=r"mm.csv, group mm.csv: half of .* millimetres, give --length-unit mm"
    ):
        check_against(data, robot)


def test_millimetres_of_a_stroke_read_as_metres() -> None:
    robot = Robot.load("adept-cobra-600")
    frame = table(robot, readings(robot))
    frame["q3"] *= 1000.0
    with pytest.raises(InputError, match=r"q3_mm.*give --length-unit mm, or name the columns: q3_mm"):
        check_against(Measurements.from_dataframe(frame, joints=robot.joints), robot)
    named = Measurements.from_dataframe(frame.rename(columns={"q3": "q3_mm"}), joints=robot.joints)
    assert check_against(named, robot) == []


@pytest.mark.parametrize("name", library_names())
def test_metres_read_as_millimetres(name: str) -> None:
    robot = Robot.load(name)
    data = Measurements.from_dataframe(table(robot, readings(robot)), length_unit="mm")
    with pytest.raises(
        InputError,
        match="far too close together.*If they are in metres, name the columns.*--length-unit m",
    ):
        check_against(data, robot)


@pytest.mark.parametrize("name", [name for name in library_names() if name != "adept-cobra-600"])
def test_degrees_read_as_radians(name: str) -> None:
    robot = Robot.load(name)
    q = readings(robot)
    data = Measurements.from_dataframe(
        table(robot, q).assign(**{f"q{k + 1}": np.degrees(q[:, k]) for k in range(q.shape[1])})
    )
    with pytest.raises(InputError, match="beyond what .* can reach.*give --angle-unit deg"):
        check_against(data, robot)


@pytest.mark.parametrize("name", ["ur10", "abb-irb-120", "kuka-iiwa-7", "rv-m2"])
def test_degrees_of_small_motions_read_as_radians(name: str) -> None:
    robot = Robot.load(name)
    q = readings(robot, share=0.9)
    q = q * np.radians(11.0) / np.abs(q).max()
    q = np.clip(q, *robot.limits.T)
    data = Measurements.from_dataframe(
        table(robot, q).assign(**{f"q{k + 1}": np.degrees(q[:, k]) for k in range(q.shape[1])})
    )
    with pytest.raises(InputError, match="give --angle-unit deg"):
        check_against(data, robot)


def test_radians_of_another_arm_are_not_taken_for_degrees_alone() -> None:
    robot = Robot.load("abb-irb-120")
    q = np.random.default_rng(0).uniform(-2.0 * np.pi, 2.0 * np.pi, (40, 6))
    with pytest.raises(InputError, match="--angle-unit deg.*if they are radians, they are of another arm"):
        check_against(Measurements.from_dataframe(table(robot, q)), robot)
    with pytest.raises(InputError, match="--angle-unit deg") as caught:
        check_against(Measurements.from_dataframe(table(robot, 10.0 * q)), robot)
    assert "another arm" not in str(caught.value)


def test_radians_read_as_degrees() -> None:
    robot = Robot.load("ur10")
    data = Measurements.from_dataframe(table(robot, readings(robot)), angle_unit="deg")
    with pytest.raises(InputError, match="stated in degrees, look like radians.*--angle-unit rad"):
        check_against(data, robot)


def test_stated_radians_are_believed() -> None:
    """An endless wrist may have turned many times: what is stated is not doubted, but said."""
    robot = Robot.load("ur10")
    q = readings(robot)
    q[7:15, 5] += 8 * np.pi
    points = table(robot, q)
    with pytest.raises(InputError, match="rows 8, 9.*beyond what UR10 can reach"):
        check_against(Measurements.from_dataframe(points), robot)
    (notice,) = check_against(Measurements.from_dataframe(points, angle_unit="rad"), robot)
    assert (notice.kind, notice.rows) == ("limits", tuple(range(8, 16)))


def test_limits_are_warned_of_with_rows() -> None:
    robot = Robot.load("rv-m2")
    q = readings(robot)
    q[[4, 9], 1] = np.radians([101.0, 105.0])
    q[11, 2] = np.radians(3.0)
    notices = check_against(Measurements.from_dataframe(table(robot, q)), robot)
    assert [(notice.kind, notice.rows) for notice in notices] == [("limits", (5, 10)), ("limits", (12,))]
    assert (
        notices[0].message
        == "Joint 2 is outside its limits (-30 to 100 deg) in rows 5 and 10, up to 105 deg."
    )


def test_identical_rows_are_warned_of_with_rows() -> None:
    robot = Robot.load("rv-m2")
    points = table(robot, readings(robot, 10))
    data = Measurements.from_dataframe(pd.concat([points, points.iloc[[2, 5]]]))
    (notice,) = check_against(data, robot)
    assert (notice.kind, notice.rows) == ("identical_rows", (11, 12))
    assert notice.message == "Identical to an earlier row in everything, counted once: rows 11 and 12."


MM_PER_INCH = 25.4
INCHES = ["abb-irb-120", "ur10", "kuka-iiwa-7", "adept-cobra-600"]


@pytest.mark.parametrize("name", INCHES)
@pytest.mark.parametrize(
    ("scale", "unit", "words"),
    [
        (1000.0 / MM_PER_INCH, "mm", "times 25.4 they fit it.*stated as millimetres.*multiply by 25.4"),
        (1000.0 / MM_PER_INCH, "m", "times 0.0254 they fit it.*stated as metres.*--length-unit mm"),
        (MM_PER_INCH, "m", "times 0.03937 they fit it.*as if they were inches.*divide by 25.4"),
    ],
)
def test_inches_are_recognised(name: str, scale: float, unit: LengthUnit, words: str) -> None:
    robot = Robot.load(name)
    data = Measurements.from_dataframe(table(robot, readings(robot), scale), length_unit=unit)
    with pytest.raises(InputError, match=words):
        check_against(data, robot)


@pytest.mark.parametrize("off_m", [0.0, 0.005])
def test_a_point_that_stands_nearly_still_is_not_in_inches(off_m: float) -> None:
    """The wrist turns about a point beside its middle, as where a tip is held to one place."""
    robot = Robot.load("abb-irb-120")
    q = readings(robot)
    q[:, :3] = q[0, :3]
    flange = robot.pose(q)
    wrist_in_flange = np.array([off_m, 0.0, -0.072])
    data = table(robot, q)
    points = flange[:, :3, 3] + flange[:, :3, :3] @ wrist_in_flange
    data[["x", "y", "z"]] = points + np.random.default_rng(0).normal(0.0, 1e-5, points.shape)
    assert np.ptp(flange[:, :3, 3], axis=0).max() > FAR_FACTOR * np.ptp(points, axis=0).max()
    assert check_against(Measurements.from_dataframe(data), robot) == []


def test_poses_in_a_small_box_are_not_in_inches() -> None:
    robot = Robot.load("ur10")
    q = readings(robot, 1) + np.random.default_rng(0).uniform(-0.02, 0.02, (40, 6))
    assert check_against(Measurements.from_dataframe(table(robot, q)), robot) == []


def test_all_poses_alike() -> None:
    robot = Robot.load("ur5")
    points = table(robot, np.tile(readings(robot, 1), (8, 1)))
    with pytest.raises(InputError, match="all 8 poses are alike.*Measure poses all over the workspace"):
        check_against(Measurements.from_dataframe(points), robot)
    points = table(robot, readings(robot, 8)).assign(x=1.0, y=2.0, z=3.0)
    with pytest.raises(InputError, match="all 8 measured positions are equal though the joints vary"):
        check_against(Measurements.from_dataframe(points), robot)


def test_another_arm() -> None:
    points = table(Robot.load("rv-m2"), readings(Robot.load("rv-m2")))
    with pytest.raises(InputError, match="there are 5 joint columns. The robot has 6 joints"):
        check_against(Measurements.from_dataframe(points), Robot.load("ur5"))


def test_kinds_of_joints() -> None:
    scara = Robot.load("adept-cobra-600")
    points = table(scara, readings(scara))
    in_mm = points.rename(columns={"q3": "q3_mm"}).assign(q3_mm=1000 * points["q3"])
    assert check_against(Measurements.from_dataframe(in_mm), scara) == []
    wrong = points.rename(columns={"q2": "q2_mm"})
    with pytest.raises(InputError, match="joint 2 is given in mm. Joint 2 of Adept Cobra 600 is revolute"):
        check_against(Measurements.from_dataframe(wrong), scara)


@given(seed=st.integers(0, 1000), reach=st.floats(0.0, 1.5), share=st.floats(0.02, 0.9))
def test_no_honest_tool_or_region_is_refused(seed: int, reach: float, share: float) -> None:
    """Long tools and small regions are no wrong units."""
    robot = Robot.load("abb-irb-120")
    q = readings(robot, 30, seed, share)
    points = robot.pose(q) @ np.array([reach, 0.0, 0.0, 1.0])
    data = table(robot, q).assign(x=points[:, 0], y=points[:, 1], z=points[:, 2])
    assert check_against(Measurements.from_dataframe(data), robot) == []


def test_one_gross_outlier_is_no_wrong_unit() -> None:
    robot = Robot.load("abb-irb-120")
    points = table(robot, readings(robot))
    points.loc[3, "x"] = 1e3
    assert check_against(Measurements.from_dataframe(points), robot) == []


def test_wrong_units_of_one_group_are_found() -> None:
    robot = Robot.load("ur5")
    good = Measurements.from_dataframe(table(robot, readings(robot)), name="good")
    bad = Measurements.from_dataframe(table(robot, readings(robot, seed=1), 1000.0), name="bad")
    with pytest.raises(InputError, match="bad, group bad: .*--length-unit mm"):
        check_against(Measurements.concatenate([good, bad]), robot)


def test_distances_alone_may_be_of_any_plausible_size() -> None:
    robot = Robot.load("ur5")
    q = readings(robot)
    data = table(robot, q).drop(columns=["x", "y", "z"]).assign(distance=1.0, anchor="bar")
    assert check_against(Measurements.from_dataframe(data), robot) == []


def test_poses_pass() -> None:
    robot = Robot.load("ur5")
    q = readings(robot)
    quaternions = quaternion_from_matrix(robot.pose(q)[:, :3, :3])
    data = table(robot, q).assign(**{f"q{axis}": quaternions[:, k] for k, axis in enumerate("wxyz")})
    assert check_against(Measurements.from_dataframe(data), robot) == []


@pytest.mark.parametrize(
    ("file", "robot"),
    [
        ("ur10_ipa_A", "ur10"),
        ("ur10_ipa_B", "ur10"),
        ("ur10_ipa_C", "ur10"),
        ("irb120_faro", "abb-irb-120"),
        ("ur5_gtpn", "ur5"),
    ],
)
def test_public_data_is_plausible_and_is_not_in_other_units(shared_data: Path, file: str, robot: str) -> None:
    arm, path = Robot.load(robot), shared_data / f"{file}.csv"
    assert check_against(Measurements.read_csv(path), arm) == []
    with pytest.raises(InputError, match="too close together"):
        check_against(Measurements.read_csv(path, length_unit="mm"), arm)
    with pytest.raises(InputError, match="look like radians"):
        check_against(Measurements.read_csv(path, angle_unit="deg"), arm)


@pytest.mark.parametrize(
    ("size", "unit", "words"),
    [
        (1.0, "m", None),
        (1000.0, "mm", None),
        (1000.0, "m", "name the column distance_mm"),
        (1.0, "mm", "short"),
    ],
)
def test_distances_are_compared_with_the_arm(size: float, unit: str, words: str | None) -> None:
    robot = Robot.load("ur10")
    q = readings(robot)
    near = np.linalg.norm(robot.position(q) + WORLD / 4.0, axis=1)
    named = {"distance": size * near, "anchor": "bar"}
    data = Measurements.from_dataframe(
        table(robot, q).drop(columns=["x", "y", "z"]).assign(**named), length_unit=unit
    )
    if words is None:
        assert check_against(data, robot) == []
        return
    with pytest.raises(InputError, match=words):
        check_against(data, robot)


def test_metres_of_a_slide_that_are_named_mm_are_refused() -> None:
    robot = Robot.load("adept-cobra-600")
    slide = list(robot.joints).index("prismatic")
    q = readings(robot)
    right = table(robot, q)
    for unit, factor, words in (("mm", 1.0, "times 1000 they fit"), ("m", 1e3, "beyond what .* can reach")):
        named = right.rename(columns={f"q{slide + 1}": f"q{slide + 1}_{unit}"})
        named[f"q{slide + 1}_{unit}"] *= factor
        with pytest.raises(InputError, match=words):
            check_against(Measurements.from_dataframe(named), robot)


def test_a_slide_that_hardly_moved_is_let_be() -> None:
    robot = Robot.load("adept-cobra-600")
    slide = list(robot.joints).index("prismatic")
    q = readings(robot)
    low, high = robot.limits[slide]
    q[:, slide] = np.clip(0.0, low, high) + 1e-3 * (q[:, slide] - q[:, slide].min())
    check_against(Measurements.from_dataframe(table(robot, q)), robot)


@pytest.mark.parametrize(("apart", "told"), [(0.09, True), (0.0005, False)])
def test_points_that_lie_apart_at_equal_readings_are_told(apart: float, told: bool) -> None:
    robot = Robot.load("ur10")
    q = np.repeat(readings(robot, 20), 2, axis=0)
    rows = table(robot, q)
    rows.loc[1::2, "x"] += apart
    notices = check_against(Measurements.from_dataframe(rows), robot)
    found = [notice.message for notice in notices if notice.kind == "apart_at_equal_readings"]
    assert bool(found) == told
    assert all("rows 1 and 2" in words and "--map target=COLUMN" in words for words in found)


def elbow_below(count: int = 40) -> tuple[Robot, Floats]:
    """Readings of an arm whose joint 3 turns from -110 to 70 deg, far from zero in all rows, as joint 4."""
    robot = Robot.load("abb-irb-120")
    q = readings(robot, count)
    q[:, 2] = np.radians(-92.0) + 0.1 * q[:, 2]
    q[:, 3] = np.radians(92.0) + 0.3 * q[:, 3]
    return robot, q


def stated(robot: Robot, true: Floats, read: Floats) -> Measurements:
    """Points of the true readings beside those of the file, in no unit."""
    columns = {f"q{k + 1}": read[:, k] for k in range(robot.joint_count)}
    return Measurements.from_dataframe(table(robot, true).assign(**columns))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda q: q * [1, 1, -1, 1, 1, 1], "with joint 3 the other way round"),
        (lambda q: q[:, [0, 1, 3, 2, 4, 5]], "joints 3 and 4 exchanged"),
    ],
)
def test_joints_the_other_way_or_exchanged_are_no_degrees(change, words) -> None:
    """Points deny degrees: the readings stand, with a warning, and the calibration tells what fits."""
    robot, q = elbow_below()
    notices = check_against(stated(robot, q, change(q)), robot)
    assert {notice.kind for notice in notices} == {"limits"}
    assert words in str(notices[0])
    assert "all readings are within the limits" in str(notices[0])


def test_too_few_points_deny_no_degrees() -> None:
    robot, q = elbow_below(10)
    read = q * [1, 1, -1, 1, 1, 1]
    largest = np.abs(read[:, 2]).max()
    assert np.abs(read).max() > largest, "another joint reads more, within its limits"
    with pytest.raises(InputError) as caught:
        check_against(stated(robot, q, read), robot)
    assert f"readings of joint 3 up to {largest:.4g} rad, whose limits are -1.92 to 1.222 rad" in str(
        caught.value
    )
    assert "--angle-unit deg" in str(caught.value)
    assert "with joint 3 the other way round all readings are within the limits" in str(caught.value)


def test_degrees_of_joints_the_other_way_stay_an_error() -> None:
    robot, q = elbow_below()
    q = np.radians(11.0) * q / np.abs(q).max()
    with pytest.raises(InputError, match="give --angle-unit deg"):
        check_against(stated(robot, q, np.degrees(q * [1, -1, -1, 1, 1, 1])), robot)


def unlimited(robot: Robot) -> Robot:
    return replace(robot, limits=np.full(robot.limits.shape, np.inf) * [-1.0, 1.0])


def about(robot: Robot, span: float) -> Floats:
    middle = np.array([0.3, -1.2, 1.5, -1.8, -1.5, 0.2])
    return middle + np.random.default_rng(1).uniform(-span, span, (40, robot.joint_count))


@pytest.mark.parametrize("span", [0.05, 0.3, 1.0])
@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (180.0 / np.pi, "degrees that are read as radians"),
        (np.pi / 180.0, "radians that were taken for degrees"),
    ],
)
def test_points_tell_degrees_where_limits_do_not(span: float, factor: float, words: str) -> None:
    robot = unlimited(Robot.load("ur10"))
    data = table(robot, about(robot, span))
    assert check_against(Measurements.from_dataframe(data), robot) == []
    data.iloc[:, : robot.joint_count] *= factor
    with pytest.raises(InputError, match=words):
        check_against(Measurements.from_dataframe(data), robot)


def test_points_tell_metres_read_as_millimetres_where_they_lie_close_together() -> None:
    robot = Robot.load("ur10")
    data = table(robot, about(robot, 0.05))
    with pytest.raises(InputError, match="too close together.*--length-unit m"):
        check_against(Measurements.from_dataframe(data, length_unit="mm"), robot)


def test_one_reading_beyond_all_limits_makes_no_degrees_of_the_others() -> None:
    robot = Robot.load("ur10")
    q = readings(robot)
    q[7, 0] = 20.0
    notices = check_against(Measurements.from_dataframe(table(robot, q)), robot)
    assert [(notice.kind, notice.rows) for notice in notices] == [("limits", (8,))]


@pytest.mark.parametrize("value", [9999.0, -99999.0, 1e15, 1e300])
@pytest.mark.parametrize("columns", [["x"], ["x", "y", "z"]])
def test_numbers_that_stand_for_nothing_seen_are_named(value: float, columns: list[str]) -> None:
    robot = Robot.load("ur10")
    data = table(robot, readings(robot))
    data.loc[[4, 9], columns] = value
    with pytest.raises(InputError, match=r"in rows 5 and 10, .*Leave the cells empty"):
        check_against(Measurements.from_dataframe(data), robot)


def test_a_reading_that_no_joint_can_have() -> None:
    robot = Robot.load("ur10")
    rows = table(robot, readings(robot))
    rows.loc[3, "q2"] = 1e308
    with pytest.raises(InputError, match=r"joint 2 reads up to 1e\+308 rad in row 4"):
        check_against(Measurements.from_dataframe(rows), robot)


def test_half_a_pair_is_refused() -> None:
    robot = Robot.load("ur10")
    q = readings(robot)
    frame = pd.DataFrame({f"q{k + 1}": q[:, k] for k in range(6)})
    pair = np.arange(len(q)) // 2
    data = Measurements.from_dataframe(frame.assign(pair=pair.astype(str), distance=0.5 + 0.01 * pair))
    whole = data[: len(q) - 2]
    assert check_against(whole, robot) == []
    with pytest.raises(InputError, match=r"the other row of the pair is not there in rows 1 and 6\."):
        check_against(whole[[k not in (1, 4) for k in range(len(whole))]], robot)
