"""What may be wrong where nothing fits: a file of measurements, or the description of the robot."""

from typing import Final

OF_FILE: Final = (
    "that readings and points belong together row by row, the order of the columns, units, a device frame "
    "that is right-handed"
)
CHECKS: Final = (
    f"Check {OF_FILE}, the robot, and in its file the convention, the signs of d, a and alpha, "
    "the direction of each joint (direction = -1), its zero (theta) and whether joint 3 is counted against "
    "link 2 or against the horizontal ([coupling]). Rows of different stations need a column group"
)
