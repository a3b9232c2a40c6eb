"""ABB targets whose configuration data or external axes are named data, as post-processors write them."""

import numpy as np
import pytest

from tests.programs_rig import ABB, models, read, rewritten
from tests.test_programs_rapid import UNUSED, numbers
from truearm.programs.densify import Spacing

Q1, Q2 = [5.0, 10.0, 10.0, 3.0, 60.0, 20.0], [8.0, 12.0, 11.0, 3.0, 62.0, 20.0]
RAIL = "VAR extjoint rail:=[100,9E9,9E9,9E9,9E9,9E9];"
DATA = f"VAR confdata conf:=[0,0,0,0];\nVAR extjoint extj:={UNUSED};\n{RAIL}"


def pose(q_deg, conf="conf", axes="extj"):
    place, turn, _, _ = numbers(q_deg, tool=np.eye(4), placed=np.eye(4)).strip("[]").split("],[")
    return f"[[{place}],[{turn}],{conf},{axes}]"


def joints(axes="extj"):
    return f"[{Q1},{axes}]"


def program_of(body, data=DATA, other=""):
    text = f"MODULE Job\n{data}\nPROC main()\n{body}\nENDPROC\n{other}ENDMODULE\n"
    return read("job.mod", text, ABB)


def reasons(body, **others):
    return [one.reason for one in rewritten(program_of(body, **others), models(ABB)).listed]


JOB = f"""ConfL \\Off;
MoveAbsJ {joints()},v100,fine,tool0;
MoveL {pose(Q2)},v100,z1,tool0;
MoveL {pose(Q1)},v100,fine,tool0;"""


def test_where_it_is_not_heeded_configuration_data_may_have_a_name():
    done = rewritten(program_of(JOB), models(ABB))
    assert done.changed.all()
    np.testing.assert_allclose(np.rad2deg(done.nominal), [Q1, Q2, Q1], atol=1e-3)
    lines = done.contents[0].decode().splitlines()
    assert [line.count("],conf,extj]") for line in lines[7:9]] == [1, 1]
    assert lines[6].count(",extj]") == 1
    assert lines[1:4] == DATA.splitlines()


def test_where_it_is_heeded_it_is_listed():
    (first, second) = reasons(JOB.replace("ConfL \\Off;\n", ""))
    assert first == second == 'its configuration data is "conf", as that of others may be, and is heeded'


@pytest.mark.parametrize("axes", ["rail", "other", "conf", "[9E9,9E9,9E9,9E9,9E9,x]"])
def test_external_axes_are_those_of_the_name(axes):
    (found,) = reasons(f"MoveAbsJ {joints(axes)},v100,fine,tool0;")
    assert found == ("external axes" if axes == "rail" else "not all of its components are numbers")


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ({"other": "PROC change()\nextj.eax_a:=10;\nENDPROC\n"}, "is changed at run time"),
        ({"other": f"PROC change()\nVAR extjoint extj:={UNUSED};\nENDPROC\n"}, "more than once"),
        ({"other": "PROC change()\nMoveRail extj;\nENDPROC\n"}, "may change it"),
    ],
)
def test_named_axes_that_may_change_are_listed(more, told):
    assert any(told in reason for reason in reasons(f"MoveAbsJ {joints()},v100,fine,tool0;", **more))


def test_a_declared_target_may_name_them_too():
    data = f"{DATA}\nCONST jointtarget jHome:={joints()};"
    assert rewritten(program_of("MoveAbsJ jHome,v100,fine,tool0;", data), models(ABB)).changed.all()


def test_no_waypoint_is_written_without_configuration_data():
    spacing = Spacing.of(1e-4, 5.0)
    done = rewritten(
        program_of(JOB), models(ABB, by_rad=(1e-3, -1e-3, 5e-4, 1e-3, -1e-3, 2e-3)), spacing=spacing
    )
    assert "nan" not in done.contents[0].decode()
    assert done.inserted == 0


STORED = ",".join(numbers(q, tool=np.eye(4), placed=np.eye(4)) for q in (Q1, Q2))
PATH = f"CONST robtarget pa{{2}}:=[{STORED}];\nVAR robtarget pb{{2}};\nVAR robtarget pc{{2,2}};"
TO = "v100,fine,tool0"


def test_asking_for_the_length_of_an_array_computes_with_none_of_its_targets():
    body = f"FOR i FROM 1 TO Dim(pa,1) DO\nMoveAbsJ {joints()},{TO};\nMoveJ pa{{i}},{TO};\nENDFOR"
    assert reasons(body, data=f"{DATA}\n{PATH}") == []
    for other in ("n:=Dim(pa,1)+pa{1}.trans.x;", "Dim pa,1;", "n:=Distance(pa{1}.trans,pa{2}.trans);"):
        assert len(reasons(f"{body}\n{other}", data=f"{DATA}\n{PATH}")) >= 2, other


@pytest.mark.parametrize(
    ("target", "reason"),
    [
        ("pb{1}", "its target is computed at run time"),
        ("pb{i}", "its target is computed at run time"),
        ("pc{1,2}", "arrays of more dimensions than one are not read"),
        ("pd{1}", "it is not declared in this module"),
    ],
)
def test_arrays_whose_targets_are_not_written_out(target, reason):
    assert reasons(f"pb:=pa;\nMoveJ {target},{TO};", data=f"{DATA}\n{PATH}")[-1:] == [reason]


@pytest.mark.parametrize(
    "offset",
    ["Offs(pA,0,0,nFar)", "Offs(pA,1e400,0,0)", "RelTool(pA,0,0,0\\Rz:=nFar/2)", "Offs(pA,nFar-nFar,0,0)"],
)
@pytest.mark.filterwarnings("error")
def test_an_offset_that_is_too_large_for_a_number_is_none(offset):
    target = numbers(Q1, tool=np.eye(4), placed=np.eye(4))
    data = f"CONST num nFar:=1e300*1e300;\nCONST robtarget pA:={target};"
    assert set(reasons(f"MoveJ {offset},{TO};", data=data)) == {"its offset is computed at run time"}
