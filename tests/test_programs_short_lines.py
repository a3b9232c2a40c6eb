"""Linear moves with no room for waypoints: their deviation is computed all the same, and told."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.program_tools import Bend, rewritten
from truearm.programs.densify import Spacing
from truearm.programs.urscript import UrScript
from truearm.robot import Robot

UR10 = Robot.load("ur10")
HOME = [0.1, -1.2, 1.5, -1.8, -1.4, 0.2]
TOOL = np.eye(4)
TOOL[2, 3] = 0.2


def moved(shift, turn_deg):
    """A program with one line: the tool's point shifts, m, and the tool turns about its x axis."""
    here = UR10.flange_chain.pose(UR10.joints_from_readings(np.atleast_2d(HOME)))[0] @ TOOL
    there = np.array(here)
    there[:3, 3] += shift
    there[:3, :3] = here[:3, :3] @ Rotation.from_euler("x", turn_deg, degrees=True).as_matrix()
    words = ", ".join(f"{v:.9f}" for v in [*there[:3, 3], *Rotation.from_matrix(there[:3, :3]).as_rotvec()])
    return f"def p():\n  set_tcp(p[0,0,0.2,0,0,0])\n  movej({HOME})\n  movel(p[{words}])\nend\n"


def densified(text, deviation_mm, least_mm):
    return rewritten(UrScript(), text, UR10, by=Bend(), spacing=Spacing.of(deviation_mm, least_mm))


@pytest.mark.parametrize(("shift", "turn_deg", "least_mm"), [(0.4, 0, 201), (0, 60, 10), (0.015, -60, 10)])
def test_a_line_without_room_for_a_waypoint_is_named_where_it_needs_one(shift, turn_deg, least_mm):
    text = moved([0, 0, shift] if turn_deg else [0, shift, 0], turn_deg)
    done = densified(text, 1e-3, least_mm)
    assert done.inserted == 0
    (one,) = done.deviating
    assert one.listed.reason == f"it is shorter than twice the least spacing of {least_mm} mm"
    assert densified(text, 1.01 * one.deviation_mm, least_mm).deviating == ()
    (again,) = densified(text, 0.99 * one.deviation_mm, least_mm).deviating
    assert again.deviation_mm == one.deviation_mm


def test_the_deviation_does_not_change_where_room_begins():
    text = moved([0, 0.4, 0], 0)
    short, long = (densified(text, 1e-6, least_mm).deviating[0] for least_mm in (201, 199))
    assert short.deviation_mm == pytest.approx(long.deviation_mm, rel=0.05)
    assert "is too wide" in long.listed.reason


def test_a_short_line_that_turns_much_has_waypoints_no_closer_than_allowed():
    done = densified(moved([0.035, 0, 0], 75), 0.1, 10)
    assert done.deviating == ()
    assert done.inserted == 1
    said = re.findall(rb"movel\(p\[(.*?)\]", done.contents[0])
    waypoint, end = (np.array([float(v) for v in one.split(b",")[:3]]) for one in said)
    assert 0.01 <= np.linalg.norm(end - waypoint) <= 0.025


def test_a_line_from_where_the_arm_may_be_anywhere_is_named():
    """The head of the loop is reached from its end, too."""
    away = [0.7, *HOME[1:]]
    head = f"def p():\n  set_tcp(p[0,0,0.2,0,0,0])\n  movej({HOME})\n"
    lines = f"  movel({away})\n  movel({HOME})\n"
    straight = densified(f"{head}{lines}end\n", 0.1, 10)
    looped = densified(f"{head}  while True:\n{lines}  end\nend\n", 0.1, 10)
    assert straight.deviating == ()
    assert straight.inserted == 2 * looped.inserted > 0
    (one,) = looped.deviating
    reason = "where the arm comes from is not known"
    assert (one.listed.line, one.deviation_mm, one.listed.reason) == (5, None, reason)
    (notice,) = (notice for notice in looped.notices if notice.kind == "deviation")
    assert f"line 5 (how far is not known; {reason})" in notice.message
