"""Messages of a fleet name keys of its file, not options of the command line."""

import pytest

import truearm as ta
from tests.in_process import in_this_process
from truearm.errors import InputError
from truearm.fleet import Fleet, run_fleet, running
from truearm.fleet.keys import in_keys
from truearm.simulation import VirtualArm

FLEET = '[defaults]\nrobot = "ur10"\nreport = false\n[[arm]]\nname = "R1"\nmeasurements = "*.csv"\n'


@pytest.mark.parametrize(
    ("option", "key"),
    [
        ("give --length-unit mm, or name", 'give length_unit = "mm", or name'),
        ("--angle-unit rad.", 'angle_unit = "rad".'),
        ("hold out less: --holdout 0.25 is enough", "hold out less: holdout = 0.25 is enough"),
        ("With --model variable or constant", 'With model = "variable" or constant'),
        ("Leave --frame out", "Leave frame out"),
        ("Give --split-by or --holdout-range", "Give split_by or holdout_range"),
        ("truearm import --map q3=COLUMN:mm", "truearm import --map q3=COLUMN:mm"),
    ],
)
def test_options_become_keys(option, key):
    assert in_keys(option) == key


def test_what_an_arm_fails_with_names_keys(tmp_path, monkeypatch):
    monkeypatch.setattr(running, "run_tasks", in_this_process)
    arm = VirtualArm(ta.Robot.load("ur10"), seed=1)
    table = arm.measure_table(arm.poses(40))
    table[["x", "y", "z"]] *= 1000.0
    table.to_csv(tmp_path / "mm.csv", index=False)
    run = run_fleet(Fleet.from_toml(FLEET, folder=tmp_path), tmp_path / "out", workers=1)
    words = run.arms[0].row["error"]
    assert 'length_unit = "mm"' in words
    assert "--" not in words


def test_options_that_contradict_each_other_in_a_fleet_file_name_keys():
    with pytest.raises(InputError, match='Leave them out, or model = "variable"'):
        Fleet.from_toml(f'{FLEET}model = "constant"\nfeatures = ["load"]\n')


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('length_unit = "in"', 'length_unit: "in" is not known. Either m or mm'),
        ('angle_unit = "grad"', 'angle_unit: "grad" is not known. Either rad or deg. Did you mean "rad"'),
        ('strip = "yes"', "strip: 'yes' cannot be used. Must be true or false"),
    ],
)
def test_what_an_arm_is_read_by_is_checked_with_the_file(line, words):
    with pytest.raises(InputError, match=f'fleet.toml, arm "R1", {words}'):
        Fleet.from_toml(f"{FLEET}{line}\n", where="fleet.toml")
    with pytest.raises(InputError, match=f"fleet.toml, defaults, {words}"):
        Fleet.from_toml(FLEET.replace("[[arm]]", f"{line}\n[[arm]]"), where="fleet.toml")
