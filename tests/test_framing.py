"""Tools and work objects taught again: known ones come back, within what is said of them."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import f as f_distribution

import truearm as ta
from truearm.errors import InputError, UsageError, WorkError
from truearm.exporting import constant_robot
from truearm.framing import find_object, find_tool
from truearm.inverse import Inverse
from truearm.measurements import Measurements
from truearm.rotations import quaternion_from_matrix
from truearm.simulation import VirtualArm

TIP_NOISE_M = 5e-5
TOOL = np.eye(4)
TOOL[:3, :3] = Rotation.from_euler("ZYX", [30.0, 20.0, -10.0], degrees=True).as_matrix()
TOOL[:3, 3] = [0.02, -0.05, 0.18]
OBJECT = np.eye(4)
OBJECT[:3, :3] = Rotation.from_euler("ZYX", [80.0, 2.0, 1.0], degrees=True).as_matrix()
OBJECT[:3, 3] = [0.55, 0.25, 0.1]
PLACES = np.array(
    [[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0], [0.3, 0.2, 0.05], [0.15, 0.1, 0.02], [0.1, 0.2, 0.03]], dtype=float
)


@pytest.fixture(scope="module")
def arm():
    return VirtualArm(ta.Robot.load("ur10"), seed=4)


@pytest.fixture(scope="module")
def calibration(arm):
    return ta.calibrate(arm.robot, arm.measure(arm.poses(120)))


@pytest.fixture(scope="module")
def exact(calibration):
    """The arm that the calibration's constant part describes: what it does is known exactly."""
    models = {name: model for name, model in calibration.models.items() if name != "variable"}
    model = replace(calibration, variable=None, models=models)
    return model, constant_robot(calibration)


def tilted(rng, count, angle_deg=40.0):
    """Orientations of the flange around one that looks down, tilted about all axes."""
    down = Rotation.from_euler("x", 180.0, degrees=True)
    return (Rotation.from_rotvec(rng.uniform(-1, 1, (count, 3)) * np.radians(angle_deg)) * down).as_matrix()


def readings_at(robot, points, turns, tool=TOOL):
    """Readings at which the tool's tip is at points of the base frame and the flange is turned so."""
    poses = np.tile(np.eye(4), (len(points), 1, 1))
    poses[:, :3, :3] = turns
    poses[:, :3, 3] = points - turns @ tool[:3, 3]
    return Inverse(robot).near(poses, np.radians([0.0, -90.0, 90.0, -90.0, -90.0, 0.0]))


def at_touch(arm, points, turns, tool=TOOL):
    """Readings at which the real tip is at points: where the nominal arm misses is stepped towards."""
    aimed = points.copy()
    for _ in range(6):
        q = readings_at(arm.robot, aimed, turns, tool)
        aimed += points - arm.true_pose(q, tool=tool)[:, :3, 3]
    return q


def readings(q, **columns):
    table = pd.DataFrame({f"q{j + 1}_rad": q[:, j] for j in range(q.shape[1])})
    return table.assign(**columns)


def as_data(table, path):
    table.to_csv(path, index=False)
    return Measurements.read_touches(path)


def touched(robot, seed, tmp_path, count=8, noise=TIP_NOISE_M):
    rng = np.random.default_rng(seed)
    points = np.tile([0.6, 0.1, 0.2], (count, 1)) + rng.normal(scale=noise, size=(count, 3))
    return as_data(readings(readings_at(robot, points, tilted(rng, count))), tmp_path / "touches.csv")


def scaled_square(error, covariance):
    return float(error @ np.linalg.solve(covariance, error)) / len(error)


def test_a_touched_tool_is_within_its_covariance(exact, tmp_path):
    model, robot = exact
    squares, freedoms = [], set()
    for seed in range(40):
        found = find_tool(model, touched(robot, seed, tmp_path), orientation=TOOL[:3, :3])
        squares.append(scaled_square(found.transform[:3, 3] - TOOL[:3, 3], found.covariance[:3, :3]))
        freedoms.add(found.freedom)
        assert np.array_equal(found.transform[:3, :3], TOOL[:3, :3])
    assert freedoms == {18}
    law = f_distribution(3, 18)
    assert max(squares) < law.ppf(1.0 - 1e-4)
    assert law.ppf(1e-3) < np.median(squares) < 2.0 * law.median()


