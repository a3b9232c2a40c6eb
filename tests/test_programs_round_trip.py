"""Programs on a virtual arm: run as they were written, they miss; rewritten, they hit as well as calibrated.

The arm bends under its weight and a load, its joints have errors of their own, and it carries another load
than when it was measured: nothing of that is in the nominal model. Its controller computes with the nominal
kinematics, or, on Universal Robots' arm, with factory kinematics of its own. The tool was taught with the
uncorrected arm, and again through the calibrated one.
"""

import dataclasses
from functools import cache, cached_property
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from tests.virtual_controller import VirtualController, euler, numbers
from truearm.calibrating import calibrate
from truearm.calibration import Calibration
from truearm.compensation import Compensator
from truearm.controller import Controller
from truearm.framing import find_tool
from truearm.inverse import Inverse
from truearm.measurements import Measurements
from truearm.programs.frames import Frames
from truearm.programs.languages import LANGUAGES
from truearm.programs.program import Program
from truearm.programs.rewriting import Choices, Models, rewrite
from truearm.programs.source import Source
from truearm.robot import Robot
from truearm.rotations import quaternion_from_matrix
from truearm.simulation import Conditions, Deflection, Harmonic, Imperfections, JointError, Mass, VirtualArm

TOOL = np.eye(4)
TOOL[:3, :3] = Rotation.from_euler("ZYX", [30, 10, 5], degrees=True).as_matrix()
TOOL[:3, 3] = [0.02, -0.01, 0.12]
OBJECT = np.eye(4)
OBJECT[:3, :3] = Rotation.from_euler("ZYX", [15, 0, 5], degrees=True).as_matrix()
OBJECT[:3, 3] = [0.2, 0.05, -0.03]
STATED_TOOL = "{xyz = [20, -10, 120], euler_zyx_deg = [30, 10, 5]}"
OBJECT_ENTRY = "xyz = [200, 50, -30]\neuler_zyx_deg = [15, 0, 5]\n"
WAYPOINTS, MEASURED, TAUGHT, HELD_OUT = 30, 240, 20, 400
SPREAD_DEG = np.array([70.0, 25.0, 30.0, 60.0, 25.0, 120.0])
MEASURED_KG, CARRIED_KG = 1.0, 1.3
SHARE_OF_FACTORY = 0.4


@dataclasses.dataclass(frozen=True, eq=False)
class Cell:
    """An arm as it is, as it was calibrated, and what its controller takes it for."""

    arm: VirtualArm
    calibration: Calibration
    factory: Robot

    @property
    def robot(self):
        return self.arm.robot

    def misses_mm(self, q, wanted):
        """How far the tool is from where it is wanted (n, 4, 4), in the base, at readings (n, N)."""
        asked = self.world_from_base() @ wanted
        return 1e3 * np.linalg.norm(self.tool_in_world(q)[:, :3, 3] - asked[:, :3, 3], axis=1)

    def tool_in_world(self, q):
        """Where the tool really is, with the load that it carries when the program runs."""
        conditions = Conditions(payload_kg=CARRIED_KG)
        return self.arm.world_from_base @ self.arm.true_pose(q, tool=TOOL, conditions=conditions)

    @cached_property
    def tool(self):
        """The tool as it is taught again through the calibrated arm, from measured poses of it."""
        q = self.arm.poses(TAUGHT, seed=3)
        poses = self.tool_in_world(q)
        table = pd.DataFrame(q, columns=[f"q{k + 1}" for k in range(q.shape[1])])
        table[["x", "y", "z"]] = poses[:, :3, 3]
        table[["qw", "qx", "qy", "qz"]] = quaternion_from_matrix(poses[:, :3, :3])
        return find_tool(self.calibration, Measurements.from_dataframe(table)).transform

    def frames(self, tool, work_object=""):
        """A frames file with the tool as it was taught again, and as the controller has it."""
        xyz, turn = (1e3 * self.tool[:3, 3]).tolist(), quaternion_from_matrix(self.tool[:3, :3]).tolist()
        entry = f'[tool."{tool}"]\nxyz = {xyz}\nquaternion_wxyz = {turn}\ncontroller = {STATED_TOOL}\n'
        return entry + (f'[object."{work_object}"]\n{OBJECT_ENTRY}' if work_object else "")

    def world_from_base(self):
        """Where the calibration found the base to stand."""
        q, group = np.zeros(self.robot.joint_count), self.calibration.groups[0]
        in_world = self.calibration.pose(q, tool=TOOL, group=group)
        return in_world @ np.linalg.inv(self.calibration.pose(q, tool=TOOL))


