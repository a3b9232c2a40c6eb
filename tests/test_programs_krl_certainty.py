"""KUKA KRL: where tool, base and targets are certain, and where waypoints may stand."""

import pytest

from tests.program_tools import Bend
from tests.programs_rig import KUKA, models, read, rewritten
from tests.test_programs_krl import ALREADY, pose_text, reasons
from truearm.programs.densify import Spacing
from truearm.programs.rewriting import Choices, rewrite

HERE, THERE = (pose_text(q, decimals=5) for q in ([-30, -90, 100, 20, 45, 30], [30, -90, 100, 20, 45, 30]))
BASE, OTHER = "$BASE={X 1,Y 0,Z 0,A 0,B 0,C 0}", "$BASE={X 2,Y 0,Z 0,A 0,B 0,C 0}"
AT_START = '[tool."$TOOL"]\nxyz=[0,0,0]\n[tool."2"]\nxyz=[0,0,100]\n[object."$BASE"]\nxyz=[0,0,0]\n'
FRAME_DATA = "DECL FDAT FP1={TOOL_NO 1,BASE_NO 0,IPO_FRAME #BASE}\n"


def changed(src, dat="", frames=AT_START):
    """Which targets are changed, in the order of the text."""
    done = rewritten(read("a.src", src, KUKA, frames, dat=dat), models(KUKA))
    return done.changed.tolist()


def why(src, dat="", frames=AT_START):
    """All reasons that are listed, as one text."""
    return " ".join(reasons(src, dat, frames).values())


def densified(lines, dat=FRAME_DATA):
    """Waypoints inserted before the motions of a program, and moves that could have none."""
    bent = models(KUKA, by_rad=0.0)
    bent.compensator.by_rad = Bend()
    program = read("a.src", f"{ALREADY}{lines}\nEND\n", KUKA, '[tool."1"]\nxyz=[0,0,0]\n', dat=dat)
    done = rewritten(program, bent, spacing=Spacing.of(0.05, 20.0))
    notices = [notice.message for notice in done.notices if notice.kind == "deviation"]
    return done, " ".join(notices)


@pytest.mark.parametrize(
    "line",
    [
        f"SLIN {THERE} WITH $TOOL=STOOL2(FP1), $BASE=SBASE(FP1.BASE_NO)",
        f"SLIN {THERE} WITH $VEL.CP=0.2",
        f"TRIGGER WHEN DISTANCE=1 DELAY=0 DO $OUT[1]=TRUE\nLIN {THERE}",
        f"TRIGGER WHEN PATH=-10 DELAY=0 DO $OUT[1]=TRUE\n$VEL.CP=0.2\nLIN {THERE}",
        f"STOP WHEN PATH=10 IF $IN[1]\nSLIN {THERE}",
        f"INTERRUPT ON 3\nLIN {THERE}",
        f"TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[1]=TRUE\nLINES=LINES+1\nLIN {THERE}",
        f";FOLD ARCON WDAT1 LIN P2\n;FOLD Parameters\n;ENDFOLD\nLIN {THERE}\n;ENDFOLD",
    ],
)
def test_no_waypoints_where_they_would_not_be_executed_as_their_motion_is(line):
    done, told = densified(f"PTP {HERE}\n{line}")
    assert done.changed.all()
    assert done.inserted == 0
    assert "waypoints could not be inserted there: a.src, line " in told
    assert " mm; its statement is not a plain one, or belongs to others)" in told


def test_no_waypoints_before_a_line_to_axes():
    done, told = densified(f"PTP {HERE}\nLIN {{A1 30,A2 -90,A3 100,A4 20,A5 45,A6 30}}")
    assert done.changed.all()
    assert done.inserted == 0
    assert " mm; its statement is not a plain one" in told


@pytest.mark.parametrize("word", ["SPLINE", "PTP_SPLINE"])
def test_no_waypoints_within_a_spline(word):
    done, told = densified(f"PTP {HERE}\n{word}\nSLIN {THERE}\nSLIN {HERE}\nENDSPLINE")
    assert done.inserted == 0
    assert "waypoints could not be inserted" in told