def test_an_object_is_within_its_covariance_which_holds_the_tools(exact, tmp_path):
    model, robot = exact
    tip = np.diag([1e-4, 2e-4, 1e-4]) ** 2
    squares = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        wrong = TOOL.copy()
        wrong[:3, 3] += rng.multivariate_normal(np.zeros(3), tip)
        points = PLACES @ OBJECT[:3, :3].T + OBJECT[:3, 3] + rng.normal(scale=TIP_NOISE_M, size=(6, 3))
        q = readings_at(robot, points, tilted(rng, 6, 15.0))
        data = as_data(
            readings(q, **dict(zip(["x_m", "y_m", "z_m"], PLACES.T, strict=True))), tmp_path / "o.csv"
        )
        found = find_object(model, data, wrong, tip)
        turn = Rotation.from_matrix(found.transform[:3, :3] @ OBJECT[:3, :3].T).as_rotvec()
        error = np.concatenate([found.transform[:3, 3] - OBJECT[:3, 3], turn])
        squares.append(scaled_square(error, found.covariance))
    law = f_distribution(6, 12)
    assert max(squares) < law.ppf(1.0 - 1e-4)
    assert law.ppf(1e-2) < np.median(squares) < 2.0 * law.median()


def test_measured_poses_give_tool_and_orientation_within_their_covariance(exact, tmp_path):
    model, robot = exact
    world = np.eye(4)
    world[:3, :3] = Rotation.from_euler("ZYX", [100.0, 5.0, -3.0], degrees=True).as_matrix()
    world[:3, 3] = [2.0, -1.0, 0.5]
    squares = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        q = np.radians([0.0, -90.0, 90.0, -90.0, -90.0, 0.0]) + rng.uniform(-0.6, 0.6, (20, 6))
        poses = world @ robot.pose(q) @ TOOL
        noise = Rotation.from_rotvec(rng.normal(scale=2e-4, size=(20, 3))).as_matrix()
        quaternions = quaternion_from_matrix(noise @ poses[:, :3, :3])
        xyz = poses[:, :3, 3] + rng.normal(scale=TIP_NOISE_M, size=(20, 3))
        columns = dict(zip(["x_m", "y_m", "z_m"], xyz.T, strict=True))
        columns |= dict(zip(["qw", "qx", "qy", "qz"], quaternions.T, strict=True))
        found = find_tool(model, as_data(readings(q, **columns), tmp_path / "poses.csv"))
        turn = Rotation.from_matrix(found.transform[:3, :3] @ TOOL[:3, :3].T).as_rotvec()
        error = np.concatenate([found.transform[:3, 3] - TOOL[:3, 3], turn])
        squares.append(scaled_square(error, found.covariance))
    assert max(squares) < f_distribution(6, 100).ppf(1.0 - 1e-4)
    assert 0.4 < np.median(squares) < 2.0


def test_measured_points_give_the_tip(exact, tmp_path):
    model, robot = exact
    rng = np.random.default_rng(0)
    q = np.radians([0.0, -90.0, 90.0, -90.0, -90.0, 0.0]) + rng.uniform(-0.6, 0.6, (20, 6))
    columns = dict(zip(["x_m", "y_m", "z_m"], (robot.pose(q) @ TOOL)[:, :3, 3].T, strict=True))
    data = as_data(readings(q, **columns), tmp_path / "points.csv")
    found = find_tool(model, data, orientation=TOOL[:3, :3])
    assert np.abs(found.transform - TOOL).max() < 1e-9
    assert not found.covariance[3:].any()
    with pytest.raises(WorkError, match="only points of the tool were measured.*orientation=np.eye"):
        find_tool(model, data)


def poses_of(robot, q, path):
    """Poses of the tool at readings, measured by a device that stands where it stands."""
    world = np.eye(4)
    world[:3, :3], world[:3, 3] = OBJECT[:3, :3], [2.0, -1.0, 0.5]
    poses = world @ robot.pose(q) @ TOOL
    columns = dict(zip(["x_m", "y_m", "z_m"], poses[:, :3, 3].T, strict=True))
    columns |= dict(zip(["qw", "qx", "qy", "qz"], quaternion_from_matrix(poses[:, :3, :3]).T, strict=True))
    return as_data(readings(q, **columns), path)


