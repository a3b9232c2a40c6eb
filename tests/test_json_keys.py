"""docs/reference/json.md names the keys that commands print with --json."""

import json
import re
from pathlib import Path

import pytest

from tests.report_support import write_arm_and_later
from truearm.cli import main

PAGE = Path(__file__).resolve().parents[1] / "docs" / "reference" / "json.md"
ROW = re.compile(r"^\| `(?P<command>truearm [^`]*)`[^|]* \| (?P<keys>.*) \|$", re.MULTILINE)
WITHIN = re.compile(r"\([^()]*\)")
ARGUMENTS = {
    "truearm evaluate": "evaluate arm.calib later.csv",
    "truearm report": "report arm.calib -o report.html",
    "truearm robots": "robots",
    "truearm robots ROBOT": "robots rv-m2",
    "truearm import": "import later.csv -o imported.csv --joint-unit rad --length-unit m",
    "truearm plan": "plan rv-m2 -n 20 -o poses.csv",
    "truearm plan --next": "plan --next 3 --from arm.calib -o next.csv",
    "truearm plan --acceptance": "plan --acceptance 8 --from arm.calib -o check.csv",
    "truearm cell example": "cell example ur -o cell.toml",
    "truearm export": "export arm.calib --to dh-json -o arm.json",
    "truearm strip": "strip arm.calib -o bare.calib",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_arm_and_later(tmp_path_factory.mktemp("json"))


@pytest.mark.parametrize("command", ARGUMENTS)
def test_the_page_names_all_keys_of_a_command(folder, monkeypatch, capsys, command):
    monkeypatch.chdir(folder)
    told = {row["command"]: row["keys"] for row in ROW.finditer(PAGE.read_text())}
    named = set(re.findall(r"`([^`]*)`", WITHIN.sub("", told[command])))
    assert main([*ARGUMENTS[command].split(), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found[0] if isinstance(found, list) else found) == named