@pytest.mark.parametrize(("word", "passed"), [("LIN", "C_DIS"), ("SLIN", "C_SPL")])
def test_waypoints_are_blended_by_the_word_of_their_motion(word, passed):
    done, told = densified(
        f"TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[1]=TRUE\nPTP {HERE}\n{word} {THERE} ;WITH"
    )
    lines = done.contents[0].decode().splitlines()
    assert done.inserted >= 2
    assert not told
    assert sum(line.startswith(word) and line.endswith(passed) for line in lines) == done.inserted


def test_a_routine_begins_with_what_holds_at_its_calls():
    tail = f"PTP {HERE}\npart()\nEND\n@DEF part()\nLIN {THERE}\nEND\n"
    src = f"DEF a()\n$TOOL=TOOL_DATA[2]\n$BASE=$NULLFRAME\n{tail}"
    local = read("a.src", src.replace("@", ""), KUKA, AT_START)
    assert {environment.tool.name for environment in local.environments} == {"2"}
    assert changed(src.replace("@", "")) == [True, True]
    assert "callers" in why(src.replace("@", "GLOBAL "))
    assert "callers" in why(src.replace("part()\nEND\n@", "END\n"))
    again = src.replace("@", "") + "DEF other()\n$TOOL=$NULLFRAME\npart()\nEND\n"
    assert "callers" in why(again)


def test_routines_that_call_each_other_twice_are_read_in_no_time():
    deep = "".join(f"DEF r{k}()\nr{k + 1}()\nr{k + 1}()\nEND\n" for k in range(40))
    body = f"DEF a()\nBASE_DATA[7]={{X 1,Y 2,Z 3,A 0,B 0,C 0}}\nr0()\nEND\n{deep}"
    assert changed(f"{body}DEF r40()\n$TOOL=$NULLFRAME\n$BASE=BASE_DATA[7]\nLIN {THERE}\nEND\n") == [True]


@pytest.mark.parametrize(
    ("calls", "reason"),
    [
        (f"part()\n{BASE}\npart()", "not the same on all ways"),
        (f"LOOP\npart()\n{BASE}\nENDLOOP", "loop comes round"),
        ("INTERRUPT DECL 5 WHEN $IN[1] DO part()", "interrupt or a trigger"),
        ("OUTSIDE()\npart()", "subroutine"),
    ],
)
def test_calls_of_a_routine_that_differ(calls, reason):
    assert reason in why(f"{ALREADY}{calls}\nEND\nDEF part()\nLIN {THERE}\nEND\n")


@pytest.mark.parametrize("word", ["GLOBAL INTERRUPT", "INTERRUPT"])
def test_an_interrupt_declaration_is_no_routine(word):
    line = f"{word} DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )\nINTERRUPT ON 3\n"
    src = f"DEF a()\n{BASE}\n$TOOL=TOOL_DATA[2]\nIF $IN[1] THEN\n{line}ENDIF\nPTP {HERE}\nLIN {THERE}\nEND\n"
    program = read("a.src", src, KUKA, AT_START)
    assert {environment.tool.name for environment in program.environments} == {"2"}
    assert changed(src) == [True, True]


@pytest.mark.parametrize(
    "line",
    [
        "OK=FIT(2)",
        "IF FIT(2) THEN\nENDIF",
        "WHILE NOT FIT(2)\nENDWHILE",
        "WAIT FOR FIT(2)",
        "$OUT[1]=NOT FIT(2)",
        "TRIGGER WHEN DISTANCE=0 DELAY=FIT(1) DO $OUT[1]=TRUE",
        "INTERRUPT DECL 5 WHEN $IN[1] DO FIT(2)",
        "BAS(#EX_BASE,1)",
    ],
)
def test_what_is_called_anywhere_in_a_line_may_set_tool_or_base(line):
    function = f"DEFFCT BOOL FIT(N:IN)\nINT N\n{BASE}\nRETURN TRUE\nENDFCT\n"
    for behind in ("", function):
        src = f"{ALREADY}DECL BOOL OK\nPTP {HERE}\n{line}\nPTP {THERE}\nEND\n{behind}"
        assert changed(src) == [True, False]


