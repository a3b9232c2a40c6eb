"""What Python does with any object: printing, copying, and sending to another process."""

import copy
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

import truearm as ta
from truearm import planning, streaming
from truearm.cell.conformance import ConformanceError
from truearm.compensation import TOOLS_KEPT
from truearm.exporting import export
from truearm.fits import identified
from truearm.framing import find_object, find_tool
from truearm.inverse import Inverse
from truearm.proposing import Candidates, next_poses
from truearm.serving.protocol import MalformedError
from truearm.simulation import VirtualArm


@pytest.fixture(scope="module")
def robot():
    return ta.Robot.load("ur10")


@pytest.fixture(scope="module")
def data(robot):
    arm = VirtualArm(robot, seed=2)
    return arm.measure(arm.poses(60))


@pytest.fixture(scope="module")
def calibration(robot, data):
    return ta.calibrate(robot, data)


def test_standard_deviations_of_targets_are_along_the_axes_of_their_world(data, calibration):
    q, name = data.readings[:5], calibration.groups[0]
    target = calibration.model.setup.targets[0, 0]
    in_base = calibration.position_std(q, tool=target)
    in_world = calibration.position_std(q, group=name, target=1)
    assert np.linalg.norm(in_world, axis=1) == pytest.approx(np.linalg.norm(in_base, axis=1))
    assert not np.allclose(in_world, in_base, rtol=1e-3)
    with pytest.raises(ta.WorkError, match="the orientation of the target on the tool is not known"):
        calibration.pose_std(q, group=name, target=1)
    assert calibration.pose_std(q, group=name, tool=target).shape == (5, 6)


def sent(value):
    return pickle.loads(pickle.dumps(value))


@pytest.mark.parametrize("again", [sent, copy.copy, copy.deepcopy])
def test_robots_measurements_and_calibrations_come_back_whole(again, robot, data, calibration):
    robot.position(data.readings)
    assert again(robot) == robot
    same = again(data)
    assert same.hash() == data.hash()
    assert not same.readings.flags.writeable
    found = again(calibration)
    assert found.to_bytes() == calibration.to_bytes()
    assert np.array_equal(found.position_std(data.readings), calibration.position_std(data.readings))
    assert (found.notices, found.seconds, found.file) == (calibration.notices, calibration.seconds, None)


def test_hyper_parameters_are_in_one_order(calibration):
    assert list(calibration.variable.hyper) == sorted(calibration.variable.hyper)


def test_a_calibration_that_was_read_keeps_its_file(calibration, tmp_path):
    calibration.save(tmp_path / "arm.calib")
    read = ta.Calibration.load(tmp_path / "arm.calib")
    assert sent(read).file == (tmp_path / "arm.calib").read_bytes()
    other = replace(read, file=b"as an older version wrote it")
    assert sent(other).file == b"as an older version wrote it"


def test_a_compensator_corrects_the_same_after_it_was_sent(calibration, data):
    limits = ta.Limits(largest_mm=20.0, largest_joint_deg=10.0, largest_std_mm=100.0)
    compensator = ta.Compensator(calibration, task="position", moving=[1, 2, 3], limits=limits)
    q = data.readings[:5]
    assert np.array_equal(sent(compensator).joints(q).q, compensator.joints(q).q, equal_nan=True)


