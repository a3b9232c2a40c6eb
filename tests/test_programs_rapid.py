"""ABB RAPID: what is read, what is written, what is listed."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.programs_rig import ABB, again, models, obeyed, read, rewritten
from truearm.errors import InputError
from truearm.programs.branches import Branches
from truearm.programs.rapid_configuration import Confdata
from truearm.robot import Robot
from truearm.rotations import quaternion_from_matrix

UNUSED = "[9E9,9E9,9E9,9E9,9E+09,9E9]"
TOOL, TABLE = np.eye(4), np.eye(4)
TOOL[2, 3], TABLE[:3, 3] = 0.12, [0.3, 0.0, 0.11]
NOTHING = np.eye(4)
SEEN = {
    "pHome": [0, 10, 20, 0, 40, 0],
    "pA": [5, 12, 22, 10, 45, -20],
    "pB": [8, 14, 24, 12, 47, -22],
    "pC": [9, 15, 25, -95, 48, 170],
    "pD": [10, 16, 26, 14, -50, 190],
}


def numbers(q_deg, tool=TOOL, placed=TABLE, decimals=4):
    """The text of a robtarget that means readings, with confdata by the vendor's definition."""
    q = np.deg2rad(np.asarray(q_deg, dtype=float))
    pose = np.linalg.inv(placed) @ ABB.pose(q) @ tool
    quarter = np.floor(np.rad2deg(q)[[0, 3, 5]] / 90.0).astype(int)
    arm = Branches.of(ABB)
    cfx = 4 * (arm.reach(q[None])[0] < 0) + 2 * (arm.elbow(q[None])[0] < 0) + (q[4] < 0)
    place = ",".join(f"{value * 1e3:.{decimals}f}" for value in pose[:3, 3])
    turn = ", ".join(f"{value:.8f}" for value in quaternion_from_matrix(pose[:3, :3]))
    return f"[[{place}],[{turn}],[{','.join(map(str, [*quarter, cfx]))}],{UNUSED}]"


def module(body, data="", tool="TRUE", placed="FALSE,TRUE"):
    return f"""%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE Demo(SYSMODULE)
  ! CONST robtarget pX:=[[1,2 is no code; MoveL pX,v1,z1,t; \xe4
  PERS tooldata tG:=[{tool},[[0,0,120],[1,0,0,0]],[1.5,[0,0,50],[1,0,0,0],0,0,0]];
  TASK PERS wobjdata wT:=[{placed},"",[[300,0,100],[1,0,0,0]],[[0,0,10],[1,0,0,0]]];
  CONST num nUp:=25*2;
{data}
  PROC main()
{body}
  ERROR
    RETRY;
  ENDPROC
ENDMODULE
""".replace("\n", "\r\n")


def points():
    lines = [f"  CONST robtarget {name}:={numbers(q_deg)};" for name, q_deg in SEEN.items()]
    joints = ",".join(f"{value}" for value in SEEN["pHome"])
    return "\n".join([*lines, f"  CONST jointtarget jHome:=[[{joints}],{UNUSED}];"])


BODY = f"""    VAR num i:=0;
    ConfL\\Off;
    MoveAbsJ jHome\\NoEOffs,v1000,fine,tG;
    MoveAbsJ [[0,10,20,0,30,0.00000],{UNUSED}],v1000,z50,tG;
    MoveJ pA,v1000,z10,tG\\WObj:=wT;
    MoveL \\Conc,pB,v100,
      fine,tG\\WObj:=wT;
    TPWrite "MoveL p99; ""x"" ";
    MoveJ pC,v100,z5,tG\\WObj:=wT;
    MoveJ pD,v100,fine,tG\\WObj:=wT;
    MoveJ {numbers(SEEN["pA"])},v100,fine,tG\\WObj:=wT;"""


def test_declared_and_written_out_targets():
    program = read("demo.mod", module(BODY, points()), ABB)
    done = rewritten(program, models(ABB))
    assert [(one.name, one.reason) for one in done.listed] == [("phome", "no motion goes there")]
    by_name = {name: number for number, name in program.targets.names.items()}
    for name in ("pA", "pB", "pC", "pD"):
        meant = np.rad2deg(done.nominal[by_name[name.lower()]])
        assert np.abs(meant - np.array(SEEN[name])).max() < 0.005, name
    said = obeyed(again(done, ABB), ABB, done.corrected)
    assert np.abs(said - done.corrected)[done.changed].max() < 3e-5


def test_only_numbers_change():
    program = read("demo.mod", module(BODY, points()), ABB)
    done = rewritten(program, models(ABB))
    before, after = program.sources[0].text, done.contents[0].decode("latin-1")
    hidden = re.compile(r"(?<![\w.])-?\d+\.?\d*(?:E\+?\d+)?")
    assert hidden.sub("#", before) == hidden.sub("#", after)
    assert after.count("\r\n") == before.count("\r\n")
    assert ",0.11459]" in after  # the fifth decimal of the source is kept
    assert "! CONST robtarget pX:=[[1,2 is no code" in after


