"""Methods of the comparison: each finds a function of the pose that it can hold."""

import numpy as np
import pytest

from truearm.robot import Robot
from truearm.simulation import VirtualArm
from truearm.studies.accuracy.cells import Cell
from truearm.studies.accuracy.fitted import CorrectedArm, FittedArm
from truearm.studies.accuracy.libraries import one_thread
from truearm.studies.accuracy.methods import BY_NAME, Effort
from truearm.studies.accuracy.methods.curves import fit_curves
from truearm.studies.accuracy.methods.gaussian import fit_additive, fit_cartesian, fit_joint
from truearm.studies.accuracy.methods.gravity import fit_gravity, torque_columns
from truearm.studies.accuracy.methods.grid import fit_grid
from truearm.studies.accuracy.methods.neighbours import fit_neighbours
from truearm.studies.accuracy.methods.network import fit_network
from truearm.studies.accuracy.methods.radial import fit_radial
from truearm.studies.accuracy.methods.trees import fit_trees
from truearm.studies.accuracy.poses import prepare
from truearm.studies.accuracy.sets import DataSet, parse_sets
from truearm.studies.accuracy.splits import Cut

QUICK, FULL = Effort(quick=True), Effort()
POSES = 140
TRAINING = 90


@pytest.fixture(autouse=True)
def few_threads():
    with one_thread():
        yield


@pytest.fixture(scope="module")
def arm_file(tmp_path_factory):
    """Measurements of a virtual UR10 whose joints sag and wave, with two targets."""
    arm = VirtualArm(Robot.load("ur10"), seed=3)
    table = arm.measure_table(arm.poses(POSES))
    file = tmp_path_factory.mktemp("accuracy") / "arm.csv"
    table.assign(**{f"{axis}2": table[axis] for axis in "xyz"}).to_csv(file, index=False)
    return file


@pytest.fixture(scope="module")
def prepared(arm_file):
    return prepare(Cell(_set(arm_file), Cut("random"), "all", TRAINING, 0))


def _set(file):
    return parse_sets([f"ur10={file}"], None)[0]


def _share_left(learn, prepared, function, effort=QUICK):
    """Mean error on held-out poses, as a share of the size of what is to be found."""
    train, held = prepared.train_poses, prepared.poses(prepared.held, 0)
    wanted = function(held)
    left = learn(train, function(train), effort).predict(held) - wanted
    return np.linalg.norm(left, axis=1).mean() / np.linalg.norm(wanted, axis=1).mean()


def of_joints(poses):
    q = poses.joints
    return 1e-3 * np.column_stack([np.sin(q[:, 0]), np.cos(q[:, 1]), np.sin(q[:, 0]) + np.cos(q[:, 1])])


def of_place(poses):
    return 1e-3 * np.sin(2.0 * poses.points)


@pytest.mark.parametrize(
    ("learn", "function", "effort", "library", "share"),
    [
        (fit_joint, of_joints, QUICK, "sklearn", 0.05),
        (fit_additive, of_joints, QUICK, "sklearn", 0.02),
        (fit_cartesian, of_place, QUICK, "sklearn", 0.05),
        (fit_radial, of_place, FULL, "", 0.3),
        (fit_neighbours, of_place, FULL, "sklearn", 0.7),
        (fit_network, of_joints, QUICK, "sklearn", 0.3),
        (fit_trees, of_joints, QUICK, "lightgbm", 0.6),
        (fit_grid, of_place, QUICK, "", 0.7),
    ],
)
def test_what_is_learned_from_residuals_holds_on_other_poses(
    learn, function, effort, library, share, prepared
):
    if library:
        pytest.importorskip(library)
    assert _share_left(learn, prepared, function, effort) < share


def test_curves_of_theta_are_found(prepared):
    def waving(poses):
        return 1e-3 * np.einsum("nij,nj->ni", poses.joint_columns(), np.sin(3.0 * poses.joints))

    assert _share_left(fit_curves, prepared, waving) < 0.3


