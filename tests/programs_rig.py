"""What tests of programs share: a controller that obeys what it reads, and a stand-in for corrections."""

from types import SimpleNamespace

import numpy as np

from truearm.controller import Controller
from truearm.inverse import Inverse
from truearm.programs.frames import Frames
from truearm.programs.languages import language_of
from truearm.programs.layouts import of_joints
from truearm.programs.rewriting import Choices, Models, rewrite
from truearm.programs.source import Source
from truearm.programs.uses import Uses
from truearm.robot import Robot


class Shift:
    """Adds the same to all readings: what is written can be told from what was read.

    Where the author took the arm for another than `robot`, the readings of `robot` for the same flange.
    """

    def __init__(self, by_rad, refuse=(), robot=None, code=5):
        self.by_rad, self.refuse, self.robot, self.code = np.asarray(by_rad), refuse, robot, code

    def joints(self, q, *, tool=None, author=None):
        assert tool is None or np.shape(tool) == (4, 4)
        count = len(q)
        if author is not None:
            flange = author.flange_chain.pose(author.joints_from_readings(q))
            q = Inverse(self.robot).near(flange, q)
        refused = np.zeros(count, dtype=bool)
        refused[[place for place in self.refuse if place < count]] = True
        refusals = [
            SimpleNamespace(number=place + 1, reason="too far", code=self.code)
            for place in np.flatnonzero(refused)
        ]
        return SimpleNamespace(
            q=np.where(refused[:, None], np.nan, q + self.by_rad),
            correction_mm=np.full(count, 1.5),
            correction_mrad=np.full(count, 2.5),
            residual_mm=np.zeros(count),
            residual_mrad=np.zeros(count),
            std_mm=np.full(count, 0.1),
            refused=refused,
            refusals=tuple(refusals),
        )


def models(robot, by_rad=(1e-3, -1e-3, 5e-4, 1e-3, -1e-3, 2e-3), refuse=(), controller=None, code=5):
    """Programming and controller model of an arm, and a stand-in compensator."""
    shift = Shift(np.zeros(robot.joint_count) + by_rad, refuse, robot, code)
    return Models(robot, Inverse(robot), controller or Controller.nominal(robot), shift)


def read(name, text, robot, frames="", **others):
    """The program of a text, with further files by ending (dat="...")."""
    from pathlib import Path

    path = Path(name)
    sources = [Source.of(path, text)]
    sources += [Source.of(path.with_suffix(f".{ending}"), more) for ending, more in others.items()]
    return language_of(path).read(sources, robot, Frames.parse(frames))


def rewritten(program, given=None, **choices):
    """A program rewritten with the stand-in."""
    return rewrite(program, given, Choices(**choices))


def again(done, robot, frames=""):
    """The program that was written, read again."""
    texts = [content.decode("latin-1") for content in done.contents]
    sources = [Source.of(source.path, text) for source, text in zip(done.program.sources, texts, strict=True)]
    return done.program.language.read(sources, robot, Frames.parse(frames))


def obeyed(program, robot, before):
    """Readings (t, N) that a controller moves to: joints as they stand, poses by its own inverse kinematics.

    Independent of what wrote them: all readings of a pose with all turns, those kept that the
    configuration data names exactly; one must be left. Without such data the nearest to `before` (t, N).
    """
    uses, targets = Uses.of(program), program.targets
    inverse = Inverse(robot)
    found = np.full((len(targets), robot.joint_count), np.nan)
    for target in range(len(targets)):
        layout = program.layouts[targets.layout[target]]
        places = slice(targets.first[target], targets.first[target + 1])
        values = (targets.values[places] * targets.factors[places])[None]
        if of_joints(layout):
            found[target] = layout.to_readings(values)[0]
            continue
        if uses.environment[target] < 0:
            continue
        environment = program.environments[uses.environment[target]]
        width = layout.width - layout.configuration
        base_from_tool = (
            environment.work_object.controller
            @ environment.before
            @ layout.to_poses(values[:, :width])[0]
            @ environment.after
        )
        flange = base_from_tool @ np.linalg.inv(environment.tool.controller)
        candidates = inverse.solutions(flange, turns=True)
        stated = values[:, width:]
        if layout.configuration and np.isfinite(stated).all():
            candidates = candidates[named(program, candidates, stated)]
            assert len(candidates) == 1, f"target {target}: {np.rad2deg(candidates)}"
            found[target] = candidates[0]
        else:
            found[target] = candidates[np.abs(candidates - before[target]).max(axis=1).argmin()]
    return found


def named(program, candidates, stated):
    """Which candidates the configuration data names, by the vendor's definition written out here again."""
    degrees = np.rad2deg(candidates)
    if program.language.name == "RAPID":
        quarters = np.floor(degrees[:, [0, 3, 5]] / 90.0)
        negative = degrees[:, 4] < 0.0
        agree = (quarters == stated[:, :3]).all(axis=1)
        return agree & (negative == (int(stated[0, 3]) & 1))
    turns = ((degrees < 0.0) * 2 ** np.arange(6)).sum(axis=1)
    flipped = degrees[:, 4] < 0.0
    return (turns == (int(stated[0, 1]) & 63)) & (flipped == bool(int(stated[0, 0]) & 4))


KUKA, ABB = Robot.load("kuka-kr-6-r900"), Robot.load("abb-irb-120")
