"""Reports that people read: self-contained pages, their figures, and the report of a calibration.

`truearm.reporting.page` makes a page of any sections; `truearm.reporting.report` the one of a calibration.
"""
