"""`truearm compensate` as people run it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import truearm as ta
from tests.programs_rig import ABB, obeyed, read
from tests.test_programs_rapid import GO, SEEN, TABLE, TOOL, module, points
from truearm.cli import main
from truearm.simulation import VirtualArm

PROGRAM = str(Path(sys.executable).parent / "truearm")
BODY = f"MoveAbsJ jHome,v100,fine,tG;\nMoveJ pA,{GO}\nMoveL pB,{GO}\nMoveL pNowhere,{GO}\nMoveJ pD,{GO}"
FAR = f"MoveAbsJ jHome,v100,fine,tG;\nMoveJ pA,{GO}"


@pytest.fixture(scope="module")
def arm():
    return VirtualArm(ABB, seed=3)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, arm):
    place = tmp_path_factory.mktemp("compensate")
    measured = arm.measure(arm.poses(60, seed=1), orientation=True)
    ta.calibrate(ABB, measured, ta.CalibrationOptions.of(model="constant")).save(place / "arm.calib")
    (place / "demo.mod").write_bytes(module(BODY, points()).encode("latin-1"))
    return place


@pytest.fixture(autouse=True)
def inside(folder, monkeypatch):
    monkeypatch.chdir(folder)


def run(*options):
    return main(["compensate", "arm.calib", "demo.mod", "--controller", "nominal", *options])


def test_a_program_as_people_rewrite_it():
    command = [PROGRAM, "compensate", "arm.calib", "demo.mod", "-o", "out.mod", "--controller", "nominal"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    told = " ".join(done.stdout.split())
    assert "RAPID: 4 of 6 targets changed, 0 kept as they were after a refusal, 2 left as they are" in told
    assert "2 left as they are; listed besides: 1 place without numbers of its own." in told
    assert "Left as they are:" in done.stdout
    assert "MoveL pNowhere" in done.stdout
    assert "not declared in this module" in done.stdout
    assert "Written: out.mod" in done.stdout
    assert "This tells whether the arm is still as it was calibrated:" in done.stdout
    assert sorted(path.name for path in Path().iterdir() if "out" in path.name) == ["out.mod"]


def test_the_true_tool_goes_where_the_author_meant(arm, folder):
    """Before and after, the truth of the virtual arm at the program's own tool."""
    assert run("-o", "hit.mod", "--report", "hit.json") == 0
    report = json.loads(Path("hit.json").read_text())
    calibration = ta.Calibration.load(folder / "arm.calib")
    written = read("hit.mod", Path("hit.mod").read_bytes().decode("latin-1"), ABB)
    by_name = {name: number for number, name in written.targets.names.items()}
    said = obeyed(written, ABB, np.zeros((len(written.targets), 6)))
    for name in ("pA", "pB", "pD"):
        wanted = ABB.pose(np.deg2rad(SEEN[name])) @ TOOL
        before = calibration.pose(np.deg2rad(SEEN[name])) @ TOOL
        after = calibration.pose(said[by_name[name.lower()]]) @ TOOL
        assert np.linalg.norm(before[:3, 3] - wanted[:3, 3]) > 2e-4
        assert np.linalg.norm(after[:3, 3] - wanted[:3, 3]) < 3e-6, "numbers are rounded to a micrometre"
        truth = arm.true_pose(said[by_name[name.lower()]][None], tool=TOOL)[0]
        missed = np.linalg.norm(
            arm.true_pose(np.deg2rad(SEEN[name])[None], tool=TOOL)[0][:3, 3] - wanted[:3, 3]
        )
        assert np.linalg.norm(truth[:3, 3] - wanted[:3, 3]) < 0.5 * missed
    assert report["counts"]["changed"] == 4
    assert sum('"corrected"' in line for line in Path("hit.json").read_text().splitlines()) == 4
    assert report["controller"] == {"kind": "nominal", "source": ""}
    assert TABLE[0, 3] == 0.3


def test_json_is_all_that_is_printed(capsys):
    assert run("-o", "json.mod", "--json") == 0
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    counts = found["counts"]
    assert counts["targets"] == counts["changed"] + counts["kept"] + counts["left"] == 6
    assert (counts["listed"], counts["beside"]) == (3, 1)
    assert found["outputs"] == ["json.mod"]
    assert {"line", "column", "name", "nominal", "corrected", "correction_mm"} <= found["targets"][0].keys()


