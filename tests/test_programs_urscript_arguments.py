"""Arguments of URScript's functions: by place or by name, and those that change what the others mean."""

import numpy as np
import pytest

from tests.program_tools import Bend, names_changed, reasons, rewritten, says
from tests.test_programs_urscript import PATH, SHIFT, UR, pose_text
from truearm.programs.densify import Spacing
from truearm.programs.tables import Motion
from truearm.programs.urscript_reader import PERHAPS_ALONG, TURNED_ALONG
from truearm.robot import Robot

FRAME = "p[0.05, 0.02, 0, 0, 0, 0.1]"
START = f"set_tcp(p[0, 0, 0.1203, 0, 0, 0])\nmovej({PATH[0].tolist()})\n"


@pytest.fixture(scope="module")
def robot():
    return Robot.load("ur10e")


NAMED = [
    "pose_trans(p_from_to={framed}, p_from={FRAME})",
    "pose_trans(pose_inv(p_from=pose_inv({FRAME})), p_from_to={framed})",
    "pose_add(p_2=p[0, 0, 0.01, 0, 0, 0], p_1={lower})",
    "pose_sub(p_from=p[0, 0, sqrt(f=0.0001), 0, 0, 0], p_to={higher})",
    "get_inverse_kin(qnear={near}, x={plain})",
]


@pytest.mark.parametrize("target", NAMED)
def test_arguments_by_name_may_come_in_any_order(robot, target):
    plain = pose_text(robot, PATH[1])
    x, y, z, *turn = plain.split(", ")
    places = {
        "framed": pose_text(robot, PATH[1], feature=np.array([0.05, 0.02, 0.0, 0.0, 0.0, 0.1])),
        "lower": ", ".join([x, y, f"{float(z) - 0.01:.9f}", *turn]),
        "higher": ", ".join([x, y, f"{float(z) + 0.01:.9f}", *turn]),
        "plain": plain,
    }
    written = {name: f"p[{numbers}]" for name, numbers in places.items()}
    text = START + f"movel({target.format(FRAME=FRAME, near=PATH[1].tolist(), **written)})\n"
    result = rewritten(UR, text, robot, by=SHIFT)
    assert reasons(result) == []
    (moved,) = result.program.moves.target[result.program.moves.motion == Motion.LINEAR]
    assert np.abs(result.nominal[moved] - PATH[1]).max() < 1e-7
    assert np.abs(says(UR, result.contents[0], robot)[moved] - PATH[1] - SHIFT).max() < 1e-6


OTHERS = {
    "pose_trans(p_from=p[{0}], p_to=p[{1}])": "pose_trans is given other arguments than p_from and p_from_to",
    "pose_add(p_2=p[{0}], p[{1}])": "pose_add is given other arguments than p_1 and p_2",
    "pose_sub(p[{0}])": "pose_sub is given other arguments than p_to and p_from",
    "get_inverse_kin(p[{0}], near=[0, 0, 0, 0, 0, 0])": 'get_inverse_kin has no argument "near"',
    "get_forward_kin(tcp=p[{0}])": "its target is computed by get_forward_kin when the program runs",
}


@pytest.mark.parametrize("target", OTHERS)
def test_a_target_of_other_arguments_is_listed(robot, target):
    places = [pose_text(robot, q) for q in PATH[:2]]
    result = rewritten(UR, START + f"movel({target.format(*places)})\n", robot, by=SHIFT)
    assert names_changed(result) == [2]
    assert [reason for _, _, reason in reasons(result)] == [OTHERS[target]]


def test_tcp_and_payload_are_read_by_name(robot):
    text = (
        'set_tcp(tcp_name="grip", pose=p[0, 0, 0.1203, 0, 0, 0])\n'
        "set_target_payload(cog=[0, 0, 0.05], m=1.25)\n"
        f"movej({PATH[0].tolist()})\nmovel(p[{pose_text(robot, PATH[1])}])\n"
    )
    result = rewritten(UR, text, robot, by=SHIFT)
    assert result.changed.all()
    assert np.abs(result.nominal - PATH[:2]).max() < 1e-7
    assert {one.payload_kg for one in result.program.environments} == {1.25}


MODES = {
    "": None,
    ", mode=0": None,
    ", mode=kept": None,
    ", 1.2, 0.25, 0, 1": TURNED_ALONG,
    ", mode=1": TURNED_ALONG,
    ", mode=2": PERHAPS_ALONG,
    ", mode=get_digital_in(2)": PERHAPS_ALONG,
}


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("end", ["p", "q", "there"])
def test_an_arc_that_turns_the_tool_along_does_not_end_as_its_target_is_turned(robot, mode, end):
    """Script Manual, movec: of pose_to "only position is used in Fixed orientation mode"."""
    via, there, behind = (f"p[{pose_text(robot, q)}]" for q in PATH[1:4])
    to = {"p": there, "q": PATH[2].tolist(), "there": "there"}[end]
    text = f"kept = 0\nthere = {there}\n{START}movec({via}, {to}{mode})\nmovel({behind})\n"
    result = rewritten(UR, text, robot, by=Bend(), spacing=Spacing.of(1e-3, 2.0))
    told = [reason for _, _, reason in reasons(result)]
    if MODES[mode] is None:
        assert told == []
        assert result.changed.all()
        assert result.inserted > 0
    else:
        assert told == [MODES[mode], MODES[mode]]
        assert names_changed(result) == [4, 6]
        assert result.inserted == 0
        assert [notice.kind for notice in result.notices] == ["steps"]


def test_a_pose_of_such_an_arc_is_changed_for_no_other_motion(robot):
    via, there, behind = (f"p[{pose_text(robot, q)}]" for q in PATH[1:4])
    joints = f"movej({PATH[3].tolist()})\n"
    text = f"there = {there}\n{START}movec({via}, there, mode=1)\n{joints}movel(there)\nmovel({behind})\n"
    result = rewritten(UR, text, robot, by=SHIFT)
    assert [reason for _, name, reason in reasons(result) if name == "there"] == [TURNED_ALONG]
