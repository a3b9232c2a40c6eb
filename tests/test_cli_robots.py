"""The command line: what it loads, prints, and answers to what it cannot do."""

import json
import os
import subprocess
import sys
import types

import numpy as np
import pytest

from truearm.cli import COMMANDS, console, main
from truearm.cli.entry import Entry
from truearm.cli.lazy import build
from truearm.description.library import library_names
from truearm.errors import InputError, Notice, UsageError, WorkError
from truearm.robot import Robot

HEAVY = ("numpy", "pandas", "scipy", "truearm._core", "truearm.robot")


def loaded_by(*arguments):
    """Exit status, stdout and the heavy modules that a fresh process loads for a command."""
    script = (
        "import sys\nfrom truearm.cli import main\nstatus = main(sys.argv[1:])\n"
        f"print([name for name in {HEAVY!r} if name in sys.modules], file=sys.stderr)\nsys.exit(status)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments], capture_output=True, text=True, check=False
    )
    return done.returncode, done.stdout, done.stderr.strip().splitlines()[-1]


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["nonsense"], []])
def test_help_loads_nothing_heavy(arguments):
    _, _, heavy = loaded_by(*arguments)
    assert heavy == "[]"


def test_help_lists_every_command():
    status, printed, _ = loaded_by("--help")
    assert status == 0
    for entry in COMMANDS:
        assert f"  {entry.name} " in printed
        assert entry.summary in printed
    assert max(map(len, printed.splitlines())) <= 80


def test_the_library_is_listed(capsys):
    assert main(["robots"]) == 0
    printed = capsys.readouterr().out
    for name in library_names():
        assert f" {name} " in printed
    assert "RRPR" in printed


