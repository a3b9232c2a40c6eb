"""Calibrating virtual arms whose errors are known."""

from importlib.metadata import version

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from tests.wall import on_a_wall
from truearm.rotations import matrix_from_quaternion, quaternion_from_rotation_vector
from truearm.simulation import Imperfections, VirtualArm

FAITHFUL = Imperfections(share=0.0)
EXACT = Imperfections(share=0.0, noise_mm=1e-6, noise_mrad=1e-6)
UR10_DETERMINED = (
    *("a1", "alpha1", "theta2", "a2", "alpha2", "beta2", "theta3", "a3", "alpha3", "beta3"),
    *("theta4", "d4", "a4", "alpha4", "theta5", "d5", "a5", "alpha5"),
)


def ur10(seed=1, imperfections=FAITHFUL):
    """A UR10 that errs in nothing that positions do not tell."""
    return VirtualArm(
        ta.Robot.load("ur10"), seed=seed, imperfections=imperfections, parameters=UR10_DETERMINED
    )


@pytest.fixture(scope="module")
def variable():
    """An arm with harmonics, its measurements, and its calibration."""
    arm = VirtualArm.paper(seed=2)
    data = arm.measure(arm.poses(120))
    return arm, data, ta.calibrate(arm.robot, data)


def rows_of(calibration):
    """The rows of a calibration that has them."""
    assert calibration.rows is not None
    return calibration.rows


def named_errors(arm, names):
    kinds = ("theta", "d", "a", "alpha", "beta")
    return np.array([arm.errors[int(name[-1]) - 1, kinds.index(name[:-1])] for name in names])


def named_corrections(calibration):
    columns = dict(zip(calibration.arm.candidates.names, calibration.arm.candidates.columns, strict=True))
    corrections = (calibration.models["constant"].constants - calibration.arm.table).ravel()
    return corrections[[columns[name] for name in calibration.constant.names]]


def test_errors_are_recovered_within_their_stated_covariance():
    inside = []
    for seed in range(60):
        arm = ur10(seed)
        calibration = ta.calibrate(
            arm.robot, arm.measure(arm.poses(60)), model="constant", refit=False, seed=seed
        )
        names = calibration.constant.names
        assert set(names) == set(UR10_DETERMINED)
        size = len(names)
        deviation = np.sqrt(np.diag(calibration.constant.covariance)[:size])
        missed = named_corrections(calibration) - named_errors(arm, names)
        inside.extend(np.abs(missed) < 1.96 * deviation)
    assert 0.90 <= np.mean(inside) <= 0.98, f"{len(inside)} intervals"


def test_without_noise_the_errors_come_back():
    arm = ur10(imperfections=EXACT)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(60)), model="constant")
    np.testing.assert_allclose(
        named_corrections(calibration), named_errors(arm, calibration.constant.names), atol=2e-7
    )
    np.testing.assert_allclose(calibration.models["constant"].setup.frames[0], arm.world_from_base, atol=1e-6)


def test_pose_measurements_tell_the_tool_s_orientation():
    arm = ur10(imperfections=EXACT)
    data = arm.measure(arm.poses(60), orientation=True)
    calibration = ta.calibrate(arm.robot, data, model="constant")
    errors = {name: found.to_dict() for name, found in calibration.validation.holdout.items()}
    assert errors["nominal"]["mean_mrad"] > 0.5
    assert errors["constant"]["mean_mrad"] < 1e-4
    q = arm.poses(5, seed=3)
    world = calibration.pose(q, group="data", target=1)
    measured = arm.measure(q, orientation=True)
    np.testing.assert_allclose(world[:, :3, 3], measured.targets[:, 0], atol=1e-6)
    np.testing.assert_allclose(world[:, :3, :3], matrix_from_quaternion(measured.orientations), atol=1e-5)


def test_what_varies_is_learnt(variable):
    _, _, calibration = variable
    errors = calibration.validation.holdout
    assert errors["variable"].position.mean < errors["constant"].position.mean
    assert errors["constant"].position.mean < 0.2 * errors["nominal"].position.mean
    assert calibration.validation.n_train == 84
    assert calibration.validation.n_holdout == 36