def test_measured_poses_that_do_not_tell_the_tool_are_refused(exact, tmp_path):
    model, robot = exact
    middle = np.radians([17.0, -70.0, 80.0, -40.0, 60.0, 10.0])
    free = middle + np.random.default_rng(0).uniform(-0.6, 0.6, (3, 6))
    assert np.abs(find_tool(model, poses_of(robot, free, tmp_path / "3.csv")).transform - TOOL).max() < 1e-7
    with pytest.raises(WorkError, match="2 measured poses of the tool tell no more than is unknown"):
        find_tool(model, poses_of(robot, free[:2], tmp_path / "2.csv"))
    some = poses_of(robot, free, tmp_path / "some.csv")
    turns = np.where(np.arange(3)[:, None] == 0, some.orientations, np.nan)
    with pytest.raises(WorkError, match="3 measured poses of the tool tell no more than is unknown"):
        find_tool(model, replace(some, orientations=turns))
    parallel = np.tile(middle, (8, 1))
    parallel[:, 1:3] += np.linspace([-0.6, 0.4], [0.6, -0.4], 8) ** [1, 3]
    with pytest.raises(WorkError, match="measured poses hardly turn the flange's direction"):
        find_tool(model, poses_of(robot, parallel, tmp_path / "plane.csv"))
    points = replace(poses_of(robot, parallel, tmp_path / "points.csv"), orientations=None)
    with pytest.raises(WorkError, match="measured points hardly turn the flange's direction"):
        find_tool(model, points, orientation=np.eye(3))


def test_through_the_calibrated_arm_the_real_tool_is_found_better(arm, calibration, tmp_path):
    rng = np.random.default_rng(1)
    points = np.tile([0.6, 0.1, 0.2], (12, 1)) + rng.normal(scale=TIP_NOISE_M, size=(12, 3))
    q = at_touch(arm, points, tilted(rng, 12))
    data = as_data(readings(q), tmp_path / "touches.csv")
    found = find_tool(calibration, data, orientation=TOOL[:3, :3])
    nominal = replace(calibration, variable=None, models={"constant": calibration.models["nominal"]})
    believed = find_tool(nominal, data, orientation=TOOL[:3, :3])
    error, former = (np.linalg.norm(f.transform[:3, 3] - TOOL[:3, 3]) for f in (found, believed))
    assert error < 0.5 * former
    assert found.noise_m < 0.5 * believed.noise_m


def test_several_points_share_one_tool(exact, tmp_path):
    model, robot = exact
    rng = np.random.default_rng(2)
    where = np.repeat([[0.6, 0.1, 0.2], [0.5, -0.2, 0.3]], 5, axis=0)
    q = readings_at(robot, where, tilted(rng, 10))
    data = as_data(readings(q, group=["left"] * 5 + ["right"] * 5), tmp_path / "two.csv")
    found = find_tool(model, data, orientation=np.eye(3), points=data.group.tolist())
    assert np.abs(found.transform[:3, 3] - TOOL[:3, 3]).max() < 1e-9
    assert found.freedom == 30 - 9
    assert found.how == "10 touches of 2 points"


def test_a_row_that_lies_far_off_is_named(exact, tmp_path):
    model, robot = exact
    rng = np.random.default_rng(3)
    points = np.tile([0.6, 0.1, 0.2], (12, 1)) + rng.normal(scale=1e-5, size=(12, 3))
    points[6] += 2e-3
    data = as_data(readings(readings_at(robot, points, tilted(rng, 12))), tmp_path / "one_off.csv")
    found = find_tool(model, data, orientation=np.eye(3))
    assert [notice.rows for notice in found.notices] == [(7,)]


def test_touches_that_are_turned_about_one_axis_are_refused(exact, tmp_path):
    model, robot = exact
    rng = np.random.default_rng(4)
    spins = Rotation.from_euler("z", rng.uniform(-60, 60, (8, 1)), degrees=True)
    turns = (spins * Rotation.from_euler("x", 180.0, degrees=True)).as_matrix()
    q = readings_at(robot, np.tile([0.6, 0.1, 0.2], (8, 1)), turns)
    with pytest.raises(WorkError, match=r"direction \[-?0.00, -?0.00, 1.00\].*Tilt the tool"):
        find_tool(model, as_data(readings(q), tmp_path / "spun.csv"), orientation=np.eye(3))


