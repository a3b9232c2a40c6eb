"""Manners that every command has: help with examples that is quick, JSON, completion, progress, colours."""

import json
import os
import pty
import re
import shlex
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

import truearm as ta
from truearm.cli import COMMANDS, console, main
from truearm.cli.arguments import choices_of
from truearm.cli.calibrate import _print_scheme
from truearm.cli.display import DISPLAY, Counted, Expected, in_words
from truearm.cli.durations import Took, place, remember, remembered
from truearm.cli.lazy import LazyCommand
from truearm.cli.progress import told_progress, told_stages
from truearm.cli.robot_tables import _print_verdict
from truearm.description.library import library_names
from truearm.errors import Notice
from truearm.programs.languages import language_of
from truearm.simulation import VirtualArm

PROGRAM = Path(sys.executable).parent / "truearm"


def leaves(entries=COMMANDS, before=()):
    """Words and entry of every command that is no table of others."""
    for entry in entries:
        below = getattr(import_module(entry.module), "COMMANDS", None)
        if below is None:
            yield (*before, entry.name), entry
        else:
            yield from leaves(below, (*before, entry.name))


LEAVES = list(leaves())
TABLES = sorted({words[:-1] for words, _ in LEAVES})
BY_WORDS = dict(LEAVES)
SERVICES = {("serve",)}  # they run until they are ended


def help_of(words, capsys):
    assert main([*words, "--help"]) == 0
    return capsys.readouterr().out


def examples_of(text):
    """The example lines of a help text, without their indentation."""
    lines = text.split("Examples:\n", 1)[1].split("\n\n", 1)[0].splitlines()
    return [line.strip() for line in lines]


@pytest.mark.parametrize("words", [*TABLES, *BY_WORDS], ids=" ".join)
def test_help_has_examples_that_are_right(words, capsys):
    text = help_of(words, capsys)
    assert max(map(len, text.splitlines())) <= console.WIDTH
    shown = []
    for example in examples_of(text):
        program, *given = shlex.split(example)
        assert program == "truearm"
        known = next(known for known in BY_WORDS if list(known) == given[: len(known)])
        shown.append(known[: len(words)])
        LazyCommand(BY_WORDS[known]).load().make_context(known[-1], given[len(known) :])
    assert words in shown


def test_examples_of_compensate_declare_the_controller_where_it_may_differ(capsys):
    for example in examples_of(help_of(["compensate"], capsys)):
        program = Path(example.split()[3])
        assert not language_of(program, None).controller_differs or "--controller" in example, example


@pytest.mark.parametrize("words", [words for words in BY_WORDS if words not in SERVICES], ids=" ".join)
def test_every_command_names_the_next_one(words):
    source = Path(str(import_module(BY_WORDS[words].module).__file__)).read_text()
    assert "suggest(" in source


@pytest.mark.parametrize("words", BY_WORDS, ids=" ".join)
def test_every_command_prints_json(words):
    options = [name for option in LazyCommand(BY_WORDS[words]).load().params for name in option.opts]
    assert "--json" in options