@pytest.mark.parametrize(
    ("line", "base"),
    [
        ("TRIGGER WHEN DISTANCE=1 DELAY=0 DO $BASE.Z=150", ""),
        ("TRIGGER WHEN PATH=0 DELAY=-10 DO $TOOL={X 0,Y 50,Z 100,A 0,B 0,C 0}", ""),
        ("TRIGGER WHEN DISTANCE=0 DELAY=0 DO BASE_DATA[2].Z=150", "$BASE=BASE_DATA[2]"),
        ("aim()", ""),
    ],
)
def test_what_a_trigger_assigns_may_be_another_tool_or_base(line, base):
    aim = "DEF aim()\nTRIGGER WHEN DISTANCE=1 DELAY=0 DO $BASE=$NULLFRAME\nEND\n"
    src = f"{ALREADY}PTP {HERE}\n{line}\nPTP {HERE}\n{base}\nPTP {THERE}\nEND\n{aim}"
    found = changed(src, "BASE_DATA[2]={X 1,Y 0,Z 0,A 0,B 0,C 0}\n")
    assert (found[0], found[2]) == (True, False)


def test_what_an_interrupt_assigns_is_not_known_behind_it():
    declared = "INTERRUPT DECL 3 WHEN $IN[1] DO $TOOL={X 0,Y 50,Z 100,A 0,B 0,C 0}"
    assert changed(f"{ALREADY}PTP {HERE}\n{declared}\nPTP {THERE}\nEND\n") == [True, False]
    kept = "GLOBAL INTERRUPT DECL 3 WHEN $IN[1] DO $OUT[2]=TRUE"
    assert changed(f"{ALREADY}PTP {HERE}\n{kept}\nPTP {THERE}\nEND\n") == [True, True]


def test_a_trigger_sets_its_tool_or_base_after_the_motion_that_it_belongs_to():
    src = f"{ALREADY}TRIGGER WHEN DISTANCE=1 DELAY=0 DO SET_IT()\nPTP {HERE}\nPTP {THERE}\nEND\n"
    assert changed(src) == [True, False]
    assert "interrupt or a trigger" in why(src)


@pytest.mark.parametrize(
    "line",
    [
        "SET_CD_PARAMS (0)",
        "PULSE($OUT[3],TRUE,0.2)",
        'SWRITE(MSG[],STATE,OFFSET,"x")',
        'CWRITE($CMD,STAT,MODE,"x")',
        'MSGNOTIFY("ready")',
        "I=SQRT(ABS(N[3]))+COS(30)*(2+1)",
        "IF (N[1]>2) AND NOT ($IN[1] OR (I==2)) THEN\nENDIF",
        "TRIGGER WHEN PATH=ArcGetPath(#On, W1) DELAY=ArcGetDelay(#Gas, W1) DO ArcMainNG(#On, W1) PRIO=-1",
        "WAIT FOR ($IN[1])",
        "BAS(#VEL_CP,0.5)",
        "EXTFCT BOOL CHECK(INT:IN)",
        "GREET(3)",
    ],
)
def test_what_surely_sets_neither_tool_nor_base(line):
    behind = "DEF GREET(N:IN)\nINT N\nIF N>SQRT(4) THEN\n$OUT[1]=TRUE\nDEEPER()\nENDIF\nEND\n"
    src = f"{ALREADY}PTP {HERE}\n{line}\nPTP {THERE}\nEND\n{behind}DEF DEEPER()\nWAIT SEC 1\nEND\n"
    assert changed(src) == [True, True]


