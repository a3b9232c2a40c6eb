"""The documentation cannot lie: its examples run, its links lead somewhere, its generated pages are current.

A fenced block is run when its first line says so: ```python run or ```bash run. The blocks of a page are run
in order in a directory of their own; Python blocks share their names. Before the first block the directory
holds measurements.csv and another_day.csv of a virtual UR10.
"""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import truearm as ta
from truearm.cli import COMMANDS
from truearm.robot import Robot
from truearm.simulation import VirtualArm

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
FENCE = re.compile(r"^( *)```(\w+) run\n(.*?)^\1```", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")
TRAINING_POSES, OTHER_POSES = 80, 30


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


@pytest.mark.parametrize("page", [page for page in PAGES if blocks_of(page)], ids=name_of)
def test_examples_run(page, tables, tmp_path, monkeypatch, capsys):
    for name, table in tables.items():
        table.to_csv(tmp_path / name, index=False)
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    for language, text in blocks_of(page):
        if language == "bash":
            run_bash(text)
        else:
            assert language == "python", f"cannot run {language}"
            exec(compile(text, name_of(page), "exec"), names)


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
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


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


def test_command_line_reference_is_current(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    maker = load_script("make_cli")
    assert maker.PAGE.read_text() == maker.page(), "run: python docs/make_cli.py"


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


def test_every_public_name_is_in_the_python_reference():
    page = (ROOT / "docs" / "reference" / "python-api.md").read_text()
    for name in ta.__all__:
        assert re.search(rf"\b{name}\b", page), name


def load_script(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
