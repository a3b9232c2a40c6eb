"""Targets behind lines over places that are not known: the arm is in the posture in which it was before."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.program_tools import names_changed, reasons, rewritten, says
from tests.test_programs_following import UR10 as ROBOT
from tests.test_programs_following import arrives, p_of, pose
from truearm.programs.open_turns import TURNS_OPEN
from truearm.programs.solving import UNKNOWN_BEFORE
from truearm.programs.urscript import UrScript
from truearm.units import FULL_TURN

UR = UrScript()
HOME = np.array([0.1, -1.5, 1.6, -1.7, -1.55, 0.2])
BY = 1e-3
SOMEWHERE = "movel(get_target_tcp_pose())"


def near(number):
    """Readings some centimetres from home."""
    return HOME + 0.03 * number * np.array([1.0, 0.5, -1.0, 0.5, 0.2, 1.0])


def program(*lines, start=HOME):
    """Line 1 and 2 set the TCP and go to the start."""
    return "\n".join(["set_tcp(p[0,0,0,0,0,0])", f"movej({start.tolist()})", *lines, ""])


def to(q):
    return f"movel({p_of(q)})"


def pose_of(content, line):
    """The pose (4, 4) that is written in a line."""
    numbers = content.decode().splitlines()[line - 1].partition("p[")[2].partition("]")[0]
    values = np.array([float(number) for number in numbers.split(",")])
    found = np.eye(4)
    found[:3, 3], found[:3, :3] = values[:3], Rotation.from_rotvec(values[3:]).as_matrix()
    return found


class Varying:
    """A correction that varies with a joint, as often in a turn as is said."""

    def __init__(self, often, axis):
        self._often, self._axis = often, axis

    __array_ufunc__ = None

    def __radd__(self, q):
        return q + 1e-3 * np.cos(self._often * q[:, self._axis, None])


@pytest.mark.parametrize("somewhere", [SOMEWHERE, "movep(there)", f"movec({p_of(near(1))}, there)"])
def test_one_place_that_is_not_known_costs_no_other_target(somewhere):
    places = [near(number) for number in range(1, 6)]
    text = program(to(places[0]), somewhere, *map(to, places[1:]))
    result = rewritten(UR, text, ROBOT, by=BY)
    assert {line for line, _, _ in reasons(result)} == {4}
    assert set(names_changed(result)) >= {2, 3, 5, 6, 7, 8}
    assert np.abs(result.nominal[-5:][1:] - places[1:]).max() < 1e-6
    assert np.abs(says(UR, result.contents[0], ROBOT)[-4:] - places[1:] - BY).max() < 2e-6


def test_a_target_that_is_left_is_passed_in_the_posture_before_it():
    left = f"there = {p_of(near(1))}"
    lines = [left, "socket_send_string(there)", "movel(there)", to(near(2)), to(near(3))]
    result = rewritten(UR, program(*lines), ROBOT, by=BY)
    assert [name for _, name, _ in reasons(result)] == ["there"]
    assert names_changed(result) == [2, 6, 7]


@pytest.mark.parametrize(
    "somewhere",
    [
        "movej(get_target_joint_positions())",
        f"{SOMEWHERE}\nmovej(there)\n{SOMEWHERE}",
        "speedl([0, 0, 0.1, 0, 0, 0], 0.5, 1)",
        f"while get_digital_in(1):\n  {SOMEWHERE}\nend",
        f"if get_digital_in(1):\n  {SOMEWHERE}\nend",
        f"x = {SOMEWHERE}",
    ],
)
def test_behind_anything_else_no_posture_is_known(somewhere):
    result = rewritten(UR, program(somewhere, to(near(1)), to(near(2))), ROBOT, by=BY)
    assert [reason for _, _, reason in reasons(result)][-2:] == [UNKNOWN_BEFORE] * 2
    assert names_changed(result) == [2]


def test_joint_by_joint_from_turns_that_are_not_known_no_solution_is_the_nearest_for_certain():
    lines = [SOMEWHERE, to(near(1)), f"movej({p_of(near(2))})"]
    result = rewritten(UR, program(*lines), ROBOT, by=BY)
    assert names_changed(result) == [2, 4]
    assert reasons(result)[-1][2] == UNKNOWN_BEFORE
    known = rewritten(UR, program(*lines[1:]), ROBOT, by=BY)
    assert known.changed.all()


def test_where_a_joint_turns_by_more_than_a_quarter_the_posture_is_not_told():
    turned = HOME + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.7])
    lines = [SOMEWHERE, to(turned)]
    result = rewritten(UR, program(*lines), ROBOT, by=BY)
    assert reasons(result)[-1][2] == UNKNOWN_BEFORE


def test_from_a_singularity_no_posture_is_told():
    straight = np.array(HOME)
    straight[4] = 0.0
    result = rewritten(UR, program(SOMEWHERE, to(near(1)), start=straight), ROBOT, by=BY)
    assert reasons(result)[-1][2] == UNKNOWN_BEFORE


@pytest.mark.parametrize(("often", "told"), [(1, []), (3, []), (0.5, [TURNS_OPEN] * 2)])
def test_a_correction_that_depends_on_turns_is_left(often, told):
    """On such lines the last joint may make a full turn, so that the arm is not where it seems nearest."""
    full = -FULL_TURN * np.eye(6)[5]
    q = near(1)
    for share in (0.3, 0.3, 0.4):
        q = arrives(ROBOT, q, pose(ROBOT, q + share * full))
    assert np.abs(q - near(1) - full).max() < 1e-6
    lines = [to(near(1)), *[SOMEWHERE] * 3, to(near(1)), to(near(2))]
    varying = Varying(often, axis=5)
    result = rewritten(UR, program(*lines), ROBOT, by=varying)
    assert [reason for line, _, reason in reasons(result) if line > 6] == told
    if not told:
        truly = pose(ROBOT, q[None] + varying)
        assert np.abs(pose_of(result.contents[0], line=7) - truly).max() < 3e-6