def test_a_frame_counts_from_its_assignment_on():
    assigned = "BASE_DATA[5]={X 1,Y 0,Z 0,A 0,B 0,C 0}"
    src = f"{ALREADY}@\n$BASE=BASE_DATA[5]\nPTP {HERE}\n%\n$BASE=BASE_DATA[5]\nPTP {THERE}\nEND\n"
    frames = '[object."5"]\nxyz=[1,0,0]\n'
    for file in ("", frames):
        before = src.replace("@", "").replace("%", assigned)
        assert changed(before, frames=file) == [False, True]
        assert "not certainly before it is used" in why(before, frames=file)
        assert changed(src.replace("@", assigned).replace("%", ""), frames=file) == [True, True]
    branch = src.replace("@", f"IF $IN[1] THEN\n{assigned}\nENDIF").replace("%", "")
    assert changed(branch) == [False, False]
    passed_by = src.replace("@", f"GOTO over\n{assigned}\nover:").replace("%", "")
    assert changed(passed_by) == [False, False]
    assert changed(src.replace("@", "").replace("%", ""), dat=assigned + "\n") == [True, True]


def test_a_frame_that_was_assigned_before_a_routine_was_called():
    part = f"DEF part()\n$BASE=MINE\nPTP {HERE}\nEND\n"
    assigned = "MINE={X 1,Y 0,Z 0,A 0,B 0,C 0}\n"
    assert changed(f"{ALREADY}{assigned}part()\nEND\n{part}") == [True]
    assert changed(f"{ALREADY}part()\n{assigned}END\n{part}") == [False]


@pytest.mark.parametrize("line", ["MEASURE(BASE_DATA[5])", "BASE_DATA[I]={X 3,Y 0,Z 0,A 0,B 0,C 0}"])
def test_a_frame_that_may_be_changed_elsewhere(line):
    frame = "BASE_DATA[5]={X 1,Y 0,Z 0,A 0,B 0,C 0}\n"
    src = f"{ALREADY}{line}\n$TOOL=$NULLFRAME\n$BASE=BASE_DATA[5]\nPTP {HERE}\nEND\n"
    assert changed(src, dat=frame) == [False]
    assert changed(src.replace(line, "").replace("[5]", "[I]"), dat=frame) == [False]


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("$ROBROOT={X 0,Y 0,Z 120,A 25,B 0,C 0}", "$ROBROOT is set in line "),
        ("$WORLD.Z=120", "$WORLD is set in line "),
        ("$ERSYSROOT=FOUND", "$ERSYSROOT is set in line "),
        ("LEVEL($ROBROOT)", "$ROBROOT is given to a subroutine"),
        ("TRIGGER WHEN DISTANCE=0 DELAY=0 DO $WORLD={X 0,Y 0,Z 9,A 0,B 0,C 0}", "$WORLD is set in line "),
        ("INTERRUPT DECL 3 WHEN $IN[1] DO $ROBROOT.Z=300", "$ROBROOT is set in line "),
    ],
)
def test_a_program_that_moves_the_world_leaves_all_that_is_told_in_it(line, told):
    axes = "PTP {A1 10,A2 -80,A3 95,A4 15,A5 40,A6 20}"
    bases = f"$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nLIN {HERE}\n$BASE=BASE_DATA[2]\nLIN {THERE}\n"
    src = f"DEF a()\n$TOOL=$NULLFRAME\n{axes}\n@\n{bases}END\nDEF part()\n%\nEND\n"
    frames = '[object."$WORLD"]\nxyz=[0,0,-120]\n[object."2"]\nxyz=[1,0,0]\n'
    assert changed(src.replace("@", "").replace("%", ""), frames=frames) == [True, True, True]
    for here in (src.replace("@", line).replace("%", ""), src.replace("@", "part()").replace("%", line)):
        assert changed(here, frames=frames) == [True, False, False]
        number = line_of(here, line) if told.endswith(" ") else ""
        assert why(here, frames=frames).count(f"base: {told}{number}, ") == 2


def line_of(src, text):
    """The line where a text stands."""
    return src.partition(text)[0].count("\n") + 1


