"""Spaces lead to poses and back, and rules say which of them can be measured."""

from typing import Any, cast

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from truearm.description.library import library_names
from truearm.errors import InputError, UsageError, WorkError
from truearm.planning import positioning
from truearm.planning.accessibility import (
    AboveFloor,
    InBox,
    InCone,
    InSphere,
    JointLimits,
    KeepOut,
    LeastContactAngle,
    Places,
    Rule,
    accessible,
    either,
    lowest,
    standing_links,
)
from truearm.planning.configurations import Configuration
from truearm.planning.joint_ways import JointWays
from truearm.planning.pool import PoolOptions, draw_pool, needed_pool
from truearm.planning.spaces import CartesianSpace, JointSpace, SphericalSpace
from truearm.robot import Robot
from truearm.types import Floats

RV_M2 = Robot.load("rv-m2")
SHOULDER = (0.0, -0.08, 0.4)
PAPER_LOW, PAPER_HIGH = np.array([0.5, *np.deg2rad([-150, -45])]), np.array([0.805, *np.deg2rad([150, 45])])


def spherical(**more):
    return SphericalSpace(RV_M2, PAPER_LOW, PAPER_HIGH, SHOULDER, **more)


@pytest.mark.parametrize(
    "space",
    [
        JointSpace(RV_M2),
        CartesianSpace(RV_M2, np.array([-0.5, 0.2, 0.1]), np.array([0.5, 0.6, 0.9])),
        spherical(),
    ],
    ids=lambda space: type(space).__name__,
)
def test_coordinates_to_readings_and_back(space):
    drawn = np.random.default_rng(1).uniform(space.low, space.high, (400, 3))
    readings, reached = space.readings(drawn)
    assert reached.mean() > 0.4
    np.testing.assert_allclose(space.coordinates(readings[reached]), drawn[reached], atol=1e-8)
    assert np.isnan(readings[~reached]).all()
    low, high = RV_M2.limits.T
    assert np.all((readings[reached] >= low) & (readings[reached] <= high))


def test_spherical_coordinates_are_those_of_figure_4c():
    space = SphericalSpace(RV_M2, PAPER_LOW, PAPER_HIGH, (0.0, 0.0, 0.0))
    x, y, z = RV_M2.position([[0.4, 0.3, -0.2, 0, 0]])[0]
    radius, theta, phi = space.coordinates(np.array([[0.4, 0.3, -0.2, 0, 0]]))[0]
    assert radius * np.cos(phi) * np.sin(theta) == pytest.approx(x)
    assert radius * np.cos(phi) * np.cos(theta) == pytest.approx(y)
    assert radius * np.sin(phi) == pytest.approx(z)


def test_what_is_out_of_reach_is_said_to_be():
    space = CartesianSpace(RV_M2, np.zeros(3), np.full(3, 2.0))
    readings, reached = space.readings(np.array([[0.1, 0.6, 0.5], [1.5, 1.5, 1.5]]))
    assert reached.tolist() == [True, False]
    assert np.isnan(readings[1]).all()


@pytest.mark.parametrize(
    ("arm", "elbow"), [("front", "up"), ("front", "down"), ("back", "up"), ("back", "down")]
)
def test_a_configuration_is_kept(arm, elbow):
    robot, wanted = Robot.load("puma-560"), Configuration(arm=arm, elbow=elbow)
    held = np.zeros(6)
    others = [
        Configuration(arm=a, elbow=e)
        for a in ("front", "back")
        for e in ("up", "down")
        if (a, e) != (arm, elbow)
    ]
    space = CartesianSpace(
        robot, np.array([-0.4, -0.4, 0.2]), np.array([0.4, 0.4, 0.9]), configuration=wanted, held=held
    )
    drawn = np.random.default_rng(2).uniform(space.low, space.high, (200, 3))
    readings, reached = space.readings(drawn)
    assert reached.sum() > 20
    np.testing.assert_allclose(robot.position(readings[reached]), drawn[reached], atol=1e-8)
    assert wanted.holds(robot, readings[reached]).all()
    assert not any(other.holds(robot, readings[reached]).any() for other in others)


