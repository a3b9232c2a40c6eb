"""KUKA KRL: what is read, what is written, what is listed."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.program_tools import Bend
from tests.programs_rig import KUKA, again, models, obeyed, read, rewritten
from truearm.errors import InputError, TruearmError
from truearm.programs.branches import Branches
from truearm.programs.densify import Spacing
from truearm.programs.krl_status import StatusAndTurn
from truearm.programs.rewriting import Choices, rewrite

TOOL = '[tool."TOOL_DATA[1]"]\nxyz = [10, 0, 120]\neuler_zyx_deg = [0, 30, 0]\n'
SRC = """&ACCESS RVP\r
&REL 3\r
DEF weld( )\r
;FOLD INI\r
BAS (#INITMOV,0 )\r
;ENDFOLD (INI)\r
$TOOL=TOOL_DATA[1]\r
$BASE={X 500,Y 0,Z 100,A 0,B 0,C 0}\r
PTP {A1 0,A2 -90,A3 90,A4 0,A5 45.5,A6 0} ; LIN {X 1} is no code, \xfcber\r
;FOLD PTP P1 Vel=100 % PDAT1 Tool[1] Base[2];%{PE}%R 8.3\r
PDAT_ACT=PPDAT1\r
FDAT_ACT=FP1\r
BAS(#PTP_PARAMS,100)\r
PTP XP1\r
;ENDFOLD\r
LIN XP2 C_DIS\r
  LIN   @LINE\r
$BASE=BASE_DATA[3]:{X 0,Y 0,Z 5,A 0,B 0,C 0}\r
PTP XP4:{X 0,Y 0,Z -10,A 0,B 0,C 0}\r
END\r
"""
POINTS = {
    "XP1": [10, -80, 95, 20, 60, -30],
    "XP2": [12, -78, 97, 21, 58, -28],
    "XP4": [-20, -100, 110, 0.01, 45, 190],
}
LINE = [14, -76, 98, 20, 57, -27]
NOTHING = np.eye(4)


def pose_text(q_deg, inner=NOTHING, outer=NOTHING, decimals=3, state=True):
    """A structure that means readings, and S and T by the vendor's definition."""
    q = np.deg2rad(np.asarray(q_deg, dtype=float))
    pose = np.linalg.inv(outer) @ KUKA.pose(q) @ inner
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # gimbal lock
        a, b, c = Rotation.from_matrix(pose[:3, :3]).as_euler("ZYX", degrees=True)
    numbers = [*(pose[:3, 3] * 1e3), a, b, c]
    text = ",".join(f"{name} {value:.{decimals}f}" for name, value in zip("XYZABC", numbers, strict=True))
    turn = int(((q < 0) * 2 ** np.arange(6)).sum())
    elbow = Branches.of(KUKA).elbow(q[None])[0] >= 0
    reach = Branches.of(KUKA).reach(q[None])[0] < 0
    status = int(reach) + 2 * int(elbow) + 4 * int(q[4] < 0)
    return f"{{{text}{f',S {status},T {turn}' if state else ''},E1 0.0,E2 0.0}}"


def the_tool():
    tool = np.eye(4)
    tool[:3, :3] = Rotation.from_euler("ZYX", [0, 30, 0], degrees=True).as_matrix()
    tool[:3, 3] = [0.010, 0, 0.120]
    return tool


def weld():
    return SRC.replace("@LINE", pose_text(LINE, the_tool(), state=False))


def data(points=POINTS, more=""):
    tool = the_tool()
    offset, base = np.eye(4), np.eye(4)
    offset[2, 3], base[:3, 3] = 0.010, [0.3, 0, 0.055]
    lines = [
        f"DECL E6POS XP1={pose_text(points['XP1'], tool)}",
        'DECL FDAT FP1={TOOL_NO 1,BASE_NO 0,IPO_FRAME #BASE,POINT2[] " ",TQ_STATE FALSE}',
        f"E6POS XP2={pose_text(points['XP2'], tool)}",
        f"DECL GLOBAL E6POS XP4={pose_text(points['XP4'], tool @ offset, base, decimals=5)}",
        "BASE_DATA[3]={X 300,Y 0,Z 50,A 0,B 0,C 0}",
    ]
    return "&ACCESS RVP\r\nDEFDAT weld PUBLIC\r\n" + "\r\n".join(lines) + more + "\r\nENDDAT\r\n"


def test_stored_and_written_out_targets_with_their_frames():
    program = read("weld.src", weld(), KUKA, TOOL, dat=data())
    given_models = models(KUKA)
    done = rewritten(program, given_models)
    assert done.listed == ()
    assert done.changed.sum() == 5
    by_name = {name: number for number, name in program.targets.names.items()}
    for name, q_deg in POINTS.items():
        assert np.abs(np.rad2deg(done.nominal[by_name[name]]) - np.array(q_deg)).max() < 0.01, name
    written = again(done, KUKA, TOOL)
    said = obeyed(written, KUKA, done.corrected)
    np.testing.assert_allclose(said, done.corrected, atol=3e-5)
    np.testing.assert_allclose(
        done.corrected - done.nominal, np.broadcast_to(given_models.compensator.by_rad, (5, 6))
    )


def test_only_numbers_change():
    program = read("weld.src", weld(), KUKA, TOOL, dat=data())
    done = rewritten(program, models(KUKA))
    for source, content in zip(program.sources, done.contents, strict=True):
        before, after = source.text.splitlines(), content.decode("latin-1").splitlines()
        assert len(before) == len(after)
        for old, new in zip(before, after, strict=True):
            if old != new:
                assert strip_numbers(old) == strip_numbers(new)
    assert done.contents[0].count(b"\r\n") == SRC.count("\r\n")
    assert "über".encode("latin-1") in done.contents[0]
    assert b"; LIN {X 1} is no code" in done.contents[0]


def strip_numbers(text):
    import re

    return re.sub(r"(?<![\w])-?\d+\.?\d*", "#", text)


def test_decimals_are_at_least_those_of_the_source():
    program = read("weld.src", weld(), KUKA, TOOL, dat=data())
    after = rewritten(program, models(KUKA)).contents
    assert b"A2 -90.0573," in after[0]
    x = after[1].decode().split("XP4={X ")[1].split(",")[0]
    assert len(x.split(".")[1]) == 5


def test_no_correction_says_the_same_place():
    program = read("weld.src", weld(), KUKA, TOOL, dat=data())
    done = rewritten(program, models(KUKA, by_rad=0.0))
    said = obeyed(again(done, KUKA, TOOL), KUKA, done.corrected)
    np.testing.assert_allclose(said, done.nominal, atol=3e-5)


ALREADY = """DEF a()
$TOOL=$NULLFRAME
$BASE=$NULLFRAME
"""


def reasons(src, dat="DEFDAT a\nENDDAT\n", frames=TOOL):
    program = read("a.src", src, KUKA, frames, dat=dat)
    done = rewritten(program, models(KUKA))
    return {f"{one.line}:{one.name}": one.reason for one in done.listed}


def test_what_cannot_be_changed_is_listed_with_line_and_reason():
    a, b = pose_text([0, -90, 90, 0, 45, 0]), pose_text([10, -90, 90, 0, 45, 0])
    src = ALREADY + "\n".join(
        [
            "LIN_REL {X 10}",
            "PTP XOUT",
            f"PTP {a.replace('E1 0.0', 'E1 25.0')}",
            "PTP {X 10,Z 20}",
            "PTP {X XOFF,Y 1,Z 2,A 3,B 4,C 5}",
            "PTP XA",
            "XA.Z=XA.Z+10",
            "PTP XB",
            "PTP XC",
            "$BASE={X 1,Y 0,Z 0,A 0,B 0,C 0}",
            "PTP XC",
            "PTP XD",
            "END",
        ]
    )
    dat = f"DECL E6POS XA={a}\nDECL E6POS XB={a}\nXB={b}\nDECL E6POS XC={b}\n"
    dat += f"DECL E6POS XUNUSED={b}\nDECL E6POS XD\n"
    found = reasons(src, dat)
    for words, reason in {
        "LIN_REL": "relative",
        "PTP XOUT": "not stored",
        "E1 25.0": "external axes",
        "PTP {X 10,Z 20}": "omitted",
        "XOFF": "computed",
        "XB": "more than once",
        "XC": "several tools",
        "XUNUSED": "no motion",
        "PTP XD": "not stored",
    }.items():
        assert any(words in key and reason in why for key, why in found.items()), (words, found)
    assert any(("XA" in key and "run time" in why) or "more than once" in why for key, why in found.items())


@pytest.mark.parametrize(
    ("between", "reason"),
    [
        ("GRIPPER( )", "subroutine"),
        ("IF $IN[1] THEN\n$BASE={X 1,Y 0,Z 0,A 0,B 0,C 0}\nENDIF", "not the same on all ways"),
        ("$IPO_MODE=#TCP", "tool stands still"),
        ("$TOOL=TOOL_DATA[7]", "TOOL_DATA[7]"),
        ("$TOOL=TOOL_DATA[1e400]", "TOOL_DATA"),
        ("$TOOL=TOOL_DATA[1.5]", "TOOL_DATA"),
        ("$TOOL=MYTOOL", "MYTOOL"),
        ("$BASE.X=100", "run time"),
    ],
)
def test_a_tool_or_base_that_is_not_certain(between, reason):
    found = reasons(ALREADY + f"{between}\nPTP {pose_text([0, -90, 90, 0, 45, 0])}\nEND\n")
    assert any(reason in why for why in found.values()), found


def test_a_loop_that_comes_round_with_another_base():
    target = pose_text([0, -90, 90, 0, 45, 0])
    src = ALREADY + f"LOOP\nPTP {target}\n$BASE={{X 1,Y 0,Z 0,A 0,B 0,C 0}}\nENDLOOP\nEND\n"
    assert any("loop comes round" in why for why in reasons(src).values())


def test_both_branches_setting_the_same_base_are_certain():
    base = "$BASE={X 1,Y 0,Z 0,A 0,B 0,C 0}"
    target = pose_text([0, -90, 90, 0, 45, 0])
    src = ALREADY + f"IF $IN[1] THEN\n{base}\nELSE\n{base}\nENDIF\nPTP {target}\nEND\n"
    assert reasons(src) == {}


def test_spline_motions_with_their_own_frames():
    target = pose_text([0, -90, 90, 0, 45, 0], decimals=5)
    own = "$VEL_AXIS[1]=SVEL_JOINT(100.0), $TOOL=STOOL2(FP1), $BASE=SBASE(FP1.BASE_NO)"
    src = f"DEF a()\nSPTP XP1 WITH {own}\nEND\n"
    dat = f"DECL E6POS XP1={target}\nDECL FDAT FP1={{TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE}}\n"
    done = rewritten(read("a.src", src, KUKA, dat=dat), models(KUKA))
    assert done.changed.tolist() == [True]
    np.testing.assert_allclose(np.rad2deg(done.nominal[0]), [0, -90, 90, 0, 45, 0], atol=1e-3)


def test_arrays_and_circles():
    points = [pose_text([a, -90, 90, 0, 45, 0]) for a in (0, 5, 10)]
    dat = "".join(f"PTS[{n}]={text}\n" for n, text in enumerate(points, start=1))
    src = ALREADY + "PTP PTS[1]\nCIRC PTS[2],PTS[3]\nEND\n"
    done = rewritten(read("a.src", src, KUKA, dat="DECL E6POS PTS[3]\n" + dat), models(KUKA))
    assert done.changed.all()
    running = rewritten(
        read("a.src", ALREADY + "FOR I=1 TO 3\nPTP PTS[I]\nENDFOR\nEND\n", KUKA, dat=dat), models(KUKA)
    )
    assert running.changed.sum() == 3


def test_an_absolutely_accurate_robot_is_told_by_its_status():
    text = pose_text([0, -90, 90, 0, 45, 0]).replace("S 2", "S 10")
    program = read("a.src", ALREADY + f"PTP {text}\nEND\n", KUKA)
    assert "absolutely accurate" in program.accurate
    done = rewritten(program, models(KUKA))
    assert b"S 10," in done.contents[0]


def test_status_in_binary_digits():
    text = pose_text([0, -90, 90, 0, 45, 0]).replace("S 2", "S 'B010'")
    done = rewritten(read("a.src", ALREADY + f"PTP {text}\nEND\n", KUKA), models(KUKA))
    assert b"S 2," in done.contents[0]


def test_a_broken_structure_is_an_error_with_line_and_column():
    with pytest.raises(InputError, match=r"a\.src, line 4, column"):
        read("a.src", ALREADY + "PTP {X 10,Y 20\nEND\n", KUKA)


@given(st.lists(st.sampled_from(SRC.split("\r\n")), max_size=12), st.text(max_size=30))
def test_any_text_ends_in_a_program_or_an_error(lines, noise):
    text = "\r\n".join([*lines, noise.encode("latin-1", "replace").decode("latin-1"), *lines])
    try:
        program = read("a.src", text, KUKA, TOOL, dat=data())
    except TruearmError as error:
        message = str(error)
    else:
        message = "line"
        assert len(rewritten(program, models(KUKA)).contents) == 2
    assert "line" in message


EDGES = st.one_of(
    st.sampled_from([-180.0, -90.0, -0.003, -0.0, 0.0, 0.0004, 90.0, 180.0]),
    st.floats(-184.0, 184.0, allow_subnormal=False),
)


@given(
    a1=st.floats(-60.0, 60.0),
    a4=EDGES,
    a5=st.one_of(st.floats(5.0, 100.0), st.floats(-100.0, -5.0)),
    a6=st.one_of(EDGES, st.floats(-340.0, 340.0)),
    by=st.floats(-0.02, 0.02),
)
def test_what_is_written_is_obeyed_to_the_turn(a1, a4, a5, a6, by):
    q_deg = np.array([a1, -95.0, 100.0, np.clip(a4, -184.0, 184.0), a5, a6])
    program = read("a.src", ALREADY + f"PTP {pose_text(q_deg, decimals=6)}\nEND\n", KUKA)
    given_models = models(KUKA, by_rad=np.deg2rad([0.01, 0.01, -0.01, by, by / 2, -by]))
    done = rewritten(program, given_models)
    if done.changed[0]:
        np.testing.assert_allclose(np.rad2deg(done.nominal[0]), q_deg, atol=1e-3)
        said = obeyed(again(done, KUKA), KUKA, done.corrected)
        np.testing.assert_allclose(said, done.corrected, atol=1e-4)
    else:
        assert done.contents[0].decode("latin-1") == program.sources[0].text
        assert done.listed[0].reason


def test_digits_are_what_the_text_says_again():
    configuration = StatusAndTurn(Branches.of(KUKA))
    q = np.deg2rad(np.random.default_rng(1).uniform(-170.0, 40.0, (50, 6)))
    digits = configuration.digits(q)
    text = configuration.text_of_digits(digits, np.zeros((50, 2)))
    np.testing.assert_array_equal(configuration.digits_of_text(text), digits)


def test_the_mark_stands_behind_the_line_that_begins_the_module():
    program = read("weld.src", weld(), KUKA, TOOL, dat=data())
    done = rewrite(program, models(KUKA), Choices(), mark="compensated by truearm")
    for content, line in zip(done.contents, (b"DEF weld( )", b"DEFDAT weld PUBLIC"), strict=True):
        assert line + b"\r\n;compensated by truearm\r\n" in content
        assert content.startswith(b"&ACCESS RVP\r\n")


def test_a_tool_holds_from_its_assignment_on():
    first, second = (pose_text([a, -90, 100, 0, 45, 0], decimals=5) for a in (-20, 20))
    tool = "$TOOL={X 0,Y 0,Z 150,A 0,B 0,C 0}"
    src = f"DEF a()\n$BASE=$NULLFRAME\nPTP {first}\n{tool}\nPTP {second}\nEND\n"
    done = rewritten(read("a.src", src, KUKA), models(KUKA))
    assert done.changed.tolist() == [False, True]
    branch = f"DEF a()\n$BASE=$NULLFRAME\nIF x THEN\n{tool}\nENDIF\nPTP {first}\nEND\n"
    assert not rewritten(read("a.src", branch, KUKA), models(KUKA)).changed.any()


@pytest.mark.parametrize("word", ["SPLINE", "PTP_SPLINE"])
def test_the_tool_of_a_spline_is_not_the_one_before_it(word):
    first, second = (pose_text([a, -90, 100, 0, 45, 0], decimals=5) for a in (-20, 20))
    src = f"{ALREADY}{word} WITH $TOOL=SOME_TOOL[1]\nSPTP {first}\nENDSPLINE\nPTP {second}\nEND\n"
    done = rewritten(read("a.src", src, KUKA), models(KUKA))
    assert done.changed.tolist() == [False, True]


def test_a_target_that_shifts_another_one_is_left_alone():
    first, second = (pose_text([a, -90, 100, 0, 45, 0], decimals=5) for a in (-20, 20))
    src = ALREADY + f"DECL E6POS XP1={first}\nDECL FRAME XOFF={{X 1,Y 2,Z 3,A 0,B 0,C 0}}\n"
    src += f"DECL E6POS XSHIFT={second}\nPTP XP1\nLIN XP1:XOFF\nPTP XSHIFT\nLIN XSHIFT:XP1\nEND\n"
    program = read("a.src", src, KUKA)
    done = rewritten(program, models(KUKA))
    names = {program.targets.names[k]: bool(done.changed[k]) for k in program.targets.names}
    assert not names["XSHIFT"]
    assert b"XOFF={X 1,Y 2,Z 3,A 0,B 0,C 0}" in done.contents[0]


def test_waypoints_on_a_line_are_passed():
    ends = [pose_text(q_deg, decimals=5) for q_deg in ([-30, -90, 100, 0, 45, 0], [30, -90, 100, 0, 45, 0])]
    src = ALREADY + f"PTP {ends[0]}\n  LIN {ends[1]}\nEND\n"
    bent = models(KUKA, by_rad=0.0)
    bent.compensator.by_rad = Bend()
    done = rewritten(read("a.src", src, KUKA), bent, spacing=Spacing.of(0.05, 20.0))
    lines = done.contents[0].decode().splitlines()
    inserted = [line for line in lines if line.endswith("C_DIS")]
    assert 2 <= done.inserted == len(inserted)
    assert all(line.startswith("  LIN {X ") for line in inserted)
    across = [float(line.split("Y ")[1].split(",")[0]) for line in inserted]
    assert (np.diff(across) < 0.0).all() or (np.diff(across) > 0.0).all(), "in the order of the way"
    last = next(line for line in lines if "LIN" in line and "E1" in line)
    assert lines.index(inserted[-1]) + 1 == lines.index(last)
    folded = src.replace("  LIN", ";FOLD LIN P2\nLIN").replace("\nEND", "\n;ENDFOLD\nEND")
    assert rewritten(read("a.src", folded, KUKA), bent, spacing=Spacing.of(0.05, 20.0)).inserted == 0


def test_frames_of_the_world_and_of_the_start():
    places = {'object."$WORLD"': "[0, 0, 100]", 'tool."$TOOL"': "[0, 0, 0]", 'object."$BASE"': "[50, 0, 0]"}
    frames = "".join(f"[{name}]\nxyz = {place}\n" for name, place in places.items())
    program = read("a.src", f"DEF a()\nPTP {pose_text([0, -90, 90, 0, 45, 0])}\nEND\n", KUKA, frames)
    np.testing.assert_allclose(program.environments[0].work_object.true[:3, 3], [0.05, 0.0, 0.1])
    assert program.environments[0].tool.unknown == ""