@pytest.mark.parametrize(
    "line",
    [
        "LIN Above(XP1,50.0)",
        "PTP INV_POS(XP1):XOFF",
        "PTP {X XP1.X,Y 0,Z 5,A 0,B 0,C 0}",
        "CIRC XP2,{X XP1.X,Y 0,Z 5,A 0,B 0,C 0}",
        "LIN_REL XP1",
        "$BASE=XP1",
        f"SLIN {HERE} WITH $BASE=XP1",
        "XP3={X XP1.X,Y 0,Z 5,A 0,B 0,C 0}",
    ],
)
def test_targets_that_others_are_computed_from_are_left(line):
    dat = f"DECL E6POS XP1={HERE}\nDECL E6POS XP2={THERE}\n"
    found = reasons(f"{ALREADY}PTP XP1\nPTP XP2\n{line}\nEND\n", dat)
    assert "the program computes with it" in found["1:XP1"]
    assert ("2:XP2" in found) == line.startswith("CIRC"), "whose end, and so how it passes XP2, is not known"


def test_a_parameter_is_not_the_point_of_its_name():
    src = f"{ALREADY}LIN XP1\npart(XP2)\nEND\nDEF part(XP1:IN)\nDECL E6POS XP1\n{BASE}\nLIN XP1\nEND\n"
    found = reasons(src, f"DECL E6POS XP1={HERE}\nDECL E6POS XP2={THERE}\n", AT_START)
    assert "given a value of that name" in found["1:XP1"]


@pytest.mark.parametrize("head", ["DEF a()\n", "", ";first\nDEF a()\n", "&ACCESS RVP\n"])
def test_a_byte_order_mark_stays_first(head):
    mark = b"\xef\xbb\xbf".decode("latin-1")
    src = f"{mark}{head}$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nPTP {HERE}\nEND\n"
    program = read("a.src", src, KUKA)
    done = rewrite(program, models(KUKA), Choices(), mark="compensated by truearm")
    assert done.changed.all()
    assert done.contents[0].startswith(b"\xef\xbb\xbf" + (head.encode() or b";compensated"))
    assert done.contents[0].count(b"\xef\xbb\xbf") == 1
    assert b"\n;compensated" in done.contents[0] or not head


def test_classic_inline_forms_with_collision_detection():
    form = (
        ";FOLD {word} P{n}\n$BWDSTART=FALSE\nPDAT_ACT=PPDAT1\nFDAT_ACT=FP1\n"
        "BAS(#{command}_PARAMS,2)\nSET_CD_PARAMS (0)\n{word} XP{n}\n;ENDFOLD\n"
    )
    src = "DEF a()\nGLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )\nBAS (#INITMOV,0 )\n"
    src += form.format(word="PTP", n=1, command="PTP") + form.format(word="LIN", n=2, command="CP") + "END\n"
    dat = f"DECL E6POS XP1={HERE}\nDECL E6POS XP2={THERE}\n"
    assert changed(src, dat + FRAME_DATA, '[tool."1"]\nxyz=[0,0,0]\n') == [True, True]
    written_out = src.replace("=FP1", "={TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE}")
    assert changed(written_out, dat, "") == [True, True]
    either = src.replace("FDAT_ACT=FP1\n", "IF $IN[1] THEN\nFDAT_ACT=FP1\nELSE\nFDAT_ACT=FP2\nENDIF\n")
    assert changed(either, dat + FRAME_DATA, '[tool."1"]\nxyz=[0,0,0]\n') == [False, False]


def test_settings_of_a_motion_are_those_that_it_states():
    own = f"SPTP {HERE} WITH $TOOL=STOOL2(FP1) C_SPL"
    frames = '[tool."1"]\nxyz=[0,0,100]\n'
    program = read("a.src", f"{ALREADY}{BASE}\n{own}\nEND\n", KUKA, frames, dat=FRAME_DATA)
    environment = program.environments[0]
    assert environment.tool.name == "1"
    assert environment.work_object.true[0, 3] == 0.001


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (f"{BASE}\nagain:\nPTP {HERE}\n{OTHER}\nGOTO again", [False]),
        (f"{BASE}\nagain:\nPTP {HERE}\nGOTO again", [True]),
        (f"{BASE}\nLOOP\n{OTHER}\nIF $IN[1] THEN\nEXIT\nENDIF\n{BASE}\nENDLOOP\nPTP {HERE}", [False]),
        (f"LOOP\n{BASE}\nPTP {HERE}\n$TOOL={{X 1,Y 0,Z 0,A 0,B 0,C 0}}\nENDLOOP", [False]),
    ],
)
def test_ways_that_lead_to_a_motion_with_another_tool_or_base(lines, expected):
    assert changed(f"{ALREADY}{lines}\nEND\n") == expected


