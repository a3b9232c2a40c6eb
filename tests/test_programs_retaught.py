"""Tools and work objects that truly are elsewhere than the controller has them: what a program means then."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import truearm as ta
from tests.programs_rig import ABB, KUKA, Shift, again, models, obeyed, read, rewritten
from tests.test_programs_krl import pose_text, the_tool
from tests.test_programs_rapid import GO, SEEN, TABLE, TOOL, UNUSED, module, numbers
from truearm.controller import Controller
from truearm.errors import WorkError
from truearm.inverse import Inverse
from truearm.programs.densify import Spacing
from truearm.programs.environment import Frame
from truearm.programs.rewriting import Models
from truearm.simulation import VirtualArm

TRUE_TOOL = TOOL.copy()
TRUE_TOOL[:3, :3] = Rotation.from_rotvec([1e-3, -2e-3, 1e-3]).as_matrix()
TRUE_TOOL[:3, 3] = [0.0004, -0.0003, 0.1206]
TURN = Rotation.from_matrix(TRUE_TOOL[:3, :3]).as_rotvec().tolist()
RETAUGHT = f"[tool.tG]\nxyz = [0.4, -0.3, 120.6]\nrotation_vector_rad = {TURN}\n"
MOVED = np.eye(4)
MOVED[:3, :3] = Rotation.from_euler("z", 0.05, degrees=True).as_matrix()
TRUE_TABLE = MOVED @ TABLE
TRUE_TABLE[:3, 3] = TABLE[:3, 3] + [0.0005, 0.001, -0.0007]
TABLE_ENTRY = "[object.wT]\nxyz = [300.5, 1.0, 109.3]\neuler_zyx_deg = [0.05, 0, 0]\n"
PLACED = TRUE_TABLE @ np.linalg.inv(TABLE)


def compensating(robot, seed=3, poses=60, **options):
    """Programming, controller and calibrated model of a virtual arm, positions and orientations measured."""
    arm = VirtualArm(robot, seed=seed)
    measured = arm.measure(arm.poses(poses, seed=1), orientation=True)
    calibration = ta.calibrate(robot, measured, ta.CalibrationOptions.of(model="constant"))
    compensator = ta.Compensator(calibration, **options)
    given = Models(robot, Inverse(robot), Controller.nominal(robot), compensator, compensator.task)
    return calibration, given


@pytest.fixture(scope="module")
def irb():
    return compensating(ABB)


def joints_text(q_deg):
    return f"[[{','.join(map(str, q_deg))}],{UNUSED}]"


def far_mm(poses, others):
    return 1e3 * np.linalg.norm((poses - others)[..., :3, 3], axis=-1)


EDGES = ([0, -90, 90, 0, 45, 0], [20, -80, 95, 0, 60, 0], [0, -70, 80, 0, -50, 0], [-30, -100, 70, 0, 30, 90])


@pytest.mark.parametrize("q_deg", EDGES)
def test_status_and_turn_on_an_edge_tell_of_the_controllers_tool(q_deg):
    tool = the_tool()
    stated = "TOOL_DATA[1]={X 10,Y 0,Z 120,A 0,B 30,C 0}"
    frames = '[tool."1"]\nxyz = [10.4, -0.3, 120.5]\neuler_zyx_deg = [0.1, 30, -0.05]\n'
    src = f"DEF a()\n{stated}\n$TOOL=TOOL_DATA[1]\n$BASE=$NULLFRAME\nPTP {pose_text(q_deg, tool)}\nEND\n"
    program = read("a.src", src, KUKA, frames)
    assert program.environments[0].tool.controller[0, 3] != program.environments[0].tool.true[0, 3]
    done = rewritten(program, models(KUKA))
    assert [one.reason for one in done.listed] == []
    assert np.abs(np.rad2deg(done.nominal[0]) - q_deg).max() < 0.005, "readings of the controller's tool"
    said = obeyed(again(done, KUKA, frames), KUKA, done.corrected)
    assert np.abs(said - done.corrected).max() < 3e-5


@pytest.mark.parametrize("q_deg", [[0, 10, 20, 0, 40, 0], [90, 10, 20, -90, 40, 180], [5, 12, 22, 0, -45, 0]])
def test_confdata_on_an_edge_tells_of_the_controllers_tool_and_object(q_deg):
    text = module(f"MoveJ {numbers(q_deg)},{GO}")
    frames = RETAUGHT + TABLE_ENTRY
    done = rewritten(read("a.mod", text, ABB, frames), models(ABB))
    assert [one.reason for one in done.listed] == []
    assert np.abs(np.rad2deg(done.nominal[0]) - q_deg).max() < 0.005


def both_ways(entry):
    """A place as joints, as a pose in the work object and as a pose in the base, and what it means."""
    q_deg = SEEN["pB"]
    body = (
        f"MoveAbsJ {joints_text(q_deg)},{GO}\nMoveJ {numbers(q_deg, decimals=6)},{GO}\n"
        f"MoveJ {numbers(q_deg, placed=np.eye(4), decimals=6)},v100,fine,tG;"
    )
    return read("a.mod", module(body), ABB, entry), ABB.pose(np.deg2rad(q_deg))


def test_a_place_taught_as_joints_and_as_a_pose_comes_out_the_same(irb):
    calibration, given = irb
    program, flange = both_ways(RETAUGHT)
    done = rewritten(program, given)
    assert done.changed.all()
    assert np.abs(done.corrected - done.corrected[0]).max() < 1e-6
    true = calibration.pose(done.corrected, tool=TRUE_TOOL)
    assert far_mm(true, flange @ TOOL).max() < 1e-3
    assert np.abs(true - flange @ TOOL)[:, :3, :3].max() < 1e-6
    assert np.abs(np.rad2deg(done.nominal) - SEEN["pB"]).max() < 1e-4
    shifted = far_mm(ABB.pose(done.corrected) @ TOOL, flange @ TOOL)
    np.testing.assert_allclose(done.correction_mm, shifted, atol=1e-3)
    plain = rewritten(both_ways("")[0], given)
    assert np.abs(done.corrected - plain.corrected).max() > 1e-4, "the tool's difference is in the readings"


def test_a_work_object_taught_again_moves_poses_in_it_and_no_joint_targets(irb):
    calibration, given = irb
    program, flange = both_ways(RETAUGHT + TABLE_ENTRY)
    done = rewritten(program, given)
    true = calibration.pose(done.corrected, tool=TRUE_TOOL)
    meant = np.stack([flange @ TOOL, PLACED @ flange @ TOOL, flange @ TOOL])
    assert far_mm(true, meant).max() < 1e-3
    assert far_mm(meant[1], meant[0]) > 0.5
    shifted = far_mm(ABB.pose(done.corrected[1]) @ TOOL, flange @ TOOL)
    assert done.correction_mm[1] == pytest.approx(shifted, abs=2e-3), "against what the program said"


class Watched(Shift):
    """Remembers for which authors' arms it was asked."""

    def joints(self, q, *, tool=None, author=None):
        self.asked = [*getattr(self, "asked", []), author]
        return super().joints(q, tool=tool, author=author)


