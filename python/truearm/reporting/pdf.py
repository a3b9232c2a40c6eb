"""A page as PDF, printed by Chromium."""

import os
import shutil
import signal
import subprocess
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Final

from truearm.errors import WorkError
from truearm.files import write_whole

BROWSERS: Final = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "msedge",
)
PATIENCE_S: Final = 180
ENDING_S: Final = 0.2
"""How long processes of a browser that was killed may take to be gone: less than Ctrl-C leaves them."""
PULSE_S: Final = 0.02
DRAWING_MS: Final = 900_000
"""Time of the page's own clock in which figures are drawn; it runs only while there is nothing to do."""


def browser() -> str:
    """Chromium's program on PATH.

    Raises:
        WorkError: If there is none; names the package.
    """
    found = next((path for path in map(shutil.which, BROWSERS) if path), None)
    if found is None:
        raise WorkError(
            "Chromium was not found on PATH",
            rule=f"A PDF is printed by one of {', '.join(BROWSERS)}",
            way_out='Install the package "chromium" (apt install chromium), or write report.html and print '
            "it from any browser",
        )
    return found


def write_pdf(html: str, path: Path) -> None:
    """Print a page to a PDF, completely or not at all.

    Raises:
        WorkError: If there is no Chromium, or it fails; says what it said.
    """
    program = browser()
    with tempfile.TemporaryDirectory(prefix="truearm-", ignore_cleanup_errors=True) as folder:
        source, target = Path(folder) / "page.html", Path(folder) / "page.pdf"
        source.write_text(html, encoding="utf-8")
        said = run_browser(
            program, folder, ["--no-pdf-header-footer", f"--print-to-pdf={target}", source.as_uri()]
        )
        if not target.exists():
            raise WorkError("Chromium printed nothing", where=program, rule=said.strip()[-500:])
        write_whole(path, target.read_bytes())


def run_browser(program: str, folder: str, arguments: list[str]) -> str:
    """Run Chromium without a window on a page that draws figures; what it said.

    It has a process group of its own, all of which is gone where this is interrupted.

    Raises:
        WorkError: If it takes minutes.
    """
    said = Path(folder) / "said.txt"
    with said.open("wb") as words:
        running = subprocess.Popen(  # noqa: S603
            browser_command(program, folder, arguments),
            stdout=subprocess.DEVNULL,
            stderr=words,
            start_new_session=True,
        )
        try:
            _wait(running, program)
        finally:
            if running.returncode is None:
                _end(running)
    return said.read_text(encoding="utf-8", errors="replace")


def _wait(running: subprocess.Popen[bytes], program: str) -> None:
    """Wait for a program to end; looks now and then, so that Ctrl-C counts at once."""
    end = time.monotonic() + PATIENCE_S
    while running.poll() is None:
        if time.monotonic() > end:
            raise WorkError(
                f"Chromium took longer than {PATIENCE_S} s",
                where=program,
                way_out="Write report.html and print it from a browser",
            )
        time.sleep(PULSE_S)


def _end(running: subprocess.Popen[bytes]) -> None:
    """End a program and all processes of its group, and wait until they write nothing any more."""
    if not hasattr(os, "killpg"):  # Windows
        running.kill()
        running.wait()
        return
    end = time.monotonic() + ENDING_S
    with suppress(ProcessLookupError):
        os.killpg(running.pid, signal.SIGKILL)
        running.wait()
        while time.monotonic() < end:
            os.killpg(running.pid, signal.SIGKILL)
            time.sleep(PULSE_S)


def browser_command(program: str, folder: str, arguments: list[str]) -> list[str]:
    """Words that run Chromium without a window, with a profile of its own in a folder."""
    return [
        program,
        "--headless",
        "--disable-gpu",
        "--enable-unsafe-swiftshader",
        "--no-first-run",
        "--hide-scrollbars",
        f"--user-data-dir={folder}/profile",
        f"--virtual-time-budget={DRAWING_MS}",
        *(["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []),
        *arguments,
    ]