def test_a_configuration_that_held_joints_rule_out_is_refused():
    robot, corners = Robot.load("ur10"), (np.array([0.4, -0.3, 0.2]), np.array([0.8, 0.3, 0.6]))
    held = np.array([0.0, 0.0, 0.0, 0.0, -0.5, 0.0])
    flipped = CartesianSpace(robot, *corners, configuration=Configuration(wrist="flip"), held=held)
    assert len(draw_pool(flipped, 5)) == 5
    with pytest.raises(UsageError, match="joints 1, 2 and 3 have wrist noflip.*held = "):
        draw_pool(CartesianSpace(robot, *corners, configuration=Configuration(wrist="noflip"), held=held), 5)


def test_two_known_poses_are_enough_to_start_from(monkeypatch):
    monkeypatch.setattr(positioning, "STARTS", 2)
    space = CartesianSpace(RV_M2, np.array([0.2, 0.2, 0.2]), np.array([0.4, 0.4, 0.4]))
    assert space.readings(space.low[None])[0].shape == (1, 5)


def test_unknown_branch_is_refused():
    with pytest.raises(UsageError, match="front or back"):
        Configuration(arm="left")  # type: ignore[arg-type]


def test_a_floor_holds_for_all_parts_that_move():
    low, high = RV_M2.limits.T
    readings = np.random.default_rng(3).uniform(low, high, (400, RV_M2.joint_count))
    tools = RV_M2.position(readings)[:, 2]
    height = float(np.quantile(tools, 0.25))
    allowed = accessible(RV_M2, readings, [AboveFloor(height)])
    assert 0 < np.count_nonzero(allowed) < np.count_nonzero(tools >= height)
    assert (tools[allowed] >= height).all()
    assert lowest(RV_M2, readings[allowed], tool=RV_M2.tool) >= height
    assert all(lowest(RV_M2, each[None], tool=RV_M2.tool) < height for each in readings[~allowed])


@pytest.mark.parametrize("name", library_names())
def test_only_what_joints_lift_is_held_above_the_floor(name):
    robot = Robot.load(name)
    low, high = np.clip(robot.limits.T, -np.pi, np.pi)
    drawn = np.random.default_rng(5).uniform(low, high, (50, robot.joint_count))
    corners = Places(robot, drawn, robot.tool).corners[:, : standing_links(robot) + 1]
    np.testing.assert_allclose(np.ptp(corners[:, :, 2], axis=0), 0.0, atol=1e-9)


def test_a_carriage_stands_on_its_rail(tmp_path):
    links = "\n".join(
        f'[[link]]\njoint = "{joint}"\nd = {d}\na = {a}\nalpha = {alpha}\nlimits = [{low}, {high}]'
        for joint, d, a, alpha, low, high in [
            ("prismatic", 0.0, 0.0, 90.0, 0.0, 3.0),
            ("revolute", 0.4, 0.0, 90.0, -180.0, 180.0),
            ("revolute", 0.0, 0.5, 0.0, 10.0, 170.0),
        ]
    )
    head = 'name = "rail"\nconvention = "standard"\nlength_unit = "m"\nangle_unit = "deg"\n'
    head += "[base]\nalpha = -90.0\n"
    (tmp_path / "rail.toml").write_text(head + links + "\n")
    rail = Robot.load(tmp_path / "rail.toml")
    assert standing_links(rail) == 2
    readings = np.array([[1.0, 0.3, 1.0], [1.0, 0.3, 0.2], [2.5, -1.0, 0.2]])
    np.testing.assert_array_equal(accessible(rail, readings, [AboveFloor(0.6)]), [False, False, False])
    np.testing.assert_array_equal(accessible(rail, readings, [AboveFloor(0.3)]), [True, True, True])


