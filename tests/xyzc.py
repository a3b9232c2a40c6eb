"""Axes X, Y and Z that slide, with one behind them that turns about Z."""

from pathlib import Path

from truearm import Robot

LINKS = (
    ("prismatic", 0.0, 0.0, -90.0, [0.0, 3000.0]),
    ("prismatic", -90.0, 0.0, -90.0, [0.0, 1800.0]),
    ("prismatic", 0.0, 0.0, 0.0, [0.0, 1200.0]),
    ("revolute", 0.0, 100.0, 0.0, [-170.0, 170.0]),
)


def xyzc(folder: Path) -> Robot:
    """The arm, of a file in a folder."""
    links = [
        f'[[link]]\njoint = "{joint}"\ntheta = {theta}\nd = {d}\na = 0.0\nalpha = {alpha}\n'
        f"limits = {limits}\n"
        for joint, theta, d, alpha, limits in LINKS
    ]
    head = 'name = "xyzc"\nconvention = "standard"\nlength_unit = "mm"\nangle_unit = "deg"\n'
    file = folder / "xyzc.toml"
    file.write_text(head + "".join(links))
    return Robot.load(file)