def test_predictions_in_world_are_what_is_measured(variable):
    arm, _, calibration = variable
    q = arm.poses(100, seed=5)
    seen = arm.measure(q, seed=5).targets[:, 0]
    missed = np.linalg.norm(calibration.position(q, group="data") - seen, axis=1)
    assert missed.mean() < 1.5e-4


def test_prediction_s_frames_agree(variable):
    _, data, calibration = variable
    q = data.readings[:4]
    setup = calibration.model.setup
    point = setup.targets[0, 0]
    in_base = calibration.position(q, tool=point)
    in_world = in_base @ setup.frames[0, :3, :3].T + setup.frames[0, :3, 3]
    np.testing.assert_allclose(calibration.position(q, group="data", target=1), in_world, atol=1e-12)
    as_transform = np.eye(4)
    as_transform[:3, 3] = point
    np.testing.assert_array_equal(calibration.position(q, tool=as_transform), in_base)
    np.testing.assert_allclose(calibration.pose(q, tool=point, group="data")[:, :3, 3], in_world, atol=1e-12)


def test_position_is_of_the_file_s_tool_in_the_base_frame(variable):
    arm, data, calibration = variable
    q = data.readings[:6]
    tables = calibration.parameters(q)
    chain = calibration.arm.chain(arm.robot.flange @ arm.robot.tool)
    np.testing.assert_array_equal(calibration.position(q), chain.position(q, tables))
    assert np.abs(calibration.position(q) - arm.robot.position(q)).max() < 5e-3


def test_one_reading_and_several_give_the_same(variable):
    _, data, calibration = variable
    q = data.readings[:3]
    for method in ("position", "pose", "parameters", "parameter_jacobian", "position_std", "pose_std"):
        several = getattr(calibration, method)(q)
        np.testing.assert_allclose(getattr(calibration, method)(q[1]), several[1], rtol=1e-9, atol=1e-15)


def test_shapes(variable):
    _, data, calibration = variable
    q = data.readings[:3]
    assert calibration.parameters(q).shape == (3, 5, 5)
    assert calibration.parameter_jacobian(q).shape == (3, 3, 25)
    assert calibration.parameter_jacobian(q, pose=True).shape == (3, 6, 25)
    assert calibration.position_std(q).shape == (3, 3)
    assert calibration.pose_std(q).shape == (3, 6)


def test_jacobian_is_the_derivative_of_the_position(variable):
    arm, data, calibration = variable
    q = data.readings[:2]
    tables, step = calibration.parameters(q), 1e-6
    chain = calibration.arm.chain(arm.robot.flange @ arm.robot.tool)
    found = calibration.parameter_jacobian(q)
    for column in (0, 7, 13, 24):
        shifted = tables.reshape(2, -1).copy()
        shifted[:, column] += step
        plus = chain.position(q, shifted.reshape(2, 5, 5))
        shifted[:, column] -= 2 * step
        minus = chain.position(q, shifted.reshape(2, 5, 5))
        np.testing.assert_allclose((plus - minus) / (2 * step), found[:, :, column], atol=1e-7)


def test_standard_deviations_grow_away_from_the_data():
    arm = VirtualArm.paper(seed=2)
    near = arm.poses(300)
    near = near[near[:, 1] < np.radians(20.0)][:100]
    calibration = ta.calibrate(arm.robot, arm.measure(near), refit=False)
    far = arm.poses(300, seed=8)
    std = np.linalg.norm(calibration.position_std(far), axis=1)
    beyond = far[:, 1] > np.radians(60.0)
    assert np.median(std[beyond]) > 1.25 * np.median(std[far[:, 1] < np.radians(20.0)])


def test_constants_alone_know_how_far_they_are_off_on_an_arm_that_varies():
    arm = VirtualArm.paper(seed=3, imperfections=Imperfections(share=0.4))
    data = arm.measure(arm.poses(150))
    calibration = ta.calibrate(arm.robot, data, model="constant")
    q = arm.poses(300, seed=9)
    target = calibration.model.setup.targets[0, 0]
    off = calibration.position(q, group=calibration.groups[0], target=1) - arm.measure(q).targets[:, 0]
    std = calibration.position_std(q, tool=target)
    assert 0.9 <= (np.abs(off) <= 1.96 * std).mean() <= 0.99
    judged = ta.Compensator(calibration, task="position").joints(q, tool=target)
    at_corrected = calibration.position_std(judged.q, tool=target)
    np.testing.assert_allclose(judged.std_mm, 1e3 * np.linalg.norm(at_corrected, axis=1), rtol=1e-6)