def reasons(body, data="", frames="", **others):
    done = rewritten(read("demo.mod", module(body, data, **others), ABB, frames), models(ABB))
    return {one.name: one.reason for one in done.listed}


GO = "v100,fine,tG\\WObj:=wT;"


@pytest.mark.parametrize(
    ("body", "name", "reason"),
    [
        (f"MoveJ pA,{GO}\nMoveL Offs(pA,0,0,nUp),{GO}", "pa", "several"),
        (f"MoveJ pA,{GO}\nMoveL Offs(pA,0,0,i),{GO}", "pa", "several"),
        (f"MoveL RelTool(pA,0,0,-10\\Rz:=i),{GO}", "pa", "run time"),
        (f"MoveJ pA,{GO}\npA.trans.z:=100;", "pa", "assigned"),
        (f"MoveJ pA,{GO}\nPickAt pA;", "pa", "not known here"),
        (f"MoveJ pA,{GO}\npB:=pA;", "pa", "computes"),
        (f"PDispOn pB,tG;\nMoveJ pA,{GO}", "pa", "displacement"),
        ("MoveJ pA,v100,fine,tOther;", "pa", '"tOther"'),
        ("MoveJ pA,v100,fine,tG\\WObj:=wOther;", "pa", '"wOther"'),
        (f"MoveJ pNowhere,{GO}", "MoveJ pNowhere", "not declared"),
        (f"MoveJ CRobT(),{GO}", "MoveJ CRobT", "run time"),
        (f"MoveExtJ pA,{GO}", "MoveExtJ", "not known"),
        ("MoveJ pA;", "MoveJ pA;", "fewer arguments"),
    ],
)
def test_what_cannot_be_changed_is_listed(body, name, reason):
    found = reasons(body, points())
    assert any(name in key and reason in why for key, why in found.items()), found


def test_external_axes_and_wrong_quaternions():
    moved = numbers(SEEN["pA"]).replace(UNUSED, "[9E9,0,9E9,9E9,9E9,9E9]")
    assert "external axes" in reasons(f"MoveJ {moved},{GO}").values()
    wrong = re.sub(r"\[0\.\d+, ", "[0.9, ", numbers(SEEN["pA"]))
    assert any("quaternion" in why for why in reasons(f"MoveJ {wrong},{GO}").values())


STATIONARY = [("FALSE", "FALSE,TRUE"), ("TRUE", "TRUE,TRUE"), ("TRUE", "FALSE,FALSE")]


@pytest.mark.parametrize(("tool", "placed"), STATIONARY)
def test_stationary_tools_and_moved_objects(tool, placed):
    found = reasons(f"MoveJ pA,{GO}", points(), tool=tool, placed=placed)
    assert "robhold" in found["pa"] or "ufprog" in found["pa"]


def test_a_tool_that_is_changed_at_run_time():
    assert "run time" in reasons(f"tG.tframe.trans.z:=100;\nMoveJ pA,{GO}", points())["pa"]


def test_constant_offsets_and_displacements_are_undone_in_the_number():
    q_deg = np.array(SEEN["pA"])
    up = np.eye(4)
    up[2, 3] = 0.05
    offset = f"CONST robtarget pUp:={numbers(q_deg, placed=TABLE @ up)};"
    relative = f"CONST robtarget pRel:={numbers(q_deg, tool=TOOL @ np.linalg.inv(up))};"
    data = f"{offset}\n{relative}\nCONST pose peUp:=[[0,0,50],[1,0,0,0]];"
    body = f"MoveJ Offs(pUp,0,0,nUp),{GO}\nMoveL RelTool(pRel,0,0,50),{GO}"
    done = rewritten(read("demo.mod", module(body, data), ABB), models(ABB))
    assert done.changed.all()
    assert np.abs(np.rad2deg(done.nominal) - q_deg).max() < 0.005
    displaced = f"PDispSet peUp;\nMoveJ pUp,{GO}\nPDispOff;"
    moved = rewritten(read("demo.mod", module(displaced, data), ABB), models(ABB))
    number = next(n for n, name in moved.program.targets.names.items() if name == "pup")
    assert moved.changed[number]
    assert np.abs(np.rad2deg(moved.nominal[number]) - q_deg).max() < 0.005


def test_arrays_indexed_at_run_time():
    data = f"CONST robtarget pts{{2}}:=[{numbers(SEEN['pA'])},\n  {numbers(SEEN['pB'])}];"
    body = f"FOR i FROM 1 TO 2 DO\nMoveJ pts{{i}},{GO}\nENDFOR\nMoveL pts{{1}},{GO}"
    done = rewritten(read("demo.mod", module(body, data), ABB), models(ABB))
    assert done.changed.all()
    assert len(done.changed) == 2


