"""The report in a real browser: it draws all figures, says nothing on the console, and prints."""

import json
import os
import re
import subprocess

import pytest

from tests.report_support import figures_of, small_calibration
from truearm.reporting.pdf import browser, browser_command, write_pdf
from truearm.reporting.report import report

if os.environ.get("TRUEARM_BROWSER") != "1":
    pytest.skip("looked at by: make check-report", allow_module_level=True)

NARROW, MIDDLE, WIDE = 400, 800, 1280


@pytest.fixture(scope="module")
def page():
    return report(small_calibration("variable")).html


@pytest.fixture(scope="module")
def path(page, tmp_path_factory):
    found = tmp_path_factory.mktemp("browser") / "report.html"
    found.write_text(page)
    return found


@pytest.mark.parametrize("width", [NARROW, WIDE])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_figure_is_drawn_without_a_word_on_the_console(page, path, tmp_path, width, scheme):
    dark = ["--blink-settings=preferredColorScheme=0"] if scheme == "dark" else []
    logging = ["--enable-logging=stderr", "--v=0", f"--window-size={width},2000", *dark]
    command = browser_command(browser(), str(tmp_path), [*logging, "--dump-dom", path.as_uri()])
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    said = [line for line in done.stderr.splitlines() if re.search(r":(ERROR|WARNING):CONSOLE", line)]
    assert said == []
    assert 'data-figures="printable"' in done.stdout
    assert done.stdout.count('class="printed"') == len(figures_of(page)["figures"])
    assert done.stdout.count("main-svg") >= len(figures_of(page)["figures"])


def test_a_figure_that_cannot_be_drawn_says_so_and_stops_no_other(page, tmp_path):
    figures = figures_of(page)
    smooth = (figure for figure in figures["figures"] if "zsmooth" in figure["traces"][0])
    for trace in next(smooth)["traces"]:
        trace["y"] = [0] * len(trace["y"])
    path = tmp_path / "report.html"
    opening = '<script type="application/json" id="figures">'
    before, _, after = page.partition(opening)
    path.write_text(before + opening + json.dumps(figures) + after[after.index("</script>") :])
    command = browser_command(browser(), str(tmp_path), ["--dump-dom", path.as_uri()])
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert 'data-figures="printable"' in done.stdout
    assert done.stdout.count(">This figure could not be drawn.<") == 1
    whole = re.findall(r'class="figure[^"]* ready', done.stdout)
    assert len(whole) == len(figures["figures"]) - 1


@pytest.mark.parametrize("width", [NARROW, MIDDLE, WIDE])
def test_the_first_table_is_shown_whole_on_a_screen(page, tmp_path, width):
    measure = (
        "const first = document.querySelector('.beside .scroll');"
        "document.title = first.scrollWidth > first.clientWidth ? 'clipped' : 'whole';"
    )
    path = tmp_path / "report.html"
    path.write_text(page.replace("</body>", f"<script>{measure}</script></body>"))
    command = browser_command(
        browser(), str(tmp_path), [f"--window-size={width},2000", "--dump-dom", path.as_uri()]
    )
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "<title>whole</title>" in done.stdout


def test_it_prints(page, tmp_path):
    write_pdf(page, tmp_path / "report.pdf")
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF-")
    assert (tmp_path / "report.pdf").stat().st_size > 100_000