def test_standard_deviation_carries_to_another_tool(variable):
    _, data, calibration = variable
    q = data.readings[:20]
    near = calibration.position_std(q, tool=calibration.model.setup.targets[0, 0])
    long = calibration.position_std(q, tool=[0.0, 0.0, 1.0])
    assert (np.linalg.norm(long, axis=1) > np.linalg.norm(near, axis=1)).mean() > 0.9


def test_many_poses_are_as_uncertain_as_some(variable):
    arm, _, calibration = variable
    q = arm.poses(1100, seed=3)
    parts = np.concatenate([calibration.position_std(part) for part in np.split(q, [300, 512, 800])])
    np.testing.assert_allclose(calibration.position_std(q), parts, rtol=1e-9)


def test_an_arm_on_a_wall_is_recognised_by_how_it_gives_way():
    calibration, data = on_a_wall()
    assert calibration.variable.hyper["up"] == [1.0, 0.0, 0.0]
    assert [notice.kind for notice in calibration.notices] == ["mounting"]
    again = ta.Calibration.from_bytes(calibration.to_bytes(), where="kept")
    q = data.readings[:5]
    np.testing.assert_array_equal(again.position(q), calibration.position(q))
    np.testing.assert_allclose(again.position_std(q), calibration.position_std(q), rtol=1e-6)


def test_threads_are_counted_from_one(variable):
    arm, data, _ = variable
    with pytest.raises(ta.UsageError, match="-1 threads"):
        ta.calibrate(arm.robot, data, threads=-1)


def test_same_bits_whatever_the_number_of_threads():
    arm = VirtualArm.paper(seed=4)
    data = arm.measure(arm.poses(80))
    found = [ta.calibrate(arm.robot, data, threads=threads) for threads in (1, 2, 4)]
    q = arm.poses(20, seed=3)
    for other in found[1:]:
        assert vars(found[0].variable) == vars(other.variable)
        np.testing.assert_array_equal(found[0].parameters(q), other.parameters(q))
        np.testing.assert_array_equal(rows_of(found[0]).residual, rows_of(other).residual)
        assert found[0].validation == other.validation


def test_same_seed_same_calibration(tmp_path):
    arm = VirtualArm.paper(seed=4)
    data = arm.measure(arm.poses(40))
    for name in ("first", "second"):
        ta.calibrate(arm.robot, data).save(tmp_path / name)
    assert (tmp_path / "first").read_bytes() == (tmp_path / "second").read_bytes()


def test_no_refit_keeps_the_training_fit():
    arm = ur10()
    data = arm.measure(arm.poses(100))
    kept = ta.calibrate(arm.robot, data, model="constant", train_size=50, refit=False)
    again = ta.calibrate(arm.robot, data, model="constant", train_size=50)
    order = np.random.default_rng(7).permutation(100)
    np.testing.assert_array_equal(rows_of(kept).data.rows, order[:50] + 1)
    assert sorted(rows_of(again).data.rows) == list(range(1, 101))
    assert kept.validation == again.validation
    alone = ta.calibrate(arm.robot, data.select(order[:70]), model="constant", refit=True)
    assert not np.array_equal(alone.models["constant"].constants, kept.models["constant"].constants)
    assert [int((rows_of(again).side == side).sum()) for side in (0, 1, 2)] == [20, 50, 30]