def test_a_dry_run_shows_a_table_and_a_diff_and_writes_nothing(capsys):
    before = sorted(Path().iterdir())
    assert run("--dry-run") == 0
    printed = capsys.readouterr().out
    assert "shift mm" in printed
    assert "--- demo.mod" in printed
    assert "+++ demo.mod (compensated)" in printed
    assert "4 of 6 targets would be changed" in " ".join(printed.split())
    table = printed.split("--- demo.mod")[0]
    assert max(map(len, table.splitlines())) <= 80
    assert sorted(Path().iterdir()) == before
    named = printed.splitlines()[-1].split()
    assert named[-2:] == ["-o", "OUT"]
    assert main([*named[1:-1], "named.mod"]) == 0
    assert Path("named.mod").exists()


def test_what_was_rewritten_is_not_rewritten_again(capsys):
    assert run("-o", "once.mod") == 0
    again = ["compensate", "arm.calib", "once.mod", "-o", "twice.mod", "--controller", "nominal"]
    assert main(again) == 1
    assert "compensated already" in capsys.readouterr().err
    assert not Path("twice.mod").exists()
    assert main([*again, "--force"]) == 0


TO_X = ["arm.calib", "demo.mod", "-o", "x.mod", "--controller", "nominal"]


@pytest.mark.parametrize(
    ("words", "status", "told"),
    [
        (["arm.calib", "demo.mod", "-o", "x.mod"], 2, "--controller"),
        (["arm.calib", "demo.mod", "--controller", "nominal"], 2, "no output"),
        (["arm.calib", "demo.mod", "-o", "demo.mod", "--controller", "nominal"], 2, "the program itself"),
        (["none.calib", "demo.mod", "-o", ".", "--controller", "nominal"], 2, "the program itself"),
        ([*TO_X, "--feature", "t=1", "--feature", "t=2"], 2, '"t" has two values'),
        (["arm.calib", "none.mod", "-o", "x.mod", "--controller", "nominal"], 1, "no such file"),
        (["arm.calib", "demo.xyz", "-o", "x.mod", "--controller", "nominal"], 2, "--language"),
        (["arm.calib", "demo.mod", "-o", "x.mod", "--controller", "none.toml"], 1, "none.toml"),
        (["arm.calib", "demo.mod", "-o", "no/x.mod", "--controller", "nominal"], 1, "no such directory"),
        (
            ["arm.calib", "demo.mod", "-o", "x.mod", "--controller", "nominal", "--task", "pos"],
            2,
            "pose or axis",
        ),
        ([*TO_X, "--moving", "a"], 2, "1,2,3"),
        (
            ["arm.calib", "demo.mod", "-o", "x.mod", "--controller", "nominal", "--feature", "t"],
            2,
            "NAME=VALUE",
        ),
        (
            ["arm.calib", "demo.mod", "-o", "x.mod", "--controller", "nominal", "--densify-mm", "0"],
            2,
            "positive",
        ),
        (
            ["arm.calib", "demo.mod", "-o", "x.mod", "--controller", "nominal", "--largest-mm", "0.001"],
            1,
            "keep-nominal",
        ),
        (
            ["arm.calib", "demo.mod", "-o", "x.mod", "--controller", "nominal", "--frames", "f.toml"],
            1,
            "f.toml",
        ),
    ],
)
def test_errors_say_the_way_out_and_nothing_is_written(words, status, told, capsys):
    assert main(["compensate", *words]) == status
    assert told in " ".join(capsys.readouterr().err.split())
    assert not Path("x.mod").exists()


def test_a_broken_program_names_line_and_column(capsys):
    Path("broken.mod").write_text("MODULE B\nCONST robtarget p:=[[1,2,3;\nENDMODULE\n")
    assert main(["compensate", "arm.calib", "broken.mod", "-o", "x.mod", "--controller", "nominal"]) == 1
    assert "broken.mod, line 2, column" in capsys.readouterr().err


def test_keep_nominal_where_that_makes_no_step(capsys):
    Path("far.mod").write_bytes(module(FAR, points()).encode("latin-1"))
    words = ["compensate", "arm.calib", "far.mod", "-o", "kept.mod", "--controller", "nominal"]
    assert main([*words, "--largest-mm", "1.35", "--on-refusal", "keep-nominal"]) == 0
    assert "Kept after a refusal:" in capsys.readouterr().out
    before = module(FAR, points()).splitlines()
    after = Path("kept.mod").read_bytes().decode("latin-1").splitlines()
    assert len(after) == len(before) + 1
    assert len(set(after) - set(before)) == 2, "the mark and jHome"