def test_rules_of_the_volume():
    readings = np.zeros((3, 5))
    readings[:, 0] = [0.0, 1.0, 2.0]
    points = RV_M2.position(readings)
    assert accessible(RV_M2, readings, [InBox(points[0] - 0.01, points[0] + 0.01)]).tolist() == [
        True,
        False,
        False,
    ]
    assert accessible(RV_M2, readings, [InSphere(points[1], 0.01)]).tolist() == [False, True, False]
    assert accessible(RV_M2, readings, [InSphere(points[1], 9.0, 0.01)]).tolist() == [True, False, True]
    apex = np.array([0.0, 3.0, 0.4])
    sees = InCone(apex, points[0] - apex, 0.05)
    assert accessible(RV_M2, readings, [sees]).tolist() == [True, False, False]
    assert accessible(RV_M2, readings, [either(sees, InSphere(points[1], 0.01))]).tolist() == [
        True,
        True,
        False,
    ]


def test_limits_with_a_margin():
    readings = np.zeros((2, 5))
    readings[:, :3] = np.deg2rad([[149.0, 0, -10], [100.0, 0, -10]])
    assert accessible(RV_M2, readings, [JointLimits(np.deg2rad(5.0))]).tolist() == [False, True]


def test_the_pin_must_meet_the_panel_steeply_enough():
    """The tool's x axis is the pin: level at home, pointing up when joint 2 is lifted."""
    readings = np.zeros((4, 5))
    readings[:, 1] = np.deg2rad([0.0, 14.0, 16.0, 90.0])
    allowed = accessible(RV_M2, readings, [LeastContactAngle((0.0, 0.0, 1.0))])
    assert allowed.tolist() == [False, False, True, True]


@pytest.mark.parametrize("wrong", [(0.0, 0.0, 0.0), (0.0, 1.0), (np.nan, 0.0, 1.0)])
def test_directions_of_rules_lead_somewhere(wrong):
    with pytest.raises(UsageError, match="axis is .*A direction has three finite numbers"):
        InCone((0.0, 0.0, 0.0), wrong, 0.1)
    with pytest.raises(UsageError, match="normal is"):
        LeastContactAngle(wrong)
    with pytest.raises(UsageError, match="pin is"):
        LeastContactAngle((0.0, 0.0, 1.0), pin=wrong)


def test_no_part_of_the_arm_may_be_in_the_box():
    straight, lifted = np.zeros(5), np.array([0.0, np.pi / 2, 0, 0, 0])
    elbow_room = KeepOut((-0.05, 0.2, 0.35), (0.05, 0.3, 0.45))
    assert accessible(RV_M2, np.stack([straight, lifted]), [elbow_room]).tolist() == [False, True]


class Lines(Places):
    """Places whose lines are given."""

    def __init__(self, corners: Floats) -> None:
        super().__init__(RV_M2, np.zeros((len(corners), 5)), np.eye(4))
        self.__dict__["corners"] = corners


SIXTEENTHS = st.integers(-16, 16).map(lambda count: count / 16.0)
TRIPLES = arrays(np.float64, 3, elements=SIXTEENTHS)


@given(arrays(np.float64, (2, 4, 3), elements=SIXTEENTHS), TRIPLES, TRIPLES, st.sampled_from([0.0, 0.01]))
def test_no_line_that_meets_the_box_is_allowed(corners, one, other, margin):
    low, high = np.minimum(one, other), np.maximum(one, other)
    part = np.linspace(0.0, 1.0, 200)[:, None]
    points = corners[:, :-1, None] * (1.0 - part) + corners[:, 1:, None] * part
    deep = ((points >= low - margin + 1e-9) & (points <= high + margin - 1e-9)).all(axis=3).any(axis=(1, 2))
    near = ((points >= low - margin - 0.01) & (points <= high + margin + 0.01)).all(axis=3).any(axis=(1, 2))
    allowed = KeepOut(low, high, margin)(Lines(corners))
    assert not (allowed & deep).any()
    assert (allowed | near).all()


