"""The command line: `truearm COMMAND`, one module a command, loaded when it is called.

To add a command, write a module with a function `command` whose signature and docstring are its
options and its help, and name it in :data:`COMMANDS`. What is heavy is imported inside of functions: neither
help nor completion may wait for it, and Ctrl-C ends a command that is still being imported as any other.
"""

import sys
from collections.abc import Sequence
from typing import Final

from truearm.cli import console
from truearm.cli.display import DISPLAY
from truearm.cli.entry import Entry
from truearm.errors import UsageError

COMMANDS: Final = (
    Entry("demo", "truearm.cli.demo", "The whole way on a virtual arm."),
    Entry("robots", "truearm.cli.robots", "List the library of arms, show and check a robot."),
    Entry("import", "truearm.cli.import_", "Bring in other people's measurement tables."),
    Entry("calibrate", "truearm.cli.calibrate", "Learn an arm's parameters and validate them."),
    Entry("fleet", "truearm.cli.fleet", "Calibrate many arms and say which need attention."),
    Entry("plan", "truearm.cli.plan", "Choose measurement poses."),
    Entry("measure", "truearm.cli.measure", "Measure poses with the devices of a cell."),
    Entry("session", "truearm.cli.session", "Look into a measurement session, export it."),
    Entry("cell", "truearm.cli.cell", "A virtual cell; check a cell; cell files to begin with."),
    Entry("evaluate", "truearm.cli.evaluate", "Errors of a calibration on other measurements."),
    Entry("update", "truearm.cli.update", "Take a calibration over to an arm that was re-mastered."),
    Entry("report", "truearm.cli.report", "A calibration's report, as a page or a PDF."),
    Entry("frame", "truearm.cli.frame", "Teach a tool or a work object again."),
    Entry("strip", "truearm.cli.strip", "A calibration without its measurements, for controllers."),
    Entry("serve", "truearm.cli.serve", "Correct set-points that come over TCP."),
    Entry("export", "truearm.cli.export", "A calibration as URDF, D-H table or samples."),
    Entry("compensate", "truearm.cli.compensate", "Rewrite a robot program for the calibrated arm."),
    Entry("study", "truearm.cli.study", "Simulations and comparisons to run again."),
)
HELP: Final = """Robot arm calibration with Denavit-Hartenberg parameters that vary over the workspace.

Each command has examples: truearm COMMAND --help.

Examples:
  truearm demo
  truearm calibrate ur10 measurements.csv -o result
  truearm evaluate result/calibration.calib another_day.csv
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; its exit status: 0 done, 1 could not be done, 2 wrong usage, 130 interrupted.

    Args:
        arguments: Words behind `truearm`; those of the process by default.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    console.open_what_is_closed()
    console.say_all()
    try:
        _check_none_empty(given)
        from truearm.cli.lazy import build

        return build(COMMANDS, HELP)(given)
    except (Exception, KeyboardInterrupt) as error:
        DISPLAY.clear()
        status = console.exit_status(error)
        if status is None:
            raise
        return status
    finally:
        DISPLAY.clear()


def _check_none_empty(words: Sequence[str]) -> None:
    """Raise UsageError where an argument is empty: as a path it would be the working directory."""
    for before, word in zip(["", *words], words, strict=False):
        name, equals, value = word.partition("=")
        if not word or (name.startswith("--") and equals and not value):
            raise UsageError(
                "an argument is empty",
                where=name or (before if before.startswith("-") else ""),
                rule="A variable of the shell that is not set leaves such behind",
                way_out="Give it a value, or leave the option out",
            )
