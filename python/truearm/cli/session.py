"""`truearm session`: look into a session file, or export its measurements."""

from typing import Final

from truearm.cli.entry import Entry

HELP: Final = """Look into a measurement session, or export its measurements.

Examples:
  truearm session show session.db
  truearm session export session.db -o measurements.csv
"""
COMMANDS: Final = (
    Entry("show", "truearm.cli.session_show", "What a session holds."),
    Entry("export", "truearm.cli.session_export", "Write the accepted measurements."),
)