@cache
def cell(name):
    robot = Robot.load(name)
    curves = [JointError(j, (Harmonic(1, 0.008, 30.0 * j), Harmonic(2, 0.005, 50.0 * j))) for j in (1, 2, 3)]
    imperfections = Imperfections(
        length_mm=0.3,
        angle_deg=0.03,
        share=0.0,
        noise_mm=0.02,
        noise_mrad=0.05,
        joint_errors=tuple(curves),
        deflection=Deflection(
            compliance=(0.0, 2e-6, 2e-6, 4e-6, 4e-6, 0.0),
            masses=(Mass(2, 5.0, (0.0, 0.0, 0.0)), Mass(3, 4.0, (0.0, 0.0, 0.0))),
        ),
    )
    arm = VirtualArm(robot, seed=5, imperfections=imperfections)
    data = arm.measure(arm.poses(MEASURED), orientation=True, conditions=Conditions(payload_kg=MEASURED_KG))
    calibration = calibrate(robot, data, model="constant", use="pose", seed=7)
    factory = dataclasses.replace(robot, table=robot.table + SHARE_OF_FACTORY * arm.errors)
    return Cell(arm, calibration, factory)


def waypoints(robot, around_deg, count=WAYPOINTS, seed=11):
    """Readings (n, 6) in a large part of the workspace, around a posture and away from singular ones."""
    rng = np.random.default_rng(seed)
    return np.deg2rad(around_deg + rng.uniform(-1.0, 1.0, (count, robot.joint_count)) * SPREAD_DEG)


def stored(robot, q, base_from_object=OBJECT):
    """Poses that a program would state."""
    flange = robot.flange_chain.pose(robot.joints_from_readings(q))
    return np.linalg.inv(base_from_object) @ flange @ TOOL


def configured(language, text, robot, frames, q):
    """What the language's configuration data is for readings `q`, (n, C)."""
    program = read(language, text, robot, frames)
    digits = program.configuration.digits(q)
    count = next(one.configuration for one in program.layouts if getattr(one, "configuration", 0))
    return program.configuration.text_of_digits(digits, np.zeros((len(q), count))).astype(int)


def urscript(robot, q, state=None):
    assert state is None, "there is no configuration data"
    tool = numbers([*TOOL[:3, 3], *Rotation.from_matrix(TOOL[:3, :3]).as_rotvec()], 12)
    lines = [f"movej([{numbers(q[0], 8)}])"]
    for row, pose in zip(q[1:], stored(robot, q[1:], np.eye(4)), strict=True):
        written = numbers([*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_rotvec()], 8)
        lines.append(f"movej(get_inverse_kin(p[{written}], qnear=[{numbers(row, 2)}]))")
    return f"def weld():\n  set_tcp(p[{tool}])\n  " + "\n  ".join(lines) + "\nend\n"


def krl(robot, q, state=None):
    joints = ",".join(f"A{k + 1} {value:.5f}" for k, value in enumerate(np.rad2deg(q[0])))
    lines = [
        "DEF weld()",
        "$TOOL=TOOL_DATA[1]",
        "$BASE={X 200,Y 50,Z -30,A 15,B 0,C 5}",
        f"PTP {{{joints}}}",
    ]
    for number, pose in enumerate(stored(robot, q[1:])):
        values = ",".join(f"{n} {v:.5f}" for n, v in zip("XYZABC", euler(pose), strict=True))
        s, t = (0, 0) if state is None else state[number]
        lines.append(f"PTP {{{values},S {s},T {t}}}")
    return "\n".join([*lines, "END", ""])


