"""ABB RAPID: what is read, what is written, what is listed."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.programs_rig import ABB, again, models, obeyed, read, rewritten
from truearm.errors import InputError, TruearmError
from truearm.programs.branches import Branches
from truearm.programs.program import LinearStep
from truearm.programs.rapid_configuration import Confdata
from truearm.programs.rewriting import Choices, rewrite
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


def numbers(q_deg, tool=TOOL, placed=TABLE, decimals=4, author=ABB):
    """The text of a robtarget that means readings, with confdata by the vendor's definition."""
    q = np.deg2rad(np.asarray(q_deg, dtype=float))
    pose = np.linalg.inv(placed) @ author.pose(q) @ tool
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


def test_a_number_that_is_too_large_is_told_with_its_line():
    text = f"MoveAbsJ [[1e400,10,20,0,30,0],{UNUSED}],v1000,z50,tG;"
    with pytest.raises(InputError, match=r"demo\.mod, line \d+, column \d+: 1e400 is too large for a number"):
        read("demo.mod", module(text), ABB)


def test_only_numbers_change():
    program = read("demo.mod", module(BODY, points()), ABB)
    done = rewritten(program, models(ABB))
    before, after = program.sources[0].text, done.contents[0].decode("latin-1")
    hidden = re.compile(r"(?<![\w.])-?\d+\.?\d*(?:E\+?\d+)?")
    assert hidden.sub("#", before) == hidden.sub("#", after)
    assert after.count("\r\n") == before.count("\r\n")
    assert ",0.11459]" in after  # the fifth decimal of the source is kept
    assert "! CONST robtarget pX:=[[1,2 is no code" in after


def test_a_number_with_an_exponent_gets_the_decimals_of_its_unit():
    place = "[[0,10,1.2E-07,-3.5e-10,3.0E1,-3.7185420358343666e-18]"
    text = f"MoveAbsJ {place},{UNUSED}],v1000,z50,tG;"
    done = rewritten(read("demo.mod", module(text), ABB), models(ABB))
    (joints,) = re.findall(r"MoveAbsJ \[\[(.*?)\]", done.contents[0].decode("latin-1"))
    assert [len(number.partition(".")[2]) for number in joints.split(",")] == [4] * 6


def reasons(body, data="", frames="", **others):
    done = rewritten(read("demo.mod", module(body, data, **others), ABB, frames), models(ABB))
    return {one.name: one.reason for one in done.listed}


GO = "v100,fine,tG\\WObj:=wT;"