def test_lists_of_measurements_are_put_together(exact, tmp_path):
    model, robot = exact
    data = touched(robot, 0, tmp_path, count=8)
    parts = [data.select(range(4)), data.select(range(4, 8))]
    whole, parted = (find_tool(model, given, orientation=TOOL[:3, :3]) for given in (data, parts))
    np.testing.assert_array_equal(parted.transform, whole.transform)
    for names in (["a"] * 7, ["a"] * 9, []):
        with pytest.raises(UsageError, match=f"points: {len(names)} names of points. There are 8 touches"):
            find_tool(model, data, orientation=np.eye(3), points=names)
    with pytest.raises(InputError, match="no place x, y, z of every touched point"):
        find_object(model, parts, TOOL)


def test_too_little_is_refused(exact, tmp_path):
    model, robot = exact
    data = touched(robot, 0, tmp_path, count=8)
    with pytest.raises(WorkError, match="at least 4 times"):
        find_tool(model, data.select(range(3)), orientation=np.eye(3))
    with pytest.raises(UsageError, match="do not tell how the tool is turned"):
        find_tool(model, data)
    with pytest.raises(InputError, match="no rotation matrix"):
        find_tool(model, data, orientation=np.ones((3, 3)))
    with pytest.raises(InputError, match="the orientation is no rotation matrix: R mirrors"):
        find_tool(model, data, orientation=-np.eye(3))
    with pytest.raises(InputError, match=r"the orientation has shape \(4, 4\)"):
        find_tool(model, data, orientation=np.eye(4))
    with pytest.raises(InputError, match="the entries of the orientation hold NaN"):
        find_tool(model, data, orientation=np.full((3, 3), np.nan))
    for names in (["a"] * 7, ["a"] * 9, []):
        with pytest.raises(UsageError, match=f"points: {len(names)} names of points. There are 8 touches"):
            find_tool(model, data, orientation=np.eye(3), points=names)
    with pytest.raises(InputError, match="no place x, y, z of every touched point"):
        find_object(model, data, TOOL)
    places = dict(zip(["x_m", "y_m", "z_m"], np.outer([1, 2, 3, 4, 5, 6, 7, 8], [0.1, 0, 0]).T, strict=True))
    line = as_data(readings(data.readings, **places), tmp_path / "line.csv")
    with pytest.raises(WorkError, match="the 8 points lie on a line"):
        find_object(model, line, TOOL)
    with pytest.raises(WorkError, match="2 points"):
        find_object(model, line.select(range(2)), TOOL)
    with pytest.raises(InputError, match="the entries of the covariance hold NaN"):
        find_object(model, line, TOOL, np.full((3, 3), np.nan))
    for wrong in (-np.eye(3), np.triu(np.ones((3, 3)))):
        with pytest.raises(InputError, match="the covariance is none. It is symmetric"):
            find_object(model, line, TOOL, wrong)


def placed(robot, tmp_path, places, stated, seed=5):
    """Touches of `places` on the object, with `stated` as what the file says of them, m."""
    points = places @ OBJECT[:3, :3].T + OBJECT[:3, 3]
    q = readings_at(robot, points, tilted(np.random.default_rng(seed), len(places), 15.0))
    return as_data(readings(q, **dict(zip(["x_m", "y_m", "z_m"], stated.T, strict=True))), tmp_path / "o.csv")


def test_one_row_far_off_among_few_is_the_one_that_is_named(exact, tmp_path):
    model, robot = exact
    rng = np.random.default_rng(6)
    points = np.tile([0.6, 0.1, 0.2], (5, 1)) + rng.normal(scale=2e-5, size=(5, 3))
    points[3] += [0.0, 4e-3, -3e-3]
    data = as_data(readings(readings_at(robot, points, tilted(rng, 5))), tmp_path / "few.csv")
    (notice,) = find_tool(model, data, orientation=np.eye(3)).notices
    assert notice.rows == (4,)
    assert "row 4 lies far off, 4.97 mm from where the other rows say" in notice.message
    stated = PLACES.copy()
    stated[1] += [5e-3, 0.0, 0.0]
    found = find_object(model, placed(robot, tmp_path, PLACES, stated), TOOL)
    assert [notice.rows for notice in found.notices] == [(2,)]


