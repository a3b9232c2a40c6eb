"""Commands whose standard streams are closed, as daemons and schedulers start them, do their work."""

import os
import shlex
import subprocess
import sys

import pytest

from truearm.cell.examples import example
from truearm.cli import main

TRUEARM = f"{shlex.quote(sys.executable)} -m truearm"
STREAMS = ("stdin", "stdout", "stderr")


@pytest.mark.skipif(os.name != "posix", reason="there is no shell that closes streams")
def test_work_is_done_and_written_where_it_belongs(tmp_path):
    output = tmp_path / "cell.toml"
    words = f"{TRUEARM} cell example ur -o {shlex.quote(str(output))} <&- >&- 2>&-"
    done = subprocess.run(["/bin/sh", "-c", words], capture_output=True, check=False)
    assert done.returncode == 0
    assert output.read_text() == example("ur")


def test_errors_without_a_stderr_have_their_exit_status(monkeypatch):
    for name in STREAMS:
        monkeypatch.setattr(sys, name, None)
    assert main(["robots", "--check", ""]) == 2
    for name in STREAMS:
        getattr(sys, name).close()