def test_several_set_ups_have_frames_of_their_own():
    robot = ta.Robot.load("ur10")
    arms = [ur10(1, EXACT), ur10(1, EXACT)]
    turn = np.eye(4)
    turn[:3, :3] = matrix_from_quaternion(quaternion_from_rotation_vector([[0.2, -0.3, 0.5]]))[0]
    turn[:3, 3] = 0.4, 0.1, -0.2
    arms[1].world_from_base = turn @ arms[1].world_from_base
    tables = [arm.measure_table(arm.poses(60, seed=k)) for k, arm in enumerate(arms)]
    parts = [
        ta.Measurements.from_dataframe(table, name=name)
        for table, name in zip(tables, ("one", "two"), strict=True)
    ]
    calibration = ta.calibrate(robot, parts, model="constant")
    assert calibration.groups == ("one", "two")
    q = arms[0].poses(4, seed=9)
    in_one, in_two = (calibration.position(q, group=group) for group in ("one", "two"))
    np.testing.assert_allclose(in_two, in_one @ turn[:3, :3].T + turn[:3, 3], atol=1e-6)
    with pytest.raises(ta.UsageError, match='"three".*"one" and "two"'):
        calibration.position(q, group="three")
    with pytest.raises(ta.UsageError, match="no group is named"):
        calibration.position(q, target=1)


def test_several_targets_and_a_judge_that_takes_no_part():
    arm = ur10(imperfections=EXACT)
    q = arm.poses(80)
    table = arm.measure_table(q)
    for number, offset in ((2, [0.1, 0.0, 0.0]), (3, [0.0, 0.1, 0.05])):
        arm.target_in_flange = arm.target_in_flange + offset
        names = [f"{axis}{number}" for axis in "xyz"]
        table[names] = arm.measure_table(q)[["x", "y", "z"]].to_numpy()
    data = ta.Measurements.from_dataframe(table)
    everything = ta.calibrate(arm.robot, data, model="constant")
    assert everything.selection.targets == (0, 1, 2)
    judged = ta.calibrate(arm.robot, data, model="constant", judge_target=3)
    assert judged.selection.targets == (0, 1)
    assert judged.validation.holdout["constant"].position.max < 1e-3
    first = ta.calibrate(arm.robot, data, model="constant", use="position", judge_target=2)
    assert first.selection.targets == (0,)
    assert first.validation.holdout["constant"].position.max < 1e-2
    with pytest.raises(ta.UsageError, match=r"Targets \[1, 2\] were fitted"):
        judged.position(q, group="data", target=3)


def test_the_world_as_frame_puts_the_base_s_errors_into_the_arm():
    arm = VirtualArm.paper(seed=3, imperfections=EXACT)
    table = arm.measure_table(arm.poses(80))
    base_from_world = np.linalg.inv(arm.world_from_base)
    in_base = table[["x", "y", "z"]].to_numpy() @ base_from_world[:3, :3].T + base_from_world[:3, 3]
    table[["x", "y", "z"]] = in_base
    data = ta.Measurements.from_dataframe(table)
    calibration = ta.calibrate(arm.robot, data, frame="world", model="constant")
    assert calibration.validation.holdout["constant"].position.max < 1e-3
    assert calibration.parameters(arm.poses(2)).shape == (2, 5, 5)
    assert calibration.parameter_jacobian(arm.poses(2)).shape == (2, 3, 25)


def test_a_feature_that_matters_is_learnt():
    arm = VirtualArm.paper(seed=5, imperfections=Imperfections(share=0.0, noise_mm=0.01))
    readings = arm.poses(150)
    table = arm.measure_table(readings)
    warmth = np.random.default_rng(0).uniform(15.0, 35.0, 150)
    upper_arm = arm.robot.parameter_jacobian(readings)[:, :, 7]
    grown = 2e-5 * (warmth - 25.0)[:, None] * upper_arm
    table[["x", "y", "z"]] += grown @ arm.world_from_base[:3, :3].T
    table["temperature_C"] = warmth
    data = ta.Measurements.from_dataframe(table)
    without = ta.calibrate(arm.robot, data, refit=False)
    calibration = ta.calibrate(arm.robot, data, features="temperature_C", refit=False)
    errors = [c.validation.holdout["variable"].position.mean for c in (calibration, without)]
    assert errors[0] < 0.6 * errors[1]
    q = arm.poses(3)
    warm, cold = (calibration.position(q, features={"temperature_C": t}) for t in (35.0, 15.0))
    assert np.linalg.norm(warm - cold, axis=1).mean() > 1e-4
    tables = pd.DataFrame({"temperature_C": [35.0] * 3}), pd.DataFrame({"temperature_C": [35.0]})
    assert all(np.array_equal(calibration.position(q, features=each), warm) for each in tables)
    for hot in ("35", [35.0] * 2, np.full((3, 1), 35.0)):
        with pytest.raises(ta.InputError, match='the feature "temperature_C"'):
            calibration.position(q, features={"temperature_C": hot})
    varying = calibration.variation_std(q, "theta2, a2", features={"temperature_C": 35.0})
    assert np.array_equal(
        calibration.variation_std(q, ["theta2", "a2"], features={"temperature_C": 35.0}), varying
    )
    assert calibration.variation_std(q[0], "theta2", features={"temperature_C": 35.0}).shape == (1,)
    with pytest.raises(ta.UsageError, match="temperature_C"):
        calibration.position(q)
    with pytest.raises(ta.UsageError, match='"humidity"'):
        calibration.position(q, features={"humidity": 1.0})