@pytest.mark.parametrize(
    ("body", "name", "reason"),
    [
        (f"MoveJ pA,{GO}\nMoveL Offs(pA,0,0,nUp),{GO}", "pa", "with offsets"),
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


def test_an_array_of_more_dimensions_is_not_read():
    one, other = numbers(SEEN["pA"]), numbers(SEEN["pB"])
    found = reasons(f"MoveJ pts{{1,2}},{GO}", f"CONST robtarget pts{{1,2}}:=[[{one},{other}]];")
    assert set(found.values()) == {"arrays of more dimensions than one are not read"}
    assert any(name.startswith("MoveJ pts") for name in found)


def test_a_copy_of_a_target_is_called_one():
    found = reasons(f"MoveJ pCopy,{GO}\nMoveJ pA,{GO}", f"{points()}\nCONST robtarget pCopy:=pA;")
    copied = next(why for name, why in found.items() if name.startswith("MoveJ pCopy"))
    assert copied == "it is a copy of pA, without numbers of its own"


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


@pytest.mark.parametrize("comma", [",", " , ", ",\r\n"])
def test_options_behind_a_comma_are_those_of_the_argument_before(comma):
    data = f"{points()}\nPERS loaddata heavy:=[5,[0,0,50],[1,0,0,0],0,0,0];"
    turned = f"RelTool(pB,0,0,5{comma}\\Rz:=10)"
    body = f"MoveJ pA,v100,fine,tG{comma}\\WObj:=wT{comma}\\TLoad:=heavy;\nMoveJ {turned},v1,fine,tG;"
    first, second = (
        program.environments[number]
        for program in [read("demo.mod", module(body, data), ABB)]
        for number in program.moves.environment
    )
    assert (first.work_object.name, first.payload_kg) == ("wT", 5.0)
    np.testing.assert_allclose(first.work_object.controller, TABLE)
    assert second.after[0, 1] == pytest.approx(-np.sin(np.deg2rad(10.0)))


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
    except TruearmError as error:
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


OTHER = "ENDPROC\nPROC other"
SHADOWED = [
    (f"MoveJ Offs(pA,0,0,nUp),{GO}\n{OTHER}()\nVAR num nUp:=10;\nMoveJ pB,{GO}", "declared more than once"),
    (f"MoveJ Offs(pA,0,0,nUp),{GO}\n{OTHER}(num nUp)\nMoveJ pB,{GO}", "declared more than once"),
    (f"MoveJ Offs(pA,0,0,nUp),{GO}\n{OTHER}(\\switch on|num nUp{{*}})\nMoveJ pB,{GO}", "more than once"),
    (f"MoveJ Offs(pA,0,0,nUp),{GO}\nFOR nUp FROM 1 TO 2 DO\nMoveJ pB,{GO}\nENDFOR", "more than once"),
    (f"CONST num n:=5;\n{OTHER}()\nCONST num n:=6;\nMoveJ RelTool(pA,0,0,-n),{GO}", "more than once"),
    (f"CONST num n:=5;\n{OTHER}()\nMoveJ Offs(pA,0,0,n),{GO}", "run time"),
    (f"CONST num n:=nUp;\nMoveJ Offs(pA,0,0,n),{GO}\n{OTHER}()\nVAR num nUp;", "run time"),
    (f"CONST pose d:=[[0,0,25],[1,0,0,0]];\nPDispSet d;\nMoveJ pA,{GO}\n{OTHER}()\n"
     "CONST pose d:=[[0,0,60],[1,0,0,0]];", "displacement"),
    (f"CONST pose d:=[[0,0,25],[1,0,0,0]];\n{OTHER}()\nPDispSet d;\nMoveJ pA,{GO}", "displacement"),
    (f"MoveJ pA,{GO}\n{OTHER}(robtarget pA)", "declared more than once"),
    (f"MoveJ pA,{GO}\n{OTHER}()\nVAR num pA;", "declared more than once"),
    (f"MoveJ pA,{GO}\n{OTHER}(PERS tooldata tG)", 'tool "tG" is declared more than once'),
]  # fmt: skip


@pytest.mark.parametrize(("body", "reason"), SHADOWED)
def test_a_name_with_several_meanings_is_not_certain(body, reason):
    assert reason in reasons(body, points())["pa"]


def test_a_target_of_one_routine_is_not_that_of_another():
    local = f"CONST robtarget pL:={numbers(SEEN['pA'])};\nMoveJ pL,{GO}\n"
    found = reasons(f"{local}{OTHER}()\nMoveJ pL,v100,fine,tool0;")
    assert found == {"MoveJ pL,v100,fine,tool0;": "it is declared in another routine alone"}


def test_constants_declared_alike_are_certain():
    pose = "CONST pose d:=[[0,0,25],[1,0,0,0]];"
    body = f"CONST num n:=25;\nPDispOff;\nMoveJ Offs(pA,0,0,n),{GO}\n{OTHER}()\nCONST num n:=5*5;\n{pose}\n"
    body += f"PDispSet d;\nMoveJ pB,{GO}\n{OTHER}2(num unused)\nCONST num n:=25;\n{pose}\nVAR num unused2;"
    found = reasons(body, points())
    assert "pa" not in found
    assert "pb" not in found


CHANGED = [
    ("FindPart wT;", ""),
    ("FindPart wT.uframe;", ""),
    ("FindPart \\Frame:=wT;", ""),
    ("ok:=Found(wT);", ""),
    ("IF ok FindPart wT;", ""),
    ("IF NOT Found(wT) THEN\nok:=FALSE;\nENDIF", ""),
    ("Incr wT.oframe.trans.x;", ""),
    ("Own wT;", "Own(INOUT wobjdata w)\nw.oframe.trans.x:=1;"),
    (
        "Own wT;",
        "Own(PERS wobjdata w)\nOnce w;\nENDPROC\nPROC Once(INOUT wobjdata v)\nIncr v.oframe.trans.x;",
    ),
    ("Own 3;", "Own(VAR num dx)\nwT.oframe.trans.x:=dx;"),
    ("Own 3;", "Own(num dx)\nIF dx>1 wT.oframe.trans.x:=dx;"),
]


@pytest.mark.parametrize(("statement", "routine"), CHANGED)
def test_what_may_change_a_work_object_makes_it_uncertain(statement, routine):
    own = f"\nENDPROC\nPROC {routine}" if routine else ""
    assert 'work object "wT" is ' in reasons(f"MoveJ pA,{GO}\n{statement}{own}", points())["pa"]
    other = f"MoveJ {numbers(SEEN['pA'], placed=NOTHING)},v100,fine,tG;"
    assert not any(key.startswith("MoveJ [") for key in reasons(f"{other}\n{statement}{own}"))


UNCHANGED = [
    ("pHere:=CRobT(\\Tool:=tG\\WObj:=wT);", ""),
    ("SearchL di1,pHere,pB,v100,tG\\WObj:=wT;", ""),
    ("IF (ok) AND NOT (wT.robhold) MoveJ pB,v100,fine,tG\\WObj:=wT;", ""),
    ('TPWrite "x"\\Num:=wT.oframe.trans.x;', ""),
    ("Own wT,tG;", "Own(PERS wobjdata w,PERS tooldata t)\nMoveJ pB,v100,fine,t\\WObj:=w;"),
    ("Own wT;", "Own(wobjdata w)\nw.oframe.trans.x:=1;"),
]


@pytest.mark.parametrize(("statement", "routine"), UNCHANGED)
def test_what_only_reads_a_work_object_leaves_it_certain(statement, routine):
    own = f"\nENDPROC\nPROC {routine}" if routine else ""
    assert "pa" not in reasons(f"MoveJ pA,{GO}\n{statement}{own}", points())


HANDLERS = ["ERROR\nPDispSet pd;\nRETRY;", "ENDPROC\nTRAP t1\nPDispSet pd;\nENDTRAP\nPROC more()"]


@pytest.mark.parametrize("handler", HANDLERS)
def test_what_is_executed_between_motions_may_displace_them(handler):
    assert "displacement" in reasons(f"PDispOff;\nMoveJ pA,{GO}\n{handler}", points())["pa"]


def test_an_if_in_an_if_is_no_routine():
    found = reasons(f"IF ok IF ready MoveJ pA,{GO}\nMoveL pB,{GO}", points())
    assert not {"pa", "pb"} & set(found)


def test_a_path_that_sensors_correct_is_left():
    found = reasons(f"MoveL pA,{GO.removesuffix(';')}\\Corr;\nMoveL pB,{GO}", points())
    assert "run time" in found["pa"] or "comput" in found["pa"]
    assert "pb" not in found
    assert any("sensors" in reason for reason in found.values())


def test_a_short_if_may_displace_what_comes_after():
    body = f"PDispOff;\nIF ok shift;\nMoveJ pA,{GO}\n{OTHER}()\nPDispSet pd;"
    assert "displacement" in reasons(body, points())["pa"]


READ_IN_MOTIONS = [
    f"MoveL Above(pA,50),{GO}",
    f"MoveL Offs(Above(pA,50),0,0,5),{GO}",
    f"MoveL [pA.trans,[1,0,0,0],pA.robconf,pA.extax],{GO}",
    f"MoveL Offs(pB,0,0,Distance(pA.trans,pB.trans)),{GO}",
    "MoveL pB,v100\\T:=Distance(pA.trans,pB.trans),fine,tG\\WObj:=wT;",
]


@pytest.mark.parametrize("motion", READ_IN_MOTIONS)
def test_targets_that_a_motion_is_computed_from_are_left(motion):
    found = reasons(f"MoveJ pA,{GO}\n{motion}", points())
    assert found["pa"] == "the program computes with it"


def test_an_array_with_an_external_axis_keeps_the_others():
    moved = numbers(SEEN["pB"]).replace(UNUSED, "[9E9,0,9E9,9E9,9E9,9E9]")
    data = f"CONST robtarget pts{{3}}:=[{numbers(SEEN['pA'])},{moved},pHome];"
    found = reasons(f"MoveJ pts{{i}},{GO}\nMoveJ pts{{2}},v100,fine,tG;", data)
    assert {"pts{2}", "pts{3}"} < set(found)
    assert "pts{1}" not in found


@pytest.mark.parametrize("start", ["\xef\xbb\xbf", ""])
def test_a_byte_order_mark_stays_in_front(start):
    target = numbers(SEEN["pA"], NOTHING, NOTHING)
    text = f"{start}MODULE m\nCONST robtarget pA:={target};\nPROC main()\nMoveJ pA,v1,fine,tool0;\n"
    for body in (text, text.replace("MODULE m\n", "")):
        done = rewrite(read("a.mod", body, ABB), models(ABB), Choices(), mark="mark")
        assert done.changed.all()
        head = body.partition("CONST")[0]
        assert done.contents[0].decode("latin-1").startswith(f"{head}! mark\nCONST")


PLAIN = [
    "MoveL pB,v100,fine,tG;",
    "MoveL pB,v100\\V:=50,z1\\Z:=2,tG\\WObj:=wT\\TLoad:=load0;",
    "MoveL pB,v100,\\V:=50,fine,tG,\\WObj:=wT;",
]
NOT_TWICE = [
    "MoveL pB,v100\\T:=5,fine,tG;",
    "MoveL pB,v100,z10\\Inpos:=inpos50,tG;",
    "MoveL \\Conc,pB,v100,z10,tG;",
    "MoveL pB\\ID:=10,v100,z10,tG;",
    "MoveL pB,v100,z10,tG\\WObj:=wT\\Corr;",
    "MoveLDO pB,v100,z10,tG,do1,1;",
    "MoveLSync pB,v100,z10,tG,\"proc\";",
    "TriggL pB,v100,trigg1,z10,tG;",
]  # fmt: skip


@pytest.mark.parametrize("motion", PLAIN + NOT_TWICE)
def test_waypoints_copy_what_holds_for_a_part_of_the_way(motion):
    text = module(motion, points())
    line = text.split("\r\n").index(motion) + 1
    values, decimals = (1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0, 0, 0, 0, 0), (3,) * 3 + (7,) * 4 + (0,) * 4
    step = LinearStep(line, 0, 0, values, decimals, 0.01)
    program = read("a.mod", text, ABB)
    found = program.language.linear_steps(program, [[step]])
    assert found.impossible == (() if motion in PLAIN else (0,))
    assert found.waypoints == len(found.insertions) == (motion in PLAIN)


def test_a_line_to_joints_gets_no_waypoints():
    text = module("MoveL jHome,v100,fine,tG;", points())
    line = text.split("\r\n").index("MoveL jHome,v100,fine,tG;") + 1
    program = read("a.mod", text, ABB)
    found = program.language.linear_steps(program, [[LinearStep(line, 0, 0, (1.0,) * 6, (3,) * 6, 0.01)]])
    assert (found.impossible, found.insertions) == ((0,), ())
