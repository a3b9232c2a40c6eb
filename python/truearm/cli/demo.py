"""`truearm demo`: from a virtual arm's measurements to a calibration that is judged."""

from pathlib import Path
from typing import Final

from truearm.cli.arguments import AsJson, OutputDirectory
from truearm.cli.calibrate import (
    CALIBRATION_NAME,
    check_directory,
    print_places,
    print_results,
    write_results,
)
from truearm.cli.console import print_json, say, say_wrapped, suggest, warn
from truearm.cli.interrupt import ends_promptly
from truearm.cli.progress import told_stages
from truearm.files import write_whole

POSES: Final = 400
OTHER_POSES: Final = 150
SEED: Final = 1


def command(
    output: OutputDirectory = Path("demo"),
    as_json: AsJson = False,
) -> None:
    """Measure a virtual RV-M2, the paper's arm, calibrate it and show what that gained.

    Its Denavit-Hartenberg parameters are off by 0.4 mm and 0.05 deg, its first joints err as in the paper's
    equation (6), and the instrument that measures it has noise.

    Examples:
      truearm demo
      truearm demo -o here --json
    """
    from truearm.calibrating import calibrate
    from truearm.measurements import Measurements
    from truearm.robot import Robot
    from truearm.simulation import VirtualArm

    check_directory(output)
    arm = VirtualArm.paper(seed=SEED)
    sizes = arm.imperfections
    output.mkdir(parents=True, exist_ok=True)
    measured, other = output / "measurements.csv", output / "another_day.csv"
    table = arm.measure_table(arm.poses(POSES))
    write_whole(measured, table.to_csv(index=False, lineterminator="\n"))
    later = arm.measure_table(arm.poses(OTHER_POSES, seed=1), seed=1)
    write_whole(other, later.to_csv(index=False, lineterminator="\n"))
    robot, data = Robot.load("rv-m2"), Measurements.read_csv(measured)
    with ends_promptly():
        calibration = calibrate(robot, data, stages=told_stages("demo", POSES))
    warn(calibration.notices)
    summary = write_results(calibration, output)
    if as_json:
        print_json({"measurements": [str(measured), str(other)], **summary})
        return
    say_wrapped(
        f"A virtual {arm.robot.name}: parameters off by {sizes.length_mm:g} mm and {sizes.angle_deg:g} deg, "
        f"{POSES} poses measured with {sizes.noise_mm:g} mm of noise in each coordinate."
    )
    print_results(calibration)
    say(f"Measurements: {measured} and {other}")
    print_places(output)
    suggest(
        f"truearm evaluate {output / CALIBRATION_NAME} {other}",
        f"truearm calibrate rv-m2 {measured} -o {output / 'half'} --train-size {POSES // 2}",
    )