def test_what_is_printed_is_short_and_says_what_it_is(robot, data, calibration):
    assert repr(robot) == "<Robot UR10: 6 joints, standard Denavit-Hartenberg>"
    assert repr(data) == '<Measurements: 60 rows, 6 joints, 1 target; "data">'
    mean = calibration.validation.holdout["variable"].position.mean
    words = f"<Calibration of UR10: variable, 6 joints, 60 rows, {mean:.3g} mm mean on held-out rows>"
    assert repr(calibration) == words
    nominal, constant = (
        calibration.validation.holdout[name].position.mean for name in ("nominal", "constant")
    )
    means = f"nominal {nominal:.3g} mm, constant {constant:.3g} mm, variable {mean:.3g} mm in the mean"
    assert repr(calibration.validation) == f"<Validation: 42 training poses, 18 held-out poses; {means}>"
    assert repr(calibration.held) == '<HeldRows: 18 rows, errors of "nominal", "constant" and "variable">'
    assert repr(calibration.rows) == "<FittedRows: 60 rows, 0 outliers>"
    compensator = ta.Compensator(calibration)
    assert repr(compensator) == "<Compensator of UR10 by the variable model, pose>"
    far = compensator.joints(data.readings[:3] + 50.0)
    assert repr(far) == "<Compensated: 3 waypoints, 3 refused>"
    assert repr(VirtualArm(robot, seed=2)) == "<VirtualArm of UR10: seed 2, 24 erring parameters>"
    assert repr(Inverse(robot)) == "<Inverse of UR10: three parallel axes>"
    assert "Asked" not in repr(ta.Frames())
    pool = planning.draw_pool(planning.JointSpace(robot), 20)
    assert repr(pool) == "<Pool: 20 poses, 100.0 % of the draws could be measured>"
    exported = export(calibration, "dh-csv")
    lines, notes = len(exported.text.splitlines()), len(exported.notes)
    assert repr(exported) == f"<Exported as dh-csv: {lines} lines, {notes} notes>"
    tool = repr(find_tool(calibration, data, orientation=np.eye(3)))
    assert tool.startswith("<IdentifiedFrame: tool at ")
    assert tool.endswith(" mm, from 60 measured points of it>")


def test_what_a_spoilt_calibration_prints_says_so(robot, data):
    off = data.targets.copy()
    off[4] += 0.02
    spoilt = ta.calibrate(robot, replace(data, targets=off), model="constant")
    assert " 60 rows, 1 outlier, " in repr(spoilt)
    lost = ta.calibrate(robot, replace(data, targets=data.targets[::-1]), model="constant", drift="none")
    assert "e+" not in repr(lost) + repr(lost.validation)


def test_a_rewritten_program_prints_what_was_changed(robot, calibration, tmp_path):
    path = tmp_path / "path.csv"
    path.write_text("q1,q2,q3,q4,q5,q6\n0.3,-1.2,1.5,-0.8,1.1,0.4\n0.31,-1.2,1.5,-0.8,1.1,0.4\n")
    compensator = ta.Compensator(calibration, limits=ta.Limits(largest_mm=20.0, largest_std_mm=10.0))
    rewritten = ta.compensate_program(path, compensator, controller=ta.Controller.nominal(robot))
    assert repr(rewritten) == "<Rewritten path.csv: 2 of 2 targets changed, 0 kept, 0 listed>"
    for_controller: Any = robot
    with pytest.raises(ta.UsageError, match=r"controller is of type Robot.*Controller.nominal\(robot\)"):
        ta.compensate_program(path, compensator, controller=for_controller)


def test_what_an_update_prints_counts_each_row_once(calibration, data):
    found = ta.update(calibration, data.select(range(20)))
    assert repr(found) == f"<Update of UR10: {found.verdict}, 20 poses, 0 outliers>"
    mean = found.calibration.validation.holdout["variable"].position.mean
    words = f"<Calibration of UR10: variable, 6 joints, 20 rows, {mean:.3g} mm mean on left-out rows>"
    assert repr(found.calibration) == words
    revision: Any = found.calibration.revision
    assert repr(revision) == f"<Revision: {found.verdict}, the calibration before is kept>"
    assert repr(revision.stripped()) == f"<Revision: {found.verdict}, the calibration before is left out>"
    assert repr(revision.carried) == f"<Carried: {len(revision.carried.own)} unknowns, 60 values of rows>"
    assert "covariance" not in repr(found.calibration.constant)


def test_models_are_copied_and_sent_with_their_calibration(calibration):
    models = copy.deepcopy(calibration.models)
    assert models is not calibration.models
    assert models == dict(calibration.models)
    assert copy.copy(calibration.model) is calibration.model
    with pytest.raises(ta.UsageError, match="Send the calibration, and take calibration.models from that"):
        pickle.dumps(calibration.models)
    with pytest.raises(ta.UsageError, match="Send the calibration, and take calibration.spread from that"):
        pickle.dumps(calibration.spread)
    assert calibration.arm.flange_chain is not None
    assert np.array_equal(sent(calibration.arm).table, calibration.arm.table)