@pytest.mark.parametrize("kind", ["anchor", "pair"])
def test_distances_give_constants(kind):
    arm = ur10(imperfections=EXACT)
    table = arm.measure_table(arm.poses(160))
    points = table[["x", "y", "z"]].to_numpy()
    if kind == "anchor":
        table["anchor"] = "post"
        table["distance"] = np.linalg.norm(points - [0.5, 0.2, 0.1], axis=1)
    else:
        table["pair"] = [f"p{k // 2}" for k in range(160)]
        table["distance"] = np.repeat(np.linalg.norm(points[::2] - points[1::2], axis=1), 2)
    data = ta.Measurements.from_dataframe(table.drop(columns=["x", "y", "z"]))
    with pytest.raises(ta.UsageError, match="the variable one is not.*model constant"):
        ta.calibrate(arm.robot, data)
    calibration = ta.calibrate(arm.robot, data, model="constant")
    assert set(calibration.identifiability.determined) == set(UR10_DETERMINED)
    assert calibration.validation.holdout["constant"].position.max < 1e-3
    np.testing.assert_allclose(
        named_corrections(calibration), named_errors(arm, calibration.constant.names), atol=1e-6
    )


@pytest.mark.parametrize("name", ["adept-cobra-600", "franka-panda", "fanuc-lr-mate-200id"])
def test_other_kinds_of_arms(name):
    arm = VirtualArm(ta.Robot.load(name), seed=2)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(120)), refit=False)
    errors = calibration.validation.holdout
    assert errors["constant"].position.mean < 0.3 * errors["nominal"].position.mean
    assert errors["variable"].position.mean < 1.05 * errors["constant"].position.mean


def test_a_robust_constant_fit_withstands_a_gross_error():
    arm = ur10()
    table = arm.measure_table(arm.poses(60))
    order = np.random.default_rng(7).permutation(60)
    table.loc[order[:3], "y"] += 0.05
    data = ta.Measurements.from_dataframe(table)
    found = {
        loss: ta.calibrate(arm.robot, data, model="constant", robust=loss).validation.holdout["constant"]
        for loss in ("none", "huber", "cauchy")
    }
    assert found["huber"].position.mean < 0.5 * found["none"].position.mean
    assert found["cauchy"].position.mean < 0.1 < found["none"].position.mean


def test_identical_rows_count_once():
    arm = ur10()
    table = arm.measure_table(arm.poses(60))
    doubled = table.iloc[[*range(60), *range(5)]].reset_index(drop=True)
    once = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant")
    twice = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(doubled), model="constant")
    np.testing.assert_array_equal(once.models["constant"].constants, twice.models["constant"].constants)
    assert [notice.kind for notice in twice.notices] == ["identical_rows"]


def test_weights_follow_sigma():
    arm = ur10()
    table = arm.measure_table(arm.poses(120))
    noisy = np.arange(120) % 2 == 0
    table.loc[noisy, ["x", "y", "z"]] += np.random.default_rng(0).normal(scale=2e-3, size=(60, 3))
    plain = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant")
    table["sigma_mm"] = np.where(noisy, 2.0, 0.001)
    told = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant")

    def missed(calibration):
        return np.abs(named_corrections(calibration) - named_errors(arm, calibration.constant.names)).mean()

    assert missed(told) < 0.3 * missed(plain)


