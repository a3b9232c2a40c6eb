"""The documentation cannot lie: its examples run, its links lead somewhere, its generated pages are current.

A fenced block is run when its first line says so: ```python run or ```bash run. The blocks of a page are run
in order in a directory of their own; Python blocks share their names. Before the first block the directory
holds measurements.csv and another_day.csv of a virtual UR10. Commands of truearm that need no shell are run
in this process, which spares the time of starting others; a calibration that several pages begin with is made
once. Blocks of TOML and JSON are read. What is neither says why: ```bash shown: REASON.
"""

import importlib.util
import json
import lzma
import os
import re
import shlex
import shutil
import sqlite3
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

import truearm as ta
from tests.in_process import in_this_process
from truearm.cell.cell_file import CellFile
from truearm.cell.drivers import ROBOTS, SENSORS, driver_and_settings
from truearm.cell.schema import checked
from truearm.cell.session_schema import SCHEMA
from truearm.cli import COMMANDS, main
from truearm.description.robot_file import RobotFile
from truearm.doubts import of_results as doubts
from truearm.fits.options import CHOICES
from truearm.fleet import Fleet, running
from truearm.judgement import validation
from truearm.programs.frames import FramesFile
from truearm.reporting import advice, gravity, other_data
from truearm.reporting import known as certainty
from truearm.robot import Robot
from truearm.simulation import VirtualArm

