"""Tasks over processes and over a real Dask cluster: errors, workers that die, and the end by Ctrl-C."""

import logging
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import distributed
import pytest
from distributed import LocalCluster

from tests.tasks import LONG_S, bad_answer, cube, die_sometimes, native_threads, wait_to_be_killed
from truearm.errors import InputError, UsageError, WorkError
from truearm.workers import check_workers, processors, run_tasks
from truearm.workers import cluster as over_cluster
from truearm.workers.done import ATTEMPTS

ROOT = Path(__file__).resolve().parents[1]
ENDS_WITHIN_S = 1.5


@pytest.fixture(scope="module")
def cluster():
    made = LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
    )
    yield made
    made.close()


def written(path):
    """The number of a process that appears in a file."""
    deadline = time.monotonic() + LONG_S
    while not (path.exists() and path.read_text()):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return int(path.read_text())


def alive(process):
    """Whether a process runs; one that ended and is not yet collected does not."""
    status = Path(f"/proc/{process}/stat")
    return status.exists() and status.read_text().rpartition(")")[2].split()[0] != "Z"


def test_results_come_with_their_numbers():
    found = {done.index: done.result() for done in run_tasks(cube, range(7), workers=2)}
    assert found == {k: k**3 for k in range(7)}
    assert list(run_tasks(cube, [])) == []


def test_an_error_is_a_value():
    good, bad = sorted(run_tasks(cube, [2, -1], workers=1), key=lambda done: done.index)
    assert (good.value, good.error, bad.trace) == (8, None, "")
    with pytest.raises(InputError, match=r"-1 is negative\. It must not be\."):
        bad.result()


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("bug", "division by zero"),
        ("exits", "SystemExit"),
        ("unsendable", "lambda"),
        ("own error", "1 and 2"),
    ],
)
def test_answers_that_cannot_be_sent_are_errors(kind, words):
    (done,) = run_tasks(bad_answer, [kind], workers=1)
    assert words in str(done.error)
    assert done.value is None
    assert ("bad_answer" in done.trace) == (kind in ("bug", "own error"))