def test_compliance_is_found(prepared):
    def sagging(poses):
        weights = np.random.default_rng(1).normal(size=torque_columns(poses).shape[2])
        return 1e-4 * torque_columns(poses) @ weights

    assert _share_left(fit_gravity, prepared, sagging) < 0.05


def test_levers_of_gravity_are_changes_of_height(prepared):
    robot, poses = prepared.task.arm.robot, prepared.train_poses
    step, joint = 1e-6, 2
    moved = poses.joints.copy()
    moved[:, joint] += step
    change = (robot.flange_chain.pose(moved) - robot.flange_chain.pose(poses.joints))[:, 2, 3] / step
    assert np.allclose(poses.heights[:, -1, joint], change, atol=1e-2)
    assert np.all(poses.heights[:, 0, 1:] == 0.0)


def test_intervals_of_a_process_hold_what_they_should(prepared):
    pytest.importorskip("sklearn")
    fitted = BY_NAME["gp-joint"].fit(prepared, QUICK)["gp-joint"]
    assert 0.8 < (fitted.coverage(prepared) or 0.0) <= 1.0


@pytest.mark.parametrize("name", ["constant", "robust", "gravity", "regions"])
def test_models_of_the_arm_beat_the_nominal_one(name, prepared):
    def mean(method):
        fitted = BY_NAME[method].fit(prepared, QUICK)
        return np.linalg.norm(fitted[method].errors(prepared, prepared.held), axis=1).mean()

    assert mean(name) < 0.5 * mean("nominal")


def test_ours_brings_its_parts(prepared):
    fitted = BY_NAME["ours"].fit(prepared, QUICK)
    assert set(fitted) == {"ours", *BY_NAME["ours"].parts}
    errors = {
        name: np.linalg.norm(one.errors(prepared, prepared.held), axis=1) for name, one in fitted.items()
    }
    assert errors["ours"].mean() < 0.5e-3
    assert (fitted["ours"].coverage(prepared) or 0.0) > 0.8


def test_parts_of_ours_have_the_blocks_up_to_theirs(prepared):
    fitted = BY_NAME["ours"].fit(prepared, QUICK)
    named = {name: _blocks(one) for name, one in fitted.items()}
    whole = named.pop("ours")
    assert {"own", "smooth", "sag"} <= whole
    assert list(named) == [f"ours-{block}" for block in ("sag", "wrist", "major", "smooth", "own")]
    assert named["ours-own"] == {"own"}
    assert named["ours-smooth"] == {"own", "smooth"}
    assert named["ours-major"] == whole & {"own", "smooth", "major"}
    assert named["ours-sag"] == whole - {"wave"}


def _blocks(fitted):
    """Names of the blocks that change a parameter by more than a tenth of a micrometre or microradian."""
    return {block["name"] for block in fitted.model.field.blocks() if np.abs(block["weights"]).max() > 1e-7}


def test_another_target_is_judged_with_its_point_found(arm_file):
    """The second target of the file is where the first is, so that it must be judged alike."""
    pytest.importorskip("sklearn")
    first = prepare(Cell(_set(arm_file), Cut("random"), "all", TRAINING, 0))
    second = prepare(Cell(_set(arm_file), Cut("target", "2"), "all", TRAINING, 0))
    for name in ("constant", "knn"):
        means = [
            np.linalg.norm(BY_NAME[name].fit(one, QUICK)[name].errors(one, one.held), axis=1).mean()
            for one in (first, second)
        ]
        assert means[1] == pytest.approx(means[0], rel=0.1)


def test_a_correction_of_nothing_changes_nothing(prepared):
    class Nothing:
        settings = {}  # noqa: RUF012

        def predict(self, poses):
            return np.zeros((len(poses), 3))

        def spread(self, _):
            return None

    left = CorrectedArm(Nothing()).errors(prepared, prepared.held)
    assert np.array_equal(left, FittedArm(prepared.constant).errors(prepared, prepared.held))


def test_a_set_is_a_name_an_arm_and_a_file():
    assert parse_sets(["ur10=a/b.csv", "c.csv"], "ur5") == (
        DataSet("b", "ur10", "a/b.csv"),
        DataSet("c", "ur5", "c.csv"),
    )
