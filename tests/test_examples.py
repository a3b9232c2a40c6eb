"""The examples run as they are, and show what they say they show."""

import json
import re
import runpy
from pathlib import Path

import pytest

import truearm as ta

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)

    def run_example(name):
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
        return capsys.readouterr().out

    return run_example


def numbers(line):
    return [float(number) for number in re.findall(r"-?\d+\.?\d*", line)]


def test_the_notebook_goes_from_a_csv_file_to_a_calibration(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    cells = json.loads((EXAMPLES / "calibrate_from_csv.ipynb").read_text())["cells"]
    names: dict[str, object] = {"__name__": "__main__"}
    for cell in cells:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
    lines = capsys.readouterr().out.splitlines()
    means = {line.split(":")[0].strip(): numbers(line)[0] for line in lines if " mm mean" in line}
    assert means["variable"] < means["constant"] < means["nominal"]
    assert ta.Calibration.load("arm.calib").robot.name == "UR10"
    assert (tmp_path / "theta2.png").stat().st_size > 0


def test_variable_parameters_pay_with_enough_poses(run):
    rows = [numbers(line) for line in run("constant_or_variable.py").splitlines()[1:]]
    for _, nominal, constant, variable in rows:
        assert max(constant, variable) < nominal / 5
        assert variable < 1.1 * constant
    assert rows[-1][3] < rows[-1][2]


def test_a_virtual_cell_is_measured_and_calibrated(run):
    printed = run("measure_a_virtual_cell.py")
    assert "all poses are done" in printed
    errors = dict(re.findall(r"(\w+): ([\d.]+) mm", printed))
    assert float(errors["constant"]) < float(errors["nominal"]) / 2


def test_a_rewritten_program_is_nearer_to_what_was_meant(run):
    printed = run("compensate_a_program.py")
    before, after = (float(value) for value in re.findall(r"off by ([\d.]+) mm", printed))
    assert after < before / 2
    assert "left as it is: it is not declared in this module" in printed
    assert Path("compensated/pick.mod").read_text().count("MoveL") == 3


def test_the_field_is_an_array_function(run):
    lines = run("field_in_numpy.py").splitlines()
    low, high = numbers(lines[0])[1:]
    assert low < high
    assert 0 < numbers(lines[2])[0] < 100


def test_every_example_is_listed_and_run():
    listed = (EXAMPLES / "README.md").read_text()
    run_here = Path(__file__).read_text()
    for path in EXAMPLES.glob("*.py"):
        assert f"({path.name})" in listed
        assert path.stem in run_here
