"""What the robot file says of directions, zeros, coupling and the frame, where measurements say otherwise."""

import re
from dataclasses import replace

import numpy as np
import pytest

import truearm as ta
from tests.test_doubts import notice_of
from truearm.doubts.conventions import Convention, conventions_of
from truearm.doubts.nominal_misfit import NominalArm, Seen
from truearm.fits.parameters import ALPHA, A, D
from truearm.simulation import VirtualArm


def measured_otherwise(name, **otherwise):
    """An arm that is otherwise than its file says, and what is measured of it."""
    robot, convention = ta.Robot.load(name), Convention(**otherwise)
    arm = VirtualArm(convention.robot(robot), seed=4)
    table = arm.measure_table(arm.poses(36))
    data = ta.Measurements.from_dataframe(table, joints=robot.joints)
    seen = convention.measured(Seen.of(data, 0))
    return robot, replace(data, readings=seen.readings, targets=seen.points[:, None])


@pytest.mark.parametrize(
    ("name", "otherwise", "words"),
    [
        ("ur10", {"turned": (0,)}, "if joint 1 is counted the other way (direction = -1 in its link). Put"),
        ("kuka-kr-6-r900", {"turned": (0,)}, "joint 1 is counted the other way (direction = 1 in its link)"),
        ("ur10", {"turned": (2, 4)}, "joint 3 is counted the other way .*, and joint 5 is counted the other"),
        (
            "fanuc-lr-mate-200id",
            {"coupled": 0.0},
            r"joint 3 is counted against link 2 .* is [0, 0, 1, 0, 0, 0])",
        ),
        ("ur10", {"coupled": 1.0}, "joint 3 is counted against the horizontal .* is [0, 1, 1, 0, 0, 0])"),
    ],
)
def test_what_the_controller_counts_otherwise_is_named(name, otherwise, words):
    found = ta.calibrate(*measured_otherwise(name, **otherwise), model="constant", refit=False)
    checks = notice_of(found, "no_help")
    assert "direction = -1" in checks
    assert "[coupling]" in checks
    said = notice_of(found, "fits_otherwise")
    assert re.search(re.escape(words).replace(r"\.\*", ".*"), said), said


@pytest.fixture(scope="module")
def few_joints(tmp_path_factory):
    """An arm of few joints, of which all conventions are soon tried."""
    links = [
        ("revolute", 0.4, 0.1, -90, 170),
        ("prismatic", 0.3, 0, 90, 0.8),
        ("revolute", 0.2, 0.3, -90, 170),
        ("revolute", 0.1, 0.2, 90, 170),
    ]
    rows = [
        f'[[link]]\njoint = "{joint}"\nd = {d}\na = {a}\nalpha = {alpha}\nlimits = [{-limit}, {limit}]\n'
        for joint, d, a, alpha, limit in links
    ]
    head = 'name = "four"\nconvention = "standard"\nlength_unit = "m"\nangle_unit = "deg"\n'
    file = tmp_path_factory.mktemp("arm") / "four.toml"
    file.write_text(head + "".join(rows))
    return VirtualArm(ta.Robot.load(file), seed=4)


def told_of(arm, table):
    """What is said of a calibration from a table."""
    data = ta.Measurements.from_dataframe(table, joints=arm.robot.joints)
    return ta.calibrate(arm.robot, data, model="constant", refit=False)


@pytest.mark.parametrize(
    ("column", "factor", "words"),
    [
        ("z", 1e-3, "if the z coordinate is 1000 times what was read (metres taken for mm)"),
        ("y", 1.0 / 25.4, "if the y coordinate is 25.4 times what was read (inches taken for mm)"),
        ("q3", np.pi / 180.0, "joint 3 is 57.3 times what was read (radians taken for degrees)"),
    ],
)
def test_a_column_in_another_unit_is_named(few_joints, column, factor, words):
    table = few_joints.measure_table(few_joints.poses(36))
    table[column] *= factor
    found = told_of(few_joints, table)
    said = notice_of(found, "fits_otherwise")
    assert words in said
    assert "They fit as well" not in said
    assert notice_of(found, "far_from_nominal") == ""


