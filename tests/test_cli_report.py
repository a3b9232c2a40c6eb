"""`truearm report` as people run it."""

import json
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import pandas as pd
import pytest

from tests.report_support import words_of, write_arm_and_later
from truearm.cli import main
from truearm.errors import WorkError
from truearm.reporting import pdf

PROGRAM = str(Path(sys.executable).parent / "truearm")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    return write_arm_and_later(tmp_path_factory.mktemp("report"))


@pytest.fixture
def folder(written, monkeypatch):
    monkeypatch.chdir(written)
    yield written
    for page in written.glob("*.html"):
        page.unlink()


def test_a_report_as_people_run_it(folder):
    done = subprocess.run([PROGRAM, "report", "arm.calib"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("On 28 held-out poses the mean position error is")
    assert "What would help most next:" in done.stdout
    assert "\nReport: arm.html\n" in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert (folder / "arm.html").read_text().startswith("<!DOCTYPE html>")


def test_the_report_of_a_calibration_stays_beside_it_as_others_are_written(folder, capsys):
    made = folder / "calibration.calib"
    made.write_bytes((folder / "arm.calib").read_bytes())
    for file, page in ((made.name, "report.html"), ("arm.calib", "arm.html")):
        assert main(["report", file, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["report"] == page
    made.unlink()


def test_json_alone_on_stdout(folder, capsys):
    assert main(["report", "arm.calib", "-o", "there.html", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert list(printed) == ["report", "verdict", "advice", "figures", "other"]
    assert printed["other"] is None
    assert printed["report"] == "there.html"
    assert {"kind", "words"} == set(printed["advice"][0])
    page = words_of((folder / "there.html").read_text())
    assert printed["verdict"] in page
    for figure in printed["figures"]:
        assert figure["title"] in page
        assert figure["says"] in page


def test_other_measurements_get_their_chapter(folder, capsys):
    assert main(["report", "arm.calib", "later.csv"]) == 0
    printed = capsys.readouterr().out
    assert main(["evaluate", "arm.calib", "later.csv", "--json"]) == 0
    judged = json.loads(capsys.readouterr().out)
    assert "On later.csv:" in printed
    assert f"{judged['errors']['constant']['mean_mm']:.3f}" in printed
    page = words_of((folder / "arm.html").read_text())
    assert "On other measurements" in page
    assert f"later.csv: {judged['n_judged']} rows judged" in page
    for key in ("mean_mm", "p95_mm", "max_mm"):
        assert f"{judged['errors']['constant'][key]:.3f}" in page.partition("later.csv: ")[2]


def test_json_has_the_errors_on_other_measurements(folder, capsys):
    assert main(["evaluate", "arm.calib", "later.csv", "--json"]) == 0
    judged = json.loads(capsys.readouterr().out)
    assert main(["report", "arm.calib", "later.csv", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["other"] == {"files": ["later.csv"], **judged}
    assert "other_measurements" not in [advice["kind"] for advice in printed["advice"]]


def test_measurements_that_are_not_met_are_the_first_advice(folder, tmp_path, capsys):
    table = pd.read_csv("later.csv")
    table[["x", "y", "z"]] = table[["x", "y", "z"]].to_numpy()[::-1]
    strange = tmp_path / "strange.csv"
    table.to_csv(strange, index=False)
    assert main(["report", "arm.calib", str(strange)]) == 0
    advice = " ".join(capsys.readouterr().out.partition("What would help most next:")[2].split())
    assert advice.startswith(
        "- Look at the other measurements first. Of strange.csv: The calibration does not help"
    )
    assert "Look at the other measurements first. Of strange.csv:" in words_of(
        (folder / "arm.html").read_text()
    )
    assert main(["report", "arm.calib", str(strange), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["advice"][0]["kind"] == "other_measurements"
    assert printed["other"]["errors"]["constant"]["mean_mm"] > 10.0


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["report", "none.calib"], 1, "none.calib: there is no such file"),
        (["report", "later.csv"], 1, "no calibration"),
        (["report", "."], 1, "Error: .: this is a directory. A calibration is a file"),
        (["report", "/"], 1, "Error: /: this is a directory"),
        (["report", "arm.calib", "-o", "report.docx"], 2, "A report is a page (.html) or a PDF (.pdf)"),
        (["report", "arm.calib", "-o", "nowhere/report.html"], 1, "there is no such directory"),
        (["report", "arm.calib", "missing.csv"], 1, "missing.csv: there is no such file"),
        (["report"], 2, "Missing argument"),
    ],
)
def test_what_cannot_be_done_is_said(folder, capsys, arguments, status, words):
    assert main(arguments) == status
    assert words in " ".join(capsys.readouterr().err.split())
    assert not list(folder.glob("*.html"))


def test_without_chromium_a_pdf_names_the_package(folder, monkeypatch, capsys):
    monkeypatch.setenv("PATH", str(folder))
    assert main(["report", "arm.calib", "-o", "report.pdf"]) == 1
    said = capsys.readouterr().err
    assert 'Install the package "chromium"' in said
    assert not (folder / "report.pdf").exists()


def test_a_browser_that_prints_nothing_leaves_no_pdf(folder, tmp_path, monkeypatch, capsys):
    fake = tmp_path / "chromium"
    fake.write_text("#!/bin/sh\necho something broke >&2\n")
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    assert main(["report", "arm.calib", "-o", "report.pdf"]) == 1
    assert "something broke" in capsys.readouterr().err
    assert not (folder / "report.pdf").exists()


def test_a_browser_that_is_ended_leaves_neither_processes_nor_files(tmp_path, monkeypatch):
    fake = tmp_path / "chromium"
    fake.write_text(f"#!/bin/sh\n(echo $$ > {tmp_path}/pid; sleep 60) &\nsleep 60\n")
    fake.chmod(0o755)
    made = tmp_path / "made"
    made.mkdir()
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    monkeypatch.setattr(tempfile, "tempdir", str(made))
    monkeypatch.setattr(pdf, "PATIENCE_S", 0.5)
    began = time.monotonic()
    with pytest.raises(WorkError, match="longer than"):
        pdf.write_pdf("<p>", tmp_path / "report.pdf")
    assert time.monotonic() - began < 30.0
    assert list(made.iterdir()) == []
    group = int((tmp_path / "pid").read_text())
    assert commands_of(group) == []


def commands_of(group):
    """Names of the living processes of a process group, as /proc tells them."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(FileNotFoundError, ProcessLookupError):
            name, _, rest = stat.read_text().partition("(")[2].rpartition(")")
            state, _, own = rest.split()[:3]
            found += [name] if int(own) == group and state != "Z" else []
    return found


def test_help_imports_no_numbers(folder):
    code = "import sys\nfrom truearm.cli import main\nmain(['--help'])\nprint(sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "'numpy'" not in done.stdout
    assert "'plotly'" not in done.stdout
    assert "'truearm._core'" not in done.stdout