def test_nothing_goes_through_a_thin_plate_or_into_half_a_space():
    upright = np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, 0.9]], [[0.0, 0.0, 0.0], [0.0, 0.5, 0.0]]])
    assert KeepOut((-0.5, -0.5, 0.301), (0.5, 0.5, 0.303))(Lines(upright)).tolist() == [False, True]
    assert KeepOut((-np.inf, -np.inf, 0.7), np.full(3, np.inf))(Lines(upright)).tolist() == [False, True]
    with pytest.raises(UsageError, match="the lowest and then the highest"):
        KeepOut((0, 0, 1), (1, 1, 0))
    with pytest.raises(UsageError, match="margin_m: -0.01. Zero or more"):
        KeepOut((0, 0, 0), (1, 1, 1), -0.01)


def test_a_users_own_rule_and_its_shape():
    readings = np.zeros((4, 5))
    readings[:, 0] = [0.1, 0.2, 0.3, 0.4]
    kept = accessible(RV_M2, readings, [lambda places: places.readings[:, 0] > 0.15, JointLimits()])
    assert kept.tolist() == [False, True, True, True]
    with pytest.raises(InputError, match="shape"):
        accessible(RV_M2, readings, [lambda _: np.array([True])])


@pytest.mark.parametrize(
    "answer",
    [
        lambda places: places.point[:, 2] - 0.2,
        lambda places: ~(places.point[:, 2] < 0.2).astype(int),
        lambda places: np.full(len(places.point), np.nan),
        lambda places: np.full(len(places.point), None),
        lambda places: np.full((len(places.point), 1), fill_value=True),
    ],
    ids=["distances", "inverted integers", "nan", "none", "column"],
)
def test_a_rule_that_does_not_say_true_or_false_allows_nothing(answer):
    class ByHand:
        holds_on_ways = True

        def __call__(self, places: Places) -> Any:
            return answer(places)

    by_hand, readings = ByHand(), np.zeros((4, 5))
    words = r"ByHand: a rule .* answered with .*true or false of each of 4 poses, as booleans \(4,\)"
    for rules in ([by_hand], [either(by_hand, AboveFloor(9.0))]):
        with pytest.raises(InputError, match=words):
            accessible(RV_M2, readings, rules)
    with pytest.raises(InputError, match="ByHand: a rule"):
        JointWays(RV_M2, [by_hand], [RV_M2.tool]).clear(readings)


def test_a_rule_may_answer_with_a_list():
    def in_front(places: Places) -> Any:
        return [bool(x > 0.0) for x in places.point[:, 0]]

    readings = np.zeros((3, 5))
    readings[:, 0] = np.deg2rad([-60.0, 0.0, 60.0])
    meant = RV_M2.position(readings)[:, 0] > 0.0
    assert 0 < meant.sum() < 3
    np.testing.assert_array_equal(accessible(RV_M2, readings, [in_front]), meant)
    none = accessible(RV_M2, readings, [AboveFloor(9.0), in_front])
    np.testing.assert_array_equal(none, [False, False, False])


@pytest.mark.parametrize("wrong", [(0.0, 0.0), 1.0, (np.nan, 0.0, 0.0)])
def test_places_of_rules_are_three_numbers(wrong):
    for rule in (lambda: InSphere(wrong, 1.0), lambda: InCone(wrong, (0.0, 0.0, 1.0), 0.1)):
        with pytest.raises(UsageError, match="(centre|apex) is .*A place has three finite numbers"):
            rule()
    with pytest.raises(UsageError, match="radius_m is '1'. It must be a number"):
        InSphere((0.0, 0.0, 0.0), cast("Any", "1"))