def test_where_nothing_is_changed_nothing_is_written_that_says_it_was(capsys):
    Path("still.mod").write_bytes(module(FAR, points()).encode("latin-1"))
    words = ["compensate", "arm.calib", "still.mod", "--controller", "nominal", "--largest-mm", "0.001"]
    words += ["--on-refusal", "keep-nominal", "--report", "still.json"]
    assert main([*words, "-o", "new/"]) == 1
    printed = capsys.readouterr()
    assert "nothing was changed: none of 6 targets" in printed.err
    assert "RAPID: 0 of 6 targets changed, 2 kept" in printed.out
    assert "Run it slowly" not in printed.out
    assert not Path("new").exists()
    assert json.loads(Path("still.json").read_text())["outputs"] == []
    assert main([*words, "--dry-run"]) == 0
    assert "RAPID: 0 of 6 targets would be changed" in capsys.readouterr().out
    done = ta.compensate_program(
        "still.mod",
        ta.Compensator(ta.Calibration.load("arm.calib"), limits=ta.Limits(largest_mm=0.001)),
        controller="nominal",
        choices=ta.Choices(on_refusal="keep-nominal"),
    )
    assert done.contents == (Path("still.mod").read_bytes(),)
    with pytest.raises(ta.WorkError, match="only where something in it is corrected"):
        done.save("still2.mod")


def test_seeds_of_a_path_are_no_targets(arm, capsys):
    q = arm.poses(3, seed=5)
    poses = ABB.pose(q)
    xyz = 1e3 * poses[:, :3, 3]
    table = np.hstack([xyz, Rotation.from_matrix(poses[:, :3, :3]).as_rotvec(), q])
    names = "x_mm,y_mm,z_mm,rx,ry,rz,q1,q2,q3,q4,q5,q6"
    np.savetxt("seeds.csv", table, delimiter=",", header=names, comments="", fmt="%.9f")
    words = ["compensate", "arm.calib", "seeds.csv", "--controller", "nominal", "-o", "seeds_out.csv"]
    assert main([*words, "--report", "seeds.json"]) == 0
    assert "CSV path: 3 of 3 targets changed, 0 kept" in capsys.readouterr().out
    counts = json.loads(Path("seeds.json").read_text())["counts"]
    assert (counts["targets"], counts["moves"], counts["changed"]) == (3, 3, 3)
    assert main([*words[:-1], "x.csv", "--largest-mm", "0.001"]) == 1
    told = capsys.readouterr().err
    assert "3 of 3 targets cannot be corrected" in told
    assert "Change them, or allow more with --largest-mm; --on-refusal" in told


def test_no_option_is_named_where_none_helps(arm, capsys):
    wrist, far = np.array([0.1, 0.2, -0.3, 0.4, 0.01, 0.5]), arm.poses(1, seed=5)[0]
    np.savetxt("path.csv", [wrist, far], delimiter=",", header="q1,q2,q3,q4,q5,q6", comments="")
    words = ["compensate", "arm.calib", "path.csv", "--controller", "nominal", "-o", "out.csv"]
    assert main([*words, "--largest-joint-deg", "0.5"]) == 1
    told = capsys.readouterr().err
    assert "the tool stays" in told
    assert "No option allows a tool to stay away" in told
    assert "--largest-mm" not in told


def test_a_directory_takes_files_of_the_same_names(arm):
    Path("out").mkdir(exist_ok=True)
    assert run("-o", "out") == 0
    assert Path("out/demo.mod").exists()
    compensator = ta.Compensator(ta.Calibration.load("arm.calib"))
    done = ta.compensate_program("demo.mod", compensator, controller="nominal")
    assert done.save("made/for it/") == [Path("made/for it/demo.mod")]


def test_refusals_of_positions_alone_name_the_tool(arm, capsys):
    table = arm.measure(arm.poses(60, seed=1))
    ta.calibrate(ABB, table, ta.CalibrationOptions.of(model="constant")).save(Path("points.calib"))
    np.savetxt("path.csv", arm.poses(3, seed=5), delimiter=",", header="q1,q2,q3,q4,q5,q6", comments="")
    command = ["compensate", "points.calib", "path.csv", "--controller", "nominal", "-o", "out.csv"]
    assert main([*command, "--largest-std-mm", "1e-4"]) == 1
    told = capsys.readouterr().err
    assert "3 of 3 targets cannot be corrected" in told
    assert "sure of tools near the points that were measured" in told
    assert not Path("out.csv").exists()


@pytest.mark.parametrize(
    "words",
    [
        ["-o", "arm.calib"],
        ["-o", "new.mod", "--report", "demo.mod"],
        ["-o", "own.toml", "--programming", "own.toml"],
        ["-o", "new.mod", "--report", "own.toml", "--controller", "own.toml"],
    ],
)
def test_what_is_read_is_never_written_over(words, capsys):
    Path("own.toml").write_text(ta.Robot.load("abb-irb-120").to_toml())
    names = ("arm.calib", "demo.mod", "own.toml")
    before = [Path(name).read_bytes() for name in names]
    assert run(*words) == 2
    assert "never written over" in capsys.readouterr().err
    assert [Path(name).read_bytes() for name in names] == before


