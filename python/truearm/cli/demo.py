"""`truearm demo`: from a virtual arm's measurements to a calibration that is judged."""

from pathlib import Path
from typing import Annotated, Final

import typer

from truearm.calibrating import calibrate
from truearm.cli.calibrate import (
    CALIBRATION_NAME,
    check_directory,
    print_places,
    print_results,
    write_results,
)
from truearm.cli.console import say, say_wrapped, warn
from truearm.cli.interrupt import ends_promptly
from truearm.cli.progress import told_stages
from truearm.files import write_whole
from truearm.measurements import Measurements
from truearm.robot import Robot
from truearm.simulation import VirtualArm

POSES: Final = 400
OTHER_POSES: Final = 150
SEED: Final = 1


def command(
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Where the results go.")
    ] = Path("demo"),
) -> None:
    """Measure a virtual RV-M2, the paper's arm, calibrate it and show what that gained.

    Its Denavit-Hartenberg parameters are off by 0.4 mm and 0.05 deg, its first joints err as in the paper's
    equation (6), and the instrument that measures it has noise.
    """
    check_directory(output)
    arm = VirtualArm.paper(seed=SEED)
    sizes = arm.imperfections
    say_wrapped(
        f"A virtual {arm.robot.name}: parameters off by {sizes.length_mm:g} mm and {sizes.angle_deg:g} deg, "
        f"{POSES} poses measured with {sizes.noise_mm:g} mm of noise in each coordinate."
    )
    output.mkdir(parents=True, exist_ok=True)
    measured, other = output / "measurements.csv", output / "another_day.csv"
    table = arm.measure_table(arm.poses(POSES))
    write_whole(measured, table.to_csv(index=False, lineterminator="\n"))
    later = arm.measure_table(arm.poses(OTHER_POSES, seed=1), seed=1)
    write_whole(other, later.to_csv(index=False, lineterminator="\n"))
    with ends_promptly():
        calibration = calibrate(Robot.load("rv-m2"), Measurements.read_csv(measured), stages=told_stages())
    warn(calibration.notices)
    write_results(calibration, output)
    print_results(calibration)
    say(f"Measurements: {measured} and {other}")
    print_places(output)
    say("Try next:")
    say(f"  truearm evaluate {output / CALIBRATION_NAME} {other}")
    say(f"  truearm calibrate rv-m2 {measured} -o {output / 'half'} --train-size {POSES // 2}")
