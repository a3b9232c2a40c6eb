"""`truearm study`: simulations and comparisons that anybody can run again."""

from typing import Final

from truearm.cli.entry import Entry

HELP: Final = """Simulations and comparisons that anybody can run again.

Examples:
  truearm study paper -o study --seeds 1 --figure 6
  truearm study accuracy ur10=measurements.csv -o accuracy
  truearm study experiment -o experiment
"""
COMMANDS: Final = (
    Entry("paper", "truearm.cli.study_paper", "The paper's simulations, reproduced and measured."),
    Entry("experiment", "truearm.cli.study_experiment", "The paper's experiment, on the virtual cell."),
    Entry("accuracy", "truearm.cli.study_accuracy", "Our models and other methods on your measurements."),
)