@pytest.mark.parametrize("kind", [ta.TruearmError, ta.InputError, MalformedError, ConformanceError])
def test_all_errors_say_what_is_wrong_in_parts(kind):
    error = sent(kind("2 mm", where="limits", rule="It is less than 1", way_out="Give less").at("a.toml"))
    assert (type(error), error.what, error.where) == (kind, "2 mm", "a.toml, limits")
    assert (error.rule, error.way_out) == ("It is less than 1", "Give less")
    assert str(error) == "a.toml, limits: 2 mm. It is less than 1. Give less."


def test_no_kind_of_error_is_another_one():
    kinds = [ta.InputError, ta.UsageError, ta.WorkError]
    assert all(issubclass(kind, ta.TruearmError) for kind in kinds)
    assert not [(a, b) for a in kinds for b in kinds if a is not b and issubclass(a, b)]


@pytest.mark.parametrize("again", [sent, copy.copy, copy.deepcopy])
def test_a_controller_is_sent_after_it_has_solved(again, robot, data):
    controller = ta.Controller.declared("nominal", robot)
    poses = controller.pose(data.readings)
    solved = controller.inverse.near(poses, data.readings)
    assert np.array_equal(again(controller).inverse.near(poses, data.readings), solved)


def test_a_controller_takes_a_tool_as_a_point(robot, data):
    controller, tool = ta.Controller.nominal(robot), np.eye(4)
    tool[:3, 3] = 0.0, 0.01, 0.1
    assert np.array_equal(controller.pose(data.readings, tool[:3, 3]), controller.pose(data.readings, tool))


def test_a_compensator_keeps_the_correctors_of_few_tools(calibration):
    compensator = ta.Compensator(calibration)
    first = compensator.corrector([0.0, 0.0, 0.1])
    for k in range(3 * TOOLS_KEPT):
        compensator.corrector([0.0, 0.001 * k, 0.2])
        assert compensator.corrector([0.0, 0.0, 0.1]) is first
    assert len(compensator._correctors) == TOOLS_KEPT


def measured(robot):
    return VirtualArm(robot, seed=2).measure_table(np.zeros((3, 6)))


def counted_from_zero(robot):
    return measured(robot).rename(columns={f"q{k + 1}": f"q{k}" for k in range(6)})


