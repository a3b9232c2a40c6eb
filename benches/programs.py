"""Rewriting a program, against copying its file line by line in Python."""

import json
import tempfile
from pathlib import Path

import numpy as np

import truearm as ta
from benches.ours import measured_with_threads
from benches.timing import Comparison, Results, seconds_of
from truearm.compensation import Compensator
from truearm.controller import Controller
from truearm.inverse import Inverse
from truearm.programs.frames import Frames
from truearm.programs.languages import language_of
from truearm.programs.outputs import write_outputs
from truearm.programs.rewriting import Choices, Models, read_program, rewrite
from truearm.simulation import VirtualArm

MOVES = 100_000
TARGET = 1.0 / 3.0
MARK = "compensated by truearm"


def path_of_joints():
    """A path (n, 6), rad, that an arm could follow."""
    at = np.linspace(0.0, 200.0, MOVES)[:, None]
    return np.array([0.3, -1.2, 1.4, -0.8, 0.9, 0.2]) + 0.4 * np.sin(at * np.arange(1, 7) / 7.0)


def write_program(path):
    lines = (
        f"  movej([{', '.join(f'{v:.6f}' for v in q)}], a=1.4, v=1.05, r=0.002)" for q in path_of_joints()
    )
    path.write_text("def main():\n" + "\n".join(lines) + "\nend\n")


def copied(source, target):
    """The file line by line through Python."""
    with source.open() as lines, target.open("w") as out:
        for line in lines:
            out.write(line)


def models():
    """A UR10 with constant parameters and the arms around it."""
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(60), orientation=True), model="constant")
    robot = calibration.robot
    return Models(robot, Inverse(robot), Controller.nominal(robot), Compensator(calibration))


def rewritten(source, target, given):
    """The file read, corrected and written."""
    program = read_program(source, language_of(source), given.programming, Frames())
    done = rewrite(program, given, Choices(), mark=MARK)
    write_outputs([target], done.contents)
    return done


def seconds():
    """Times of both, s, after a look at what was written."""
    given = models()
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder, "in.script"), Path(folder, "out.script")
        write_program(source)
        done = rewritten(source, target, given)
        wanted = given.compensator.joints(path_of_joints().round(6)).q
        if not done.changed.all() or np.abs(done.corrected - wanted).max() > 1e-9:
            raise RuntimeError("the program says something else than the compensator")
        ours = seconds_of(lambda: rewritten(source, target, given))
        return {"ours": ours, "copy": seconds_of(lambda: copied(source, target))}


def run():
    """Compare on one thread and on two."""
    single, double = (measured_with_threads("programs", threads) for threads in (1, 2))
    work = f"URScript of {MOVES} joint moves, read, corrected, written"
    return Results(
        "Programs",
        [
            Comparison(f"{work}, {words}", "copy line by line", found["ours"], found["copy"], TARGET)
            for words, found in (("one thread", single), ("two threads", double))
        ],
        remarks=["A ratio of 0.33 is three times as long as copying."],
    )


if __name__ == "__main__":
    print(json.dumps(seconds()))
