"""Rewriting a program's text without a calibration: a compensator that shifts all joints."""

import re
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from truearm.controller import Controller
from truearm.errors import TruearmError
from truearm.programs.frames import Frames
from truearm.programs.rewriting import Choices, Models, rewrite
from truearm.programs.source import Source

NUMBER = re.compile(r"(?<![\w.])[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?![\w.])")


@dataclass
class Shift:
    """A compensator whose correction is the same everywhere."""

    by: object = 0.0
    tools: list = field(default_factory=list)

    def joints(self, q, *, tool=None, author=None):
        self.tools.append(tool)
        zeros = np.zeros(len(q))
        return SimpleNamespace(
            q=q + self.by,
            correction_mm=zeros,
            correction_mrad=zeros,
            residual_mm=zeros,
            residual_mrad=zeros,
            std_mm=zeros,
            refused=np.zeros(len(q), dtype=bool),
            refusals=(),
        )


def read(language, text, robot, frames=""):
    content = text if isinstance(text, str) else text.decode("latin-1")
    source = Source.of(Path(f"test{language.endings[0]}"), content)
    return language.read([source], robot, Frames.parse(frames))


class Bend:
    """A correction that varies with joint 1, added to an array of readings."""

    def __radd__(self, q):
        return q + 4e-3 * np.sin(6.0 * q[:, :1]) * np.eye(q.shape[1])[0]

    __array_ufunc__ = None


def rewritten(language, text, robot, *, by=0.0, frames="", mark="", spacing=None):
    """What rewriting gives, with every joint shifted by `by`, rad."""
    program = read(language, text, robot, frames)
    controller = Controller.nominal(robot)
    models = Models(robot, controller.inverse, controller, Shift(by))
    return rewrite(program, models, Choices(spacing=spacing), mark=mark)


def skeleton(text):
    """A text with its numbers left out."""
    return NUMBER.sub("#", text if isinstance(text, str) else text.decode("latin-1"))


def reasons(result):
    """What is listed: line, name and reason."""
    return [(one.line, one.name, one.reason) for one in result.listed]


def names_changed(result):
    """Names of the targets that were changed, or their lines where they have none."""
    program = result.program
    places = [program.sources[0].place(int(at))[0] for at in program.targets.at]
    changed = np.flatnonzero(result.changed)
    return [program.targets.names.get(int(target), places[target]) for target in changed]


def says(language, content, robot, frames=""):
    """Readings that a text says, of all targets."""
    return rewritten(language, content, robot, frames=frames).nominal


def survives(language, text, robot, frames="", **options):
    """Whether a text ends in a program or in an error with a place, and nothing else."""
    try:
        rewritten(language, text, robot, frames=frames, **options)
    except TruearmError as error:
        return bool(error.where)
    return True
