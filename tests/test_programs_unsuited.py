"""What a program states and this arm or what is known of it does not settle is listed, and not guessed."""

from dataclasses import replace

import numpy as np
import pytest

from tests.program_tools import Bend, read, reasons, rewritten
from truearm.cli import main
from truearm.programs.densify import Spacing
from truearm.programs.krl import KRL
from truearm.programs.melfa import MelfaBasic
from truearm.programs.rapid import RAPID
from truearm.programs.urscript import UrScript
from truearm.robot import Robot
from truearm.simulation import VirtualArm

KUKA, ABB, UR10 = (Robot.load(name) for name in ("kuka-kr-6-r900", "abb-irb-120", "ur10"))
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


def test_a_report_beside_files_that_are_not_written_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arm = VirtualArm(UR10, seed=3)
    arm.measure_table(arm.poses(60)).to_csv("m.csv", index=False)
    assert main(["calibrate", "ur10", "m.csv", "-o", "out", "--model", "constant"]) == 0
    (tmp_path / "none.script").write_text("def prog():\n  sleep(1.0)\nend\n")
    words = ["compensate", "out/calibration.calib", "none.script", "--controller", "nominal", "-o", "new/"]
    assert main([*words, "--report", "new/r.json"]) == 1
    assert "nothing was changed" in capsys.readouterr().err
    assert (tmp_path / "new" / "r.json").stat().st_size > 0


def test_functions_that_call_each_other_many_times_are_walked_once():
    depth, calls = 9, 8
    lines = ["def prog():", f"  def f{depth}():", "    movel(p[0.4, 0.2, 0.5, 0, 3, 0])", "  end"]
    for level in reversed(range(depth)):
        lines += [f"  def f{level}():", *[f"    f{level + 1}()"] * calls, "  end"]
    lines += ["  set_tcp(p[0, 0, 0.2, 0, 0, 0])", "  f0()", "end"]
    program = read(UrScript(), "\n".join(lines), UR10)
    move = int(np.flatnonzero(program.moves.moving)[0])
    assert program.environments[int(program.moves.environment[move])].tool.true[2, 3] == pytest.approx(0.2)
