"""`truearm serve` as clients use and abuse it."""

import asyncio
import contextlib
import json
import queue
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import truearm as ta
from truearm.cli import main
from truearm.serving import Bounds, Server
from truearm.serving.vanished import probe
from truearm.simulation import Imperfections, VirtualArm
from truearm.streaming import CorrectionStream

PROGRAM = str(Path(sys.executable).parent / "truearm")
HOME = [0.3, -1.2, 1.4, -0.7, 1.1, 0.2]
TOKEN = "a-token-for-the-tests-only"


@pytest.fixture(scope="module")
def calib(tmp_path_factory):
    robot = ta.Robot.load("ur5e")
    arm = VirtualArm(robot, seed=4, imperfections=Imperfections(share=0.5))
    path = tmp_path_factory.mktemp("serve") / "arm.calib"
    ta.calibrate(robot, arm.measure(arm.poses(80)), model="constant").save(path)
    return path


@contextlib.contextmanager
def serving(*words):
    """A server on a free port: its port and its process."""
    command = [PROGRAM, "serve", *map(str, words), "--port", "0", "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    out = process.stdout
    assert out is not None
    try:
        yield json.loads(out.readline())["port"], process
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=10)


@pytest.fixture(scope="module")
def port(calib):
    with serving(calib, "--ramp-s", "0.05", "--hold-s", "0.02", "--deadline-s", "2") as (found, _):
        yield found