@pytest.mark.parametrize(("rows", "words"), [(slice(30, 50), "from row 31 on"), (slice(25), "up to row 25")])
def test_a_joint_that_changes_its_sign_is_named_with_the_row(few_joints, rows, words):
    table = few_joints.measure_table(few_joints.poses(50))
    table.loc[table.index[rows], "q3"] *= -1.0
    said = notice_of(told_of(few_joints, table), "fits_otherwise")
    assert f"if joint 3 is counted the other way {words}" in said, said


@pytest.mark.parametrize("turned", [slice(22), slice(22, 50)])
def test_a_joint_with_another_sign_in_one_set_up_is_named_with_it(few_joints, turned):
    table = few_joints.measure_table(few_joints.poses(50)).assign(group=["a"] * 22 + ["b"] * 28)
    table.loc[table.index[turned], "q3"] *= -1.0
    said, group = notice_of(told_of(few_joints, table), "fits_otherwise"), table["group"][turned].iloc[0]
    assert f"The measurements of {group} fit" in said
    assert f"if joint 3 is counted the other way in all rows of {group}. Give all" in said


def named_otherwise(name, **otherwise):
    robot, data = measured_otherwise(name, **otherwise)
    return notice_of(ta.calibrate(robot, data, model="constant", refit=False), "fits_otherwise")


@pytest.mark.parametrize(
    ("name", "zeros", "words"),
    [
        ("ur10", ((1, -1), (2, 1), (3, 2)), ["2 is elsewhere (theta = -90", "3 is", "4 is"]),
        ("kuka-iiwa-7", ((2, -1),), ["3 is elsewhere (theta = -90 deg in its link, and not 0)"]),
        ("franka-panda", ((5, 2),), ["6 is elsewhere (theta = 180 deg in its link, and not 0)"]),
    ],
)  # fmt: skip
def test_zeros_that_are_elsewhere_are_named(name, zeros, words):
    """Whether the calibration does not help, or found angles that no arm has."""
    told = named_otherwise(name, zeros=zeros).partition(" They fit as well if ")[0]
    assert told.count("the zero of joint") == len(words)
    assert all(f"the zero of joint {part}" in told for part in words)
    assert "counted the other way" not in told


@pytest.mark.parametrize(
    ("name", "otherwise", "words"),
    [
        ("ur10", {"other_rows": True}, 'its rows are of the other convention (convention = "modified"). Put'),
        ("franka-panda", {"other_rows": True}, 'the other convention (convention = "standard"). Put'),
        ("ur10", {"signs": ((1, A),)}, "a of link 2 has the other sign (a = 612 mm, and not -612 mm). Put"),
        (
            "abb-irb-120",
            {"signs": ((3, D),)},
            "d of link 4 has the other sign (d = -302 mm, and not 302",
        ),
        ("abb-irb-120", {"signs": ((2, ALPHA),)}, "alpha of link 3 has the other sign (alpha = 90 deg, and"),
        ("kuka-iiwa-7", {"signs": ((2, D), (4, D))}, "d of link 3 has the other sign (d = -400 mm, and not"),
        ("abb-irb-120", {"exchanged": (3, 4)}, "if the columns of joints 4 and 5 are exchanged. Put"),
    ],
)
def test_what_is_written_otherwise_in_rows_and_columns_is_named(name, otherwise, words):
    told = named_otherwise(name, **otherwise)
    assert words in told
    assert "link 7 has the other sign" not in told, "the target takes that over"


@pytest.mark.parametrize("name", ["ur10", "abb-irb-120"])
def test_a_zero_and_a_direction_that_nobody_can_tell_apart_are_both_named(name):
    told, _, others = named_otherwise(name, zeros=((1, 2),)).partition(" They fit as well if ")
    assert "if joint 1 is counted the other way" in told
    assert "the zero of joint 2 is elsewhere" in others
    assert "where it is at zero" in others