def test_a_report_never_takes_the_place_of_a_file_that_belongs_to_the_program(capsys):
    Path("part.src").write_text("DEF part()\nPTP {A1 0,A2 10,A3 -20,A4 0,A5 30,A6 0}\nEND\n")
    Path("part.dat").write_text("DEFDAT part\nENDDAT\n")
    words = ["compensate", "arm.calib", "part.src", "--controller", "nominal"]
    for output in (["--dry-run"], ["-o", "else/"]):
        assert main([*words, *output, "--report", "part.dat"]) == 2
        assert "never written over" in capsys.readouterr().err
    Path("there").mkdir()
    for named, report in (("new.src", "new.dat"), ("there", "there/part.src")):
        assert main([*words, "-o", named, "--report", report]) == 2
        assert "is the output already" in capsys.readouterr().err
        assert not Path(named).is_file()
    assert Path("part.dat").read_text() == "DEFDAT part\nENDDAT\n"


def test_a_directory_that_is_made_may_be_called_as_the_program_and_take_the_report():
    Path("part.src").write_text("DEF part()\nPTP {A1 0,A2 10,A3 -20,A4 0,A5 30,A6 0}\nEND\n")
    Path("part.dat").write_text("DEFDAT part\nENDDAT\n")
    words = ["compensate", "arm.calib", "part.src", "--controller", "nominal", "--on-refusal", "keep-nominal"]
    assert main([*words, "-o", "part/", "--report", "part/report.json"]) == 0
    assert {path.name for path in Path("part").iterdir()} == {"part.src", "part.dat", "report.json"}


def test_a_dry_run_writes_nothing_and_may_name_any_output():
    assert run("--dry-run", "-o", "nowhere/out.mod") == 0


def test_a_least_spacing_says_nothing_alone(capsys):
    assert run("--dry-run", "--least-spacing-mm", "5") == 2
    assert "Give --densify-mm as well" in capsys.readouterr().err


def test_a_report_does_not_take_the_place_of_the_program(capsys):
    assert run("-o", "new.mod", "--report", "./new.mod") == 2
    assert "is the output already" in capsys.readouterr().err
    assert not Path("new.mod").exists()


def test_inserted_waypoints_are_counted(capsys):
    assert run("-o", "dense.mod", "--densify-mm", "0.001", "--least-spacing-mm", "5") == 0
    told = capsys.readouterr().out
    lines = Path("dense.mod").read_text(encoding="latin-1").count("MoveL [[")
    assert lines > 0
    assert f"Waypoints inserted on straight lines: {lines}." in told


def test_the_model_of_another_arm_is_refused_and_nothing_is_written(capsys):
    other = ta.Robot.load("abb-irb-1200")
    Path("other.toml").write_text(other.to_toml())
    words = ["compensate", "arm.calib", "demo.mod", "-o", "wrong.mod", "--controller"]
    assert main([*words, "other.toml"]) == 1
    told = " ".join(capsys.readouterr().err.split())
    assert "other.toml: at the same joints its flange is up to" in told
    assert "Declare the model of this very arm" in told
    assert not Path("wrong.mod").exists()
    compensator = ta.Compensator(ta.Calibration.load("arm.calib"))
    with pytest.raises(ta.InputError, match="away from that of ABB IRB 120"):
        ta.compensate_program("demo.mod", compensator, controller=ta.Controller.nominal(other))
    Path("other.toml").write_text(ABB.to_toml())
    assert main([*words, "other.toml"]) == 0