class Client:
    """A connection."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=5)
        self.file = self.socket.makefile("rwb")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        with contextlib.suppress(OSError):
            self.file.close()
        self.socket.close()

    def read(self):
        line = self.file.readline()
        return json.loads(line) if line else None

    def send(self, data):
        self.file.write(data if isinstance(data, bytes) else json.dumps(data).encode() + b"\n")
        self.file.flush()

    def ask(self, content):
        self.send(content)
        return self.read()


@pytest.fixture
def client(port):
    with Client(port) as found:
        greeting = found.read()
        assert (greeting["protocol"], greeting["joints"]) == (1, ["revolute"] * 6)
        yield found


def is_served(port):
    """Whether another client is answered, once connections that were closed have been noticed."""
    for _ in range(50):
        with Client(port) as other:
            if "protocol" in (other.read() or {}):
                return other.ask({"q": HOME})["q"] is not None
        time.sleep(0.1)
    return False


def settle(client, request):
    """The answer once nothing moves: a correction that has just arrived may still have a rate."""
    until = time.monotonic() + 20.0
    before, answer = client.ask(request), client.ask(request)
    while answer["phase"] != "on" or answer["lag"] != 0.0 or before["lag"] != 0.0:
        assert time.monotonic() < until, answer
        time.sleep(0.001)
        before, answer = answer, client.ask(request)
    return answer


def test_set_points_are_corrected(client, calib):
    answer = settle(client, {"q": HOME, "id": 7})
    expected = ta.Compensator(ta.Calibration.load(calib)).correct(HOME)
    assert answer["id"] == 7
    assert answer["fault"] is None
    assert answer["q"] == pytest.approx(expected, abs=1e-9)
    degrees = client.ask({"q_deg": np.degrees(HOME).tolist()})
    assert degrees["q_deg"] == pytest.approx(np.degrees(expected), abs=1e-6)


def test_joints_that_must_not_move_do_not(calib):
    known = ta.Calibration.load(calib)
    expected = ta.Compensator(known, task="position", moving=(1, 2, 3)).correct(HOME)
    options = ("--ramp-s=0.05", "--deadline-s=10", "--task=position", "--moving=1,2,3")
    with serving(calib, *options) as (found, _), Client(found) as client:
        client.read()
        answer = settle(client, {"q": HOME})
    assert answer["q"] == pytest.approx(expected, abs=1e-9)
    assert answer["q"][3:] == HOME[3:]


def test_what_has_no_correction_holds_the_last_one(client):
    before = settle(client, {"q": HOME})
    for missing in (None, [*HOME[:5], None]):
        held = client.ask({"q": missing})
        assert held["phase"] == "holding"
        assert "missing" in held["fault"]
        assert held["q"] == pytest.approx(before["q"], abs=1e-4)
        settle(client, {"q": HOME})
    assert "limit" in client.ask({"q": [9.0, *HOME[1:]]})["fault"]


def test_a_pause_is_a_missed_deadline(client):
    settle(client, {"q": HOME})
    time.sleep(2.2)
    assert client.ask({"q": HOME})["fault"] == "the set-point came after the deadline"


def test_it_is_switched_off(client):
    settle(client, {"q": HOME})
    assert "q" not in client.ask({"switch": "off"})
    answer = client.ask({"q": HOME})
    for _ in range(400):
        if answer["phase"] == "off":
            break
        time.sleep(0.001)
        answer = client.ask({"q": HOME})
    assert answer["q"] == HOME


def test_an_order_alone_is_no_set_point(client):
    nothing = {"id": 1, "phase": "off", "gain": 0.0, "lag": 0.0, "fault": "there was no set-point yet"}
    assert client.ask({"switch": "on", "id": 1}) == nothing
    before = settle(client, {"q": HOME})
    answer = client.ask({"switch": "on"})
    assert answer == {key: value for key, value in before.items() if key != "q"}
    assert client.ask({"q": HOME})["q"] == pytest.approx(before["q"], abs=1e-6)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (b"hello\n", "no JSON"),
        (b"\xff\xfe\n", "no JSON"),
        (b"[1, 2]\n", "JSON object"),
        (b"[" * 15000 + b"\n", "no JSON"),
        (b"{}\n", "has q, q_deg, switch or features"),
        (b'{"features": [21]}\n', "features are an object"),
        (b'{"features": {"temperature": 21}}\n', "'temperature' is no feature of the calibration"),
        (b'{"features": {"temperature": "warm"}}\n', "a feature is no number"),
        (b'{"q": [1, 2]}\n', "list of 6 numbers"),
        (b'{"q": "x"}\n', "list of 6 numbers"),
        (b'{"q": [1, 2, 3, 4, 5, true]}\n', "no number"),
        (b'{"q": [1, 2, 3, 4, 5, 1' + b"0" * 400 + b"]}\n", "too large"),
        (b'{"q": [1, 2, 3, 4, 5, 1' + b"0" * 5000 + b"]}\n", "no JSON"),
        (b'{"q": null, "q_deg": null}\n', "not both"),
        (b'{"switch": "maybe"}\n', "on"),
        (b'{"switch": null}\n', 'switch is "on" or "off"'),
        (b'{"q": null, "switch": null}\n', 'switch is "on" or "off"'),
        (b'{"q": null, "id": {"a": 1}}\n', "id is a number"),
        (b'{"q": null, "id": 1' + b"0" * 400 + b"}\n", "id is a number"),
        (b'{"q": [1.7e308, 0, 0, 0, 0, 0]}\n', "too large"),
        (b'{"other": 1}\n', "not known"),
        (b'{"q": "' + b"x" * 20000 + b'"}\n', "longer than"),
        (b"x" * 40000, "longer than"),
    ],
)
def test_what_is_malformed_costs_the_connection_and_nothing_else(port, line, words):
    with Client(port) as client:
        client.read()
        client.send(line)
        assert words in client.read()["error"]
        with contextlib.suppress(ConnectionError):
            assert client.read() is None
    assert is_served(port)


def test_features_may_change(tmp_path):
    robot = ta.Robot.load("ur5e")
    arm = VirtualArm(robot, seed=4, imperfections=Imperfections(share=0.5))
    q = arm.poses(50)
    mass = np.random.default_rng(1).uniform(0.0, 5.0, len(q))
    table = arm.measure_table(q).assign(payload_kg=mass)
    table["z"] -= 1e-4 * mass
    path = tmp_path / "arm.calib"
    data = ta.Measurements.from_dataframe(table)
    ta.calibrate(robot, data, features=("payload_kg",), refit=False).save(path)
    known = ta.Calibration.load(path)
    limits = ta.Limits(largest_std_mm=50.0)
    expected = {
        loaded: ta.Compensator(known, limits=limits, features={"payload_kg": loaded}).correct(HOME)
        for loaded in (0.5, 4.5)
    }
    options = ("--ramp-s=0.05", "--deadline-s=10", "--largest-std-mm=50", "--feature=payload_kg=0.5")
    with serving(path, *options) as (port, _), Client(port) as client:
        assert client.read()["features"] == ["payload_kg"]
        assert settle(client, {"q": HOME})["q"] == pytest.approx(expected[0.5], abs=1e-9)
        assert "q" not in client.ask({"features": {"payload_kg": 4.5}})
        assert settle(client, {"q": HOME})["q"] == pytest.approx(expected[4.5], abs=1e-9)
        assert "feature" in client.ask({"q": HOME, "features": {"payload_kg": None}})["fault"]


@contextlib.contextmanager
def served_here(calib, token=None, **bounds):
    """The port of a server in this process."""
    compensator = ta.Compensator(ta.Calibration.load(calib))
    server = Server(
        compensator.calibration.robot,
        lambda: CorrectionStream(compensator),
        token=token,
        bounds=Bounds(**bounds),
    )
    ports: queue.Queue[int] = queue.Queue()
    ends: queue.Queue[object] = queue.Queue()

    async def run():
        running = await server.start("127.0.0.1", 0)
        ports.put(running.sockets[0].getsockname()[1])
        while ends.empty():
            await asyncio.sleep(0.01)
        running.close()

    thread = threading.Thread(target=lambda: asyncio.run(run()))
    thread.start()
    try:
        yield ports.get(timeout=10)
    finally:
        ends.put(None)
        thread.join()


def test_a_flood_costs_the_connection_and_nothing_else(calib):
    with served_here(calib, requests_per_s=20) as port, Client(port) as client:
        client.read()
        with contextlib.suppress(ConnectionError):
            client.send((json.dumps({"q": HOME}).encode() + b"\n") * 2000)
        assert is_served(port)
        answers = [client.read() for _ in range(21)]
        assert "q" in answers[0]
        assert answers[-1]["error"] == "more than 20 requests a second"


def test_who_does_not_read_loses_the_connection(port):
    with Client(port) as client:
        client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.socket.settimeout(0.5)
        line = (json.dumps({"q": HOME, "id": "x" * 100}).encode() + b"\n") * 200
        with contextlib.suppress(OSError):
            for _ in range(300):
                client.socket.sendall(line)
        assert is_served(port)


def test_too_many_connections_are_turned_away(port):
    with contextlib.ExitStack() as stack:
        clients = [stack.enter_context(Client(port)) for _ in range(20)]
        greetings = [client.read() for client in clients]
        assert sum("error" in greeting for greeting in greetings) >= 4
    time.sleep(0.1)
    assert is_served(port)


def test_who_has_no_token_takes_no_place(calib):
    with contextlib.ExitStack() as stack:
        port = stack.enter_context(served_here(calib, TOKEN, connections=2, waiting=3, token_s=60.0))
        clients = [stack.enter_context(Client(port)) for _ in range(2)]
        assert clients[0].ask({"token": TOKEN})["protocol"] == 1
        idle = [stack.enter_context(Client(port)) for _ in range(20)]
        assert idle[0].read()["error"] == "newer connections came before the token"
        with Client(port) as client:
            assert client.ask({"token": TOKEN})["protocol"] == 1
            assert client.ask({"q": HOME})["q"] is not None
            assert clients[0].ask({"q": HOME})["q"] is not None
            with Client(port) as other:
                assert other.ask({"token": TOKEN})["error"] == "more than 2 connections"
        assert idle[-1].ask({"token": "wrong"})["error"] == "the token is wrong"


def test_clients_that_vanish_leave_no_trace(port):
    for _ in range(5):
        with Client(port) as client:
            client.send({"q": HOME})
    assert is_served(port)


def test_who_vanishes_without_a_word_gives_the_connection_back(calib):
    with served_here(calib, connections=1, vanished_s=1.5) as port:
        gone = Client(port)
        gone.read()
        with Client(port) as other:
            assert other.read()["error"] == "more than 1 connections"
        vanish(gone)
        assert is_served(port)


def vanish(client):
    """Leave without a word, as where power or a cable fails; skips the test where that is not allowed."""
    repairs = 19
    try:
        client.socket.setsockopt(socket.IPPROTO_TCP, repairs, 1)
    except OSError:
        client.__exit__()
        pytest.skip("only Linux lets a socket close in silence, and whoever may administer its network")
    client.__exit__()


@pytest.mark.parametrize(("vanished_s", "seconds"), [(40.0, [20, 4, 5]), (0.5, [1, 1, 5])])
def test_silent_connections_are_probed(vanished_s, seconds):
    with socket.create_server(("127.0.0.1", 0)) as server:
        client = socket.create_connection(server.getsockname())
        with client, server.accept()[0] as peer:
            probe(peer, vanished_s)
            assert peer.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
            for name, wanted in zip(("TCP_KEEPIDLE", "TCP_KEEPINTVL", "TCP_KEEPCNT"), seconds, strict=True):
                if hasattr(socket, name):
                    assert peer.getsockopt(socket.IPPROTO_TCP, getattr(socket, name)) == wanted


def test_a_token_is_asked_for(calib, tmp_path):
    (tmp_path / "token").write_text(TOKEN + "\n")
    with serving(calib, "--token-file", tmp_path / "token", "--address", "0.0.0.0") as (port, _):
        for bad in ({"token": "wrong"}, {"q": HOME}, {"token": 3}, {"token": "\ud800"}):
            with Client(port) as client:
                assert client.ask(bad)["error"] == "the token is wrong"
        with Client(port) as client:
            assert client.ask({"token": TOKEN})["protocol"] == 1
            assert client.ask({"q": HOME})["q"] is not None


def test_other_addresses_need_a_token(calib, tmp_path, capsys):
    assert main(["serve", str(calib), "--address", "0.0.0.0"]) == 2
    assert "--token-file" in capsys.readouterr().err
    (tmp_path / "token").write_text("short")
    assert main(["serve", str(calib), "--token-file", str(tmp_path / "token")]) == 1
    assert "At least 16" in capsys.readouterr().err


def test_a_port_in_use_is_said(calib, port, capsys):
    assert main(["serve", str(calib), "--port", str(port)]) == 1
    assert "cannot listen" in capsys.readouterr().err


def test_ctrl_c_ends_it_cleanly(calib):
    with serving(calib) as (port, process):
        with Client(port) as client:
            client.read()
            process.send_signal(signal.SIGINT)
            assert process.wait(timeout=10) == 0
        said = process.stderr.read()
        assert "Traceback" not in said
        assert "the server ends" in said


@pytest.mark.parametrize(
    "option", ["--tool-mm=1,2", "--tool-mm=a,b,c", "--feature=warm", "--task=tool", "--moving=a"]
)
def test_options_are_checked(calib, option, capsys):
    assert main(["serve", str(calib), option]) == 2
    assert "Traceback" not in capsys.readouterr().err


def test_it_ends_without_a_traceback_while_a_client_is_turned_away(calib):
    with serving(calib) as (found, process), socket.create_connection(("127.0.0.1", found)) as client:
        lines = client.makefile("rw")
        lines.readline()
        lines.write('{"q_deg": [1]}\n')
        lines.flush()
        assert "error" in json.loads(lines.readline())
        process.send_signal(signal.SIGINT)
        _, told = process.communicate(timeout=10)
    assert "Traceback" not in told
    assert "Exception" not in told
    assert "connection closed" in told