@pytest.mark.parametrize("use", ["XP[1,2]", "XP[I,1]", "XP[2,2]"])
@pytest.mark.parametrize("stored", [[(1, 1), (1, 2)], [(1, 2)]])
def test_arrays_of_two_dimensions_are_told_as_such(use, stored):
    dat = "DECL E6POS XP[2,2]\n" + "".join(f"XP[{i},{k}]={HERE}\n" for i, k in stored)
    found = reasons(f"{ALREADY}PTP {use}\nEND\n", f"DEFDAT a\n{dat}ENDDAT\n")
    assert set(found.values()) == {"arrays of more dimensions than one are not read"}


KEPT, CHOSEN = "keeps the orientation that it comes with", "the controller chooses the orientation"
LINE_DATA = "DECL LDAT LC@={VEL 2.0,ACC 100.0,APO_DIST 100.0,APO_FAC 50.0,ORI_TYP #MODE,CIRC_TYP #BASE}\n"
DATA = FRAME_DATA + "".join(
    LINE_DATA.replace("@", mode).replace("MODE", mode) for mode in ("VAR", "CONSTANT")
)
DATA += "DECL LDAT LCNONE={VEL 2.0}\nDECL LDAT LCTWICE={ORI_TYP #VAR}\nLCTWICE.ORI_TYP=#CONSTANT\n"
DATA = DATA.replace("TOOL_NO 1", "TOOL_NO 0")


FLANGE = "$TOOL=$NULLFRAME\n$BASE=$NULLFRAME"


def inline(name):
    """What an inline form of a line sets, with line data of a name."""
    return f"LDAT_ACT={name}\nFDAT_ACT=FP1\nBAS(#CP_PARAMS,2.0)"


@pytest.mark.parametrize(
    ("before", "told"),
    [
        ("$ORI_TYPE=#CONSTANT", KEPT),
        ("$ori_type = #constant ;kept", KEPT),
        ("$ORI_TYPE=#IGNORE", CHOSEN),
        ("$ORI_TYPE=MODE", "$ORI_TYPE: it is computed at run time"),
        (inline("LCCONSTANT"), KEPT),
        (inline("{VEL 2.0,ACC 100.0,ORI_TYP #CONSTANT}"), KEPT),
        (inline("LCTWICE"), "$ORI_TYPE: LCTWICE does not tell it in this program"),
        ("LDAT_ACT=LCVAR\nLDAT_ACT.ORI_TYP=#CONSTANT\nBAS(#CP_DAT)", KEPT),
        ("IF $IN[1] THEN\n$ORI_TYPE=#CONSTANT\nENDIF", "$ORI_TYPE: it is not the same on all ways"),
        (f"{inline('LCCONSTANT')}\n{inline('LCNONE')}", KEPT),
        ("turned()", "$ORI_TYPE: a subroutine was called"),
        (f"OUTSIDE()\n{FLANGE}", "and may have set another: set $ORI_TYPE=#VAR behind it"),
        ("given($ORI_TYPE)", "$ORI_TYPE: a subroutine was called"),
        ("giving()", "$ORI_TYPE: a subroutine was called"),
        ("INTERRUPT DECL 5 WHEN $IN[1] DO given($ORI_TYPE)", "$ORI_TYPE: an interrupt or a trigger"),
        ("named()", "$ORI_TYPE: a subroutine was called"),
        ("$ORI_TYPE=#CONSTANT\neven()", "$ORI_TYPE: a subroutine was called"),
        ("INTERRUPT DECL 5 WHEN $IN[1] DO $ORI_TYPE=#CONSTANT", "$ORI_TYPE: an interrupt or a trigger"),
        ("INTERRUPT DECL 5 WHEN $IN[1] DO turned()", "$ORI_TYPE: an interrupt or a trigger"),
        ("$ORI_TYPE=#CONSTANT\nGOTO over\n$ORI_TYPE=#VAR\nover:\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME", "GOTO"),
    ],
)
def test_orientations_that_the_controller_does_not_take_from_the_target(before, told):
    behind = "DEF turned()\n$ORI_TYPE=#CONSTANT\nEND\nDEF even()\n$ORI_TYPE=#VAR\nEND\n"
    behind += "DEF given(x:OUT)\nx=#CONSTANT\nEND\nDEF named()\n$ORI_TYPE=var\nEND\n"
    behind += "DEF giving()\ngiven($ORI_TYPE)\nEND\n"
    src = f"{ALREADY}PTP {HERE}\n{before}\n@\nPTP {HERE}\nEND\n{behind}"
    for move in (f"LIN {THERE}", f"SLIN {THERE}", f"SPLINE\nSPL {THERE}\nENDSPLINE"):
        assert changed(src.replace("@", move), DATA) == [True, False, True]
        assert told in why(src.replace("@", move), DATA)
    assert changed(src.replace("@", f"PTP {THERE}"), DATA) == [True, True, True]
    assert changed(src.replace("@", f"CIRC {HERE},{THERE}"), DATA) == [True, False, False, True]


