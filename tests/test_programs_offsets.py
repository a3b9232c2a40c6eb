"""Targets that are used as they stand and with offsets: one change where all uses stay near enough."""

import numpy as np
import pytest

from tests.programs_rig import ABB, again, models, read, rewritten
from tests.test_programs_rapid import GO, SEEN, TABLE, TOOL, module, numbers, points
from truearm.errors import UsageError, WorkError
from truearm.inverse import Inverse
from truearm.programs.densify import OFFSET, Spacing
from truearm.programs.encoding import CORRECTED_SINGULAR
from truearm.programs.offsets import ALSO_OFFSET, STRETCHED, TURNED, Offsets, also_with_offsets
from truearm.programs.report import report_of
from truearm.programs.rewriting import Choices
from truearm.programs.uses import SEVERAL
from truearm.rotations import matrix_from_rotation_vector, quaternion_from_matrix

ABOVE = f"MoveJ Offs(pA,0,0,40),{GO}\nMoveL pA,{GO}\nMoveL RelTool(pA,0,0,-60),{GO}"


def program_of(body, data=None):
    return read("demo.mod", module(body, points() if data is None else data), ABB)


def listed(done):
    return {one.name: one.reason for one in done.listed if not one.reason.startswith("no motion")}


def tool_places(done):
    """Where the controller takes the tool for each move, (m, 3), m, by what the program says now."""
    program = again(done, ABB)
    found = []
    for move in np.flatnonzero(program.moves.moving):
        target = int(program.moves.target[move])
        environment = program.environments[int(program.moves.environment[move])]
        layout = program.layouts[int(program.targets.layout[target])]
        span = slice(program.targets.first[target], program.targets.first[target + 1])
        stored = layout.to_poses(program.targets.values[span][None, :7])
        found.append((environment.flange_poses(stored) @ environment.tool.controller)[0, :3, 3])
    return np.array(found)


def test_a_target_is_changed_where_its_approaches_stay_within():
    program = program_of(ABOVE)
    done = rewritten(program, models(ABB), offsets_mm=0.2)
    assert done.changed.sum() == 1
    assert not listed(done)
    assert len(done.nominal) == len(done.changed) == len(done.moved_mm) == len(program.targets)
    assert done.program is program
    exactly = rewritten(program_of(f"MoveJ pA,{GO}"), models(ABB))
    assert done.contents[0].count(b"Offs(pA,0,0,40)") == 1
    name = b"CONST robtarget pA"
    (line,) = (line for line in done.contents[0].splitlines() if name in line)
    assert line in exactly.contents[0].splitlines()


def test_its_approaches_are_as_far_off_as_is_said():
    apart = rewritten(program_of(ABOVE), models(ABB), offsets_mm=1e-4)
    assert not apart.changed.any()
    (reason,) = listed(apart).values()
    said_mm = float(reason.removeprefix("with its correction a use with an offset would be ").split()[0])
    assert 0.01 < said_mm < 0.2
    done = rewritten(program_of(ABOVE), models(ABB), offsets_mm=0.2)
    wanted = np.array(tool_places(done))
    for place, offset in ((0, "before"), (2, "after")):
        plain = program_of(f"MoveJ {moved(offset)},{GO}")
        wanted[place] = tool_places(rewritten(plain, models(ABB)))[0]
    off_mm = 1e3 * np.linalg.norm(tool_places(done) - wanted, axis=1)
    assert off_mm[1] == 0.0
    assert off_mm.max() == pytest.approx(said_mm, abs=2e-3)


def moved(offset):
    """pA with one of the offsets, written out."""
    program = program_of(ABOVE)
    number = next(number for number, name in program.targets.names.items() if name == "pa")
    span = slice(program.targets.first[number], program.targets.first[number + 1])
    values = program.targets.values[span]
    layout = program.layouts[int(program.targets.layout[number])]
    pose = layout.to_poses(values[None, :7])[0]
    shift = np.eye(4)
    shift[2, 3] = 0.04 if offset == "before" else -0.06
    pose = shift @ pose if offset == "before" else pose @ shift
    written = layout.from_poses(pose[None], values[None, :7])[0]
    place, turn = (",".join(f"{value:.7f}" for value in part) for part in (written[:3], written[3:]))
    conf = ",".join(f"{value:.0f}" for value in values[7:])
    return f"[[{place}],[{turn}],[{conf}],[9E9,9E9,9E9,9E9,9E9,9E9]]"