ROOT = Path(__file__).resolve().parents[1]
PAGES = [
    ROOT / "README.md",
    ROOT / "CHANGELOG.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "examples" / "README.md",
    *sorted((ROOT / "docs").rglob("*.md")),
]
FENCE = re.compile(r"^( *)```(\w+) run\n(.*?)^\1```", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")
COMMAND = re.compile(r"^.*<<'?(\w+)'?\n(?:.*\n)*?\1\n|^(?:.*\\\n)*.*\n", re.MULTILINE)
OF_A_SHELL = re.compile(r"[|&<>$]")
PREPARING = re.compile(r"truearm calibrate ur10 measurements\.csv -o (\w+)(?: --model \w+)?")
TRAINING_POSES, OTHER_POSES = 60, 30


def name_of(page):
    return str(page.relative_to(ROOT))


def blocks_of(page):
    """Language and text of each block to run, without the indentation it has inside lists."""
    found = FENCE.findall(page.read_text())
    return [
        (language, re.sub(rf"^{indent}", "", text, flags=re.MULTILINE)) for indent, language, text in found
    ]


@pytest.fixture(scope="module")
def tables():
    arm = VirtualArm(Robot.load("ur10"), seed=3)
    return {
        "measurements.csv": arm.measure_table(arm.poses(TRAINING_POSES)),
        "another_day.csv": arm.measure_table(arm.poses(OTHER_POSES, seed=1), seed=1),
    }


@pytest.fixture(scope="module")
def prepared(tables, tmp_path_factory):
    """Makes DIR by `truearm calibrate ur10 measurements.csv -o DIR`, of the same measurements only once."""
    folder, made = tmp_path_factory.mktemp("prepared"), dict[tuple[str, str], Path]()

    def make(command, directory):
        kind = command.replace(f" {directory}", ""), Path("measurements.csv").read_text()
        if kind not in made:
            run_command(command)
            made[kind] = shutil.copytree(directory, folder / f"{len(made)}")
        else:
            shutil.copytree(made[kind], directory)

    return make


@pytest.mark.parametrize("page", [page for page in PAGES if blocks_of(page)], ids=name_of)
def test_examples_run(page, tables, prepared, tmp_path, monkeypatch, capsys):
    for name, table in tables.items():
        table.to_csv(tmp_path / name, index=False)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(running, "run_tasks", in_this_process)
    names = {"__name__": "__main__"}
    for language, text in blocks_of(page):
        if language == "bash" and "&\n" in text:
            run_bash(text)
        elif language == "bash":
            for command in COMMAND.finditer(text):
                run_one(command[0], prepared)
        else:
            assert language == "python", f"cannot run {language}"
            exec(compile(text, name_of(page), "exec"), names)


def run_one(command, prepared):
    """Run a command of a block where it is quickest."""
    preparing = PREPARING.fullmatch(command.strip())
    if preparing:
        prepared(command, preparing[1])
    elif command.startswith("truearm ") and not OF_A_SHELL.search(command):
        run_command(command)
    else:
        run_bash(command)


def run_command(command):
    """Run a command of truearm in this process."""
    assert main(shlex.split(command.replace("\\\n", " "))[1:]) == 0, command


def run_bash(text):
    """Run commands as a reader would, with the truearm of this environment first on the path."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", text],
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{text}\n{done.stdout}\n{done.stderr}"


def fences_of(page) -> Iterator[tuple[str, str]]:
    """First line, without its marks, and text of every fenced block."""
    first: str | None = None
    lines: list[str] = []
    for line in page.read_text().splitlines():
        mark = re.match(r" *```(.*)", line)
        if mark and first is None:
            first, lines = mark[1].strip(), []
        elif mark:
            yield first or "", "\n".join(lines)
            first = None
        else:
            lines.append(line)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_block_is_run_or_read_or_says_why_not(page):
    for first, text in fences_of(page):
        language, _, how = first.partition(" ")
        if language == "toml":
            check_toml(tomllib.loads(text), name_of(page))
        elif language == "json":
            json.loads(text)
        elif language == "text":
            commands = re.findall(r"^(?:\$ )?(?:truearm|make|cargo|pip|python) .*", text, re.MULTILINE)
            assert page.name == "cli.md" or commands == [], "a block of commands is run, or says why not"
        else:
            assert language in ("python", "bash", "c"), f"```{first}"
            assert how == "run" or re.fullmatch(r"shown: \w.+", how), f"```{first}: run, or shown: REASON"


def check_toml(content, where):
    """What is a whole file of truearm, or a section of a cell file, has to be right."""
    if "convention" in content:
        checked(RobotFile, content, where=where)
    elif isinstance(content.get("arm"), list):
        Fleet.from_dict(content, where=where)
    elif "arm" in content:
        checked(CellFile, content, where=where)
    elif "format" in content:
        checked(FramesFile, content, where=where)
    for key, known in (("robot", ROBOTS), ("sensor", SENSORS)):
        if key in content:
            driver_and_settings(content[key], known, where=where)


def test_there_are_examples():
    assert sum(len(blocks_of(page)) for page in PAGES) > 10


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page):
    for link in LINK.findall(page.read_text()):
        if re.match(r"https?:|mailto:", link):
            continue
        place, _, anchor = link.partition("#")
        target = (page.parent / place).resolve() if place else page
        assert target.exists(), f"{link} leads nowhere"
        if anchor:
            assert anchor in anchors_of(target), f"{link}: there is no such heading"


def anchors_of(page):
    headings = re.findall(r"^#+ (.+)$", page.read_text(), re.MULTILINE)
    return {anchor_of(heading) for heading in headings}


def anchor_of(heading):
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def test_every_page_is_reached_from_the_index():
    index = (ROOT / "docs" / "README.md").read_text()
    listed = {(ROOT / "docs" / link).resolve() for link in LINK.findall(index)}
    decisions = ROOT / "docs" / "decisions"
    missing = [name_of(page) for page in PAGES if page.parent.parent == ROOT / "docs" and page not in listed]
    assert [page for page in missing if Path(ROOT / page).parent != decisions] == []


def test_every_decision_is_listed():
    index = (ROOT / "docs" / "decisions" / "README.md").read_text()
    for record in (ROOT / "docs" / "decisions").glob("0*.md"):
        assert f"({record.name})" in index
        assert re.match(rf"# {record.name[:4]}: \w", record.read_text()), record


@pytest.mark.parametrize("name", ["make_cli", "make_docstrings", "make_header_page", "make_notebook"])
def test_generated_pages_are_current(name, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    maker = load_script(name)
    assert maker.PAGE.read_text() == maker.page(), f"run: make docs, or python docs/{name}.py"


def test_files_of_the_package_that_decisions_name_are_there():
    texts = [path.read_text() for path in (ROOT / "docs" / "decisions").glob("*.md")]
    named = {name for text in texts for name in re.findall(r"python/truearm/[\w/]+\.py", text)}
    assert {name for name in named if not (ROOT / name).exists()} == set()


def test_schemas_are_current():
    maker = load_script("make_schemas")
    found = {path.name: path.read_text() for path in maker.FOLDER.glob("*.json")}
    assert found == {name: maker.text_of(schema) for name, schema in maker.schemas().items()}, "make docs"


def test_schemas_tell_what_readers_ask_for():
    schemas = load_script("make_schemas").schemas()
    for key in ("robot", "sensor"):
        choices = schemas["cell.json"]["properties"][key]["anyOf"]
        assert all("driver" in choice["required"] for choice in choices)
    for part in ("defaults", "arm"):
        section = schemas["fleet.json"]["properties"][part]
        keys = section.get("items", section)["properties"]
        for name in CHOICES.keys() & keys.keys():
            assert keys[name]["enum"] == [choice for choice in CHOICES[name] if choice is not None]
        assert (keys["holdout"]["exclusiveMaximum"], keys["seed"]["minimum"]) == (1, 0)
        assert keys["length_unit"]["anyOf"][0]["enum"] == ["m", "mm"]


def test_every_column_of_a_session_is_explained():
    text = (ROOT / "docs" / "reference" / "session-file.md").read_text()
    explained = dict(re.findall(r"^\| `(\w+)` \|(.*)$", text, re.MULTILINE))
    database = sqlite3.connect(":memory:")
    database.executescript(SCHEMA)
    for table, words in explained.items():
        columns = [column[1] for column in database.execute(f"PRAGMA table_info({table})")]
        named = set(re.findall(r"\w+", words))
        for first, last in re.findall(r"`(\w+)` to `(\w+)`", words):
            named |= set(columns[columns.index(first) : columns.index(last) + 1])
        assert [column for column in columns if column not in named] == [], table
    database.close()


def test_every_command_is_in_the_reference():
    page = (ROOT / "docs" / "reference" / "cli.md").read_text()
    for entry in COMMANDS:
        assert f"## truearm {entry.name}\n" in page


def test_every_key_of_a_summary_is_explained(tables):
    page = (ROOT / "docs" / "reference" / "calibration-file.md").read_text()
    first_column = " ".join(re.findall(r"^\|([^|]+)\|", page, re.MULTILINE))
    data = [ta.Measurements.from_dataframe(table) for table in tables.values()]
    calibration = ta.calibrate(ta.Robot.load("ur10"), data[0], model="constant")
    evaluation = ta.evaluate(calibration, data[1])
    for key in [*calibration.summary, *evaluation.to_dict()]:
        assert f"`{key}`" in first_column, key


def test_the_report_page_has_the_rules_of_the_report():
    text = (ROOT / "docs" / "how-to" / "read-a-report.md").read_text()
    code = "".join(Path(f"{module.__file__}").read_text() for module in (advice, other_data))
    named = set(re.findall(r'Advice\(\s*"?\w+"?,\s*"([^"]+)"', code))
    assert set(re.findall(r"^\| ([A-Z][^|]*\.) \|", text, re.MULTILINE)) == named
    for rule in (
        f"at most {advice.AT_THE_FLOOR:g} times what noise alone would leave",
        f"more than {advice.LONG_TAIL:g} times the mean",
        f"more than {certainty.STANDS_OUT:g} times its median",
        f"fewer than {validation.FEW_HELD} were",
        f"fewer than {validation.FEW_HELD} |",
        f"less than {advice.COVERED:.0%}".replace("%", " %"),
        f"by less than {1.0 - doubts.SAME:.0%}".replace("%", " %"),
        f"more than {gravity.STANDS_OUT:g} times what horizontal ones do",
        f"at least {gravity.LEAST:.0%}".replace("%", " %"),
    ):
        assert rule in text, rule


def test_a_leaner_picture_is_the_same_picture():
    maker = load_script("make_methods")
    marker = '<use xlink:href="#m" x="{x}" y="2.50" style="fill: red"/>'
    svg = (
        '<svg><g id="a"><text x="1.23456">0.00512</text></g><g clip-path="url(#p)">\n'
        f"  {marker.format(x='1.23456')}\n  {marker.format(x='-7.0001')}\n</g></svg>"
    )
    assert maker.leaner(svg) == (
        '<svg><g><text x="1.23">0.00512</text></g><g clip-path="url(#p)" style="fill: red">\n'
        '<use xlink:href="#m" x="1.23" y="2.5"/>\n<use xlink:href="#m" x="-7" y="2.5"/>\n</g></svg>'
    )


def test_kept_results_are_unpacked_for_a_study_that_goes_on(monkeypatch, tmp_path):
    maker = load_script("make_methods")
    line = b'{"set": "ur10"}\n'
    monkeypatch.setattr(maker, "RESULTS", tmp_path / "page.jsonl.xz")
    maker.RESULTS.write_bytes(lzma.compress(line))
    monkeypatch.setattr("sys.argv", ["make_methods.py", str(tmp_path / "new" / "study"), "--unpack"])
    assert maker.main() == 0
    assert (tmp_path / "new" / "study" / "results.jsonl").read_bytes() == line
    with pytest.raises(FileExistsError):
        maker.main()


def test_a_section_of_the_comparison_is_replaced_alone(monkeypatch):
    maker = load_script("make_methods")
    fresh = ["## Where ours stands", "new", "## What it costs", "| cheap |"]
    monkeypatch.setattr(maker, "sections", lambda summary: fresh)
    summary = {"methods": ["constant", "ours"]}
    page = "# Page\n\n## Where ours stands\n\nold\n\n## What it costs\n\n| dear |\n\n## End\n\nlast\n"
    changed = maker.with_section(page, summary, "What it costs")
    assert changed.startswith("# Page\n\n## Where ours stands\n\nold\n\n## What it costs\n\n| cheap |\n\n")
    assert "of these methods: constant, ours.\n\n## End\n\nlast\n" in changed
    assert "dear" not in changed
    with pytest.raises(SystemExit, match='must both have a section "End"'):
        maker.with_section(page, summary, "End")


def test_single_runs_that_are_behind_are_listed_last_with_their_seed():
    maker = load_script("make_methods")
    assert maker.parted(["## A", "text", "## B", "more"]) == (["## A", "text"], ["## B", "more"])
    result = {"set": "ur10", "split": "tails", "detail": "q1:low:0.3", "size": "100", "n_train": 100}
    results = [
        result | {"seed": seed, "method": method, "errors": {"mean_mm": mean}}
        for seed, means in ((7, (0.2, 0.1)), (8, (0.1, 0.2)), (9, (0.2, 0.1)))
        for method, mean in zip(("ours", "curves"), means, strict=True)
    ]
    summary = {"results": results, "methods": ["ours", "curves"], "groups": []}
    heading, listed = maker.list_of_runs(summary)
    assert [line.split(" | ")[3] for line in listed.splitlines()[2:]] == ["7", "9"]
    assert f"2 of 3 are as far behind, on the same sizes ([list](#{anchor_of(heading[3:])}))" in maker.behind(
        summary
    )


def test_every_public_name_is_in_the_python_reference():
    for page in ("python-api", "python-docstrings"):
        text = (ROOT / "docs" / "reference" / f"{page}.md").read_text()
        for name in ta.__all__:
            assert re.search(rf"\b{name}\b", text), name


def test_the_python_reference_shows_only_what_is_for_calls():
    text = (ROOT / "docs" / "reference" / "python-docstrings.md").read_text()
    assert not re.search(r"^#### \w+\.(core|corrector|values_of|field_inputs)$", text, re.MULTILINE)
    assert ("`Calibration(" in text, "`Robot(" in text, "`Limits(" in text) == (False, False, True)
    assert "Internal" not in text
    items = re.findall(r"^- `([^`]+)`: ", text, re.MULTILINE)
    assert [item for item in items if re.search(r"[^,] ", item)] == []


def load_script(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