def rapid(robot, q, state=None):
    nine = "[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]"
    turn = np.roll(Rotation.from_matrix(TOOL[:3, :3]).as_quat(), 1)
    place = np.roll(Rotation.from_matrix(OBJECT[:3, :3]).as_quat(), 1)
    lines = [
        "MODULE weld",
        f"PERS tooldata gun:=[TRUE,[[20,-10,120],[{numbers(turn, 10)}]],[1.3,[0,0,50],[1,0,0,0],0,0,0]];",
        f'PERS wobjdata part:=[FALSE,TRUE,"",[[200,50,-30],[{numbers(place, 10)}]],[[0,0,0],[1,0,0,0]]];',
        "PROC main()",
        f"MoveAbsJ [[{numbers(np.rad2deg(q[0]), 5)}],{nine}],v100,fine,gun\\WObj:=part;",
    ]
    for number, pose in enumerate(stored(robot, q[1:])):
        quaternion = np.roll(Rotation.from_matrix(pose[:3, :3]).as_quat(), 1)
        cf = "0,0,0,0" if state is None else ",".join(str(value) for value in state[number])
        target = f"[[{numbers(1e3 * pose[:3, 3])}],[{numbers(quaternion, 8)}],[{cf}],{nine}]"
        lines.append(f"MoveJ {target},v100,fine,gun\\WObj:=part;")
    return "\n".join([*lines, "ENDPROC", "ENDMODULE", ""])


def fanuc(robot, q, state=None):
    main = [f"   {n}:J P[{n}] 20% FINE    ;" for n in range(1, len(q) + 1)]
    joints = ",\n".join(f"\tJ{k + 1}={value:11.5f} deg" for k, value in enumerate(np.rad2deg(q[0])))
    positions = [f"P[1]{{\n   GP1:\n\tUF : 1, UT : 2,\t\n{joints}\n}};"]
    for number, pose in enumerate(stored(robot, q[1:])):
        x, y, z, r, p, w = euler(pose)
        digits = (0, 0, 0, 0, 0, 0) if state is None else state[number]
        letters = " ".join(known[digit] for known, digit in zip(("NF", "UD", "TB"), digits, strict=False))
        config = f"{letters}, {numbers(digits[3:], 0)}"
        positions.append(
            f"P[{number + 2}]{{\n   GP1:\n\tUF : 1, UT : 2,\t\tCONFIG : '{config}',\n"
            f"\tX ={x:11.4f}  mm,\tY ={y:11.4f}  mm,\tZ ={z:11.4f}  mm,\n"
            f"\tW ={w:11.5f} deg,\tP ={p:11.5f} deg,\tR ={r:11.5f} deg\n}};"
        )
    return "\n".join(["/PROG  WELD", "/ATTR", "/MN", *main, "/POS", *positions, "/END", ""])


def melfa(robot, q, state=None):
    code = ["1 M_Tool=1", "2 Base 1", "3 Mov JHOME"]
    points = ["JHOME=(" + ",".join(f"{value:.5f}" for value in np.rad2deg(q[0])) + ")"]
    for number, pose in enumerate(stored(robot, q[1:]), 1):
        x, y, z, c, b, a = euler(pose)
        first, second = (7, 0) if state is None else state[number - 1]
        code.append(f"{number + 3} Mov P{number}")
        points.append(f"P{number}=({','.join(f'{v:+.4f}' for v in (x, y, z, a, b, c))})({first},{second})")
    return "\n".join([*code, *points, ""])