api: Any = ta
streams: Any = streaming
virtual: Any = VirtualArm
plans: Any = planning
arms: Any = identified
WRONG = {
    "a robot for a calibration": (
        lambda r, d, c: api.evaluate(r, d),
        "the calibration is of type Robot",
    ),
    "measurements first": (lambda r, d, c: api.evaluate(d, c), "A truearm.Calibration is needed. Load it"),
    "a path": (lambda r, d, c: api.evaluate(c, "m.csv"), "measurements are of type str.*read_csv"),
    "a list of tables": (
        lambda r, d, c: api.update(c, [pd.DataFrame()]),
        "are of type DataFrame",
    ),
    "no such option": (
        lambda r, d, c: api.evaluate(c, d, frame_row=9),
        'no option "frame_row".*"frame_rows"',
    ),
    "other options": (
        lambda r, d, c: api.evaluate(c, d, ta.CalibrationOptions()),
        "truearm.EvaluationOptions is needed",
    ),
    "options in two ways": (
        lambda r, d, c: api.evaluate(c, d, ta.EvaluationOptions(), seed=1),
        "given both ways",
    ),
    "no such option of update": (lambda r, d, c: api.update(c, d, keep_tol=True), 'you mean "keep_tool"'),
    "calibrating with a dict": (
        lambda r, d, c: api.calibrate(r, d, {"seed": 1}),
        "truearm.CalibrationOptions is needed",
    ),
    "a compensator of a file": (lambda r, d, c: api.Compensator("arm.calib"), "Calibration.load"),
    "a programming model by name": (lambda r, d, c: api.Compensator(c, programming="ur10"), "Robot.load"),
    "one moving joint": (lambda r, d, c: api.Compensator(c, moving=3), "A list of joints"),
    "a program without compensator": (
        lambda r, d, c: api.compensate_program("a.src", c),
        "Compensator is",
    ),
    "a program that is not there": (
        lambda r, d, c: api.compensate_program("none.script", api.Compensator(c)),
        "none.script: there is no such file",
    ),
    "a program's name that is none": (
        lambda r, d, c: api.compensate_program(None, api.Compensator(c)),
        "the file is of type NoneType",
    ),
    "a tool in words": (
        lambda r, d, c: c.position(d.readings, tool="gripper"),
        "entries of the tool are not real numbers",
    ),
    "a table for a path": (
        lambda r, d, c: api.Measurements.from_dataframe("m.csv"),
        "table is of type str",
    ),
    "no path": (lambda r, d, c: api.Calibration.load(None), "the file is of type NoneType. A path is needed"),
    "a list for a path": (lambda r, d, c: api.Measurements.read_csv(["m.csv"]), "the file is of type list"),
    "a bound in words": (lambda r, d, c: api.Limits(largest_mm="5"), "largest_mm is '5'. It must be"),
    "a rate in words": (
        lambda r, d, c: api.CalibrationOptions.of(rate="1"),
        "rate is '1'. It must be a number",
    ),
    "a level in words": (lambda r, d, c: api.UpdateOptions(level="1"), "level is '1'. It must be a number"),
    "a ramp in words": (
        lambda r, d, c: streams.StreamOptions(ramp_s="1"),
        "ramp_s is '1'. It must be a number",
    ),
    "a time in words": (
        lambda r, d, c: streams.CorrectionStream(api.Compensator(c)).step(None, "1"),
        "elapsed_s is '1'. It must be a number",
    ),
    "a touching tool in words": (
        lambda r, d, c: find_object(c, d, "gripper"),
        "the entries of the tool are not real numbers",
    ),
    "a tool turned in words": (
        lambda r, d, c: find_tool(c, d, orientation="down"),
        "the entries of the orientation are not real numbers",
    ),
    "a set-up by number": (lambda r, d, c: c.position(d.readings, group=0), 'there is no set-up "0"'),
    "features in a list": (lambda r, d, c: c.position(d.readings, features=[1]), "features are of type list"),
    "poses for a calibration": (
        lambda r, d, c: next_poses(c, d.readings, 5),
        "Make them of poses",
    ),
    "poses chosen for a robot": (
        lambda r, d, c: plans.choose(r, d.readings, 9),
        "Make it of a robot: truearm.fits.identified",
    ),
    "an arm by name": (lambda r, d, c: arms.IdentifiedArm("ur10"), "Robot.load"),
    "a space by name": (lambda r, d, c: plans.JointSpace("ur10"), "Robot.load"),
    "a pool of no poses": (
        lambda r, d, c: plans.draw_pool(plans.JointSpace(r), 0),
        "count: 0. It must be pos",
    ),
    "a pool of half a pose": (
        lambda r, d, c: plans.draw_pool(plans.JointSpace(r), 0.5),
        "count is 0.5. It must be a whole",
    ),
    "a box upside down": (lambda r, d, c: plans.InBox((0, 0, 1), (1, 1, 0)), "x, y and z in m, the lowest"),
    "a flat box": (lambda r, d, c: plans.InBox((0, 0), (1, 1)), "x, y and z in m, the lowest"),
    "a tool to plan with": (
        lambda r, d, c: plans.accessible(r, d.readings, [], tool=np.zeros(2)),
        "transform",
    ),
    "candidates of two joints": (lambda r, d, c: Candidates(c, d.readings[:1, :2]), r"have shape \(1, 2\)"),
    "a virtual arm by name": (lambda r, d, c: virtual("ur10"), "the robot is of type str.*Robot.load"),
    "imperfections in a dict": (lambda r, d, c: virtual(r, imperfections={}), "are of type dict"),
    "an author by name": (lambda r, d, c: api.Compensator(c).joints(d.readings, author="ur10"), "Robot.load"),
    "a controller by no name": (lambda r, d, c: api.Controller.declared("nominel", r), "nominal is declared"),
    "a parameter": (lambda r, d, c: c.variation_std(d.readings, "theta9"), 'parameter "theta9"'),
    "a number of joints": (
        lambda r, d, c: api.Measurements.from_dataframe(pd.DataFrame({"q1": [1.0]}), joints=6),
        "joints is 6. It must be a list of names",
    ),
    "joints counted from zero": (
        lambda r, d, c: api.evaluate(c, api.Measurements.from_dataframe(counted_from_zero(r))),
        'Joints are counted from 1: rename "q0"',
    ),
    "kinds of joints": (
        lambda r, d, c: api.Measurements.from_dataframe(pd.DataFrame({"q1": [1.0]}), joints=["rotary"]),
        'joints: "rotary" is not known. Either revolute or prismatic',
    ),
    "complex readings": (
        lambda r, d, c: c.position(d.readings + 1j),
        "real numbers: complex numbers were given",
    ),
    "times": (lambda r, d, c: r.position(np.zeros((1, 6), "M8[s]")), "dates were given"),
    "numbers in words": (lambda r, d, c: r.position([["1"] * 6]), "texts were given"),
    "masked readings": (
        lambda r, d, c: c.position(np.ma.masked_greater(d.readings, d.readings[3].max())),
        "NaN or infinite values in row",
    ),
    "a complex waypoint": (
        lambda r, d, c: api.Compensator(c).correct(d.readings[0] + 0j),
        "complex numbers were given",
    ),
    "complex coordinates": (
        lambda r, d, c: api.Measurements.from_dataframe(
            pd.DataFrame({**{f"q{k}": [0.1] for k in range(1, 7)}, "x": [1j], "y": [1.0], "z": [1.0]})
        ),
        'column "x" holds "1j" in row 1',
    ),
    "a calibration in words": (
        lambda r, d, c: api.Calibration.from_bytes("arm.calib", where="here"),
        "content of a calibration file is of type str. Bytes are needed",
    ),
    "a bound that no float holds": (
        lambda r, d, c: api.Limits(largest_mm=10**400),
        "largest_mm is beyond 1.8e",
    ),
    "a time that no float holds": (
        lambda r, d, c: streams.CorrectionStream(api.Compensator(c)).step(None, 10**400),
        "elapsed_s is beyond 1.8e",
    ),
    "a table called by a number": (
        lambda r, d, c: api.Measurements.from_dataframe(counted_from_zero(r), name=5),
        "name is 5. It must be a text",
    ),
    "a number of joints in words": (
        lambda r, d, c: d.require_joint_count("6"),
        "joint_count is '6'. It must be a whole number",
    ),
    "one kind of joint for all": (
        lambda r, d, c: api.Measurements.from_dataframe(measured(r), joints="revolute"),
        "there are 6 joint columns. The robot has 1 joint. ",
    ),
    "a target in words": (
        lambda r, d, c: c.position(d.readings, group=c.groups[0], target="1"),
        "target is '1'. It must be a whole number",
    ),
    "rows one by one": (lambda r, d, c: list(d), r"One row is said by \[0\]; to go through them all, take"),
    "a controller of a robot by name": (
        lambda r, d, c: api.Controller.declared("nominal", "ur10"),
        "the robot is of type str.*Robot.load",
    ),
    "a file's controller of a robot by name": (
        lambda r, d, c: api.Controller.load("arm.toml", robot="ur10"),
        "the robot is of type str.*Robot.load",
    ),
    "no robot file": (lambda r, d, c: api.Robot.from_toml(None), "robot: the text is of type NoneType"),
    "names in a set": (
        lambda r, d, c: api.CalibrationOptions(features={"b"}),
        "features is {'b'}. It must be a list of names, as a set has no order",
    ),
    "columns in a set": (
        lambda r, d, c: api.SplitRule(split_by=frozenset({"b"})),
        "It must be a list of names, as a set has no order",
    ),
    "a robot without a name": (lambda r, d, c: replace(r, name=""), "name: ''. The name is a text that is"),
    "a robot called by a number": (
        lambda r, d, c: api.Robot.from_table(5, np.zeros((2, 4))),
        "name: 5. The name is a text that is not empty",
    ),
    "a convention": (
        lambda r, d, c: api.Robot.from_dict({**r.to_dict(), "convention": "craig"}),
        'convention: "craig" is not known. Either standard or modified',
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_arguments_are_told_what_is_needed(case, robot, data, calibration):
    call, words = WRONG[case]
    with pytest.raises((ta.InputError, ta.UsageError), match=words):
        call(robot, data, calibration)


@pytest.mark.parametrize("kind", [bytearray, memoryview])
def test_the_content_of_a_calibration_may_be_any_bytes(kind, calibration):
    content = calibration.to_bytes()
    again = ta.Calibration.from_bytes(kind(content), where="a message")
    assert (again.to_bytes(), type(again.file)) == (content, bytes)


def test_what_a_calibration_says_is_read_only(calibration, data):
    model, rows = calibration.models["constant"], calibration.rows
    arrays = [model.constants, calibration.constant.covariance, calibration.constant.standard_errors]
    arrays += [rows.weight, rows.residual, calibration.held.readings, calibration.measured.rows]
    assert not any(array.flags.writeable for array in arrays)
    with pytest.raises(ValueError, match="read-only"):
        model.constants[0, 1] += 0.01


def test_a_compensator_keeps_what_it_was_made_of(calibration, warm, data):
    moving = [1, 2, 3]
    few = ta.Compensator(calibration, task="position", moving=moving)
    before = few.joints(data.readings).q
    moving.append(4)
    assert few.moving_count == 3
    np.testing.assert_array_equal(sent(few).joints(data.readings).q, before)
    assert ta.Compensator(warm, features={"temperature_C": 22.0}).features == (22.0,)


def test_one_file_is_read_as_a_list_of_one(data, tmp_path):
    path = tmp_path / "m.csv"
    VirtualArm(ta.Robot.load("ur10"), seed=2).measure_table(data.readings[:5]).to_csv(path, index=False)
    one, several = ta.Measurements.read_files(str(path)), ta.Measurements.read_files([path])
    assert one.hash() == several.hash()


def test_lists_of_measurements_are_put_together(data, calibration):
    parts = [data.select(np.arange(30)), data.select(np.arange(30, 60))]
    whole, parted = ta.evaluate(calibration, data), ta.evaluate(calibration, parts)
    assert parted.to_dict() == whole.to_dict()


def test_an_evaluation_prints_without_its_rows(calibration, data):
    found = ta.evaluate(calibration, data)
    assert found.rows is not None
    assert len(repr(found)) < 1000
    assert found in {found}
    assert copy.copy(found) != found


def test_types_that_are_needed_are_called_by_their_package(robot):
    with pytest.raises(ta.UsageError, match="A pandas.DataFrame is needed"):
        ta.Measurements.from_dataframe(None)  # type: ignore[arg-type]
    with pytest.raises(ta.UsageError, match="A truearm.Measurements is needed"):
        ta.calibrate(robot, "data.csv")  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def warm(robot):
    """A calibration with a feature."""
    arm = VirtualArm(robot, seed=2)
    table = arm.measure_table(arm.poses(60)).assign(temperature_C=np.linspace(20.0, 25.0, 60))
    return ta.calibrate(robot, ta.Measurements.from_dataframe(table), features=["temperature_C"])


def test_a_missing_feature_is_told_with_the_ways_to_give_it(warm):
    with pytest.raises(ta.UsageError, match=r"Give --feature temperature_C=NUMBER, or in Python features="):
        warm.position(np.zeros(6))


def test_of_no_readings_there_are_no_predictions(warm):
    none, features = np.zeros((0, 6)), {"temperature_C": 22.0}
    shapes = {
        "parameters": (0, 6, 5),
        "position": (0, 3),
        "pose": (0, 4, 4),
        "parameter_jacobian": (0, 3, 30),
        "position_std": (0, 3),
        "pose_std": (0, 6),
        "conservative_std": (0, 2),
    }
    assert {name: getattr(warm, name)(none, features=features).shape for name in shapes} == shapes
    assert warm.variation_std(none, ["theta2", "a3"], features=features).shape == (0, 2)
    assert warm.solve(np.zeros((0, 4, 4)), np.zeros(6), features=features).shape == (0, 6)