def test_help_and_completion_import_neither_numpy_nor_the_core():
    script = (
        "import sys\nfrom truearm.cli import main\n"
        f"for words in {[list(words) for words in [*TABLES, *BY_WORDS]]}:\n"
        "    assert main([*words, '--help']) == 0\n"
        "    heavy = {'numpy', 'pandas', 'scipy', 'rich', 'truearm._core'} & set(sys.modules)\n"
        "    assert not heavy, (words, heavy)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_without_docstrings_help_says_what_a_command_is_for():
    words = [sys.executable, "-OO", "-m", "truearm", "strip", "--help"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert BY_WORDS["strip",].summary in " ".join(done.stdout.split()), done.stderr


def test_what_a_controller_loads_goes_without_scipy():
    script = (
        "import sys\nfrom truearm import Calibration, Compensator, evaluate\n"
        "import truearm.cli.evaluate, truearm.cli.export, truearm.cli.serve\n"
        "assert 'truearm._core' in sys.modules and 'scipy' not in sys.modules\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def completed(line, folder):
    """What bash offers at the end of a line, as its completion would find it."""
    script = (
        f'eval "$({shlex.quote(str(PROGRAM))} --show-completion)"\n'
        "COMP_LINE=$1; read -ra COMP_WORDS <<< \"$1\"; [[ $1 == *' ' ]] && COMP_WORDS+=('')\n"
        "COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); COMPREPLY=()\n"
        'words=$(complete -p truearm); function=${words#*-F }; "${function%% *}" truearm\n'
        'printf "%s\\n" "$words" "${COMPREPLY[@]}"\n'
    )
    done = subprocess.run(
        ["bash", "-c", script, "bash", line],
        env={**os.environ, "PATH": f"{PROGRAM.parent}{os.pathsep}{os.environ['PATH']}"},
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    how, *offered = done.stdout.splitlines()
    assert "-o default" in how, "where nothing is offered bash completes files"
    return [word for word in offered if word]


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("truearm ca", ["calibrate"]),
        ("truearm session ", ["show", "export"]),
        ("truearm session show --p", ["--pose"]),
        ("truearm calibrate ur1", [name for name in library_names() if name.startswith("ur1")]),
        ("truearm robots rv", ["rv-m2"]),
        ("truearm calibrate ur10 m.csv --model c", ["constant", "cmac"]),
        ("truearm export arm.calib --to dh-", ["dh-toml", "dh-json", "dh-csv"]),
        ("truearm cell example t", ["tracker"]),
        ("truearm calibrate ur10 m", []),
        ("truearm evaluate ", []),
    ],
)
def test_bash_completes(line, offered, tmp_path):
    (tmp_path / "m.csv").write_text("")
    assert completed(line, tmp_path) == offered


def test_completion_installs_itself(tmp_path):
    environment = {**os.environ, "HOME": str(tmp_path)}
    script = f"{shlex.quote(str(PROGRAM))} --install-completion; exit $?"
    done = subprocess.run(
        ["bash", "-c", script], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "truearm" in (tmp_path / ".bashrc").read_text()


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_are_told_how_to_complete(shell):
    environment = {**os.environ, "_TRUEARM_COMPLETE": f"source_{shell}"}
    done = subprocess.run([PROGRAM], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert f"_TRUEARM_COMPLETE=complete_{shell}" in done.stdout


def test_choices_are_the_plain_words_of_a_metavar():
    assert choices_of("mm|m") == ["mm", "m"]
    assert choices_of("nominal|FILE") == ["nominal"]
    assert choices_of("FILE") == choices_of("") == []


def on_a_terminal(script, **environment):
    """What a Python script writes to a terminal of 80 columns."""
    leader, follower = pty.openpty()
    kept = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "FORCE_COLOR")}
    running = subprocess.Popen(
        [sys.executable, "-c", script],
        env={**kept, "TERM": "xterm", "COLUMNS": "80", **environment},
        stdout=follower,
        stderr=follower,
    )
    os.close(follower)
    written = b""
    while True:
        try:
            part = os.read(leader, 65536)
        except OSError:
            break
        if not part:
            break
        written += part
    assert running.wait(timeout=120) == 0, written.decode()
    os.close(leader)
    return written.decode()


SERIES = (
    "import time\nfrom truearm.cli import display\nfrom truearm.cli.progress import told_stages\n"
    "display.PATIENCE_S = 0.1\n"
    "stages = told_stages()\n"
    "for number in (1, 2):\n"
    "    with stages(f'seed {number} of 2'):\n        time.sleep(0.7)\n"
)


@pytest.mark.parametrize("left", ["", " that are left"])
def test_a_terminal_shows_a_bar_with_the_time_left_and_takes_it_away(left):
    shown = on_a_terminal(SERIES.replace("} of 2", f"}} of 2{left}"))
    assert f"Seed 2 of 2{left}" in shown
    assert "50 %" in shown
    assert "s left" in shown
    assert "\x1b[?25h" in shown, "the cursor is back"


def test_no_color_leaves_bars_and_errors_without_colour():
    error = "import sys\nfrom truearm.cli import main\nsys.exit(main(['robots', 'nobody']) - 1)\n"
    assert "\x1b[31m" in on_a_terminal(error)
    assert "\x1b[" not in on_a_terminal(error, NO_COLOR="1")
    assert "\x1b[3" not in on_a_terminal(SERIES, NO_COLOR="1")


def test_a_log_gets_plain_lines_and_no_bar(capfd, monkeypatch):
    monkeypatch.setattr("truearm.cli.display.PATIENCE_S", 0.01)
    with told_stages()("something slow"):
        time.sleep(0.7)
    assert re.fullmatch(r"Something slow ... \d+ s\n", capfd.readouterr().err)


def test_a_log_is_not_told_the_same_again(capfd, monkeypatch):
    monkeypatch.setattr("truearm.cli.display.PATIENCE_S", 0.01)
    monkeypatch.setattr("truearm.cli.display.IN_LOG_S", 0.02)
    with told_stages()("something slow"):
        time.sleep(0.3)
    lines = capfd.readouterr().err.splitlines()
    assert lines
    assert len(lines) == len(set(lines))


def shown():
    return None if DISPLAY.current is None else DISPLAY.current.text


def test_what_does_not_end_by_itself_is_taken_away_with_its_stage():
    progress = told_progress()
    with told_stages()("compensation"):
        progress("targets", 1, 5)
        assert shown() == "targets: 1 of 5"
    assert shown() is None
    progress("targets", 5, 5)


@pytest.mark.parametrize("encoding", ["utf-8", "ascii", "latin-1"])
def test_names_that_stdout_cannot_print_are_escaped(encoding):
    found = ["Γ", os.fsdecode(b"caf\xe9")]
    code = f"""
from truearm.cli import console
console.say_all()
console.say({found[1]!r})
console.print_json({found!r})
"""
    environment = os.environ | {"PYTHONIOENCODING": encoding}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, env=environment)
    said, _, printed = done.stdout.decode(encoding).partition("\n")
    assert said == "caf\\udce9"
    assert json.loads(printed) == found


def test_warnings_have_no_colour_in_a_log(capsys):
    console.warn([Notice("limits", "careful")])
    assert capsys.readouterr().err == "Warning: careful\n"


@pytest.fixture
def now(monkeypatch):
    monkeypatch.setattr("truearm.cli.display.time", SimpleNamespace(monotonic=lambda: 1000.0))
    return 1000.0


def test_time_left_follows_the_pace(now):
    work = Counted("seeds", now - 30.0, 3.0, 9.0)
    assert work.share == pytest.approx(1 / 3)
    assert work.left_s == pytest.approx(60.0)
    assert work.words == ["33 %", "60 s left"]
    resumed = Counted("methods", now - 30.0, 83.0, 103.0, before=80.0)
    assert resumed.left_s == pytest.approx(200.0), "what an earlier run has done says nothing of the pace"
    assert Counted("methods", now - 30.0, 80.0, 103.0, before=80.0).left_s is None
    assert [in_words(s) for s in (89.0, 600.0, 7260.0)] == ["89 s", "10 min", "2 h 01 min"]


def test_time_left_of_a_fit_is_what_the_last_one_took(tmp_path, monkeypatch, now):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    took = Took(100, (("frame", 1.0), ("what varies", 9.0)))
    remember("calibrate ur10", took)
    known = remembered("calibrate ur10", 200)
    assert known == Took(200, (("frame", 2.0), ("what varies", 18.0)))
    assert remembered("calibrate ur5", 200) is None
    stage = Expected("frame", now - 1.0, before_s=0.0, this_s=2.0, after_s=18.0)
    assert stage.share == pytest.approx(0.05)
    assert stage.left_s == pytest.approx(19.0)
    late = Expected("frame", now - 3.0, before_s=0.0, this_s=2.0, after_s=18.0)
    assert late.words == ["10 %", "3 s"]


def test_short_work_and_broken_files_of_durations_are_no_matter(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    remember("calibrate ur10", Took(100, (("frame", 0.1),)))
    assert not place().exists()
    place().parent.mkdir(parents=True)
    for text in ("[1]", "{", '{"calibrate ur10": {"size": 0, "stages": []}}', '{"calibrate ur10": 3}'):
        place().write_text(text)
        assert remembered("calibrate ur10", 100) is None


def test_without_a_place_for_durations_nothing_is_kept(tmp_path, monkeypatch):
    took = Took(100, (("frame", 9.0),))
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    remember("calibrate ur10", took)
    assert remembered("calibrate ur10", 100) is None
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(Path, "home", homeless)
    remember("calibrate ur10", took)
    assert remembered("calibrate ur10", 100) is None


def homeless():
    raise RuntimeError("Could not determine home directory.")


IMPORT = ["import", "measured.csv", "-o", "again.csv", "--joint-unit", "rad", "--length-unit", "m"]
WAY = [
    (["robots"], "truearm robots NAME"),
    (["robots", "rv-m2"], "truearm plan rv-m2"),
    (IMPORT, "truearm calibrate ROBOT again.csv"),
    (["calibrate", "rv-m2", "again.csv", "-o", "d", "--model", "constant"], "truearm evaluate d/calibration"),
    (["evaluate", "d/calibration.calib", "other.csv"], "truearm compensate d/calibration.calib"),
    (["strip", "d/calibration.calib", "-o", "small.calib"], "truearm serve small.calib"),
    (["export", "d/calibration.calib", "--to", "dh-toml", "-o", "arm.toml"], "truearm robots arm.toml"),
    (["robots", "arm.toml"], "truearm calibrate arm.toml"),
    (["cell", "example", "rv-m2"], "truearm cell simulate cell.toml"),
    (["plan", "rv-m2", "-n", "20", "--cell", "cell.toml"], "truearm measure cell.toml"),
    (["measure", "cell.toml", "poses.csv", "--dry-run"], "truearm measure cell.toml poses.csv -o"),
]


@pytest.fixture
def measured(tmp_path, monkeypatch):
    arm = VirtualArm.paper(seed=2)
    arm.measure_table(arm.poses(60)).to_csv(tmp_path / "measured.csv", index=False)
    arm.measure_table(arm.poses(30, seed=1), seed=1).to_csv(tmp_path / "other.csv", index=False)
    monkeypatch.chdir(tmp_path)


def test_with_json_nothing_else_is_on_stdout(measured, capsys):
    found = []
    for words, _ in WAY:
        assert main([*words, "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out))
    assert {"name", "robot", "joints"} <= set(found[0][0])
    assert found[2]["rows"] == 60
    assert found[5]["calibration"] == "small.calib"
    assert found[10]["steps"]


def test_results_fit_80_columns_and_name_the_next_command(measured, capsys):
    for words, following in WAY:
        assert main(words) == 0
        printed = capsys.readouterr().out
        assert following in printed, words
        assert max(map(len, printed.splitlines())) <= console.WIDTH, words
        assert "\x1b" not in printed, "no colours where stdout is no terminal"


def test_long_numbers_are_wrapped(capsys):
    many = dict.fromkeys(("nominal", "constant", "variable"), 123456.7)
    _print_scheme(cast("ta.Calibration", SimpleNamespace(scheme=None)), many)
    far = SimpleNamespace(position=lambda _q: np.full(3, 12345.6789123), limits=np.zeros((6, 2)))
    _print_verdict(cast("ta.Robot", far), [])
    assert max(map(len, capsys.readouterr().out.splitlines())) <= console.WIDTH