@pytest.mark.parametrize(
    "frames", ["", "[tool.tG]\nxyz = [0, 0, 120]\n", "[object.wOther]\nxyz = [1, 2, 3]\n"]
)
def test_where_nothing_differs_the_programming_model_is_the_authors(frames):
    watched = Watched(np.full(6, 1e-3), robot=ABB)
    given = Models(ABB, Inverse(ABB), Controller.nominal(ABB), watched)
    body = f"MoveAbsJ {joints_text(SEEN['pHome'])},v100,fine,tUnknown;\nMoveJ {numbers(SEEN['pA'])},{GO}"
    assert rewritten(read("a.mod", module(body), ABB, frames), given).changed.all()
    assert watched.asked == [None, None]


def test_the_whole_change_counts_for_the_bounds(irb):
    _, given = irb
    far = "[tool.tG]\nxyz = [0, 0, 128]\n"
    with pytest.raises(WorkError, match="3 of 3 targets.*(?s:.)*shifts the tool by") as caught:
        rewritten(both_ways(far)[0], given)
    assert "--largest-mm" in str(caught.value)


def test_what_a_stretched_wrist_cannot_do_is_listed_or_refused_with_the_reason(irb):
    _, given = irb
    wrist = module(f"MoveAbsJ {joints_text([10, 10, 20, 0, 0, 0])},v100,fine,tG;")
    done = rewritten(read("a.mod", wrist, ABB, RETAUGHT), given)
    assert not done.changed.any()
    assert ["singularity" in one.reason for one in done.listed if not one.name.startswith("p")] == [True]
    nearly = module(f"MoveAbsJ {joints_text([10, 10, 20, 0, 1, 0])},v100,fine,tG;")
    with pytest.raises(WorkError, match="would change|turns the tool"):
        rewritten(read("a.mod", nearly, ABB, RETAUGHT), given)