def test_poses_to_judge_may_be_a_list_or_a_table():
    readings = np.random.default_rng(6).uniform(-1.0, 1.0, (20, 5))
    rules: list[Rule] = [AboveFloor(0.3), KeepOut((0.1, 0.1, 0.0), (0.2, 0.3, 0.5))]
    allowed = accessible(RV_M2, readings, rules)
    for given_so in (readings.tolist(), pd.DataFrame(readings)):
        np.testing.assert_array_equal(accessible(RV_M2, given_so, rules), allowed)
    np.testing.assert_array_equal(accessible(RV_M2, readings[3], rules), allowed[3:4])
    with pytest.raises(InputError, match=r"joint readings of .* have shape \(20, 4\)"):
        accessible(RV_M2, readings[:, :4], rules)


def test_a_pool_obeys_its_box_and_rules():
    space, low = spherical(), np.array([0.6, 0.2, -0.3])
    high = low + np.array([0.05, 0.3, 0.3])
    rule = InBox((-1, -1, 0.35), (1, 1, 1))
    pool = draw_pool(space, 50, PoolOptions(rules=[rule], seed=3), box=(low, high))
    assert len(pool) == 50
    assert np.all((pool.coordinates >= low) & (pool.coordinates <= high))
    assert np.all(RV_M2.position(pool.readings)[:, 2] >= 0.35)
    again = draw_pool(space, 50, PoolOptions(rules=[rule], seed=3), box=(low, high))
    np.testing.assert_array_equal(pool.readings, again.readings)


def test_a_pool_that_cannot_be_filled_says_so():
    nowhere = PoolOptions(rules=[InSphere((5.0, 0.0, 0.0), 0.1)])
    assert len(draw_pool(JointSpace(RV_M2), 10, nowhere)) == 0
    with pytest.raises(WorkError, match="0 of 10 poses"):
        needed_pool(JointSpace(RV_M2), 10, nowhere)


def test_a_space_needs_a_box():
    with pytest.raises(UsageError, match="low"):
        JointSpace(RV_M2, low=np.array([1.0, 1.0, 1.0]), high=np.array([0.0, 2.0, 2.0]))
    with pytest.raises(UsageError, match=r"q1 from -20 to 1 rad. The limits of the joint are -\d.* to"):
        JointSpace(RV_M2, low=np.array([-20.0, 0.0, -1.0]), high=np.array([1.0, 1.0, 0.0]))
    with pytest.raises(UsageError, match="R, theta, phi"):
        SphericalSpace(RV_M2, np.array([0.1, 0.2]), np.array([0.3, 0.4]))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"joints": (1, 1, 2)}, "each once"),
        ({"joints": ()}, "One joint or more"),
        ({"joints": (1, 2, 6)}, "It has 1 to 5"),
        ({"joints": (1, 2, 2.5)}, "a number of joints is 2.5. It must be a whole number"),
        ({"held": np.zeros(3)}, r"held: \[0.0, 0.0, 0.0\]. A finite reading of each of the 5 joints"),
        ({"held": [0.0, 0.0, 0.0, 0.0, np.nan]}, "A finite reading"),
        ({"robot": "rv-m2"}, r"the robot is of type str.*Robot.load"),
    ],
)
def test_joints_of_spaces_are_checked(given, message):
    corners = {"low": np.full(3, 0.2), "high": np.full(3, 0.4)}
    for kind in (JointSpace, CartesianSpace):
        with pytest.raises(UsageError, match=message):
            kind(**({"robot": RV_M2} | corners | given))


def test_three_joints_reach_a_position():
    with pytest.raises(UsageError, match="Three joints reach a position"):
        CartesianSpace(RV_M2, np.full(3, 0.2), np.full(3, 0.4), joints=(1, 2))


def test_held_readings_may_be_a_list():
    held: Any = [0.0, 0.0, 0.0, 0.4, 0.5]
    readings, _ = JointSpace(RV_M2, held=held).readings(np.zeros((2, 3)))
    np.testing.assert_array_equal(readings[:, 3:], [[0.4, 0.5]] * 2)