def test_the_commands_run_as_a_module():
    done = subprocess.run(
        [sys.executable, "-m", "truearm", "robots", "ur10", "--json"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(done.stdout)["name"] == "UR10"


def test_the_library_as_json(capsys):
    assert main(["robots", "--json"]) == 0
    printed = capsys.readouterr()
    listed = json.loads(printed.out)
    assert [robot["name"] for robot in listed] == library_names()
    assert all(robot["source"] for robot in listed)
    assert printed.err == ""


@pytest.mark.parametrize("name", library_names())
def test_every_arm_is_shown_within_80_columns_and_in_order(name, capsys):
    assert main(["robots", name]) == 0
    printed = capsys.readouterr()
    assert max(map(len, printed.out.splitlines())) <= 80
    assert "The file is in order." in printed.out
    assert "Source: " in printed.out
    assert printed.err == ""


def test_the_table_is_in_mm_and_degrees(capsys):
    assert main(["robots", "RV-M2"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["1", "R", "0", "0", "120", "-90", "-150", "to", "150"] in lines
    assert ["3", "R", "0", "0", "265", "-90", "-120", "to", "0"] in lines


def test_a_robot_as_json_is_the_robot(capsys):
    assert main(["robots", "fanuc-lr-mate-200id", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["units"] == {"length": "m", "angle": "rad"}
    assert content["notices"] == []
    assert Robot.from_dict(content) == Robot.load("fanuc-lr-mate-200id")


def test_no_zero_of_a_coupling_has_a_sign(capsys):
    assert main(["robots", "kuka-kr-6-r900"]) == 0
    rows = capsys.readouterr().out.partition("coupling: ")[2].splitlines()[1:7]
    assert [row.split()[0] for row in rows] == ["-1", "0", "0", "0", "0", "0"]


def test_what_is_fixed_coupled_and_carried_is_shown(tmp_path, capsys):
    path = tmp_path / "arm.toml"
    text = Robot.load("fanuc-lr-mate-200id").to_toml()
    path.write_text(f"{text}\n[payload]\nmass_kg = 2.5\n[tool]\nxyz = [0, 0, 0.1]\n[base]\nbeta = 0.01\n")
    assert main(["robots", str(path)]) == 0
    printed = capsys.readouterr().out
    assert "coupling: " in printed
    assert "Payload: 2.5 kg" in printed
    assert "tool: rotation, and translation in mm" in printed
    assert "base: rotation" in printed
    assert " 100.0000" in printed


def test_strange_numbers_are_warned_of(tmp_path, capsys):
    text = Robot.load("ur5").to_toml().replace('"rad"', '"deg"')
    path = tmp_path / "arm.toml"
    path.write_text("\n".join(line for line in text.splitlines() if "limits" not in line))
    assert main(["robots", str(path)]) == 0
    printed = capsys.readouterr()
    assert "Warning: No joint has limits" in printed.err
    assert "Warning: 1.5708 deg in links 1, 4 and 5 looks like radians: check angle_unit." in printed.err
    assert "The file can be used; see the warnings." in printed.out
    short = Robot.load("ur5").to_toml().replace('length_unit = "m"', 'length_unit = "mm"')
    path.write_text(short)
    assert main(["robots", str(path)]) == 0
    assert "Warning: All links together are 1.19 mm long" in capsys.readouterr().err


def test_limits_of_a_urdf_in_degrees_are_warned_of(tmp_path, capsys):
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        f'<origin xyz="0 0 0.4"/><axis xyz="{axis}"/><limit lower="-{limit}" upper="{limit}"/></joint>'
        for k, (axis, limit) in enumerate((("0 0 1", 90), ("0 1 0", 12.56), ("0 1 0", 2), ("1 0 0", 120)))
    )
    links = "".join(f'<link name="l{k}"/>' for k in range(5))
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="arm">{links}{joints}</robot>')
    assert main(["robots", str(path)]) == 0
    warned = " ".join(capsys.readouterr().err.split())
    assert "A limit of 120 rad, 19.1 turns, in links 1 and 4 looks like degrees" in warned


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["robots", "ur12"], 1, 'Error: there is no robot "ur12" in the library'),
        (["robots", "nowhere/arm.toml"], 1, "Error: nowhere/arm.toml: there is no such file."),
        (["robots", "."], 1, "this is a directory"),
        (["robots", "a", "b"], 2, "unexpected extra argument"),
        (["robots", "--jsno"], 2, "No such option"),
        (["robts"], 2, "No such command 'robts'"),
        (["import"], 2, "Missing argument 'RAW'"),
        (["import", "raw.csv"], 2, "Missing option"),
        (["import", "raw.csv", "-o", "out.csv"], 1, "raw.csv: there is no such file"),
        (
            ["import", "raw.csv", "-o", "out.csv", "--map", "q1"],
            2,
            '"q1" is no pair of columns. Write OURS=THEIRS',
        ),
        (["import", "raw.csv", "-o", "out.csv", "--map", "q1=a", "--map", "q1=b"], 2, '"q1" is named twice'),
        (
            ["import", "raw.csv", "-o", "out.csv", "--joint-unit", "grad"],
            2,
            '"grad" is not known. Known are "rad" and "deg"',
        ),
        (["import", "raw.csv", "-o", "out.csv", "--decimal", ";"], 2, '";" is not known'),
        (["import", "raw.csv", "-o", "out.csv", "--delimiter", "ab"], 2, '"ab" is no delimiter'),
        (["import", "raw.csv", "-o", "out.csv", "--rotation", "rx,ry,rz"], 2, '"rx,ry,rz" is no rotation'),
        (
            ["import", "raw.csv", "-o", "out.csv", "--rotation", "euler:ABC:deg=a,b,c"],
            2,
            "no order of Euler angles",
        ),
        (["import", "raw.csv", "-o", "out.csv", "--skip-lines", "-1"], 2, "--skip-lines"),
    ],
)
def test_what_cannot_be_done_is_said(arguments, status, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == status
    printed = capsys.readouterr()
    assert printed.out == ""
    assert message in printed.err
    assert "Traceback" not in printed.err
    assert list(tmp_path.iterdir()) == []


RAW = "q1;q2;x;y;z;t\n0,5;1;100;200;300;20\n0,6;1;110;200;300;21\n"
RAW_OPTIONS = ["--delimiter", ";", "--decimal", ",", "--joint-unit", "rad", "--length-unit", "mm"]


def test_import_writes_what_it_says(tmp_path, capsys):
    raw, output = tmp_path / "raw.txt", tmp_path / "out.csv"
    raw.write_text(RAW)
    assert main(["import", str(raw), "-o", str(output), *RAW_OPTIONS]) == 0
    printed = capsys.readouterr()
    assert output.read_text() == "q1,q2,x,y,z\n0.5,1.0,0.1,0.2,0.3\n0.6,1.0,0.11,0.2,0.3\n"
    assert printed.err == ""
    assert "2 rows, q1, q2, x, y, z." in " ".join(printed.out.split())
    assert "Left out: t. Keep them with --keep." in printed.out
    assert main(["import", str(raw), "-o", str(output), *RAW_OPTIONS, "--keep", "t", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == {
        "output": str(output),
        "rows": 2,
        "columns": ["q1", "q2", "x", "y", "z", "t"],
        "left_out": [],
        "rows_left_out": [],
        "remarks": [],
        "notices": [],
    }


def test_import_never_overwrites_its_input(tmp_path, capsys):
    raw = tmp_path / "raw.txt"
    raw.write_text(RAW)
    assert main(["import", str(raw), "-o", str(raw), *RAW_OPTIONS]) == 2
    assert "never written over" in capsys.readouterr().err
    assert raw.read_text() == RAW


def test_import_leaves_an_older_output_alone_when_it_fails(tmp_path, capsys):
    raw, output = tmp_path / "raw.txt", tmp_path / "out.csv"
    raw.write_text(RAW.replace("0,5", "nan"))
    output.write_text("older")
    assert main(["import", str(raw), "-o", str(output), *RAW_OPTIONS]) == 1
    assert 'column "q1" holds NaN or infinite values in row 1' in capsys.readouterr().err
    assert output.read_text() == "older"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.csv", "raw.txt"]


def test_import_into_nowhere(tmp_path, capsys):
    raw = tmp_path / "raw.txt"
    raw.write_text(RAW)
    assert main(["import", str(raw), "-o", str(tmp_path / "no" / "out.csv"), *RAW_OPTIONS]) == 1
    assert "there is no such directory" in capsys.readouterr().err


def run_raising(error, monkeypatch):
    """Exit status of a command that raises."""

    def command() -> None:
        """Fail."""
        raise error

    monkeypatch.setitem(sys.modules, "failing", types.SimpleNamespace(command=command))
    monkeypatch.setattr("truearm.cli.COMMANDS", (Entry("fail", "failing", "Fail."),))
    return main(["fail"])


@pytest.mark.parametrize(
    ("error", "status", "message"),
    [
        (
            InputError("it is bad", where="file", rule="Good it must be", way_out="Mend it"),
            1,
            "file: it is bad. Good it must be. Mend it.",
        ),
        (WorkError("it did not work"), 1, "it did not work."),
        (UsageError("that is no option"), 2, "that is no option."),
        (FileNotFoundError(2, "No such file or directory", "x.csv"), 1, "x.csv: No such file or directory."),
        (PermissionError(13, "Permission denied", "x.csv"), 1, "x.csv: Permission denied."),
        (OSError(28, "No space left on device"), 1, "No space left on device."),
        (MemoryError(), 1, "not enough memory"),
        (KeyboardInterrupt(), 130, "Interrupted."),
    ],
)
def test_errors_become_exit_statuses(error, status, message, monkeypatch, capsys):
    assert run_raising(error, monkeypatch) == status
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.out == ""


def test_errors_of_the_core_are_for_people_too(monkeypatch, capsys):
    from truearm._core import CoreError

    assert run_raising(CoreError("q has shape [1, 2]"), monkeypatch) == 1
    assert capsys.readouterr().err == "Error: q has shape [1, 2]\n"


def test_what_nobody_expected_is_not_hidden(monkeypatch):
    with pytest.raises(ZeroDivisionError):
        run_raising(ZeroDivisionError(), monkeypatch)


def test_commands_take_their_options_from_their_module(monkeypatch, capsys):
    def command(count: int = 1) -> None:
        """Count."""
        console.say(f"counted {count}")

    monkeypatch.setitem(sys.modules, "counting", types.SimpleNamespace(command=command))
    program = build([Entry("count", "counting", "Count.")], "Counting.")
    assert program(["count", "--count", "3"]) == 0
    assert capsys.readouterr().out == "counted 3\n"
    assert program(["count", "--count", "three"]) == 2


def test_interrupts_end_the_process_with_130(tmp_path):
    script = tmp_path / "run.py"
    script.write_text(
        "import os, signal, sys, types\nfrom truearm import cli\nfrom truearm.cli.entry import Entry\n"
        "def command() -> None:\n    os.kill(os.getpid(), signal.SIGINT)\n    import time; time.sleep(30)\n"
        "sys.modules['waiting'] = types.SimpleNamespace(command=command)\n"
        "cli.COMMANDS = (Entry('wait', 'waiting', 'Wait.'),)\nsys.exit(cli.main(['wait']))\n"
    )
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=False, timeout=20
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "Interrupted.\n")


def test_interrupts_end_a_program_that_is_still_being_imported(tmp_path):
    (tmp_path / "typer.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
    done = subprocess.run(
        [sys.executable, "-c", "import sys; from truearm.cli import main; sys.exit(main(['robots']))"],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
        capture_output=True,
        text=True,
        check=False,
        timeout=20,
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "Interrupted.\n")


def test_json_has_no_nan():
    with pytest.raises(ValueError, match="not JSON compliant"):
        console.print_json({"mean_mm": np.nan})


def test_warnings_and_tables(capsys):
    console.warn([Notice("limits", "Joint 2 is far out.", (3,))])
    console.print_table(["model", "mean mm"], [["nominal", "0.75"], ["[b]odd[/b]", "0.09"]], title="Held out")
    printed = capsys.readouterr()
    assert printed.err == "Warning: Joint 2 is far out.\n"
    assert "[b]odd[/b]" in printed.out
    assert max(map(len, printed.out.splitlines())) <= 80


@pytest.mark.parametrize("width", [80, 40, 20])
def test_numbers_of_tables_are_whole_on_a_terminal_of_any_width(width, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(width))
    numbers = ["1.703", "1.822", "2.913", "3.003", "13.061"]
    console.print_table(["model", "mean", "RMS", "95 %", "99 %", "max"], [["nominal", *numbers]])
    printed = capsys.readouterr().out
    assert all(number in printed.split() for number in ["nominal", *numbers])


@pytest.mark.parametrize("width", [30, 40, 60])
def test_the_table_of_an_arm_keeps_all_digits(width, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(width))
    assert main(["robots", "ur10"]) == 0
    printed = capsys.readouterr().out
    assert {"163.941", "-572.3", "-360"} <= set(printed.split())
    assert "\N{HORIZONTAL ELLIPSIS}" not in printed
    if width == 60:
        assert printed.count("-360 to 360") == 6


def test_limits_have_four_decimals(tmp_path, capsys):
    arm = Robot.from_table("Mine", [[0, 0, 0.3, 0]], limits=[[-2.8973, 2.8973]])
    (tmp_path / "mine.toml").write_text(arm.to_toml())
    assert main(["robots", str(tmp_path / "mine.toml")]) == 0
    assert "-166.0031 to 166.0031" in capsys.readouterr().out