def known_within(**variances):
    """The part of an entry that tells a covariance: variances by their place, mm^2 and mrad^2."""
    diagonal = np.diag([variances.get(name, 0.0) for name in ("x", "y", "z", "rx", "ry", "rz")])
    return f"identified = {{covariance = {diagonal.tolist()}}}\n"


TOOL_WITHIN = RETAUGHT + known_within(x=0.03**2, y=0.04**2, rz=9.0)
TABLE_WITHIN = TABLE_ENTRY + known_within(x=0.01, rz=9.0)


def test_what_tool_and_object_leave_open_is_in_the_standard_deviation(irb):
    _, given = irb
    plain = rewritten(both_ways(RETAUGHT + TABLE_ENTRY)[0], given)
    assert (plain.std_mm > 0.0).all()
    tool = rewritten(both_ways(TOOL_WITHIN + TABLE_ENTRY)[0], given)
    np.testing.assert_allclose(tool.std_mm, np.hypot(plain.std_mm, 0.05), rtol=1e-9)
    program, flange = both_ways(RETAUGHT + TABLE_WITHIN)
    lever_mm = 1e3 * ((PLACED @ flange @ TOOL) - TRUE_TABLE)[:2, 3]
    of_object = np.hypot(0.1, 3e-3 * np.linalg.norm(lever_mm))
    assert of_object > 0.2
    expected = np.hypot(plain.std_mm, [0.0, of_object, 0.0])
    np.testing.assert_allclose(rewritten(program, given).std_mm, expected, rtol=1e-5)


def test_what_tool_and_object_leave_open_counts_for_the_bound(irb):
    _, given = irb
    bounded = dataclasses.replace(given, largest_std_mm=0.2)
    assert rewritten(both_ways(RETAUGHT + TABLE_ENTRY)[0], bounded).changed.all()
    program, _ = both_ways(TOOL_WITHIN + TABLE_WITHIN)
    with pytest.raises(WorkError, match="1 of 3 targets.*(?s:.)*tool and work object leave 0") as caught:
        rewritten(program, bounded)
    assert "more than 0.2" in str(caught.value)
    assert "allow more with --largest-std-mm;" in str(caught.value)
    assert "Touches further apart" in str(caught.value)
    kept = rewritten(program, bounded, on_refusal="keep-nominal")
    assert kept.changed.tolist() == [True, False, True]
    assert np.isnan(kept.std_mm[1])
    assert rewritten(program, given).changed.all(), "None is no bound"


def test_what_a_frame_in_a_frame_leaves_open():
    """Against differences: each moved by what its covariance is of."""
    rng = np.random.default_rng(5)
    poses = [MOVED @ TABLE, TRUE_TOOL]
    roots = [1e-4 * rng.normal(size=(6, 6)) for _ in poses]
    outer, inner = (
        Frame(pose, pose, covariance=root @ root.T) for pose, root in zip(poses, roots, strict=True)
    )
    whole = outer.then(inner)
    assert whole.covariance is not None

    def moved(pose, by):
        turned = np.eye(4)
        turned[:3, :3] = Rotation.from_rotvec(by[3:]).as_matrix() @ pose[:3, :3]
        turned[:3, 3] = pose[:3, 3] + by[:3]
        return turned

    def change(first, second):
        now = moved(poses[0], first) @ moved(poses[1], second)
        turn = Rotation.from_matrix(now[:3, :3] @ whole.true[:3, :3].T).as_rotvec()
        return np.concatenate([(now - whole.true)[:3, 3], turn])

    none = np.zeros(6)
    columns = [change(column, none) for column in roots[0].T] + [
        change(none, column) for column in roots[1].T
    ]
    np.testing.assert_allclose(
        whole.covariance, np.array(columns).T @ np.array(columns), rtol=1e-2, atol=1e-11
    )
    assert Frame.of(TOOL).then(Frame.of(TABLE)).covariance is None