def test_frames_from_outside_and_frames_that_were_taught_wrongly():
    """A tool of the frames file is where the tool is; what the program states is what the controller has."""
    q_deg = np.array(SEEN["pA"])
    program = module(f"MoveJ {numbers(q_deg, decimals=6)},v100,fine,tG\\WObj:=wT;")
    frames = "[tool.tG]\nxyz = [1.0, 0.0, 120.0]\n"
    done = rewritten(read("demo.mod", program, ABB, frames), models(ABB, by_rad=0.0))
    true = TOOL.copy()
    true[0, 3] = 0.001
    hit = ABB.pose(done.corrected[0]) @ true
    assert np.linalg.norm(hit[:3, 3] - (ABB.pose(np.deg2rad(q_deg)) @ TOOL)[:3, 3]) < 2e-6
    environment = done.program.environments[0]
    assert environment.tool.controller[0, 3] == 0.0
    assert environment.payload_kg == 1.5


def test_straight_motion_must_agree_with_its_configuration_data():
    flipped = re.sub(r"\[0,0,-1,0\]", "[0,-2,0,1]", numbers(SEEN["pB"]))
    found = reasons(f"MoveJ pA,{GO}\nMoveL {flipped},{GO}", points())
    assert any("line from the target before" in why or "configuration" in why for why in found.values())


def test_only_six_axes():
    with pytest.raises(InputError, match="six revolute axes"):
        read("demo.mod", module(BODY, points()), Robot.load("kuka-iiwa-7"))


@given(st.integers(0, 3000), st.text(max_size=20))
def test_any_text_ends_in_a_program_or_an_error(cut, noise):
    whole = module(BODY, points())
    text = whole[:cut] + noise.encode("latin-1", "replace").decode("latin-1") + whole[cut + len(noise) :]
    try:
        program = read("demo.mod", text, ABB)
    except InputError as error:
        message = str(error)
    else:
        message = "line, column"
        assert len(rewritten(program, models(ABB)).contents) == 1
    assert "line" in message


EDGES = st.sampled_from([-180.0, -90.0, -0.003, -0.0, 0.0, 0.0004, 89.9999, 90.0, 180.0, 270.0])


@given(
    a1=st.one_of(EDGES.filter(lambda a: abs(a) < 160), st.floats(-150.0, 150.0)),
    a4=st.one_of(EDGES.filter(lambda a: abs(a) < 155), st.floats(-155.0, 155.0)),
    a5=st.one_of(st.floats(5.0, 100.0), st.floats(-100.0, -5.0)),
    a6=st.one_of(EDGES, st.floats(-390.0, 390.0)),
    by=st.floats(-0.02, 0.02),
)
def test_what_is_written_is_obeyed_to_the_turn(a1, a4, a5, a6, by):
    q_deg = np.array([a1, 15.0, 25.0, a4, a5, a6])
    body = f"MoveJ {numbers(q_deg, decimals=7)},{GO}"
    program = read("demo.mod", module(body), ABB)
    done = rewritten(program, models(ABB, by_rad=np.deg2rad([by, 0.01, -0.01, by, by / 2, -by])))
    if done.changed[0]:
        assert np.abs(np.rad2deg(done.nominal[0]) - q_deg).max() < 1e-3
        said = obeyed(again(done, ABB), ABB, done.corrected)
        assert np.abs(said - done.corrected).max() < 1e-4
    else:
        assert done.contents[0].decode("latin-1") == program.sources[0].text
        assert done.listed[0].reason


def test_digits_are_what_the_text_says_again():
    configuration = Confdata(Branches.of(ABB))
    q = np.deg2rad(np.random.default_rng(1).uniform(-170.0, 170.0, (50, 6)))
    text = configuration.text_of_digits(configuration.digits(q), np.zeros((50, 4)))
    np.testing.assert_array_equal(configuration.digits_of_text(text), configuration.digits(q))


@pytest.mark.parametrize("scope", ["LOCAL CONST", "LOCAL PERS", "TASK PERS", "PERS"])
def test_targets_of_every_scope_are_corrected(scope):
    data = f"{scope} robtarget pA:={numbers(SEEN['pA'])};"
    done = rewritten(read("a.mod", module(f"MoveJ pA,{GO}", data), ABB), models(ABB))
    assert done.changed[done.program.moves.target].all()


def test_a_routine_may_displace_what_comes_after_its_call():
    data = "\n".join(f"CONST robtarget {name}:={numbers(SEEN[name])};" for name in ("pA", "pB"))
    body = f"PDispOff;\nMoveJ pA,{GO}\nshift;\nMoveL pB,{GO}\nENDPROC\nPROC shift()\nPDispSet pd;"
    done = rewritten(read("a.mod", module(body, data), ABB), models(ABB))
    assert done.changed[done.program.moves.target].tolist() == [True, False]