@pytest.mark.parametrize(
    "before",
    [
        "$ORI_TYPE=#VAR",
        "$ORI_TYPE=#CONSTANT\n$ORI_TYPE=#JOINT",
        "$ORI_TYPE=#CONSTANT\nBAS(#INITMOV,0)\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME",
        f"{inline('LCCONSTANT')}\n{inline('LCVAR')}",
        f"$ORI_TYPE=#CONSTANT\n{inline('LDEFAULT')}",
        inline("LCNONE"),
        "FDAT_ACT=FP1\nBAS(#CP_PARAMS,2.0)",
        "BAS(#PTP_PARAMS,100)\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME",
        "even()",
        "TRIGGER WHEN DISTANCE=0 DELAY=0 DO $ORI_TYPE=#VAR",
        "INTERRUPT DECL 5 WHEN $IN[1] DO $ORI_TYPE=#JOINT",
        f"SLIN {HERE} WITH $ORI_TYPE=#VAR",
    ],
)
def test_orientations_that_count(before):
    behind = "DEF even()\n$ORI_TYPE=#VAR\nWAIT SEC 1\nEND\n"
    assert all(changed(f"{ALREADY}PTP {HERE}\n{before}\nLIN {THERE}\nEND\n{behind}", DATA))


@pytest.mark.parametrize("own", ["#CONSTANT", "SORI_TYP(LCCONSTANT)", "SORI_TYP( LCCONSTANT )", "#IGNORE"])
def test_orientations_of_one_motion_or_one_spline(own):
    splines = f"SPLINE\nSPL {THERE} WITH $ORI_TYPE={own}\nSLIN {HERE}\nENDSPLINE"
    assert changed(f"{ALREADY}PTP {HERE}\n{splines}\nEND\n", DATA) == [True, False, True]
    around = (
        f"SPLINE WITH $ORI_TYPE={own}\nSPL {THERE}\nSLIN {HERE} WITH $ORI_TYPE=SORI_TYP(LCVAR)\nENDSPLINE"
    )
    assert changed(f"{ALREADY}PTP {HERE}\n{around}\nSLIN {THERE}\nEND\n", DATA) == [True, False, True, True]


def test_a_routine_that_leaves_orientations_and_not_the_tool():
    weld = f"DEF weld()\n$TOOL=TOOL_DATA[2]\n$BASE=$NULLFRAME\nLIN {THERE}\nEND\n"
    src = f"{ALREADY}PTP {HERE}\nweld()\n@\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nLIN {HERE}\nEND\n{weld}"
    assert changed(src.replace("@", "")) == [True, True, True]
    assert changed(src.replace("@", "$ORI_TYPE=#CONSTANT\nweld()")) == [True, False, False]