def csv(q):
    lines = [
        ",".join(f"q{k + 1}" for k in range(q.shape[1])),
        *(",".join(map(repr, row)) for row in q.tolist()),
    ]
    return "\n".join(lines) + "\n"


CSV_TOOL = "[tool.tool]\nxyz = [1.0, 2.0, 101.5]\ncontroller = {xyz = [1.5, 2.5, 100.0]}\n"


@pytest.mark.parametrize(
    ("name", "task"), [("rv-m2", "axis"), ("rv-m2", "position"), ("rv-m2", "pose"), ("kuka-iiwa-7", "pose")]
)
def test_arms_with_five_and_seven_axes(name, task):
    robot = ta.Robot.load(name)
    calibration, given = compensating(robot, poses=80, task=task, limits=ta.Limits(residual_mm=1e-4))
    q = robot.limits @ [0.4, 0.6] + 0.1 * np.sin(np.arange(3 * robot.joint_count)).reshape(3, -1)
    done = rewritten(read("path.csv", csv(q), robot, CSV_TOOL), given)
    assert done.changed.all()
    believed, true = np.array([1.5, 2.5, 100.0]) * 1e-3, np.array([1.0, 2.0, 101.5]) * 1e-3
    flange = robot.flange_chain.pose(robot.joints_from_readings(q))
    meant = flange[:, :3, :3] @ believed + flange[:, :3, 3]
    assert 1e3 * np.linalg.norm(calibration.position(done.corrected, tool=true) - meant, axis=1).max() < 2e-3


def test_the_tool_of_a_path_is_the_one_of_the_frames_file():
    pose = KUKA.pose(np.deg2rad([10, -80, 95, 20, 60, -30]))
    tool = np.eye(4)
    tool[:3, 3] = [0.001, 0.002, 0.2]
    place = pose @ tool
    turn = Rotation.from_matrix(place[:3, :3]).as_rotvec()
    row = [*place[:3, 3], *turn, *np.deg2rad([10, -80, 95, 20, 60, -30])]
    text = "x,y,z,rx,ry,rz,q1,q2,q3,q4,q5,q6\n" + ",".join(f"{value:.9f}" for value in row) + "\n"
    done = rewritten(
        read("path.csv", text, KUKA, "[tool.tool]\nxyz = [1, 2, 200]\n"), models(KUKA, by_rad=0.0)
    )
    written = np.array(done.contents[0].decode().splitlines()[1].split(","), dtype=float)
    np.testing.assert_allclose(written, row, atol=1e-7)


@pytest.mark.parametrize("taught", ["a pose", "joints"])
def test_waypoints_lie_on_the_line_that_the_author_meant(irb, taught):
    calibration, given = irb
    ends = [[-40, 20, 15, 5, 50, 0], [40, 20, 15, -5, 50, 0]]
    start = (
        f"MoveAbsJ {joints_text(ends[0])},{GO}" if taught == "joints" else f"MoveJ {numbers(ends[0])},{GO}"
    )
    frames = RETAUGHT + TABLE_ENTRY
    program = read("a.mod", module(f"{start}\n    MoveL {numbers(ends[1], decimals=6)},{GO}"), ABB, frames)
    done = rewritten(program, given, spacing=Spacing.of(0.01, 10.0))
    assert done.inserted >= 3
    flange = ABB.pose(np.deg2rad(ends))
    line = np.stack([(np.eye(4) if taught == "joints" else PLACED) @ flange[0], PLACED @ flange[1]]) @ TOOL
    written = again(done, ABB, frames)
    q = obeyed(written, ABB, np.zeros((len(written.targets), 6)))[written.moves.target]
    true = calibration.pose(q, tool=TRUE_TOOL)[:, :3, 3]
    along = (line[1] - line[0])[:3, 3] / np.linalg.norm((line[1] - line[0])[:3, 3])
    away = true - line[0, :3, 3]
    assert 1e3 * np.linalg.norm(away - (away @ along)[:, None] * along, axis=1).max() < 3e-3
