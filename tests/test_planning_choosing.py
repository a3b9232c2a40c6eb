"""Chosen poses are better conditioned than drawn ones, and divisions hold what they promise."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from truearm._core import independent_columns
from truearm.errors import InputError, UsageError, WorkError
from truearm.fits.identified import IdentifiedArm
from truearm.planning import (
    ChoiceOptions,
    DividedSpace,
    DivisionOptions,
    JointSpace,
    Workspace,
    choose,
    divide_space,
    draw_pool,
)
from truearm.planning.choosing import unknowns_jacobian
from truearm.planning.drawing import draw_regions, draw_tree
from truearm.robot import Robot
from truearm.simulation import PAPER_PARAMETERS, VirtualArm

RV_M2 = Robot.load("rv-m2")
WORLD = IdentifiedArm(RV_M2, "world")


@pytest.fixture(scope="module")
def pool():
    return draw_pool(JointSpace(RV_M2), 150).readings


@pytest.fixture(scope="module")
def divided():
    arm = VirtualArm.paper(seed=1)
    workspace = Workspace(JointSpace(RV_M2), arm.true_position)
    options = DivisionOptions(accuracy_m=0.0, most_regions=6, candidates=40)
    return divide_space(WORLD, workspace, PAPER_PARAMETERS, options), workspace


def test_a_choice_is_better_conditioned_than_its_start(pool):
    found = choose(WORLD, pool, 20, ChoiceOptions(names=PAPER_PARAMETERS, limit=100.0))
    assert len(set(found.rows.tolist())) == 20
    assert found.after["kappa"] <= found.before["kappa"]
    assert found.well_conditioned
    assert found.after["kappa_normal"] == pytest.approx(found.after["kappa"] ** 2, rel=1e-6)


def test_indices_are_in_one_order():
    choice = choose(IdentifiedArm(Robot.load("ur10")), np.random.default_rng(0).uniform(-1, 1, (40, 6)), 20)
    assert list(choice.before) == ["kappa", "kappa_normal", "log_det", "o1", "o2", "o3", "o4", "o5"]
    assert list(choice.after) == list(choice.before)


def test_a_pool_may_be_of_single_precision_or_a_list():
    arm, drawn = IdentifiedArm(Robot.load("ur10")), np.random.default_rng(0).uniform(-1, 1, (40, 6))
    single = drawn.astype(np.float32)
    chosen = choose(arm, single, 20, given=single[:2])
    again = choose(arm, single.tolist(), 20, given=single[:2].tolist())
    np.testing.assert_array_equal(again.rows, chosen.rows)
    with pytest.raises(InputError, match=r"joint readings of UR10 have shape \(40, 5\)"):
        choose(arm, drawn[:, :5], 20)


@pytest.mark.parametrize("criterion", ["o1", "o3", "d"])
def test_an_index_is_not_lowered(pool, criterion):
    found = choose(WORLD, pool, 15, ChoiceOptions(criterion=criterion, names=PAPER_PARAMETERS))
    index = "log_det" if criterion == "d" else criterion
    assert found.after[index] >= found.before[index]


@pytest.mark.parametrize("criterion", ["o4", "kappa"])
def test_the_best_of_several_starts_counts(criterion):
    arm = IdentifiedArm(RV_M2)
    low, high = RV_M2.limits.T
    drawn = np.random.default_rng(2).uniform(low, high, (400, RV_M2.joint_count))
    one, several = (choose(arm, drawn, 20, ChoiceOptions(criterion, starts=count)) for count in (1, 3))
    assert several.after["kappa"] < 0.97 * one.after["kappa"]
    assert several.after["o4"] > 1.03 * one.after["o4"]
    assert several.before == one.before


def test_a_region_that_is_too_small_is_badly_conditioned():
    space = JointSpace(RV_M2)
    middle = (space.low + space.high) / 2.0
    small = draw_pool(space, 100, box=(middle, middle + 0.01)).readings
    found = choose(WORLD, small, 20, ChoiceOptions(names=PAPER_PARAMETERS, limit=1000.0))
    assert not found.well_conditioned
    assert found.after["kappa"] > 1000.0


def test_frame_and_target_are_determined_along_with_a_free_arm():
    robot = Robot.load("ur10")
    arm = IdentifiedArm(robot)
    readings = VirtualArm(robot).poses(120)
    offset = ChoiceOptions(tool=[0.05, 0.02, 0.1])
    jacobian, columns = unknowns_jacobian(arm, readings, offset)
    assert len(independent_columns(jacobian, columns)) == 27
    assert np.isfinite(choose(arm, readings, 30, offset).after["kappa"])


def test_the_turn_of_the_target_is_determined_where_orientation_is_measured():
    robot = Robot.load("ur10")
    arm, readings, pose = IdentifiedArm(robot), VirtualArm(robot).poses(40), ChoiceOptions(pose=True)
    jacobian, columns = unknowns_jacobian(arm, readings, pose)
    assert jacobian.shape == (40, 6, len(columns)) == (40, 6, 12 + len(arm.candidates.columns))
    # A target that turns by itself moves no point, and turns what is measured about the same axis.
    np.testing.assert_allclose(jacobian[:, :3, 9:12], 0.0, atol=1e-12)
    turns = np.linalg.norm(jacobian[:, 3:, 9:12], axis=1)
    np.testing.assert_allclose(turns, 1.0)
    # Offset and turn of the last joint and of the target on it are one.
    assert {"theta6", "d6"}.isdisjoint(_determined(arm, independent_columns(jacobian, columns)))


def _determined(arm, kept):
    return {arm.candidates.names[k - 12] for k in kept if k >= 12}


def test_named_parameters_that_the_pool_does_not_determine_are_refused(pool):
    robot = Robot.load("ur10")
    arm, readings = IdentifiedArm(robot), VirtualArm(robot).poses(40)
    with pytest.raises(WorkError, match='names: .*do not determine "theta1" and "d1".*Name others'):
        choose(arm, readings, 12, ChoiceOptions(names=("d1", "theta2", "theta1")))
    still, named = np.tile(pool[:1], (20, 1)), ChoiceOptions(names=PAPER_PARAMETERS)
    with pytest.raises(WorkError, match="do not determine"):
        choose(WORLD, still, 6, named)
    assert np.isfinite(choose(WORLD, still, 6, named, given=pool[1:15]).after["kappa"])


def test_parameters_and_criteria_that_are_none_are_refused(pool):
    with pytest.raises(UsageError, match=r'no parameter "theta9".*Did you mean "theta'):
        choose(WORLD, pool, 20, ChoiceOptions(names=["theta1", "theta9"]))
    wrong: Any = "condition"
    with pytest.raises(UsageError, match='criterion: "condition" is not known. Either kappa or d'):
        ChoiceOptions(criterion=wrong)


WRONG_CHOICES: dict[str, tuple[dict[str, Any], str]] = {
    "no parameters": ({"names": ()}, "names: .*One parameter or more"),
    "one parameter twice": ({"names": ("a1", "a1")}, "each once"),
    "passes below zero": ({"passes": -1}, "passes: -1. Zero or more"),
    "half a pass": ({"passes": 1.5}, "passes is 1.5. It must be a whole number"),
    "a limit that no choice meets": ({"limit": -1.0}, "limit: -1. It must be positive"),
}
WRONG_DIVISIONS: dict[str, tuple[dict[str, Any], str]] = {
    "no poses": ({"poses": 0}, "poses: 0. It must be positive"),
    "no regions": ({"most_regions": 0}, "most_regions: 0. It must be positive"),
    "no accuracy": ({"accuracy_m": np.nan}, "accuracy_m: nan. Zero or more"),
    "no limit": ({"limit": 0.0}, "limit: 0. It must be positive"),
    "another halving": ({"halving": "x"}, "Either longest or best"),
    "another order": ({"order": "x"}, "Either worst or breadth"),
    "another criterion": ({"criterion": "x"}, "Either kappa or d"),
    "a seed below zero": ({"seed": -1}, "seed: -1. Zero or more"),
    "a seed of 65 bits": ({"seed": 2**64}, "seed: 18446744073709551616. At most"),
    "fewer candidates than poses": ({"candidates": 19}, "candidates: 19, to choose 20 poses from"),
}


@pytest.mark.parametrize(
    ("kind", "given", "message"),
    [
        *((ChoiceOptions, *case) for case in WRONG_CHOICES.values()),
        *((DivisionOptions, *case) for case in WRONG_DIVISIONS.values()),
    ],
    ids=[*WRONG_CHOICES, *WRONG_DIVISIONS],
)
def test_options_of_choices_and_divisions_are_checked(kind, given, message):
    with pytest.raises(UsageError, match=message):
        kind(**given)


def test_a_parameter_may_be_named_by_its_name_alone(pool):
    one: Any = "theta2"
    assert choose(WORLD, pool, 3, ChoiceOptions(names=one)).after["kappa"] == pytest.approx(1.0)


def test_half_a_pose_is_not_chosen(pool):
    count: Any = 12.0
    with pytest.raises(UsageError, match="count is 12.0. It must be a whole number"):
        choose(WORLD, pool, count)


def test_a_pool_that_is_too_small_is_refused(pool):
    with pytest.raises(WorkError, match="200 poses are to be chosen from 150"):
        choose(WORLD, pool, 200)


def test_a_forced_division_has_its_number_and_counts_what_it_measured(divided):
    found, workspace = divided
    assert len(found.regions.leaves) == 6
    nodes = found.regions.count
    assert nodes == 11
    assert found.measured == sum(map(len, workspace.readings)) == nodes * 30
    assert found.identifying_rows().sum() == 6 * 20
    assert np.isfinite(found.ceps).all()
    assert found.error_m[found.regions.leaves].max() < found.error_m[0]


def test_a_division_stops_where_it_is_accurate_enough():
    arm = VirtualArm.paper(seed=1)
    workspace = Workspace(JointSpace(RV_M2), arm.true_position)
    found = divide_space(WORLD, workspace, PAPER_PARAMETERS, DivisionOptions(accuracy_m=1e-3, candidates=40))
    assert len(found.regions.leaves) == 1
    assert found.ended[0]


def test_a_division_survives_its_file(divided, tmp_path):
    found, _ = divided
    found.save(tmp_path / "division.json")
    again = DividedSpace.load(tmp_path / "division.json")
    points = np.random.default_rng(0).uniform(JointSpace(RV_M2).low, JointSpace(RV_M2).high, (200, 3))
    np.testing.assert_array_equal(again.regions.find(points), found.regions.find(points))
    np.testing.assert_array_equal(again.ceps, found.ceps)
    assert (again.ended, again.batches) == (found.ended, found.batches)


@pytest.mark.parametrize("text", ["{}", "no JSON", '{"format": "other"}', "[1]", 200_000 * "["],
                         ids=["empty", "text", "other", "list", "deep"])  # fmt: skip
def test_a_file_that_is_no_division_is_refused(text, tmp_path):
    (tmp_path / "bad.json").write_text(text)
    with pytest.raises(InputError, match="no division"):
        DividedSpace.load(tmp_path / "bad.json")


def test_a_division_can_be_drawn(divided):
    found, _ = divided
    figure = Figure()
    tree = figure.add_subplot(1, 2, 1)
    draw_tree(found.regions, tree)
    shares = [text.get_text() for text in tree.texts]
    assert shares.count("1") == 1
    assert {"A", "B", "F"} <= set(shares)
    boxes = draw_regions(found.regions, JointSpace(RV_M2), figure, (1, 2, 2))
    assert boxes.get_xlabel() == "q1, deg"


def test_a_measuring_callable_of_another_shape_is_refused():
    workspace = Workspace(JointSpace(RV_M2), lambda readings: np.zeros((len(readings), 2)))
    with pytest.raises(InputError, match=r"shape \(20, 2\)"):
        divide_space(WORLD, workspace, PAPER_PARAMETERS, DivisionOptions(candidates=40))


def test_unknown_parameter_is_refused():
    workspace = Workspace(JointSpace(RV_M2), VirtualArm.paper().true_position)
    with pytest.raises(InputError, match='no parameter "theta9"'):
        divide_space(WORLD, workspace, ["theta9"])


@pytest.mark.parametrize("names", [[], ["theta1", "theta1"]])
def test_parameters_of_a_division_are_named_once(names):
    workspace = Workspace(JointSpace(RV_M2), VirtualArm.paper().true_position)
    with pytest.raises(UsageError, match="parameters: .*each once"):
        divide_space(WORLD, workspace, names)


def test_a_space_that_cannot_be_divided_is_told_in_words():
    workspace = Workspace(JointSpace(RV_M2), VirtualArm.paper().true_position)
    with pytest.raises(WorkError, match=r"whole workspace.*where 0\.5 is allowed.*higher limit"):
        divide_space(WORLD, workspace, PAPER_PARAMETERS, DivisionOptions(limit=0.5))


def test_rows_of_a_division_without_batches_are_not_known(divided):
    with pytest.raises(WorkError, match="does not tell in which order"):
        replace(divided[0], batches=()).identifying_rows()


def test_parameters_of_a_division_stand_in_the_order_of_its_ceps():
    options, arm = DivisionOptions(most_regions=1, tests=1, candidates=20), VirtualArm.paper()
    given, in_order = (
        divide_space(WORLD, Workspace(JointSpace(RV_M2), arm.true_position), names, options)
        for names in (["theta1", "theta2", "d1"], ["theta1", "d1", "theta2"])
    )
    assert given.parameters == in_order.parameters == ("theta1", "d1", "theta2")
    np.testing.assert_array_equal(given.ceps, in_order.ceps)
