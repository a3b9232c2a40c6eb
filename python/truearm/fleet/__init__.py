"""Many arms: calibrated over processes or a cluster, judged side by side, held against the last time."""

from truearm.fleet.fleet_file import Fleet
from truearm.fleet.running import FleetRun, run_fleet

__all__ = ["Fleet", "FleetRun", "run_fleet"]
