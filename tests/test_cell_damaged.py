"""Session files that were damaged, or changed by hand: one line that says what is wrong, and no traceback."""

import sqlite3
from contextlib import closing

import pytest

from tests.recorded import CELL, Recorded
from truearm.cell.accepted import accepted_table
from truearm.cell.session import Session
from truearm.cell.summary import summary_of
from truearm.cli import main
from truearm.errors import InputError

PAGE = 4096


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A session that is over, which nobody changes, and the cell and poses that it is of."""
    recorded = Recorded(tmp_path_factory.mktemp("finished"))
    recorded.measure()
    folder = recorded.folder
    (folder / "cell.toml").write_text(CELL.replace("FILE", str(folder / "there.csv")))
    rows = [",".join(map(repr, map(float, row))) for row in recorded.poses.readings]
    (folder / "poses.csv").write_text("\n".join(["q1,q2,q3,q4,q5,q6", *rows]) + "\n")
    return recorded


@pytest.fixture
def copied(finished, tmp_path):
    place = tmp_path / "session.db"
    place.write_bytes(finished.session.read_bytes())
    return place


def all_read(place):
    with Session(place, writing=False) as session:
        summary_of(session)
        accepted_table(session)


def told_by_commands(place, finished, capsys):
    """What commands say of a file that they refuse."""
    given = [finished.folder / "cell.toml", finished.folder / "poses.csv", "-o", place]
    said = []
    for words in (["session", "show", place], ["session", "export", place, "-o", place.parent / "out.csv"],
                  ["measure", *given]):  # fmt: skip
        assert main([str(word) for word in words]) == 1
        said.append(" ".join(capsys.readouterr().err.split()))
    return said


def test_whichever_page_is_damaged_there_is_an_error_and_nothing_else(finished, copied):
    whole, refused = copied.read_bytes(), 0
    pages = len(whole) // PAGE
    assert pages > 5
    for page in range(1, pages):
        for filling in (b"\xa5", b"\0", b"\x0d", b"9"):
            copied.write_bytes(whole[: page * PAGE] + PAGE * filling + whole[(page + 1) * PAGE :])
            try:
                all_read(copied)
            except InputError as error:
                refused += "the session file is damaged" in str(error)
    assert refused > pages


def test_commands_say_that_a_file_is_damaged_and_what_can_be_done(finished, copied, capsys):
    whole = copied.read_bytes()
    middle = len(whole) // PAGE // 2 * PAGE
    copied.write_bytes(whole[:middle] + PAGE * b"\xa5" + whole[middle + PAGE :])
    for said in told_by_commands(copied, finished, capsys):
        assert f"{copied.name}: the session file is damaged: " in said
        assert ".recover" in said


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("steps SET readings = 'none' WHERE step = 9", "steps, step 9: readings is 'none'"),
        ("steps SET readings = '[1, 2]' WHERE step = 9", "readings is '[1, 2]'"),
        ("steps SET readings = '[1, 2, 3, 4, 5, \"six\"]' WHERE step = 0", "a list of numbers, one a joint"),
        ("steps SET pose = 'x' WHERE step = 9", "pose is 'x'"),
        ("outcomes SET attempts = '[1' WHERE step = 9", "outcomes, step 9: attempts is '[1'"),
        ("outcomes SET attempts = '1' WHERE step = 9", "attempts is '1'"),
        ("outcomes SET attempts = '[7]' WHERE step = 9", "of attempts of that step whose readings are valid"),
        ("outcomes SET attempts = '[]' WHERE step = 9", "attempts is '[]'"),
        ("registration SET world_from_base = 'here'", "registration: world_from_base is 'here'"),
        ("registration SET world_from_base = '[[1, 2], [3]]'", "4 rows of 4 numbers"),
        ("registration SET residual_mm = 'small'", "residual_mm is 'small'"),
        ("readings SET x_m = 'far' WHERE step = 9", "readings, step 9: x_m is 'far'"),
        ("readings SET z_m = NULL WHERE step = 9", "z_m is None"),
        ("readings SET y_m = 9e999 WHERE step = 9", "y_m is inf. It is a finite number"),
        ("readings SET attempt = attempt + 1 WHERE step = 9", "attempt is 2"),
        (
            "readings SET step = 999 WHERE step = 9",
            "readings, step 999: step is 999. It is a step of the session",
        ),
        ("outcomes SET step = 999 WHERE step = 9", "outcomes, step 999: step is 999"),
        ("readings SET qx = 'x' WHERE step = 9", "qx is 'x'"),
        ("readings SET sigma_m = 'some' WHERE step = 9", "sigma_m is 'some'"),
        ("readings SET joints = '{}' WHERE step = 9", "joints is '{}'"),
        ("readings SET features = '[1]' WHERE step = 9", "features is '[1]'"),
        ("readings SET raw = x'00ff' WHERE step = 9", "raw is "),
        ("meta SET value = '' WHERE key = 'target'", "meta: target is ''"),
        ("meta SET value = '3' WHERE key = 'arm'", "meta: arm is '3'"),
        ("meta SET value = '\"far\"' WHERE key = 'drift_mm'", "meta: drift_mm is"),
        ("meta SET value = '1e300' WHERE key = 'created_s'", "meta: created_s is"),
        ("meta SET value = 'one' WHERE key = 'version'", "layout None"),
    ],
)
def test_values_changed_to_what_they_cannot_be_are_told(change, message, finished, copied, capsys):
    with closing(sqlite3.connect(copied, isolation_level=None)) as database:
        database.execute(f"UPDATE {change}")
    with pytest.raises(InputError) as error:
        all_read(copied)
    assert message in str(error.value)
    if "attempts" in change:
        for said in told_by_commands(copied, finished, capsys):
            assert "attempts is" in said


def test_a_session_that_has_lost_its_arm_is_told(finished, copied, capsys):
    with closing(sqlite3.connect(copied, isolation_level=None)) as database:
        database.execute("DELETE FROM meta WHERE key = 'arm'")
    for said in told_by_commands(copied, finished, capsys):
        assert "meta holds no arm" in said or "of another arm" in said


def test_a_byte_of_the_schema_that_is_no_text_is_told(finished, copied, capsys):
    content = copied.read_bytes()
    copied.write_bytes(content.replace(b"CREATE TABLE readings", b"CREA\xf0E TABLE readings", 1))
    for said in told_by_commands(copied, finished, capsys):
        assert "the session file is damaged: it holds bytes that are not UTF-8" in said


def test_features_that_are_no_number_are_kept_and_read(copied):
    with closing(sqlite3.connect(copied, isolation_level=None)) as database:
        database.execute('UPDATE readings SET features = \'{"humidity": NaN, "dust": Infinity}\'')
    with Session(copied, writing=False) as session:
        table = accepted_table(session)
    assert len(table) == 20
    assert table["humidity"].isna().all()
    assert (table["dust"] == float("inf")).all()


def test_a_session_with_a_step_that_has_no_outcome_is_not_complete(copied, capsys):
    assert main(["session", "show", str(copied)]) == 0
    assert "The session is complete" in capsys.readouterr().out
    with closing(sqlite3.connect(copied, isolation_level=None)) as database:
        database.execute("DELETE FROM outcomes WHERE step = 12")
    with Session(copied, writing=False) as session:
        found = summary_of(session)
        assert session.next_step() is None
    assert (found["open"], found["complete"]) == (1, False)
    assert main(["session", "show", str(copied)]) == 0
    shown = capsys.readouterr().out
    assert "19 of 20 poses measured, 0 skipped, 1 open" in shown
    assert "The session is complete" not in shown