CASES = {
    "URScript": (urscript, "ur10e", [20, -80, 90, -100, -80, 30], ("tcp",)),
    "KRL": (krl, "kuka-kr-6-r900", [20, -80, 95, 20, 50, 30], ("TOOL_DATA[1]",)),
    "RAPID": (rapid, "abb-irb-120", [20, 10, 15, 20, 50, 30], ("gun",)),
    "FANUC TP": (fanuc, "fanuc-lr-mate-200id", [20, 20, -10, 20, -60, 30], ("2", "1")),
    "MELFA BASIC": (melfa, "mitsubishi-rv-4fl", [20, 20, 85, 20, 60, 200], ("1", "base 1")),
}


@dataclasses.dataclass(frozen=True, eq=False)
class Run:
    """One program in its cell."""

    here: Cell
    program: Program
    frames: str
    q: np.ndarray
    around: list

    @property
    def held_out_mm(self):
        """Mean error of the calibration at fresh poses, where the program works and at its tool."""
        q = waypoints(self.here.robot, self.around, HELD_OUT, seed=12)
        return self.here.misses_mm(q, self.here.calibration.pose(q, tool=self.here.tool)).mean()

    def rewritten(self, declared):
        """The program that is written when `declared` is said to be the controller's model."""
        robot = self.here.robot
        compensator = Compensator(self.here.calibration)
        models = Models(robot, Inverse(robot), Controller(declared), compensator)
        return rewrite(self.program, models, Choices())

    def misses_mm(self, program, controller):
        """What the tool misses by when a controller runs a program.

        A Cartesian target says where the tool is to be; joints say it through the nominal arm and the tool
        that the author had, which is the controller's.
        """
        robot = self.here.robot
        wanted = robot.flange_chain.pose(robot.joints_from_readings(self.q)) @ TOOL
        return self.here.misses_mm(VirtualController(controller).run(program), wanted)

    def again(self, done):
        """The program that was written, as the controller reads it."""
        text = done.contents[0].decode("latin-1")
        return read(self.program.language, text, self.here.robot, self.frames)


@cache
def run_of(name):
    write, arm, around, known = CASES[name]
    here = cell(arm)
    q, frames, language = waypoints(here.robot, around), here.frames(*known), language_named(name)
    text = write(here.robot, q)
    if name != "URScript":
        text = write(here.robot, q, configured(language, text, here.robot, frames, q[1:]))
    return Run(here, read(language, text, here.robot, frames), frames, q, around)


def language_named(name):
    return next(language for language in LANGUAGES if language.name == name)


def read(language, text, robot, frames):
    source = Source.of(Path(f"weld{language.endings[0]}"), text)
    return language.read([source], robot, Frames.parse(frames))


def controller_of(name, here):
    """What the controller really computes with."""
    return here.factory if name == "URScript" else here.robot


@pytest.mark.parametrize("name", CASES)
def test_a_rewritten_program_hits_as_well_as_the_arm_is_calibrated(name):
    run = run_of(name)
    controller = controller_of(name, run.here)
    before = run.misses_mm(run.program, controller)
    done = run.rewritten(controller)
    after = run.misses_mm(run.again(done), controller)
    assert [one.reason for one in done.listed] == []
    assert len(after) == WAYPOINTS
    assert after.mean() < 1.15 * run.held_out_mm
    assert after.mean() < 0.5 * before.mean()


@pytest.mark.parametrize("name", CASES)
def test_declaring_the_wrong_controller_makes_poses_visibly_worse(name):
    run = run_of(name)
    controller = controller_of(name, run.here)
    wrong = run.here.robot if controller is run.here.factory else run.here.factory
    right = run.misses_mm(run.again(run.rewritten(controller)), controller)
    misled = run.misses_mm(run.again(run.rewritten(wrong)), controller)
    assert misled[1:].mean() > 1.5 * right[1:].mean()
    assert misled[0] == pytest.approx(right[0], abs=1e-3), "joint targets do not depend on the declaration"