def test_workers_share_the_processors(monkeypatch):
    for name in ("RAYON_NUM_THREADS", "OMP_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
    found = [done.value for done in run_tasks(native_threads, ["RAYON_NUM_THREADS"] * 2, workers=2)]
    assert found == [str(max(1, processors() // 2))] * 2
    assert "RAYON_NUM_THREADS" not in os.environ
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    assert [done.value for done in run_tasks(native_threads, ["OMP_NUM_THREADS"])] == ["7"]


def test_a_worker_that_dies_is_replaced_a_few_times(tmp_path):
    items = [(tmp_path, "once", 1), (tmp_path, "unlucky", ATTEMPTS), (tmp_path, "hopeless", ATTEMPTS + 1)]
    found = {done.index: done for done in run_tasks(die_sometimes, items, workers=2)}
    assert [found[k].value for k in range(3)] == ["once", "unlucky", None]
    with pytest.raises(WorkError, match=f"died, {ATTEMPTS} times") as caught:
        found[2].result()
    assert "__main__" not in str(caught.value)


def test_closing_ends_the_processes(tmp_path):
    (tmp_path / "b").touch()
    with closing(run_tasks(wait_to_be_killed, [(tmp_path, "a"), (tmp_path, "b")], workers=2)) as finished:
        assert next(finished).value == "b"
        worker = written(tmp_path / "a")
        began = time.monotonic()
    assert time.monotonic() - began < ENDS_WITHIN_S
    assert not alive(worker)


def ran_as_program(folder, text, way):
    """What a program prints on stdout and stderr, from a file or from standard input."""
    (folder / "program.py").write_text(text)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    command = [sys.executable, "program.py" if way == "file" else "-"]
    given = text if way == "standard input" else ""
    done = subprocess.run(
        command,
        check=False,
        input=given,
        env=environment,
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=LONG_S,
    )
    return done.stdout, done.stderr


@pytest.mark.parametrize("way", ["file", "standard input"])
def test_tasks_of_truearm_need_no_guard(tmp_path, way):
    text = (
        "from truearm.errors import typed\nfrom truearm.workers import run_tasks\nprint('began')\n"
        "print(sorted(done.result() for done in run_tasks(typed, ['b', 'a b'], workers=2)))\n"
    )
    stdout, stderr = ran_as_program(tmp_path, text, way)
    assert (stdout.splitlines(), stderr) == (["began", """["'a b'", 'b']"""], "")


@pytest.mark.parametrize("way", ["file", "standard input"])
def test_other_functions_without_a_guard_are_told_of_it(tmp_path, way):
    text = (
        "from truearm.workers import run_tasks\ndef square(number):\n    return number**2\n"
        "for done in run_tasks(square, range(20), workers=2):\n    print(done.error)\n"
    )
    stdout, stderr = ran_as_program(tmp_path, text, way)
    assert stdout == ""
    assert "a worker ended before its first task" in stderr
    assert 'if __name__ == "__main__":' in stderr
    assert "memory" not in stderr


def test_a_program_finds_its_own_functions_under_its_guard(tmp_path):
    text = (
        "from truearm.workers import run_tasks\ndef square(number):\n    return number**2\n"
        "if __name__ == '__main__':\n"
        "    print(sorted(done.result() for done in run_tasks(square, range(4), workers=2)))\n"
    )
    assert ran_as_program(tmp_path, text, "file") == ("[0, 1, 4, 9]\n", "")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_processes_are_gone_with_their_parent(tmp_path, number):
    script = (
        "import sys; from pathlib import Path; from tests.tasks import wait_to_be_killed\n"
        "from truearm.workers import run_tasks\n"
        "if __name__ == '__main__':\n"
        "    list(run_tasks(wait_to_be_killed, [(Path(sys.argv[1]), 'a')]))\n"
    )
    (tmp_path / "script.py").write_text(script)
    command = [sys.executable, str(tmp_path / "script.py"), str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    with subprocess.Popen(
        command, env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        worker = written(tmp_path / "a")
        began = time.monotonic()
        if number == signal.SIGINT:
            os.killpg(process.pid, number)  # a terminal sends it to all of them
        else:
            process.kill()
        _, said = process.communicate(timeout=LONG_S)
        while alive(worker):
            assert time.monotonic() - began < ENDS_WITHIN_S
            time.sleep(0.02)
    assert said.count("Traceback") == (number == signal.SIGINT)


def test_wrong_use_is_said_at_once():
    with pytest.raises(UsageError, match="both a scheduler and a number"):
        run_tasks(cube, [1], scheduler="tcp://127.0.0.1:1", workers=1)
    with pytest.raises(UsageError, match="0 workers"):
        run_tasks(cube, [1], workers=0)


def test_a_cluster_does_the_same(cluster):
    address = cluster.scheduler_address
    found = {done.index: done for done in run_tasks(cube, [3, -1], scheduler=address)}
    assert found[0].result() == 27
    with pytest.raises(InputError, match="-1 is negative"):
        found[1].result()
    assert [done.value for done in run_tasks(native_threads, ["RAYON_NUM_THREADS"], scheduler=address)] == [
        "1"
    ]


def test_a_worker_of_the_cluster_is_killed_in_the_middle(cluster, tmp_path):
    items = [(tmp_path, name) for name in ("a", "b", "c")]
    (tmp_path / "b").touch()
    with closing(run_tasks(wait_to_be_killed, items, scheduler=cluster.scheduler_address)) as finished:
        found = [next(finished).result()]
        os.kill(written(tmp_path / "a"), signal.SIGKILL)
        os.kill(written(tmp_path / "c"), signal.SIGKILL)
        found += [done.result() for done in finished]
    assert sorted(found) == ["a", "b", "c"]


def test_a_scheduler_that_is_not_there_is_named(monkeypatch):
    monkeypatch.setattr("truearm.workers.cluster.CONNECT_S", 0.3)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        began = time.monotonic()
        with pytest.raises(InputError, match=rf"{address}: no Dask scheduler answers.*dask scheduler"):
            check_workers(address)
        assert time.monotonic() - began < 10.0
    with pytest.raises(InputError, match="here there: no Dask scheduler answers"):
        next(run_tasks(cube, [1], scheduler="here there"))


def test_a_client_that_loses_its_scheduler_is_not_heard_as_it_is_closed(monkeypatch, caplog):
    class Lost:
        def __init__(self, *_, **__):
            """A client whose scheduler is gone."""

        def close(self, timeout):
            logging.getLogger("distributed.client").error("closed after %g s", timeout)

    monkeypatch.setattr(distributed, "Client", Lost)
    monkeypatch.setattr(over_cluster, "check_scheduler", lambda _: None)
    assert list(over_cluster.run_on_cluster(str, [], "tcp://127.0.0.1:1")) == []
    assert caplog.records == []


def test_without_dask_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r'pip install "\.\[fleet\]"'):
        check_workers("tcp://127.0.0.1:8786")
