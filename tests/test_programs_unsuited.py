"""What a program states and this arm or what is known of it does not settle is listed, and not guessed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import truearm as ta
from tests.program_tools import Bend, read, reasons, rewritten, survives
from truearm.cli import main
from truearm.programs.densify import Spacing
from truearm.programs.krl import KRL
from truearm.programs.melfa import MelfaBasic
from truearm.programs.rapid import RAPID
from truearm.programs.tp import FanucTp
from truearm.programs.urscript import UrScript
from truearm.robot import Robot
from truearm.simulation import VirtualArm
from truearm.turns import NearestTurns, with_turns

ARMS = ("kuka-kr-6-r900", "abb-irb-120", "ur10", "fanuc-lr-mate-200id")
KUKA, ABB, UR10, FANUC = (Robot.load(name) for name in ARMS)
IN_KRL = """DEF p()
$TOOL={X 0,Y 0,Z 0,A 0,B 0,C 0}
$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}
PTP {A1 9,A2 -80,A3 95,A4 0,A5 40,A6 1}
PTP {X 500,Y 0,Z 600,A 0,B 90,C 0,S 2,T 42}
PTP {A1 9,A2 -80,A3 95,A4 0,A5 40,A6 2}
END
"""
IN_RAPID = """MODULE M
CONST robtarget p1:=[[350,20,500],[0.5,0,0.866025,0],[0,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
PROC main()
MoveAbsJ [[0,10,20,0,40,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;
MoveJ p1,v100,fine,tool0;
ENDPROC
ENDMODULE
"""


def with_wrist_apart(robot, link, metres=2e-6):
    table = robot.table.copy()
    table[link, 2] += metres
    return replace(robot, table=table)


@pytest.mark.parametrize(
    ("language", "text", "robot"), [(KRL(), IN_KRL, KUKA), (RAPID(), IN_RAPID, ABB)], ids=["krl", "rapid"]
)
def test_configuration_data_of_an_arm_without_branches_is_not_passed_over(language, text, robot):
    told = reasons(rewritten(language, text, with_wrist_apart(robot, 4)))
    assert sum("its last three axes do not meet in a point" in reason for _, _, reason in told) == 1, told
    assert not any("do not meet" in reason for _, _, reason in reasons(rewritten(language, text, robot)))


def test_no_waypoints_are_put_in_where_the_tool_is_not_known():
    text = """def prog():
  movej([0.1, -1.2, 1.5, -1.8, -1.4, 0.2], a=1, v=1)
  movel([0.9, -1.4, 1.7, -1.2, -0.7, 1.4], a=1, v=0.2)
end
"""
    close = Spacing.of(0.3, 20)
    unknown = rewritten(UrScript(), text, UR10, by=Bend(), spacing=close)
    assert len(unknown.deviating) == 1
    assert unknown.inserted == 0
    known = rewritten(UrScript(), text, UR10, by=Bend(), frames="[tool.tcp]\nxyz=[0,0,200]\n", spacing=close)
    assert known.inserted > 0


def test_the_fourth_joint_of_a_scara_is_in_the_fourth_slot():
    text = "10 Mov J1\n20 Mov J2\n30 End\nJ1=(10.00,20.00,100.00,40.00,0.00,0.00)\n"
    text += "J2=(15.00,25.00,110.00,0.00,33.00,0.00)\n"
    done = rewritten(MelfaBasic(), text, Robot.load("adept-cobra-600"), by=[0.01, 0.01, 0.001, 0.02])
    assert np.degrees(done.nominal[0, 3]) == pytest.approx(40.0)
    first, second = done.contents[0].decode().splitlines()[-2:]
    assert first == "J1=(10.5730,20.5730,101.000,41.1459,0.00,0.00)"
    assert second == "J2=(15.00,25.00,110.00,0.00,33.00,0.00)"
    assert any("a joint that the arm has not" in reason for _, _, reason in reasons(done))


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """Where there is a calibration of an UR10."""
    place, arm = tmp_path_factory.mktemp("calibrated"), VirtualArm(UR10, seed=3)
    ta.calibrate(UR10, arm.measure(arm.poses(60)), model="constant").save(place / "arm.calib")
    return place


def test_a_report_beside_files_that_are_not_written_is_written(calibrated, monkeypatch, capsys):
    monkeypatch.chdir(calibrated)
    Path("none.script").write_text("def prog():\n  sleep(1.0)\nend\n")
    words = ["compensate", "arm.calib", "none.script", "--controller", "nominal", "-o", "new/"]
    assert main([*words, "--report", "new/r.json"]) == 1
    assert "nothing was changed" in capsys.readouterr().err
    assert Path("new/r.json").stat().st_size > 0


def test_fewer_joints_than_a_pose_needs_want_to_know_the_tool(calibrated, monkeypatch, capsys):
    monkeypatch.chdir(calibrated)
    Path("one.script").write_text("def prog():\n  movej([0.1, -1.2, 1.5, -1.8, -1.4, 0.2], a=1, v=1)\nend\n")
    words = ["compensate", "arm.calib", "one.script", "--controller", "nominal", "--dry-run"]
    assert main([*words, "--moving", "1,2,3"]) == 0
    told = " ".join(capsys.readouterr().err.split())
    assert "3 joints meet the position of one point first" in told
    assert main(words) == 0
    assert "of one point first" not in capsys.readouterr().err


def test_functions_that_call_each_other_many_times_are_walked_once():
    depth, calls = 9, 8
    lines = ["def prog():", f"  def f{depth}():", "    movel(p[0.4, 0.2, 0.5, 0, 3, 0])", "  end"]
    for level in reversed(range(depth)):
        lines += [f"  def f{level}():", *[f"    f{level + 1}()"] * calls, "  end"]
    lines += ["  set_tcp(p[0, 0, 0.2, 0, 0, 0])", "  f0()", "end"]
    program = read(UrScript(), "\n".join(lines), UR10)
    move = int(np.flatnonzero(program.moves.moving)[0])
    assert program.environments[int(program.moves.environment[move])].tool.true[2, 3] == pytest.approx(0.2)


HOME = "[[0,10,20,0,40,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
DEEP = {
    "a sum": (UrScript(), UR10, f"def p():\n x = {'+'.join(['1'] * 3000)}\n", "movej([0,0,0,0,0,0])\nend\n"),
    "indices": (UrScript(), UR10, f"def p():\n x = a{'[0]' * 3000}\n", "movej([0,0,0,0,0,0])\nend\n"),
    "conditions": (
        RAPID(),
        ABB,
        f"PROC main()\n{'IF a ' * 1500}",
        f"MoveAbsJ {HOME},v1,fine,tool0;\nENDPROC\n",
    ),
    "calls": (
        KRL(),
        KUKA,
        "DEF m()\nPTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}\ns0()\nEND\n",
        "".join(f"DEF s{n}()\ns{n + 1}()\nEND\n" for n in range(400)),
    ),
}


@pytest.mark.parametrize("name", DEEP)
def test_a_text_may_be_as_deep_as_it_likes(name):
    language, robot, before, behind = DEEP[name]
    assert len(read(language, before + behind, robot).moves) == 1


LONG = "9" * 5000
TOO_LONG = {
    "a position": (
        FanucTp(),
        FANUC,
        f"/MN\n 1:J P[{LONG}] 10% FINE ;\n/POS\nP[1]{{\n J1= 0 deg\n}};\n/END\n",
    ),
    "its number": (
        FanucTp(),
        FANUC,
        f"/MN\n 1:J P[1] 10% FINE ;\n/POS\nP[{LONG}]{{\n J1= 0 deg\n}};\n/END\n",
    ),
    "a frame": (FanucTp(), FANUC, f"/MN\n 1:  PR[{LONG},1]=0 ;\n 2:  UFRAME[{LONG}]=PR[1] ;\n/POS\n/END\n"),
    "a line": (MelfaBasic(), Robot.load("mitsubishi-rv-4fl"), f"{LONG} Mov J1\nJ1=(0,0,0,0,0,0)\n"),
    "bits": (KRL(), KUKA, f"DEF m()\nPTP {{X 400,Y 0,Z 500,A 0,B 90,C 0,S 'B{'1' * 2000}',T 35}}\nEND\n"),
    "an exponent": (UrScript(), UR10, f"def p():\n movej([0,0,0,0,0,0.1E-{LONG}])\nend\n"),
    "an exponent of RAPID": (
        RAPID(),
        ABB,
        f"PROC main()\nMoveAbsJ {HOME.replace('40', f'0e{LONG}')},v1,fine,tool0;\nENDPROC\n",
    ),
}


@pytest.mark.parametrize("name", TOO_LONG)
def test_a_number_may_have_more_digits_than_there_are_numbers_of(name):
    language, robot, text = TOO_LONG[name]
    assert survives(language, text, robot)


LIN = "LIN {X 400,Y 0,Z 500,A 0,B 90,C 0,S 2,T 35}\n"


@pytest.mark.parametrize(
    ("body", "known"),
    [("", True), ("again(n)\n", True), ("$TOOL=$NULLFRAME\n", False), ("FOREIGN()\n", False)],
)
def test_routines_of_krl_that_call_each_other_leave_the_tool_where_none_sets_it(body, known):
    text = f"DEF m()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nagain(1)\n{LIN}END\n"
    text += f"DEF again(n:IN)\nIF n>1 THEN\nother(n)\nENDIF\nEND\nDEF other(n:IN)\nagain(n-1)\n{body}END\n"
    program = read(KRL(), text, KUKA)
    assert program.environments[int(program.moves.environment[0])].tool.unknown[:18] == (
        "" if known else "tool: a subroutine"
    )


def test_a_joint_that_drives_a_screw_is_not_turned_by_a_full_turn():
    robot = Robot.load("adept-cobra-600")
    coupling, limits = robot.coupling.copy(), robot.limits.copy()
    coupling[2, 3], limits[3] = 0.02 / (2.0 * np.pi), [-7.0, 7.0]
    screw = replace(robot, coupling=coupling, limits=limits)
    branch, before = np.array([[[0.1, 0.2, 0.1, -2.0]]]), np.array([0.1, 0.2, 0.1, 4.0])
    free = replace(robot, limits=limits)
    assert len(with_turns(branch, free)[1]) == 2
    assert len(with_turns(branch, screw)[1]) == 1
    assert NearestTurns(free)(branch[0], before)[1][0, 3] == pytest.approx(2.0 * np.pi - 2.0)
    assert NearestTurns(screw)(branch[0], before)[1][0, 3] == -2.0