def test_how_far_written_positions_moved_holds_what_the_controller_knows(capsys):
    """With a model of its own they move by more or less than the correction does."""
    table = ABB.table + np.eye(6, 5, k=-1) * 2e-3
    own = ta.Robot.from_dict({**ABB.to_dict(), "table": table.tolist()})
    Path("own_model.toml").write_text(own.to_toml())
    words = ["compensate", "arm.calib", "demo.mod", "-o", "moved.mod", "--controller", "own_model.toml"]
    assert main([*words, "--report", "moved.json"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    report = json.loads(Path("moved.json").read_text())
    moved = [one["moved_mm"] for one in report["targets"] if one["moved_mm"] is not None]
    assert len(moved) == 3, "jHome says joints"
    assert f"Written positions moved by {max(moved):.3f} mm at most." in told
    assert report["moved_mm"]["largest"] == max(moved)
    before, after = (read(name, Path(name).read_text("latin-1"), ABB) for name in ("demo.mod", "moved.mod"))
    for one in report["targets"]:
        if one["moved_mm"] is not None:
            xyz = [values_of(program, one["name"])[:3] for program in (before, after)]
            assert one["moved_mm"] == pytest.approx(np.linalg.norm(xyz[1] - xyz[0]), abs=1e-9)
            assert abs(one["moved_mm"] - one["correction_mm"]) > 0.05


def values_of(program, name):
    target = next(number for number, known in program.targets.names.items() if known == name)
    first = program.targets.first[target]
    return program.targets.values[first : first + 7]


def test_what_fewer_joints_leave_is_told(capsys):
    q = np.array([[0.0, 0.2, 0.1, 0.1, 0.5, 0.0], [0.3, 0.2, 0.1, 0.1, 0.7, 0.2]])
    np.savetxt("few.csv", q, delimiter=",", header="q1,q2,q3,q4,q5,q6", comments="", fmt="%.9f")
    words = ["compensate", "arm.calib", "few.csv", "--controller", "nominal", "-o", "few_out.csv"]
    assert main([*words, "--moving", "1,2,3", "--report", "few.json"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    targets = json.loads(Path("few.json").read_text())["targets"]
    found = ta.Compensator(ta.Calibration.load("arm.calib"), moving=(1, 2, 3)).joints(q)
    assert [one["residual_mrad"] for one in targets] == pytest.approx(found.residual_mrad)
    assert [one["residual_mm"] for one in targets] == pytest.approx(found.residual_mm)
    assert found.residual_mrad.max() > 0.1
    most = found.residual_mrad.argmax()
    assert f"in full: left are up to {found.residual_mrad[most]:.3f} mrad (few.csv, line {most + 2}," in told
    assert main(words) == 0
    assert "in full" not in capsys.readouterr().out


def test_targets_that_are_left_alone_are_not_said_to_be_missed(capsys):
    refused_first = "\n".join(reversed(FAR.splitlines()))
    Path("far.mod").write_bytes(module(refused_first, points()).encode("latin-1"))
    words = ["compensate", "arm.calib", "far.mod", "-o", "kept.mod", "--controller", "nominal"]
    words += ["--task", "position", "--largest-mm", "1.35", "--on-refusal", "keep-nominal"]
    assert main(words) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "1 of 6 targets changed, 1 kept" in told
    assert "in full" not in told


def test_a_path_gets_no_rows_and_says_so(capsys):
    q = np.array([[0.0, 0.2, 0.1, 0.1, 0.5, 0.0], [0.6, 0.2, 0.1, 0.1, 0.5, 0.0]])
    poses = ABB.pose(q)
    turns = Rotation.from_matrix(poses[:, :3, :3]).as_rotvec()
    names = "x_mm,y_mm,z_mm,rx,ry,rz,q1,q2,q3,q4,q5,q6"
    table = np.hstack([1e3 * poses[:, :3, 3], turns, q])
    np.savetxt("two.csv", table, delimiter=",", header=names, comments="", fmt="%.9f")
    words = ["compensate", "arm.calib", "two.csv", "--controller", "nominal", "-o", "two_out.csv"]
    assert main([*words, "--densify-mm", "0.0001", "--least-spacing-mm", "2"]) == 0
    told = " ".join(capsys.readouterr().err.split())
    assert "1 move deviates by more than 0.0001 mm (--densify-mm)" in told
    assert "mm; a path gets no rows but its author's)" in told


def test_what_offsets_may_cost_is_in_the_report(capsys):
    body = f"MoveJ Offs(pA,0,0,40),{GO}\nMoveL pA,{GO}\nMoveJ pB,{GO}"
    Path("above.mod").write_bytes(module(body, points()).encode("latin-1"))
    words = ["compensate", "arm.calib", "above.mod", "-o", "beside.mod", "--controller", "nominal"]
    assert main([*words, "--offsets-mm", "0.5", "--report", "beside.json"]) == 0
    told = " ".join(capsys.readouterr().err.split())
    report = json.loads(Path("beside.json").read_text())
    off_mm, off_mrad = next((one["offset_mm"], one["offset_mrad"]) for one in report["targets"])
    assert report["offsets_mm"] == 0.5
    assert 0.0 < off_mm <= 0.5
    assert f"uses with offsets are up to {off_mm:.3f} mm and {off_mrad:.3f} mrad off" in told
    assert main([*words, "--report", "beside.json"]) == 0
    report = json.loads(Path("beside.json").read_text())
    assert report["offsets_mm"] is None
    assert {one["offset_mm"] for one in report["targets"]} == {None}