def test_without_a_length_it_is_listed_with_the_way_out():
    assert listed(rewritten(program_of(ABOVE), models(ABB))) == {"pa": ALSO_OFFSET}
    assert "--offsets-mm" in ALSO_OFFSET


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (f"MoveJ pA,{GO}\nMoveL Offs(pA,0,0,nRun),{GO}", SEVERAL),
        (f"MoveJ pA,{GO}\nMoveL Offs(pA,0,0,40),v100,fine,tool0\\WObj:=wT;", SEVERAL),
        (f"MoveJ Offs(pA,0,0,30),{GO}\nMoveL Offs(pA,0,0,40),{GO}", SEVERAL),
        (f"MoveJ pA,{GO}\nMoveJ Offs(pA,0,0,4000),{GO}", "it is used with offsets too, and its correction"),
    ],
)
def test_what_one_change_cannot_be_told_to_suit_stays(body, reason):
    done = rewritten(program_of(body), models(ABB), offsets_mm=5.0)
    assert not done.changed.any()
    assert listed(done)["pa"].startswith(reason)


def test_a_refused_approach_leaves_its_target_and_refuses_nothing():
    body = f"MoveJ pA,{GO}\nMoveJ Offs(pA,0,0,40),{GO}\nMoveJ pB,{GO}"
    program = program_of(body)
    numbers_of = {name: number for number, name in program.targets.names.items()}
    expanded = Offsets.of(program)
    assert expanded.stands_for.tolist() == [numbers_of["pa"]]
    done = rewritten(program, models(ABB, refuse=(1,)), offsets_mm=1.0)
    assert done.changed[numbers_of["pb"]]
    assert not done.changed[numbers_of["pa"]]
    assert "its correction is not known there" in listed(done)["pa"]


def test_moves_to_offsets_are_named_and_others_are_not():
    program = program_of(f"{ABOVE}\nMoveJ pB,{GO}")
    assert list(also_with_offsets(program).values()) == [[0, 2]]


def test_no_step_is_told_and_no_waypoint_goes_to_the_wrong_place():
    body = f"MoveJ pB,{GO}\n{ABOVE}"
    done = rewritten(program_of(body), models(ABB), offsets_mm=0.5, spacing=Spacing.of(1e-4, 5.0))
    assert "steps" not in [notice.kind for notice in done.notices]
    assert report_of(done)["counts"]["changed"] == 2
    text = done.contents[0].decode("latin-1")
    assert all(line in text for line in ABOVE.splitlines())
    before = {text[: text.index(line)].count("MoveL [[") for line in ABOVE.splitlines()[:2]}
    assert before == {0, done.inserted}, "waypoints lead to the target as it stands alone"
    assert done.inserted > 0


def test_programs_without_offsets_are_what_they_were():
    body = f"MoveJ {numbers(SEEN['pA'])},{GO}\nMoveL pB,{GO}"
    plain, given = (rewritten(program_of(body), models(ABB), offsets_mm=mm) for mm in (None, 0.1))
    assert plain.contents == given.contents


@pytest.mark.parametrize("length", [0.0, -1.0, float("nan")])
def test_a_length_is_positive(length):
    with pytest.raises(UsageError, match="offsets-mm"):
        rewritten(program_of(ABOVE), models(ABB), offsets_mm=length)


@pytest.mark.parametrize("length", ["0.2", True, np.array([0.2])])
def test_a_length_is_a_number(length):
    with pytest.raises(UsageError, match="--offsets-mm is .*number"):
        Choices(offsets_mm=length)


def near_an_edge(q_deg):
    """Points of which pA means these readings."""
    name = "  CONST robtarget pA:="
    return "\n".join(
        f"{name}{numbers(q_deg)};" if line.startswith(name) else line for line in points().split("\n")
    )


def test_where_the_numbers_of_a_target_cannot_be_said_the_step_at_its_approach_is_told():
    body = f"MoveJ pA,{GO}\nMoveJ pB,{GO}\nMoveL Offs(pA,0,0,40),{GO}\nMoveJ pB,{GO}"
    program = program_of(body, near_an_edge([5, 12, 22, 10, 1.0, 20]))
    by_rad = np.deg2rad([0.0, 0.0, 0.0, 0.0, -0.95, 0.0])
    done = rewritten(program, models(ABB, by_rad), offsets_mm=50.0, spacing=Spacing.of(1e-3, 5.0))
    assert listed(done) == {"pa": CORRECTED_SINGULAR}
    (notice,) = (notice for notice in done.notices if notice.kind == "steps")
    assert notice.message.startswith("1 target of linear")
    assert "offsets" not in [one.kind for one in done.notices]
    assert done.inserted == 0


