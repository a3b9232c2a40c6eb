"""Names of the files that a calibration leaves in its directory; nothing heavy is imported."""

from typing import Final

CALIBRATION_NAME: Final = "calibration.calib"
SUMMARY_NAME: Final = "summary.json"
REPORT_NAME: Final = "report.html"
