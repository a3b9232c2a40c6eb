"""Measurements as work on them begins: they can be of the arm, nothing is held twice, a pose is one row."""

from truearm.doubts.plausibility import check_against
from truearm.doubts.points_together import points_together
from truearm.errors import Notice
from truearm.measurements import Measurements
from truearm.robot import Robot


def admitted(data: Measurements, robot: Robot) -> tuple[Measurements, list[Notice]]:
    """The rows to work with, each once and with all targets of its pose, and what the user should know.

    Raises:
        InputError: If they cannot be of `robot`, or only some of them hold distances.
    """
    notices = check_against(data, robot)
    rows, together = points_together(data.deduplicated())
    return rows, [*notices, *together]
