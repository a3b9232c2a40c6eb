"""The frames file: names of what programs write out in numbers, and entries that no program asks for."""

from pathlib import Path

import numpy as np
import pytest

import truearm as ta
from tests.programs_rig import ABB, KUKA, models, read, rewritten
from tests.test_programs_krl import pose_text
from tests.test_programs_rapid import GO, SEEN, module, numbers, points
from truearm.errors import InputError
from truearm.programs.frames import Frames
from truearm.programs.languages import language_of
from truearm.programs.notices import frames_notices
from truearm.programs.source import Source
from truearm.robot import Robot
from truearm.simulation import VirtualArm

TARGET = pose_text([10, -80, 95, 20, 60, -30])
WRITTEN = "$TOOL={X 60,Y 0,Z 150,A 0,B 0,C 0}"
OTHER = "$TOOL={X 0,Y 0,Z 90,A 0,B 0,C 0}"
BASE = "$BASE={X 5,Y 0,Z 0,A 0,B 0,C 0}"
UR_POSE = "movej(get_inverse_kin(p[0.5,0.1,0.4,3.1,0,0], qnear=[0.2,-1.3,1.6,-1.8,-1.6,0.1]))"


def krl(*lines):
    return "\n".join(["DEF a()", *lines, "END", ""])


def entries(**frames):
    return "".join(
        f'[{kind}."{name}"]\nxyz = [60.5, 0.0, 150.0]\n' for kind, names in frames.items() for name in names
    )


def told(name, text, robot, content):
    """Messages about a frames file."""
    frames = Frames.parse(content, where="cell.toml")
    program = language_of(Path(name)).read([Source.of(Path(name), text)], robot, frames)
    found = frames_notices(program, frames)
    assert {notice.kind for notice in found} <= {"frames"}
    return [notice.message for notice in found]


def tools(program):
    return [program.environments[number].tool for number in program.moves.environment]


def test_a_tool_and_a_base_written_out_in_krl_are_those_of_the_frames_file():
    text = krl(WRITTEN, BASE, f"PTP {TARGET}")
    content = entries(tool=["$TOOL"], object=["$BASE"])
    program = read("a.src", text, KUKA, content)
    tool, base = program.environments[0].tool, program.environments[0].work_object
    np.testing.assert_allclose([tool.true[0, 3], tool.controller[0, 3]], [0.0605, 0.06])
    np.testing.assert_allclose([base.true[0, 3], base.controller[0, 3]], [0.0605, 0.005])
    assert told("a.src", text, KUKA, content) == []
    plain, aimed = (
        rewritten(read("a.src", text, KUKA, given), models(KUKA)) for given in ("", entries(tool=["$TOOL"]))
    )
    assert np.abs(plain.corrected - aimed.corrected).max() > 1e-4


def test_several_tools_written_out_are_numbered_in_the_order_of_the_text():
    text = krl("$BASE=$NULLFRAME", WRITTEN, f"PTP {TARGET}", OTHER, f"LIN {TARGET}", WRITTEN, f"PTP {TARGET}")
    found = tools(read("a.src", text, KUKA, entries(tool=["$TOOL 2"])))
    assert [frame.name for frame in found] == ["$TOOL 1", "$TOOL 2", "$TOOL 1"]
    assert [frame.true[0, 3] for frame in found] == pytest.approx([0.06, 0.0605, 0.06])
    assert [frame.controller[0, 3] for frame in found] == pytest.approx([0.06, 0.0, 0.06])
    told_of = told("a.src", text, KUKA, entries(tool=["$TOOL"]))
    assert told_of == [
        'tool "$TOOL" of cell.toml changes nothing: the program has none of that name, '
        'its tools are "$TOOL 1" and "$TOOL 2" there'
    ]


def test_what_holds_before_the_first_written_out_tool_is_another_one():
    text = krl("$BASE=$NULLFRAME", f"PTP {TARGET}", WRITTEN, f"LIN {TARGET}")
    first, second = tools(read("a.src", text, KUKA, entries(tool=["$TOOL"])))
    assert "$TOOL 0" in first.unknown
    assert second.true[0, 3] == pytest.approx(0.0605)
    first, second = tools(read("a.src", text, KUKA, entries(tool=["$TOOL 0"])))
    assert (first.unknown, first.true[0, 3]) == ("", pytest.approx(0.0605))
    assert second.true[0, 3] == pytest.approx(0.06)


