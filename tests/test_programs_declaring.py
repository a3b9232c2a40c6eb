"""Which model a controller computes with, and whose controllers a program is for."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.programs_rig import ABB, KUKA, read
from tests.test_controller import CONF
from truearm.controller import Controller
from truearm.errors import InputError, UsageError, WorkError
from truearm.programs.declaring import (
    declared_controller,
    may_differ,
    refuse_another_arm,
    refuse_contradiction,
)
from truearm.programs.languages import language_of
from truearm.programs.notices import language_notices
from truearm.robot import Robot


def test_controllers_that_may_differ_must_be_declared():
    for name, language in (
        ("kuka-kr-6-r900", "KRL"),
        ("abb-irb-120", "RAPID"),
        ("ur10e", "KRL"),
        ("fanuc-lr-mate-200id", "FANUC TP"),
    ):
        with pytest.raises(UsageError, match="not declared.*--controller"):
            declared_controller(None, language_of(Path("p"), language), Robot.load(name))
        assert may_differ(Robot.load(name))
        assert (
            declared_controller("nominal", language_of(Path("p"), language), Robot.load(name)).kind
            == "nominal"
        )


def test_of_universal_robots_only_a_simulated_arm_is_said_to_be_nominal():
    for name, language in (("ur10e", "KRL"), ("rv-m2", "URScript")):
        with pytest.raises(UsageError, match=r"calibration\.conf out of.*Only a simulated arm is nominal"):
            declared_controller(None, language_of(Path("p"), language), Robot.load(name))
    with pytest.raises(UsageError, match="--controller nominal if it has none"):
        declared_controller(None, language_of(Path("p"), "KRL"), KUKA)


@pytest.mark.parametrize("name", ["abb_irb120", "ur10_robot", "FANUC-R2000", "KUKA_KR6"])
def test_names_that_urdfs_give_tell_makers_too(name):
    assert may_differ(replace(ABB, name=name))


def test_a_language_of_another_maker_is_told():
    rapid, krl, csv = (language_of(Path(name)) for name in ("p.mod", "p.src", "p.csv"))
    (notice,) = language_notices(rapid, Robot.load("fanuc-lr-mate-200id"))
    assert notice.kind == "language"
    assert "RAPID is the language of ABB's controllers, and the calibration is of FANUC LR" in notice.message
    assert language_notices(rapid, Robot.load("staubli-tx2-90l"))
    for language, name in ((rapid, "abb-irb-120"), (krl, "kuka-iiwa-7"), (csv, "ur5"), (krl, "rv-m2")):
        assert not language_notices(language, Robot.load(name))


def test_other_controllers_need_not():
    arm = Robot.load("rv-m2")
    assert not may_differ(arm)
    assert declared_controller(None, language_of(Path("p"), "MELFA BASIC"), arm).kind == "nominal"


def test_a_nominal_controller_contradicts_points_of_an_accurate_one():
    text = "DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nPTP {X 500,Y 0,Z 500,A 0,B 90,C 0,S 10,T 2}\nEND\n"
    program = read("a.src", text, KUKA)
    with pytest.raises(WorkError, match="absolutely accurate"):
        refuse_contradiction(program, Controller.nominal(KUKA), force=False)
    refuse_contradiction(program, Controller.nominal(KUKA), force=True)
    refuse_contradiction(program, Controller(KUKA, "factory", "f"), force=False)


@pytest.mark.parametrize(
    ("arm", "other"),
    [("ur10", "ur5"), ("abb-irb-120", "abb-irb-1200"), ("ur3", "ur3e"), ("kuka-iiwa-7", "kuka-iiwa-14")],
)
def test_the_model_of_another_arm_is_refused(arm, other):
    robot, wrong = Robot.load(arm), Robot.load(other)
    refuse_another_arm(Controller(robot, "factory", "own.toml"), robot)
    with pytest.raises(InputError, match=r"other\.toml: .* its flange is up to \d+ mm .* 20 mm and 3 deg"):
        refuse_another_arm(Controller(wrong, "factory", "other.toml"), robot)


def test_the_factory_kinematics_of_the_arm_are_no_other_arm(tmp_path):
    """Its parameters differ by metres, and poses of its flange by millimetres."""
    path, robot = tmp_path / "calibration.conf", Robot.load("ur10")
    path.write_text(CONF)
    refuse_another_arm(Controller.load(path, robot=robot), robot)
    path.write_text(CONF.replace("81.328", "81.228"))
    with pytest.raises(InputError, match="away from that of UR10, which was calibrated"):
        refuse_another_arm(Controller.load(path, robot=robot), robot)


def test_a_base_that_is_turned_is_refused_by_the_angle():
    base = np.eye(4)
    base[:2, :2] = [[-1.0, 0.0], [0.0, -1.0]]
    with pytest.raises(InputError, match=r"180\.0 deg away"):
        refuse_another_arm(Controller(replace(ABB, base=base, base_row=None), "factory", "ros.urdf"), ABB)