def test_of_two_rows_far_off_neither_hides_the_other(exact, tmp_path):
    model, robot = exact
    rng = np.random.default_rng(3)
    points = np.tile([0.6, 0.1, 0.2], (12, 1)) + rng.normal(scale=1e-5, size=(12, 3))
    points[[2, 6]] += [[6e-3, 0.0, 0.0], [0.0, 2e-3, 0.0]]
    data = as_data(readings(readings_at(robot, points, tilted(rng, 12))), tmp_path / "two_off.csv")
    found = find_tool(model, data, orientation=np.eye(3))
    assert [notice.rows for notice in found.notices] == [(3, 7)]


def test_rows_that_are_all_as_good_are_seldom_named(exact, tmp_path):
    model, robot = exact
    found = [find_tool(model, touched(robot, seed, tmp_path), orientation=np.eye(3)) for seed in range(40)]
    assert sum(bool(one.notices) for one in found) <= 1


def test_touches_that_contradict_each_other_give_nothing(exact, tmp_path):
    model, robot = exact
    data = touched(robot, 0, tmp_path)
    mixed = as_data(readings(data.readings[:, [1, 0, 2, 3, 4, 5]]), tmp_path / "mixed.csv")
    with pytest.raises(WorkError, match=r"disagree by \d+\.?\d* mm.*Check the units"):
        find_tool(model, mixed, orientation=np.eye(3))
    stated = PLACES.copy()
    stated[2] += [0.0, 0.1, 0.0]
    with pytest.raises(WorkError, match="Row 3 lies far off, 101 mm from where the other rows say"):
        find_object(model, placed(robot, tmp_path, PLACES, stated), TOOL)


def test_readings_in_degrees_are_not_taken_for_radians(exact, tmp_path):
    model, robot = exact
    data = touched(robot, 0, tmp_path)
    table = pd.DataFrame(np.degrees(data.readings), columns=[f"q{j}" for j in range(1, 7)])
    wrong = as_data(table, tmp_path / "degrees.csv")
    with pytest.raises(InputError, match="give --angle-unit deg"):
        find_tool(model, wrong, orientation=np.eye(3))


def test_places_in_another_unit_and_mirrored_ones_are_refused(exact, tmp_path):
    model, robot = exact
    for factor, option in ((1e3, "--length-unit mm"), (1e-3, "--length-unit m,")):
        with pytest.raises(InputError, match=option):
            find_object(model, placed(robot, tmp_path, PLACES, factor * PLACES), TOOL)
    with pytest.raises(InputError, match="that each row's place belongs"):
        find_object(model, placed(robot, tmp_path, PLACES, PLACES / 25.4), TOOL)
    with pytest.raises(WorkError, match="their mirror image to .*right-handed"):
        find_object(model, placed(robot, tmp_path, PLACES, PLACES * [1.0, -1.0, 1.0]), TOOL)
    flat = PLACES * [1.0, 1.0, 0.0]
    assert find_object(model, placed(robot, tmp_path, flat, flat), TOOL).distances_mm.max() < 1e-6


def test_points_of_one_plane_do_not_tell_a_mirror_image(exact, tmp_path):
    model, robot = exact
    flat = PLACES * [1.0, 1.0, 0.0]
    assert find_object(model, placed(robot, tmp_path, flat, flat), TOOL).notices == ()
    for mirror in ([1.0, -1.0, 1.0], [-1.0, 1.0, 1.0]):
        for count in (3, 6):
            touched_places = flat[:count]
            data = placed(robot, tmp_path, touched_places, touched_places * mirror)
            (notice,) = find_object(model, data, TOOL).notices
            assert "its z axis points away from where the tool came from" in notice.message
            assert notice.kind == "one_plane"
    (notice,) = find_object(model, placed(robot, tmp_path, flat, flat[:, [2, 0, 1]]), TOOL).notices
    assert "an object and its mirror image are alike: check the signs" in notice.message


def test_points_that_were_touched_once_are_told_of_the_column(exact, tmp_path):
    model, robot = exact
    data = touched(robot, 0, tmp_path, count=6)
    with pytest.raises(WorkError, match='in a column "group"'):
        find_tool(model, data, orientation=np.eye(3), points=["a"] * 5 + ["b"])