def test_tools_written_out_in_melfa_basic_are_numbered_where_they_differ():
    robot = Robot.load("mitsubishi-rv-4fl")
    place = "P1=(300,0,400,180,0,180)(7,0)\n"
    one = f"1 Tool (0,0,100,0,0,0)\n2 Mov P1\n{place}"
    two = f"1 Tool (0,0,100,0,0,0)\n2 Mov P1\n3 Tool (0,0,50,0,0,0)\n4 Mvs P1\n{place}"
    assert tools(read("a.prg", one, robot, entries(tool=["tool"])))[0].true[0, 3] == pytest.approx(0.0605)
    found = tools(read("a.prg", two, robot, entries(tool=["tool 2"])))
    assert [frame.true[0, 3] for frame in found] == pytest.approx([0.0, 0.0605])
    assert '"tool 1" and "tool 2"' in told("a.prg", two, robot, entries(tool=["tool"]))[0]


RAPID = module(f"MoveJ {numbers(SEEN['pA'])},{GO}")
TP = """/PROG A
/MN
   1:J P[1] 20% FINE    ;
/POS
P[1]{
   GP1:
\tUF : 1, UT : 2,\t\tCONFIG : 'N U T, 0, 0, 0',
\tX = 400.0 mm,\tY = 0.0 mm,\tZ = 300.0 mm,
\tW = 180.0 deg,\tP = 0.0 deg,\tR = 0.0 deg
};
/END
"""
UNASKED = {
    "KRL": ("a.src", krl("$BASE=$NULLFRAME", WRITTEN, f"PTP {TARGET}"), "kuka-kr-6-r900", "$TOOL"),
    "number": (
        "a.src",
        krl("$BASE=$NULLFRAME", "$TOOL=TOOL_DATA[3]", f"PTP {TARGET}"),
        "kuka-kr-6-r900",
        "3",
    ),
    "start": ("a.src", krl("$BASE=$NULLFRAME", f"PTP {TARGET}"), "kuka-kr-6-r900", "$TOOL"),
    "RAPID": ("a.mod", RAPID, "abb-irb-120", "TG"),
    "UR": ("a.script", f"def a():\n  set_tcp(p[0,0,0.1,0,0,0])\n  {UR_POSE}\nend\n", "ur10e", "tcp"),
    "UR variable": (
        "a.script",
        f"def a():\n  g=p[0,0,0.1,0,0,0]\n  set_tcp(g)\n  {UR_POSE}\nend\n",
        "ur10e",
        "g",
    ),
    "UR start": ("a.script", f"def a():\n  {UR_POSE}\nend\n", "ur10e", "tcp"),
    "TP": ("a.ls", TP, "fanuc-lr-mate-200id", "2"),
    "MELFA": ("a.prg", "1 M_Tool=1\n2 Mov P1\nP1=(300,0,400,180,0,180)(7,0)\n", "mitsubishi-rv-4fl", "1"),
    "CSV": ("a.csv", "q1,q2,q3,q4,q5,q6\n0,0,0,0,1,0\n", "kuka-kr-6-r900", "tool"),
}


@pytest.mark.parametrize("case", UNASKED)
def test_entries_that_the_program_does_not_ask_for_are_named(case):
    name, text, arm, right = UNASKED[case]
    robot = Robot.load(arm)
    assert told(name, text, robot, entries(tool=[right])) == []
    wrong = told(name, text, robot, entries(tool=[right, "tGrippe"]))
    assert len(wrong) == 1
    assert 'tool "tGrippe" of cell.toml changes nothing' in wrong[0]
    assert f'"{right}"'.casefold() in wrong[0].split("its tools are")[1].casefold()


def test_what_holds_at_the_start_is_asked_for_only_by_motions():
    text = krl("$TOOL=TOOL_DATA[1]", "$BASE=$NULLFRAME", f"PTP {TARGET}")
    found = told("a.src", text, KUKA, entries(tool=["TOOL_DATA[1]", "$TOOL"], object=["$BASE", "other"]))
    assert [message.split(" of cell")[0] for message in found] == [
        'tool "$TOOL"',
        'work objects "$BASE" and "other"',
    ]
    assert 'its tools are "TOOL_DATA[1]" there' in found[0]


def test_no_name_is_offered_where_there_is_none():
    text = module(f"MoveJ {numbers(SEEN['pA'])},v100,fine,tool0;")
    found = told("a.mod", text, ABB, entries(tool=["tool0"], object=["WOBJ0"]))
    assert found == [
        'tool "tool0" of cell.toml changes nothing: the program has none of that name, '
        "it asks for no tool there"
    ]


@pytest.fixture(scope="module")
def positions_alone():
    arm = VirtualArm(ABB, seed=3)
    return ta.calibrate(ABB, arm.measure(arm.poses(60, seed=1)), ta.CalibrationOptions.of(model="constant"))


def notices_of(path, calibration, frames="", kinds=("frames", "tool")):
    compensator = ta.Compensator(calibration, limits=ta.Limits(largest_std_mm=None, largest_mm=20.0))
    given = Frames.parse(frames, where="cell.toml")
    done = ta.compensate_program(path, compensator, controller="nominal", frames=given)
    return [notice for notice in done.notices if notice.kind in kinds]


