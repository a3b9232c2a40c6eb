"""Programs whose author took the arm for another than the nominal one: --programming."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import truearm as ta
from tests.programs_rig import ABB, again, obeyed
from tests.test_programs_rapid import GO, module, numbers
from truearm.controller import Controller
from truearm.simulation import VirtualArm

TAUGHT_DEG = [[10, 10, 20, 15, 40, 30], [-20, 25, 5, -30, 50, 60]]
WIDE = ta.Limits(largest_mm=20.0, largest_deg=5.0)


def calibrated(robot):
    arm = VirtualArm(robot, seed=3)
    measured = arm.measure(arm.poses(60, seed=1), orientation=True)
    return ta.calibrate(robot, measured, model="constant")


@pytest.fixture(scope="module")
def irb():
    return calibrated(ABB)


def off(robot, scale=1e-3):
    """An arm of which no three axes meet in a point."""
    table = robot.table + np.random.default_rng(4).normal(0.0, scale, robot.table.shape)
    return replace(robot, table=table)


def test_authors_whose_tables_mean_something_else_are_not_taken_for_one_another(irb):
    other = replace(ABB, convention="modified")
    asked = ta.Compensator(irb, limits=WIDE)
    asked.joints(np.deg2rad(TAUGHT_DEG), author=ABB)
    found, wanted = (
        one.joints(np.deg2rad(TAUGHT_DEG), author=other) for one in (asked, ta.Compensator(irb, limits=WIDE))
    )
    assert [one.code for one in wanted.refusals] == [2, 2]
    assert found.refusals == wanted.refusals
    sliding = replace(ABB, joints=("prismatic", *ABB.joints[1:]))
    with pytest.raises(ta.InputError, match="has joints"):
        asked.joints(np.deg2rad(TAUGHT_DEG), author=sliding)


@pytest.mark.parametrize("controller", ["nominal", Controller.nominal(ABB)])
def test_a_nominal_controller_is_the_catalogues_whoever_the_author(irb, controller, tmp_path):
    """So are the postures of configuration data: the author's wrist axes need not meet."""
    author = off(ABB)
    moves = "\n".join(f"MoveJ {numbers(q, author=author)},{GO}" for q in TAUGHT_DEG)
    (tmp_path / "a.mod").write_text(module(moves), "latin-1")
    compensator = ta.Compensator(irb, programming=author, limits=WIDE)
    done = ta.compensate_program(tmp_path / "a.mod", compensator, controller=controller)
    assert [one.reason for one in done.listed] == []
    assert np.abs(np.rad2deg(done.nominal) - TAUGHT_DEG).max() < 1e-3
    assert np.abs(obeyed(again(done, ABB), ABB, done.corrected) - done.corrected).max() < 1e-5


def test_a_path_without_a_declared_controller_is_of_the_catalogues(irb, tmp_path):
    """Poses are of the tool in the author's robot file."""
    tool = np.eye(4)
    tool[:3, 3] = [0.01, 0.02, 0.1]
    author, (q, _) = replace(off(ABB), tool=tool), np.deg2rad(TAUGHT_DEG)
    pose = author.pose(q)
    values = [*q, *pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_rotvec()]
    head = "q1,q2,q3,q4,q5,q6,x,y,z,rx,ry,rz\n"
    (tmp_path / "a.csv").write_text(head + ",".join(f"{value:.9f}" for value in values) + "\n")
    done = ta.compensate_program(tmp_path / "a.csv", ta.Compensator(irb, programming=author, limits=WIDE))
    written = np.array([float(value) for value in done.contents[0].split(b"\n")[-2].split(b",")])[6:]
    obeyed_pose = Controller.nominal(ABB).pose(done.corrected[-1], tool)
    assert np.abs(written[:3] - obeyed_pose[:3, 3]).max() < 2e-6
    assert np.abs(Rotation.from_rotvec(written[3:]).as_matrix() - obeyed_pose[:3, :3]).max() < 2e-6


def test_the_differences_of_a_ur_are_those_to_the_arm_that_was_calibrated(tmp_path):
    """Also where the author saw the controller's poses, so that the programming model is the controller's."""
    robot = ta.Robot.load("ur10e")
    kinds, rng = ("theta", "d", "a", "alpha"), np.random.default_rng(4)
    rows = {kind: rng.normal(0.0, 5e-4, 6).round(6).tolist() for kind in kinds}
    conf, script = tmp_path / "calibration.conf", tmp_path / "a.script"
    conf.write_text("[mounting]\n" + "".join(f"delta_{kind} = {row}\n" for kind, row in rows.items()))
    factory = Controller.load(conf, robot=robot).robot
    q = np.array([0.3, -1.3, 1.6, -1.2, -1.4, 0.2])
    pose = Controller.nominal(factory).pose(q)
    words = ", ".join(f"{v:.9f}" for v in [*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_rotvec()])
    script.write_text(
        f"def p():\n  set_tcp(p[0,0,0,0,0,0])\n  movej({q.tolist()})\n  movel(p[{words}])\nend\n"
    )
    compensator = ta.Compensator(calibrated(robot), programming=factory, limits=WIDE)
    (tmp_path / "factory.toml").write_text(factory.to_toml())
    said = [
        ta.compensate_program(script, compensator, controller=one).contents[0].split(b"\n", 2)[2]
        for one in (conf, tmp_path / "factory.toml")
    ]
    assert said[0] == said[1]


def test_a_declared_model_is_held_against_the_arm_that_was_calibrated(irb, tmp_path):
    (tmp_path / "a.mod").write_text(module(f"MoveJ {numbers(TAUGHT_DEG[0])},{GO}"), "latin-1")
    other = ta.Robot.load("abb-irb-1200")
    compensator = ta.Compensator(irb, programming=other, limits=WIDE)
    with pytest.raises(ta.InputError, match="away from that of ABB IRB 120, which was calibrated"):
        ta.compensate_program(tmp_path / "a.mod", compensator, controller=Controller.nominal(other))


def test_a_program_in_the_language_of_another_maker_is_told(irb, tmp_path):
    (tmp_path / "a.src").write_text("DEF a()\nPTP {A1 10,A2 10,A3 20,A4 15,A5 40,A6 30}\nEND\n")
    done = ta.compensate_program(tmp_path / "a.src", ta.Compensator(irb), controller="nominal")
    assert "KRL is the language of KUKA's controllers" in str(done.notices[0])
