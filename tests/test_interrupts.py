"""Signals that come in quick succession: what handles them waits for nothing, least of all for itself."""

import signal
import subprocess
import sys
import threading

import pytest

from truearm.interrupts import Asked, asked_by

ROUNDS = 20
ENDS_WITHIN_S = 120.0
# A process of its own sends them, so that one comes while another is handled. Outside of the rounds both are
# ignored.
PAIRS = """
import os, signal, subprocess, sys, threading, time
from unittest.mock import Mock

BOTH = (signal.SIGINT, signal.SIGTERM)
for number in BOTH:
    signal.signal(number, signal.SIG_IGN)
TIDYING_S = 0.03
SENDING = "import os; p = os.getppid()\\nwhile True: os.kill(p, 2); os.kill(p, 15)"


def rounds(work):
    ended = 0
    with subprocess.Popen([sys.executable, "-S", "-c", SENDING]) as sender:
        for _ in range(%d):
            try:
                work()
            except KeyboardInterrupt:
                ended += 1
        sender.kill()
    print(ended)
""" % (ROUNDS,)  # noqa: UP031 - braces are the script's own
PROCESS = """
from truearm.cell.running import run

def measured():
    halted = []
    def process():
        while not halted:
            time.sleep(1e-3)
        time.sleep(TIDYING_S)
        return ""
    run(Mock(run=process, halt=lambda: halted.append(True)))

rounds(measured)
"""
SERVICE = """
from truearm.cli.until_interrupted import until_interrupted

def served():
    until_interrupted()
    raise KeyboardInterrupt

rounds(served)
"""
WORK = """
from truearm.cli.interrupt import ends_promptly

signal.signal(signal.SIGTERM, signal.SIG_IGN)

begun, tidied = [], []

def worked():
    with ends_promptly():
        try:
            begun.append(True)
            while True:
                time.sleep(1e-3)
        finally:
            time.sleep(TIDYING_S)
            tidied.append(True)

rounds(worked)
# What is ended before it begins has nothing to tidy up.
assert len(tidied) >= len(begun) > 0, (len(begun), len(tidied))
"""


@pytest.mark.parametrize("script", [PROCESS, SERVICE, WORK], ids=["measure", "simulate", "long work"])
def test_signals_in_pairs_end_what_is_under_way(script):
    found = subprocess.run(
        [sys.executable, "-c", PAIRS + script],
        capture_output=True,
        text=True,
        timeout=ENDS_WITHIN_S,
        check=False,
    )
    assert (found.returncode, found.stdout) == (0, f"{ROUNDS}\n"), found.stderr


def test_what_handled_signals_before_does_so_again():
    before = signal.getsignal(signal.SIGTERM)
    with asked_by((signal.SIGTERM,), Asked()) as asked:
        assert not asked
        signal.raise_signal(signal.SIGTERM)
        since = asked.since
        signal.raise_signal(signal.SIGTERM)
        assert asked
        assert asked.since == since
    assert signal.getsignal(signal.SIGTERM) == before


def test_work_within_work_leaves_ctrl_c_to_the_outer_one():
    """As a session that is measured in a command that goes on with what it brought."""
    outer = Asked()
    with asked_by((signal.SIGINT,), outer):
        with asked_by((signal.SIGINT,), Asked()):
            pass
        assert signal.getsignal(signal.SIGINT) is outer
        signal.raise_signal(signal.SIGINT)
    assert outer


def test_another_thread_leaves_signals_as_they_are():
    before, seen = signal.getsignal(signal.SIGTERM), []

    def work():
        with asked_by((signal.SIGTERM,), Asked()):
            seen.append(signal.getsignal(signal.SIGTERM))

    worker = threading.Thread(target=work)
    worker.start()
    worker.join()
    assert seen == [before]