def test_a_refused_target_is_not_kept_where_its_approach_would_show_the_step():
    program = program_of(f"MoveJ pA,{GO}\nMoveJ pB,{GO}\nMoveL Offs(pA,0,0,40),{GO}")
    with pytest.raises(WorkError, match="1 target can neither be corrected nor kept"):
        rewritten(program, models(ABB, refuse=(0,)), on_refusal="keep-nominal", offsets_mm=1.0)


def test_uses_with_offsets_do_not_count_as_targets_where_one_is_refused():
    program = program_of(f"{ABOVE}\nMoveJ pB,{GO}")
    with pytest.raises(WorkError, match=f"1 of {len(program.targets)} targets cannot be corrected"):
        rewritten(program, models(ABB, refuse=(1,)), offsets_mm=1.0)


def test_lines_at_approaches_get_waypoints_or_are_named():
    body = f"MoveJ pB,{GO}\nMoveL Offs(pA,0,0,200),{GO}\nMoveL pA,{GO}\nMoveL pB,{GO}"
    program = program_of(body)
    done = rewritten(program, models(ABB), offsets_mm=50.0, spacing=Spacing.of(1e-4, 5.0))
    text = done.contents[0].decode("latin-1")
    into, away = (text.index(f"MoveL {name},{GO}") for name in ("pA", "pB"))
    approach = text.index("MoveL Offs(pA,0,0,200)")
    assert text.count("MoveL [[", 0, approach) == 0
    assert text.count("MoveL [[", approach, into) > 0
    assert text.count("MoveL [[", into, away) > 0
    assert [one.listed.reason for one in done.deviating] == [OFFSET]
    assert done.deviating[0].deviation_mm > 1e-4
    (notice,) = (notice for notice in done.notices if notice.kind == "deviation")
    assert notice.rows == (
        program.sources[0].text[: program.sources[0].text.index("MoveL Offs")].count("\n") + 1,
    )


def test_what_was_allowed_and_what_it_cost_is_told():
    done = rewritten(program_of(f"{ABOVE}\nMoveJ pB,{GO}"), models(ABB), offsets_mm=0.2)
    (notice,) = (notice for notice in done.notices if notice.kind == "offsets")
    told = {one["name"]: (one["offset_mm"], one["offset_mrad"]) for one in report_of(done)["targets"]}
    off_mm, off_mrad = told["pa"]
    assert 0.01 < off_mm < 0.2
    assert 0.0 < off_mrad < 1.0
    assert told["pb"] == (None, None)
    assert notice.message == (
        "1 target is changed for its use as it stands (--offsets-mm): uses with offsets are up to "
        f"{off_mm:.3f} mm and {off_mrad:.3f} mrad off"
    )
    plain = rewritten(program_of(f"MoveJ pA,{GO}"), models(ABB), offsets_mm=0.2)
    assert not plain.notices
    assert len(done.offset_mm) == len(done.program.targets)


@pytest.mark.parametrize("heeded", [True, False])
def test_digits_that_the_controller_does_not_heed_refuse_nothing(heeded):
    off = "" if heeded else "ConfL\\Off;\n"
    body = f"{off}MoveJ pB,{GO}\nMoveL Offs(pA,0,0,40),{GO}\nMoveL pA,{GO}"
    by_rad = np.deg2rad([0.0, 0.0, 0.0, 0.0, 0.0, -0.6])
    program = program_of(body, near_an_edge([5, 12, 22, 10, 45, 0.5]))
    done = rewritten(program, models(ABB, by_rad), offsets_mm=5.0)
    assert listed(done) == ({"pa": TURNED} if heeded else {})


