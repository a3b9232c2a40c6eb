"""Draw docs/picture.svg: position error of a virtual RV-M2 along the path of the paper's Figure 6.

The arm is calibrated from noisy measurements all over its workspace; the errors on the path are against
the truth.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import truearm as ta
from truearm.simulation import Imperfections, VirtualArm

PAGE = Path(__file__).parent / "picture.svg"
MEASURED, ON_PATH, SEED = 400, 200, 2
PATH_DEG = ([60.0, 60.0, -35.0, 0.0, 0.0], [125.0, 90.0, -10.0, 0.0, 0.0])
ERRING = Imperfections(share=0.3, non_geometric="joint")
WIDTH, HEIGHT, LEFT, BOTTOM, TOP, RIGHT = 720, 300, 56, 44, 16, 120
COLOURS = {"nominal": "#8a8f98", "constant": "#d98324", "variable": "#1f6fb2"}


def main() -> int:
    """Calibrate, follow the path, draw."""
    PAGE.write_text(drawing(errors_on_path()))
    sys.stdout.write(f"written to {PAGE}\n")
    return 0


def errors_on_path() -> dict[str, np.ndarray]:
    """Distance between prediction and truth of the measured target for each model, mm, (ON_PATH,)."""
    arm = VirtualArm.paper(seed=SEED, imperfections=ERRING)
    calibration = ta.calibrate(arm.robot, arm.measure(arm.poses(MEASURED)))
    path = np.radians(np.linspace(*PATH_DEG, ON_PATH))
    quiet = VirtualArm.paper(seed=SEED, imperfections=replace(ERRING, noise_mm=0.0))
    truth = quiet.measure(path).targets[:, 0]
    joints = arm.robot.joints_from_readings(path)
    errors = {}
    for name, model in calibration.models.items():
        base_from_flange = calibration.arm.flange_chain.pose(joints, model.parameters(joints))
        world_from_flange = model.setup.frames[0] @ base_from_flange
        target = world_from_flange[:, :3, :3] @ model.setup.targets[0, 0] + world_from_flange[:, :3, 3]
        errors[name] = 1e3 * np.linalg.norm(target - truth, axis=1)
    return errors


def drawing(errors: dict[str, np.ndarray]) -> str:
    """The curves as SVG with axes and a label at the end of each."""
    top = 0.2 * np.ceil(max(curve.max() for curve in errors.values()) / 0.2)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
        'font-family="sans-serif" font-size="13">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        *(grid_line(value, top) for value in np.arange(0.0, top + 0.01, 0.2)),
        *(curve_with_label(name, curve, top) for name, curve in errors.items()),
        text(LEFT, HEIGHT - 14, "along the path"),
        f'<text x="16" y="{(TOP + HEIGHT - BOTTOM) / 2}" fill="#444" text-anchor="middle" '
        f'transform="rotate(-90 16 {(TOP + HEIGHT - BOTTOM) / 2})">position error, mm</text>',
        "</svg>\n",
    ]
    return "\n".join(parts)


def grid_line(value: float, top: float) -> str:
    """A horizontal line with its value."""
    y = height_of(value, top)
    line = f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}" stroke="#ddd"/>'
    return line + text(LEFT - 8, y + 4, f"{value:.1f}", anchor="end")


def curve_with_label(name: str, curve: np.ndarray, top: float) -> str:
    """A line through all values, named and with its mean where it ends."""
    x = np.linspace(LEFT, WIDTH - RIGHT, len(curve))
    points = " ".join(f"{a:.1f},{height_of(b, top):.1f}" for a, b in zip(x, curve, strict=True))
    colour = COLOURS[name]
    line = f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"/>'
    return line + text(WIDTH - RIGHT + 8, height_of(curve[-1], top) + 4, name, colour=colour)


def text(x: float, y: float, words: str, anchor: str = "start", colour: str = "#444") -> str:
    """Words at a place."""
    return f'<text x="{x}" y="{y:.1f}" text-anchor="{anchor}" fill="{colour}">{words}</text>'


def height_of(value: float, top: float) -> float:
    """Where a value stands in the drawing."""
    return HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * value / top


if __name__ == "__main__":
    sys.exit(main())
