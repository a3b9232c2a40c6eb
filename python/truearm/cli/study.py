"""`truearm study`: simulations and comparisons that anybody can run again."""

from typing import Final

from truearm.cli.lazy import Entry

COMMANDS: Final = (
    Entry("paper", "truearm.cli.study_paper", "The paper's simulations, reproduced and measured."),
)