def test_an_offset_in_a_turned_work_object_is_off_by_what_is_said():
    placed = rigid_motion_of([300.0, 50.0, 100.0], [0.3, -0.4, 1.2])
    x, y, z = placed[:3, 3] * 1e3
    turn = ",".join(f"{value:.9f}" for value in quaternion_from_matrix(placed[:3, :3]))
    q = np.deg2rad(SEEN["pA"])
    data = (
        f'{points()}\n  PERS wobjdata wR:=[FALSE,TRUE,"",[[{x},{y},{z}],[{turn}]],[[0,0,0],[1,0,0,0]]];\n'
        f"  CONST robtarget pT:={numbers(SEEN['pA'], placed=placed, decimals=6)};"
    )
    there = "v100,fine,tG\\WObj:=wR;"
    by_rad = np.array([1e-3, -1e-3, 5e-4, 1e-3, -1e-3, 2e-3])
    body = f"MoveJ Offs(pT,10,-20,40),{there}\nMoveL pT,{there}"
    done = rewritten(program_of(body, data), models(ABB, by_rad), offsets_mm=0.5)
    moved_by = np.eye(4)
    moved_by[:3, 3] = [0.01, -0.02, 0.04]
    approach = placed @ moved_by @ np.linalg.inv(placed) @ ABB.pose(q)
    wanted = ABB.pose(Inverse(ABB).near(approach[None], q[None])[0] + by_rad) @ TOOL
    off_mm = 1e3 * np.linalg.norm(tool_places(done)[0] - wanted[:3, 3])
    (said_mm,) = done.offset_mm[done.changed]
    assert off_mm == pytest.approx(said_mm, abs=1e-3)
    assert said_mm > 0.01


def rigid_motion_of(place_mm, turn):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = matrix_from_rotation_vector(np.array(turn)), np.array(place_mm) * 1e-3
    return pose


OTHER_TOOL = "\n  PERS tooldata tH:=[TRUE,[[0,0,130],[1,0,0,0]],[1.5,[0,0,50],[1,0,0,0],0,0,0]];"
LOAD = "\n  PERS loaddata lPart:=[2,[0,0,50],[1,0,0,0],0,0,0];"


@pytest.mark.parametrize(
    "body",
    [
        f"MoveJ Offs(pA,0,0,40),v100,fine,tH\\WObj:=wT;\nMoveL pA,{GO}",
        f"MoveJ Offs(pA,0,0,40),{GO}\nMoveL pA,{GO}\nGripLoad lPart;\nMoveL Offs(pA,0,0,40),{GO}",
        f"MoveJ Offs(pA,0,0,40),{GO}\nMoveL pA,{GO}\nPickThere pA;",
        f"MoveJ Offs(pA,0,0,40),{GO}\nMoveL pA,{GO}\npA.trans.z:=10;",
        f"FOR i FROM 1 TO 3 DO\nMoveJ Offs(pA,0,0,i*20),{GO}\nMoveL pA,{GO}\nENDFOR",
    ],
    ids=["tool", "load", "routine", "assigned", "index"],
)
def test_what_is_not_alike_at_target_and_approach_leaves_the_target(body):
    done = rewritten(program_of(body, points() + OTHER_TOOL + LOAD), models(ABB), offsets_mm=50.0)
    assert not done.changed.any()
    assert "pa" in listed(done)


@pytest.mark.parametrize(
    "body",
    [
        f"FOR i FROM 1 TO 3 DO\n{ABOVE}\nENDFOR",
        f"{ABOVE}\nMoveL pB,{GO}\nMoveL Offs(pA,0,0,40),{GO}",
        f"MoveJ Offs(pA,20,0,30),{GO}\nMoveC Offs(pA,0,0,40),pA,{GO}",
    ],
    ids=["loop", "two", "arc"],
)
def test_target_and_approach_may_be_used_again(body):
    done = rewritten(program_of(body), models(ABB), offsets_mm=0.5)
    assert not listed(done)
    names = done.program.targets.names
    assert [names[target] for target in np.flatnonzero(np.isfinite(done.offset_mm))] == ["pa"]


def test_an_approach_whose_correction_ends_at_a_singularity_leaves_its_target():
    approach, up = np.deg2rad([5, 12, 22, 10, 1.0, 20]), np.eye(4)
    up[2, 3] = 0.04
    pose = TABLE @ up @ np.linalg.inv(TABLE) @ ABB.pose(approach)
    q_deg = np.rad2deg(Inverse(ABB).near(pose[None], approach[None])[0])
    program = program_of(f"MoveJ Offs(pA,0,0,-40),{GO}\nMoveJ pA,{GO}", near_an_edge(q_deg))
    by_rad = np.deg2rad([0.0, 0.0, 0.0, 0.0, -0.95, 0.0])
    done = rewritten(program, models(ABB, by_rad), offsets_mm=50.0)
    assert listed(done) == {"pa": STRETCHED}