def test_undetermined_parameters_stay_nominal(variable):
    arm, _, calibration = variable
    columns = dict(zip(calibration.arm.candidates.names, calibration.arm.candidates.columns, strict=True))
    held = [columns[name] for name in calibration.identifiability.undetermined]
    assert held
    constants = calibration.models["constant"].constants.ravel()
    np.testing.assert_array_equal(constants[held], arm.robot.table.ravel()[held])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"model": "fancy"}, '"fancy" is not known'),
        ({"use": "everything"}, '"everything" is not known'),
        ({"use": "pose"}, "no orientation was measured"),
        ({"use": "targets"}, "one point was measured"),
        ({"judge_target": 2}, "no target 2"),
        ({"degree": 4}, '"4" is not known'),
        ({"holdot": 0.3}, 'no option "holdot".*Did you mean "holdout"'),
        ({"features": "warmth"}, 'no column "warmth"'),
        ({"demanded_mm": float("nan")}, "Zero or more, and finite"),
        ({"prior_mm": 0.0}, "must be positive"),
        ({"model": "constant", "features": "warmth"}, "features belong to what varies"),
    ],
)
def test_options_that_cannot_be(options, words):
    arm = ur10()
    with pytest.raises(ta.TruearmError, match=words):
        ta.calibrate(arm.robot, arm.measure(arm.poses(30)), **options)


@pytest.mark.parametrize("count", [4, 8, 10])
def test_too_few_rows_are_refused(count):
    arm = ur10()
    with pytest.raises(ta.WorkError, match=r"cannot determine .* unknowns.*[Mm]easure at least"):
        ta.calibrate(arm.robot, arm.measure(arm.poses(count)), model="constant")


def test_the_world_as_frame_allows_one_set_up():
    arm = ur10()
    parts = [arm.measure_table(arm.poses(30, seed=k)) for k in range(2)]
    data = [ta.Measurements.from_dataframe(part, name=f"s{k}") for k, part in enumerate(parts)]
    with pytest.raises(ta.InputError, match="2 set-ups"):
        ta.calibrate(arm.robot, data, frame="world")


def test_tools_that_are_none(variable):
    _, data, calibration = variable
    for tool in (np.eye(3), [1.0, 2.0], [np.nan, 0.0, 0.0]):
        with pytest.raises(ta.InputError, match="tool"):
            calibration.position(data.readings[:1], tool=tool)
    with pytest.raises(ta.WorkError, match="not measured"):
        calibration.pose(data.readings[:1], group="data")
    with pytest.raises(ta.UsageError, match="no target 2"):
        calibration.position(data.readings[:1], group="data", target=2)


def test_public_names_are_found_on_the_package():
    for name in ta.__all__:
        assert getattr(ta, name).__name__ == name
    assert {name for name in dir(ta) if not name.startswith("_")} == set(ta.__all__)
    assert ta.__version__ == version("truearm")
    assert "__version__" in dir(ta)
    with pytest.raises(AttributeError, match="nonsense"):
        _ = ta.nonsense  # type: ignore[attr-defined]  # type checkers tell it, too


def test_a_target_that_no_held_out_row_holds_is_said():
    arm = ur10()
    table = arm.measure_table(arm.poses(60))
    table[["x2", "y2", "z2"]] = table[["x", "y", "z"]].to_numpy()
    held = np.random.default_rng(7).permutation(60)[42:]
    table.loc[held, ["x", "y", "z"]] = np.nan
    with pytest.raises(ta.InputError, match="target 1 was measured in none of 18 rows"):
        ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant", use="position")


def test_points_and_orientations_may_be_missing_here_and_there():
    arm = ur10(imperfections=EXACT)
    table = arm.measure_table(arm.poses(80), orientation=True)
    table.loc[::7, ["qw", "qx", "qy", "qz"]] = np.nan
    calibration = ta.calibrate(arm.robot, ta.Measurements.from_dataframe(table), model="constant")
    np.testing.assert_allclose(
        named_corrections(calibration), named_errors(arm, calibration.constant.names), atol=2e-7
    )