def test_tools_that_no_measurement_of_a_target_places_are_told(tmp_path, positions_alone):
    path = tmp_path / "a.mod"
    path.write_bytes(RAPID.encode("latin-1"))
    entry = "[tool.tG]\nxyz = [0, 0, 120.4]\n"
    for frames in ("", entry):
        (found,) = notices_of(path, positions_alone, frames)
        assert found.kind == "tool"
        assert 'tool "tG" is measured' in found.message
        assert found.message.endswith("truearm frame CALIB touches.csv --tool tG")
        assert "\n" not in found.message
    assert notices_of(path, positions_alone, entry + "identified = {residual_mm = 0.03}\n") == []
    bare = numbers(SEEN["pB"], tool=np.eye(4), placed=np.eye(4))
    two = module(f"MoveJ {numbers(SEEN['pA'])},{GO}\nMoveJ {bare},v1,fine,tool0;")
    path.write_bytes(two.encode("latin-1"))
    (found,) = notices_of(path, positions_alone)
    assert 'tools "tG" and "tool0" are measured' in found.message
    assert "Teach each again" in found.message
    arm = VirtualArm(ABB, seed=3)
    poses = arm.measure(arm.poses(60, seed=1), orientation=True)
    (found,) = notices_of(path, ta.calibrate(ABB, poses, ta.CalibrationOptions.of(model="constant")))
    assert "positions and orientations of its target alone" in found.message


TABLE = "[object.wT]\nxyz = [300, 0, 110]\n"


def test_work_objects_that_were_not_taught_through_the_calibration_are_told(tmp_path, positions_alone):
    path = tmp_path / "a.mod"
    path.write_bytes(RAPID.encode("latin-1"))
    for frames in ("", TABLE):
        (found,) = notices_of(path, positions_alone, frames, ["object"])
        assert 'work object "wT": not taught through the calibration' in found.message
        assert found.message.endswith("truearm frame CALIB points.csv --object wT --with-tool tG")
    elsewhere = TABLE.replace("300", "300.4")
    for frames in (TABLE + "identified = {residual_mm = 0.03}\n", elsewhere):
        assert notices_of(path, positions_alone, frames, ["object"]) == []


def test_the_controllers_world_is_no_work_object_to_teach(tmp_path, positions_alone):
    path = tmp_path / "a.mod"
    world = np.eye(4)
    world[:3, 3] = [0.05, 0.0, -0.12]
    wide = numbers(SEEN["pA"], placed=world)
    path.write_bytes(
        module(f"MoveJ {wide},v100,fine,tG;\nMoveL {wide},v100,fine,tG\\WObj:=WOBJ0;").encode("latin-1")
    )
    frames = "[object.wobj0]\nxyz = [50, 0, -120]\n"
    assert notices_of(path, positions_alone, frames, ["object"]) == []
    path.write_bytes(RAPID.encode("latin-1"))
    (found,) = notices_of(path, positions_alone, frames, ["object"])
    assert 'work object "wT": not taught' in found.message


@pytest.mark.parametrize("body", ["MoveJ pA,v100,fine,tG;", "MoveAbsJ jHome,v100,fine,tG\\WObj:=wT;"])
def test_the_base_and_joint_targets_have_no_work_object_to_teach(body, tmp_path, positions_alone):
    path = tmp_path / "a.mod"
    path.write_bytes(module(body, points()).encode("latin-1"))
    assert notices_of(path, positions_alone, "", ["object"]) == []


def test_the_measured_point_is_known_by_positions_alone(tmp_path, positions_alone):
    path = tmp_path / "a.csv"
    path.write_text("q1,q2,q3,q4,q5,q6\n0.1,0.2,0.3,0.4,0.9,0.5\n")
    point = 1e3 * positions_alone.model.setup.targets[0, 0]
    measured = f"[tool.tool]\nxyz = {point.tolist()}\n"
    beside = f"[tool.tool]\nxyz = {(point + np.array([0.0, 0.0, 0.5])).tolist()}\n"
    assert notices_of(path, positions_alone, measured) == []
    assert [notice.kind for notice in notices_of(path, positions_alone, beside)] == ["tool"]
    unasked = notices_of(path, positions_alone, measured + "[object.wTable]\nxyz = [1, 2, 3]\n")
    assert [notice.kind for notice in unasked] == ["frames"]
    assert 'work object "wTable" of cell.toml' in unasked[0].message


@pytest.mark.parametrize("xyz", ["[true, 2, 3]", '[1, "2", 3]'])
def test_text_and_truth_are_no_numbers_of_a_frame(xyz):
    with pytest.raises(InputError, match=r'"tool.a.xyz.[01]" is wrong: Input should be a valid number'):
        Frames.parse(f"[tool.a]\nxyz = {xyz}")