@pytest.mark.parametrize("said", ["", "$ORI_TYPE=#VAR", ";$ORI_TYPE=#CONSTANT", inline("LCVAR")])
def test_routines_elsewhere_are_expected_to_set_no_mode_that_the_files_do_not(said):
    dat = DATA[: DATA.index("DECL LDAT LCCONSTANT")]
    src = f"{ALREADY}PTP {HERE}\n{said}\nOUTSIDE()\n{FLANGE}\nLIN {THERE}\nLIN {HERE}\nEND\n"
    assert all(changed(src, dat))
    assert changed(src.replace("LIN", "PTP", 1) + "DEF b()\n$ORI_TYPE=MODE\nEND\n")[1:] == [True, False]
    assert all(changed(f"{ALREADY}PTP {HERE}\nEND\nGLOBAL DEF b()\n{FLANGE}\nLIN {THERE}\nEND\n", dat))


def test_line_data_that_no_file_has_may_be_of_any_mode():
    src = f"{ALREADY}PTP {HERE}\nOUTSIDE()\n{FLANGE}\nLIN {THERE}\n{inline('LCELSEWHERE')}\nEND\n"
    assert changed(src, DATA[: DATA.index("DECL LDAT")]) == [True, False]


@pytest.mark.parametrize("what", ["TRIGGER WHEN DISTANCE=0 DELAY=0", "INTERRUPT DECL 5 WHEN $IN[1]"])
@pytest.mark.parametrize("mode", ["#VAR", "#CONSTANT"])
def test_what_sets_a_mode_later_leaves_tool_and_base(what, mode):
    src = f"{ALREADY}PTP {HERE}\n{what} DO $ORI_TYPE={mode}\nPTP {THERE}\nPTP {HERE}\nEND\n"
    assert all(changed(src))


def test_a_goto_around_a_mode_leaves_tool_and_base():
    src = f"{ALREADY}PTP {HERE}\n$ORI_TYPE=#CONSTANT\nGOTO over\n$ORI_TYPE=#VAR\nover:\nPTP {THERE}\nEND\n"
    assert all(changed(src))


@pytest.mark.parametrize("before", ["", "$ORI_TYPE=#VAR"])
@pytest.mark.parametrize(
    ("inside", "expected"),
    [
        ("$ORI_TYPE=#VAR", [True, True, False]),
        (inline("LCVAR"), [True, True, False]),
        ("IF $IN[1] THEN\n$ORI_TYPE=#VAR\nENDIF", [True, False, False]),
        ("even()", [True, False, False]),
        ("IF $IN[1] THEN\n$ORI_TYPE=#JOINT\nENDIF", [True, False, False]),
    ],
)
def test_a_mode_set_in_a_loop_counts_whatever_comes_round(before, inside, expected):
    loop = f"LOOP\n{inside}\nLIN {THERE}\n$ORI_TYPE=#CONSTANT\nLIN {HERE}\nENDLOOP\nEND\n"
    behind = "DEF even()\n$ORI_TYPE=#VAR\nEND\n"
    assert changed(f"{ALREADY}PTP {HERE}\n{before}\n{loop}{behind}", DATA) == expected


def test_a_loop_that_comes_round_with_orientations_that_do_not_count():
    src = f"{ALREADY}LOOP\nPTP {HERE}\nLIN {THERE}\n$ORI_TYPE=#CONSTANT\nENDLOOP\nEND\n"
    assert changed(src) == [True, False]
    assert "a loop comes round to it with another tool, base or $ORI_TYPE" in why(src)


def test_no_waypoints_turn_where_the_tool_does_not():
    """Between two targets of one orientation lies one with another, which the arm does not take."""
    turned = pose_text([0, -90, 100, 20, 45, 90], decimals=5)
    done, _ = densified(f"PTP {HERE}\n$ORI_TYPE=#CONSTANT\nLIN {turned}\n$ORI_TYPE=#VAR\nLIN {THERE}")
    assert done.changed.tolist() == [True, False, True]
    assert done.inserted == 0
    assert densified(f"PTP {HERE}\nLIN {turned}\nLIN {THERE}")[0].inserted > 1