def test_a_zero_and_a_direction_are_named_together():
    told = named_otherwise("ur10", turned=(2,), zeros=((1, -1),)).partition(" They fit as well if ")[0]
    assert "joint 3 is counted the other way" in told
    assert "the zero of joint 2 is elsewhere (theta = -90 deg" in told


@pytest.mark.parametrize(
    ("name", "turned"),
    [
        ("ur10", (3, 5)),
        ("ur10", (0, 1, 3, 5)),
        ("abb-irb-120", (1, 3, 4)),
        ("abb-irb-120", (0, 1, 3, 5)),
    ],
)
def test_joints_counted_otherwise_are_not_put_down_to_a_left_handed_frame(name, turned):
    told, _, others = named_otherwise(name, turned=turned).partition(" They fit as well if ")
    named = [int(joint) - 1 for joint in re.findall(r"joint (\d) is counted the other way", told)]
    assert named == list(turned)
    assert "left-handed" not in told
    assert ("left-handed" in others) == (name != "ur10")


def test_of_joints_that_fit_as_well_the_fewest_are_named():
    told, _, others = named_otherwise("kuka-iiwa-7", turned=(1, 3, 4)).partition(" They fit as well if ")
    assert 1 <= told.count("counted the other way") <= 3
    assert "left-handed" not in told
    assert re.search(r"or in \d+ other ways: measurements alone do not tell which is true", others)


@pytest.mark.parametrize(
    ("name", "mirror_image"),
    [("ur10", []), ("abb-irb-120", ["1", "4", "6"])],
)
def test_a_left_handed_frame_is_told_with_the_joints_that_look_like_it(name, mirror_image):
    told, _, others = named_otherwise(name, mirrored=True).partition(" They fit as well if ")
    assert "if the device's frame is left-handed (one axis reversed, or two exchanged). Put" in told
    assert re.findall(r"joint (\d) is counted the other way", others) == mirror_image
    assert ("measurements alone do not tell" in others) == bool(mirror_image)


def test_nothing_is_named_where_no_convention_fits():
    robot, data = measured_otherwise("ur10")
    assert not notice_of(ta.calibrate(robot, data, model="constant", refit=False), "fits_otherwise")
    points = np.random.default_rng(0).permutation(len(data))
    mixed = replace(data, targets=data.targets[points])
    found = ta.calibrate(robot, mixed, model="constant", refit=False)
    assert notice_of(found, "no_help")
    assert not notice_of(found, "fits_otherwise")


def test_of_many_joints_few_zeros_and_directions_are_tried_together():
    """An arm of ten joints would have a quarter of a million ways otherwise."""
    robot = ta.Robot.load("kuka-iiwa-7")
    longer = replace(
        robot,
        joints=robot.joints + robot.joints[:3],
        table=np.concatenate([robot.table, robot.table[:3]]),
        coupling=np.eye(10),
        limits=np.concatenate([robot.limits, robot.limits[:3]]),
    )
    tried = list(conventions_of(longer))
    assert max(one.changes for one in tried if not one.mirrored) <= 5
    assert max(len(one.zeros) for one in tried) == 3
    assert len(tried) == len(set(tried)) < 30_000


def test_points_that_nobody_trusts_pull_no_frame():
    arm = VirtualArm(ta.Robot.load("ur10"), seed=4)
    table = arm.measure_table(arm.poses(40)).assign(sigma_mm=0.05)
    table.loc[:5, ["x", "y", "z"]] += 1.0
    told = table.assign(sigma_mm=np.where(np.arange(40) < 6, 1000.0, 0.05))
    trusted, doubted = (Seen.of(ta.Measurements.from_dataframe(each), 0) for each in (table, told))
    nominal = NominalArm.of(arm.robot)
    assert nominal.misfit_m(doubted) < 0.003
    assert nominal.misfit_m(trusted) > 0.05
