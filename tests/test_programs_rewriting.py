"""What is the same in every language: marks, refusals, frames files, declarations, inserted waypoints."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.programs_rig import ABB, KUKA, Shift, again, models, obeyed, read, rewritten
from tests.test_programs_rapid import GO, NOTHING, SEEN, module, numbers, points
from truearm.controller import Controller
from truearm.errors import InputError, UsageError, WorkError
from truearm.programs.densify import Spacing
from truearm.programs.folding import constant
from truearm.programs.frames import Frames
from truearm.programs.languages import LANGUAGES, language_of
from truearm.programs.layouts import EulerPose, Joints, QuaternionPose, RotationVectorPose, within_half_turn
from truearm.programs.lexing import Token
from truearm.programs.marks import MARK, mark_text
from truearm.programs.report import report_of, unified_diff
from truearm.programs.rewriting import Choices, rewrite
from truearm.programs.solving import LEAST_GAIN, are_singular
from truearm.programs.source import Source
from truearm.robot import Robot
from truearm.turns import NearestTurns, with_turns

TWO = f"MoveJ pA,{GO}\nMoveJ pB,{GO}"


def but(robot, **others):
    return Robot(**{name: getattr(robot, name) for name in robot.__dataclass_fields__} | others)


def program_of(body, data=None):
    return read("demo.mod", module(body, points() if data is None else data), ABB)


def test_a_rewritten_program_bears_a_mark_and_is_refused_next_time():
    done = rewrite(program_of(TWO), models(ABB), Choices(), mark=mark_text("0.1.0", "abcdef0123456789"))
    assert done.contents[0].count(MARK.encode()) == 1
    written = again(done, ABB)
    with pytest.raises(WorkError, match=r"demo.mod, line 6: this program was compensated already"):
        rewritten(written, models(ABB))
    assert rewritten(written, models(ABB), force=True).changed.sum() == 2


def test_what_is_told_goes_up_to_the_last_target():
    told = []
    rewrite(program_of(TWO), models(ABB), Choices(), tell=lambda *words: told.append(words))
    assert told == [("targets", 0, 2), ("targets", 2, 2)]


def test_refused_targets_stop_with_their_lines():
    with pytest.raises(WorkError, match=r"(?s)1 of 6 targets.*line 12, pb: too far") as caught:
        rewritten(program_of(TWO), models(ABB, refuse=(1,)))
    assert "keep-nominal" in str(caught.value)


@pytest.mark.parametrize("word", ["abort", "STOP", "keep_nominal", None])
def test_what_becomes_of_refused_targets_is_one_of_two_words(word):
    with pytest.raises(UsageError, match="on_refusal.*is not known. Either stop or keep-nominal"):
        Choices(on_refusal=word)
    other = Choices()
    object.__setattr__(other, "on_refusal", word)
    with pytest.raises(WorkError, match="cannot be corrected"):
        rewrite(program_of(TWO), models(ABB, refuse=(1,)), other)


def test_a_file_is_no_directory_for_what_was_rewritten(tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError, match="a file is in the way"):
        rewritten(program_of(TWO), models(ABB)).save(f"{tmp_path}/taken/")


def test_refused_targets_are_kept_where_that_makes_no_step():
    program = program_of(TWO)
    done = rewritten(program, models(ABB, refuse=(1,)), on_refusal="keep-nominal")
    assert [(one.name, one.reason) for one in done.kept] == [("pb", "too far")]
    assert done.changed.sum() == 1
    kept = program.targets.names
    number = next(n for n, name in kept.items() if name == "pb")
    np.testing.assert_array_equal(done.corrected[number], done.nominal[number])


@pytest.mark.parametrize(
    "body",
    [
        f"MoveJ pA,{GO}\nMoveL pB,{GO}",
        f"MoveJ pA,{GO}\nMoveJ pB,v100,z10,tG\\WObj:=wT;",
        f"MoveJ pA,v100,z10,tG\\WObj:=wT;\nMoveJ pB,{GO}",
        f"MoveJ pA,{GO}\nMoveJ pB,{GO}\nMoveL pA,{GO}",
    ],
)
def test_within_straight_or_blended_motion_nothing_is_kept(body):
    with pytest.raises(WorkError, match="makes a step"):
        rewritten(program_of(body), models(ABB, refuse=(1,)), on_refusal="keep-nominal")


def test_targets_left_between_corrected_ones_are_warned_of():
    done = rewritten(program_of(f"MoveJ pA,{GO}\nMoveL pC,{GO}\npC.trans.x:=1;"), models(ABB))
    assert [notice.kind for notice in done.notices] == ["steps"]


def test_a_controller_with_factory_kinematics_gets_what_it_computes_with():
    table = ABB.table.copy()
    table[1, 2] += 0.001
    table[2, 3] += 0.002
    own = but(ABB, table=table)
    given = models(ABB, by_rad=0.0, controller=Controller(own, "factory", "arm.toml"))
    done = rewritten(program_of(TWO), given)
    said = obeyed(again(done, ABB), own, done.corrected)
    assert np.abs(said - done.corrected)[done.changed].max() < 3e-5
    nominal = obeyed(again(done, ABB), ABB, done.corrected)
    assert np.abs(nominal - done.corrected)[done.changed].max() > 1e-4


class Wavy(Shift):
    """A correction that varies along the way, as arms do."""

    def joints(self, q, *, tool=None, author=None):
        found = super().joints(q, tool=tool, author=author)
        found.q = q + 4e-3 * np.sin(6.0 * q[:, :1]) * np.array([1.0, 0.5, 0.0, 0.0, 0.0, 0.0])
        return found


def long_line(target="p1"):
    ends = [[-40, 20, 15, 5, 50, 0], [40, 20, 15, -5, 50, 0]]
    data = "\n".join(f"CONST robtarget p{n}:={numbers(q, placed=NOTHING)};" for n, q in enumerate(ends))
    return program_of(f"MoveJ p0,v100,fine,tG;\n    MoveL {target},v100,fine,tG;", data)


def test_the_lines_that_may_need_waypoints_are_counted():
    told = []
    choices = Choices(spacing=Spacing.of(0.1, 10.0))
    rewrite(long_line(), models(ABB), choices, tell=lambda *words: told.append(words))
    assert told[-2:] == [("lines", 0, 1), ("lines", 1, 1)]


def test_waypoints_are_inserted_until_the_line_is_straight_enough():
    given = models(ABB)
    given = type(given)(given.programming, given.inverse, given.controller, Wavy(np.zeros(6)))
    program = long_line()
    plain = rewritten(program, given)
    assert plain.inserted == 0
    dense = rewritten(program, given, spacing=Spacing.of(0.1, 10.0))
    assert 2 <= dense.inserted <= 60
    assert rewritten(program, given, spacing=Spacing.of(0.02, 10.0)).inserted > dense.inserted
    text = dense.contents[0].decode("latin-1")
    lines = [line for line in text.splitlines() if "MoveL [[" in line]
    assert len(lines) == dense.inserted
    assert all(",z1,tG;" in line for line in lines)
    assert text.index("MoveJ p0") < text.index("MoveL [[") < text.index("MoveL p1")
    written = again(dense, ABB)
    order = written.moves.target
    said = obeyed(written, ABB, np.zeros((len(written.targets), 6)))[order]
    points_said = (ABB.pose(said) @ tool_of_module())[:, :3, 3]
    along = (
        points_said @ (points_said[-1] - points_said[0]) / np.linalg.norm(points_said[-1] - points_said[0])
    )
    assert np.diff(along).min() > 0.0095, "each waypoint lies behind the one before"


def test_a_move_that_needs_more_waypoints_is_named_with_its_deviation():
    given = models(ABB)
    given = type(given)(given.programming, given.inverse, given.controller, Wavy(np.zeros(6)))
    program = long_line()
    bent = rewritten(program, given, spacing=Spacing.of(0.001, 100.0))
    (one,) = report_of(bent)["deviating"]
    text = program.sources[0].content.decode("latin-1").splitlines()
    assert text[one["line"] - 1].strip() == one["name"] == "MoveL p1,v100,fine,tG;"
    assert one["reason"] == "the least spacing of 100 mm is too wide"
    assert rewritten(program, given, spacing=Spacing.of(1.01 * one["deviation_mm"], 100.0)).inserted == 0
    assert rewritten(program, given, spacing=Spacing.of(0.99 * one["deviation_mm"], 10.0)).inserted > 0
    (notice,) = bent.notices
    assert (notice.kind, notice.rows) == ("deviation", (one["line"],))
    assert notice.message == (
        "1 move deviates by more than 0.001 mm (--densify-mm), and waypoints could not be inserted "
        f"there: line {one['line']} ({one['deviation_mm']:.3g} mm; {one['reason']})"
    )


def test_the_first_moves_that_need_waypoints_are_named_and_the_others_counted():
    given = models(ABB)
    given = type(given)(given.programming, given.inverse, given.controller, Wavy(np.zeros(6)))
    again_and_again = ",v100,fine,tG;\n    MoveL ".join(["p1", "p0"] * 4)
    done = rewritten(long_line(again_and_again), given, spacing=Spacing.of(0.001, 100.0))
    (notice,) = done.notices
    assert notice.message.startswith("8 moves deviate by more")
    assert notice.message.count("line ") == 5
    assert notice.message.endswith("; and 3 more")
    assert len(report_of(done)["deviating"]) == len(notice.rows) == 8


class Doubtful(Shift):
    """Refuses what is more than a few targets."""

    def joints(self, q, *, tool=None, author=None):
        self.refuse = (7,)
        return super().joints(q, tool=tool, author=author)


def test_where_waypoints_are_refused_that_is_the_reason():
    given = models(ABB)
    given = type(given)(given.programming, given.inverse, given.controller, Doubtful(np.zeros(6)))
    done = rewritten(long_line(), given, spacing=Spacing.of(0.1, 10.0))
    (one,) = report_of(done)["deviating"]
    assert one["deviation_mm"] is None
    assert one["reason"] == "places between its ends are refused: too far"
    assert "deviates, or may, by more" in done.notices[0].message
    assert "(how far is not known; places between its ends are refused: too far)" in done.notices[0].message


@pytest.mark.parametrize("target", ["Offs(p1,0,0,-20)", "RelTool(p1,0,0,20)"])
def test_a_line_to_a_shifted_target_gets_no_waypoints(target):
    given = models(ABB)
    given = type(given)(given.programming, given.inverse, given.controller, Wavy(np.zeros(6)))
    program = long_line(target)
    done = rewritten(program, given, spacing=Spacing.of(0.1, 10.0))
    assert done.inserted == 0
    assert done.changed[program.moves.target].all()
    assert [notice.kind for notice in done.notices] == ["deviation"]
    assert done.deviating[0].listed.reason == "its target has an offset, which a waypoint would not have"
    assert done.deviating[0].deviation_mm > 0.1


def tool_of_module():
    tool = np.eye(4)
    tool[2, 3] = 0.12
    return tool


def test_frames_files_say_what_is_wrong_in_them():
    frames = Frames.parse('length_unit = "m"\n[object.Table]\nxyz = [1, 2, 3]\neuler_zyx_deg = [90, 0, 0]\n')
    np.testing.assert_allclose(frames.objects["table"].true[:3, 3], [1.0, 2.0, 3.0])
    np.testing.assert_allclose(frames.objects["table"].true[:3, 0], [0.0, 1.0, 0.0], atol=1e-12)
    for text, words in {
        "[tool.a]\nxyz = [1, 2]\n": "tool.a.xyz",
        "[tool.a]\nxyz = [1, 2, 3]\nquaternion_wxyz = [1, 1, 0, 0]\n": "must be 1",
        "[tool.a]\nxyz = [1, 2, 3]\nquaternion_wxyz = [1, 0, 0, 0]\neuler_zyx_deg = [0, 0, 0]\n": "give one",
        "[tools.a]\nxyz = [1, 2, 3]\n": "tools",
        "tool = [": "not TOML",
        "[tool.tG]\nxyz = [0, 0, 1]\n[tool.TG]\nxyz = [0, 0, 2]\n": 'both "tool.tG" and "tool.TG"',
        "[tool.a]\nxyz = [1, 2, 3]\nidentified = {covariance = [[1.0], [2.0, 3.0]]}\n": "six rows",
    }.items():
        with pytest.raises(InputError, match=words):
            Frames.parse(text, where="f.toml")


def test_the_report_and_the_diff():
    done = rewritten(program_of(TWO), models(ABB))
    report = report_of(done.with_facts({"controller": {"kind": "nominal"}}, ()), [Path("out.mod")])
    assert (report["controller"], report["outputs"]) == ({"kind": "nominal"}, ["out.mod"])
    assert report["counts"] == {
        "targets": 6,
        "moves": 2,
        "changed": 2,
        "kept": 0,
        "left": 4,
        "listed": 4,
        "beside": 0,
    }
    assert report["targets"][0]["name"] == "pa"
    assert (report["targets"][0]["line"], report["targets"][0]["column"]) == (11, 23)
    np.testing.assert_allclose(np.rad2deg(report["targets"][0]["nominal"]), SEEN["pA"], atol=0.01)
    diff = list(unified_diff(done))
    assert sum(line.startswith("+  CONST robtarget") for line in diff) == 2
    assert sum(line.startswith("-  CONST robtarget") for line in diff) == 2


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_a_diff_shows_text_as_it_was_written(encoding):
    text = module(TWO, points().replace("\n", " ! Prüfling\n")).encode(encoding)
    path = Path("demo.mod")
    program = language_of(path).read([Source(path, text)], ABB, Frames())
    diff = list(unified_diff(rewrite(program, models(ABB), Choices(), mark="compensated by truearm")))
    assert any("Prüfling" in line for line in diff)


def test_a_large_programs_diff_is_told_line_by_line():
    body = "\n".join(
        f"MoveAbsJ [[{n % 50},10,20,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1,fine,tG;" for n in range(2500)
    )
    done = rewrite(program_of(body, ""), models(ABB), Choices(), mark="compensated by truearm")
    diff = list(unified_diff(done))
    assert sum(line.startswith("+") for line in diff[2:]) == 2501
    assert sum(line.startswith("-") for line in diff[2:]) == 2500


def test_layouts_come_back():
    rng = np.random.default_rng(3)
    for layout, near in (
        (EulerPose(), rng.uniform(-170.0, 170.0, (20, 6))),
        (EulerPose((2, 1, 0)), rng.uniform(-400.0, 400.0, (20, 6))),
        (RotationVectorPose(), rng.uniform(-3.0, 3.0, (20, 6))),
        (QuaternionPose(), np.hstack([rng.uniform(-900, 900, (20, 3)), unit_quaternions(rng)])),
    ):
        back = layout.from_poses(layout.to_poses(near), near)
        np.testing.assert_allclose(back, near, atol=1e-9)
    joints = Joints.of(("revolute", "prismatic"))
    values = np.array([[90.0, 120.0]])
    np.testing.assert_allclose(joints.to_readings(values), [[np.pi / 2, 0.12]])
    np.testing.assert_allclose(joints.from_readings(joints.to_readings(values), values), values)


def unit_quaternions(rng):
    q = rng.normal(size=(20, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def test_euler_angles_at_the_pole_keep_the_third():
    layout = EulerPose()
    near = np.array([[1.0, 2.0, 3.0, 40.0, 90.0, 25.0]])
    np.testing.assert_allclose(layout.from_poses(layout.to_poses(near), near), near, atol=1e-5)


def test_angles_within_half_a_turn():
    values = np.array([[200.0, -400.0, 0.0, 180.0, -180.0, 190.5], [1.0, 2.0, 3.0, 540.0, -190.0, 0.0]])
    wanted = [[200.0, -400.0, 0.0, 180.0, 180.0, -169.5], [1.0, 2.0, 3.0, 180.0, 170.0, 0.0]]
    np.testing.assert_allclose(within_half_turn(EulerPose(), values), wanted)
    np.testing.assert_array_equal(within_half_turn(Joints.of(ABB.joints), values), values)


def test_angles_of_the_text_within_half_a_turn_stay_within():
    layout = EulerPose()
    near = np.array([[1000.0, 2.0, 3.0, 180.0, 10.0, -179.95], [1000.0, 2.0, 3.0, 540.0, 10.0, 190.0]])
    turned = near + np.array([0.0, 0.0, 0.0, 0.1, 0.0, -0.1])
    written = layout.from_poses(layout.to_poses(turned), near)
    np.testing.assert_allclose(layout.to_poses(written), layout.to_poses(turned), atol=1e-12)
    np.testing.assert_allclose(written[0, 3:], [-179.9, 10.0, 179.95])
    np.testing.assert_allclose(written[1], turned[1])


def test_turns_stay_within_limits():
    branch = np.array([[0.1, -1.0, 0.5, 3.1, 0.5, -3.0]])
    owners, turned = with_turns(branch[None], KUKA)
    assert (owners == 0).all()
    assert ((turned >= KUKA.limits[:, 0]) & (turned <= KUKA.limits[:, 1])).all()
    assert len(turned) == 4
    which, near = NearestTurns(KUKA)(branch, np.array([0.0, 0.0, 0.0, -3.1, 0.0, 5.9]))
    np.testing.assert_allclose(near[0, [3, 5]], [3.1 - 2 * np.pi, -3.0 + 2 * np.pi])
    assert which.tolist() == [0]


def test_branches_beyond_the_limits_are_no_nearest_turns():
    q = np.zeros((3, 6))
    q[0, 1], q[1, 3], q[2, 3] = KUKA.limits[1, 1] + 0.1, KUKA.limits[3, 1] - 0.1, KUKA.limits[3, 1] + 0.1
    before = np.array([0.0, 0.0, 0.0, KUKA.limits[3, 1], 0.0, 0.0])
    which, near = NearestTurns(KUKA)(q, before)
    assert which.tolist() == [1, 2]
    np.testing.assert_allclose(near[:, 3], [q[1, 3], q[2, 3] - 2 * np.pi])


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2*(3-1)", 4.0),
        ("-a/4", -2.5),
        ("1/0", None),
        ("b", None),
        ("2 3", None),
        ("f(2)+1", 5.0),
        ("(1", None),
    ],
)
def test_constants_are_folded(text, value):
    import re

    kinds = re.finditer(r"(?P<name>[a-z])|(?P<number>\d+)|(?P<mark>\S)", text)
    tokens = [Token(found.lastgroup or "", found.group(), found.start(), found.end()) for found in kinds]
    assert constant(tokens, {"a": 10.0}, {"f": lambda x: 2 * x}) == value


def test_places_and_line_ends(tmp_path):
    for text, newline in (("a\r\nbc\r\n", "\r\n"), ("a\nbc", "\n"), ("a\rbc\r", "\r")):
        (tmp_path / "t").write_bytes(text.encode())
        source = Source.load(tmp_path / "t")
        assert source.newline == newline
        assert source.place(text.index("c")) == (2, 2)
        assert source.line_text(2) == "bc"
    (tmp_path / "t").write_bytes(b"a\x00b")
    with pytest.raises(InputError, match="binary"):
        Source.load(tmp_path / "t")


def test_languages_by_ending(tmp_path):
    assert language_of(tmp_path / "A.SRC").name == "KRL"
    assert len({language.name for language in LANGUAGES}) == len(LANGUAGES)
    with pytest.raises(UsageError, match='the ending ".xyz" is not known. Languages are'):
        language_of(tmp_path / "a.xyz")


def test_a_task_that_needs_the_tool_lists_joint_targets_without_one():
    program = program_of("MoveAbsJ jHome,v100,fine,tOther;")
    given = models(ABB)
    assert rewritten(program, given).changed.sum() == 1
    axis = replace(given, task="axis")
    done = rewritten(program, axis)
    assert done.changed.sum() == 0
    assert any("tOther" in one.reason for one in done.listed)


ARMS = {"abb": ABB, "kuka": KUKA, "ur": Robot.load("ur10"), "seven": Robot.load("kuka-iiwa-7")}


@pytest.mark.parametrize("arm", ARMS)
def test_readings_are_singular_where_a_pose_tells_nothing_of_a_joint(arm):
    robot = ARMS[arm]
    rng = np.random.default_rng(0)
    q = rng.uniform(-3.0, 3.0, (4000, robot.joint_count))
    q[::2, 4] *= rng.choice([0.0, 1e-3, 1e-2], 2000)
    least = np.linalg.svd(robot.joint_jacobian(q, pose=True), compute_uv=False)[:, -1]
    singular = are_singular(robot, q)
    np.testing.assert_array_equal(singular, least < LEAST_GAIN)
    assert singular.any()
    assert not singular.all()
