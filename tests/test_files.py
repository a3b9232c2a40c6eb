"""Files are written whole, all of them or none, and only files are replaced."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from truearm.cli import main
from truearm.errors import InputError
from truearm.files import (
    check_output,
    check_place,
    followed,
    make_directory,
    parsed,
    read_bytes,
    write_all,
    write_whole,
)


def test_a_link_stays_one_and_what_it_leads_to_is_written(tmp_path):
    (tmp_path / "shelf").mkdir()
    target, link = tmp_path / "shelf" / "real.txt", tmp_path / "link.txt"
    target.write_text("old")
    link.symlink_to(target)
    write_whole(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"


def test_a_pipe_stays_one_and_is_written_to(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    got: list[str] = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_text()))
    reader.start()
    write_whole(pipe, "through")
    reader.join(5.0)
    assert pipe.is_fifo()
    assert got == ["through"]


def test_a_device_that_takes_nothing_is_named():
    with pytest.raises(InputError, match="/dev/full: this cannot be written: No space left"):
        write_whole(Path("/dev/full"), "text")


def test_standard_output_is_written_to_through_a_pipe_and_into_a_file(tmp_path):
    work = "from truearm.files import write_whole; from pathlib import Path; print('before', flush=True); "
    work += "write_whole(Path('/dev/stdout'), 'whole\\n')"
    piped = subprocess.run([sys.executable, "-c", work], capture_output=True, text=True, check=True)
    assert piped.stdout == "before\nwhole\n"
    with (tmp_path / "log").open("w") as log:
        subprocess.run([sys.executable, "-c", work], stdout=log, check=True)
    assert (tmp_path / "log").read_text() == "before\nwhole\n"


def test_a_link_that_leads_to_itself_is_an_error(tmp_path):
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(InputError, match="leads to itself"):
        write_whole(tmp_path / "loop", "text")


def test_where_nobody_may_look_a_path_is_no_link(tmp_path, monkeypatch):
    def refused(*_, **__):
        raise PermissionError

    monkeypatch.setattr(os, "lstat", refused)
    assert followed(tmp_path / "plain") == tmp_path / "plain"


def test_where_one_of_several_cannot_be_written_none_is(tmp_path):
    (tmp_path / "second").mkdir()
    (tmp_path / "first").write_text("old")
    with pytest.raises(InputError, match="this is a directory"):
        write_all([(tmp_path / "first", "new"), (tmp_path / "second", "new")])
    assert (tmp_path / "first").read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["first", "second"]


def test_threads_leave_the_mask_of_new_files_alone(tmp_path):
    before, interval = os.umask(0o027), sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        work = [threading.Thread(target=_write_many, args=(tmp_path, name)) for name in "abcd"]
        for thread in work:
            thread.start()
        for thread in work:
            thread.join()
        left = os.umask(0o027)
    finally:
        os.umask(before)
        sys.setswitchinterval(interval)
    assert left == 0o027
    assert {path.stat().st_mode & 0o777 for path in tmp_path.iterdir()} == {0o640}


def _write_many(folder, name):
    for number in range(50):
        write_whole(folder / f"{name}{number}", "text")


@pytest.mark.parametrize("mode", [0o640, 0o600, 0o444, 0o666])
def test_a_file_that_is_replaced_keeps_its_permissions(tmp_path, mode):
    path = tmp_path / "private.txt"
    path.write_text("old")
    path.chmod(mode)
    write_whole(path, "new")
    assert path.read_text() == "new"
    assert path.stat().st_mode & 0o777 == mode


def test_streams_and_links_go_where_nothing_may_be_made(tmp_path, monkeypatch):
    open_to_all, closed = tmp_path / "open", tmp_path / "closed"
    open_to_all.mkdir()
    closed.mkdir()
    (closed / "link").symlink_to(open_to_all / "result.csv")
    monkeypatch.setattr("os.access", lambda path, _mode: Path(path) == open_to_all)
    for place in (Path("/dev/stdout"), Path("/dev/null"), closed / "link", open_to_all / "result.csv"):
        check_place(place)
    with pytest.raises(InputError, match="closed: no permission to write here"):
        check_place(closed / "result.csv")


@pytest.mark.parametrize("name", ["file/below", "n" * 300])
def test_what_no_file_can_be_is_told(tmp_path, name):
    (tmp_path / "file").write_text("a file")
    path = tmp_path / name
    with pytest.raises(InputError, match="this cannot be read: "):
        read_bytes(path)
    with pytest.raises(InputError, match=r"this cannot be written: |file: this is a file\. A"):
        write_whole(path, "text")
    with pytest.raises(InputError, match=r"a file is in the way|this directory cannot be made: "):
        make_directory(path)
    assert [place.name for place in tmp_path.iterdir()] == ["file"]


def test_a_directory_is_made_with_those_above_it_and_no_file_is_one(tmp_path):
    for _ in range(2):
        make_directory(tmp_path / "above" / "below")
    assert (tmp_path / "above" / "below").is_dir()
    (tmp_path / "file").write_text("a file")
    with pytest.raises(InputError, match=r"file: a file is in the way\. A directory is needed"):
        make_directory(tmp_path / "file")


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="there is no file system that takes nothing")
@pytest.mark.parametrize(
    ("words", "place"),
    [
        (["calibrate", "rv-m2", "m.csv", "-o"], "/proc/none/x"),
        (["fleet", "fleet.toml", "-o"], "/proc/none/x"),
        (["report", "a.calib", "-o"], "/proc/a.html"),
        (["strip", "a.calib", "-o"], "/proc/a.calib"),
    ],
)
def test_where_nothing_can_be_made_though_it_may_is_told_before_the_work(
    words, place, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fleet.toml").write_text("arm = [{name = 'R1', robot = 'ur10', measurements = 'm.csv'}]")
    assert main([*words, place]) == 1
    assert "Error: /proc: nothing can be written here" in capsys.readouterr().err


def test_to_try_whether_a_directory_takes_files_leaves_nothing(tmp_path):
    check_output(tmp_path / "a.html")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "words", [["calibrate", "rv-m2", "m.csv", "-o", ""], ["report", ""], ["calibrate", "rv-m2", "--output="]]
)
def test_an_empty_argument_is_not_the_working_directory(words, capsys):
    assert main(words) == 2
    assert "an argument is empty. A variable of the shell" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    "words",
    [
        ["export", "a.calib", "--to", "dh-csv", "-o"],
        ["strip", "a.calib", "-o"],
        ["report", "a.calib", "-o"],
        ["compensate", "a.calib", "p.script", "-o"],
        ["compensate", "a.calib", "p.script", "-o", "out/", "--report"],
        ["plan", "ur10", "-o"],
        ["plan", "ur10", "--picture"],
        ["import", "raw.csv", "-o"],
        ["frame", "a.calib", "touches.csv", "--tool", "t", "-o"],
        ["session", "export", "session.db", "-o"],
    ],
    ids=" ".join,
)
def test_a_place_that_takes_no_file_is_told_before_the_work(words, tmp_path, monkeypatch, capsys):
    def begin(_given):
        raise AssertionError("the work has begun")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("truearm.calibration.Calibration.load", begin)
    monkeypatch.setattr("truearm.robot.Robot.load", begin)
    assert main([*words, "nowhere/a.html"]) == 1
    assert capsys.readouterr().err == "Error: nowhere: there is no such directory.\n"


def test_a_list_in_a_list_in_a_list_and_so_on_is_no_toml():
    with pytest.raises(InputError, match=r"deep.toml: not TOML: "):
        parsed("a = " + 5_000 * "[" + 5_000 * "]", where="deep.toml")
