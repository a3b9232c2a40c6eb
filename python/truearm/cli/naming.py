"""What a command that is proposed calls an arm."""

from typing import TYPE_CHECKING, Final

from truearm.description.library import library_names

if TYPE_CHECKING:
    from truearm.robot import Robot

SOME_ROBOT: Final = "ROBOT"


def name_of(arm: "Robot") -> str:
    """Its name in the library; ROBOT, for the reader to fill in, where it is from a file of its own."""
    from truearm.robot import Robot

    return next((name for name in library_names() if Robot.load(name) == arm), SOME_ROBOT)
