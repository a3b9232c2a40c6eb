"""Beginning a session, or going on with it."""

from pathlib import Path
from typing import Final

from truearm.cell.cell_file import Cell
from truearm.cell.checks import DRIFT_MM
from truearm.cell.poses_file import GROUP, Poses
from truearm.cell.sequence import fingerprint, steps_of
from truearm.cell.session import Session
from truearm.errors import InputError

SAME: Final = {
    "poses": "another list of poses",
    "arm": "another arm",
    "target": "another target on the tool",
    GROUP: "another set-up (column group)",
}


def open_session(path: Path, cell: Cell, poses: Poses) -> Session:
    """The session at `path`: a new one, or the one that is there, if it is of the same arm and poses.

    Raises:
        InputError: If the file that is there belongs to something else, or cannot be written.
        WorkError: If another process is writing to it.
    """
    drift_mm = cell.file.process.drift_mm
    identity = {
        "poses": fingerprint(poses),
        "arm": cell.arm.to_dict(),
        "target": cell.flange_from_target.tolist(),
        GROUP: poses.group,
    }
    if not path.exists():
        head = {"cell": cell.file.name, DRIFT_MM: drift_mm, **identity}
        return Session.create(path, steps_of(poses, cell.file.process), head)
    session = Session(path, writing=True)
    for key, words in SAME.items():
        if (key != GROUP or session.has_meta(GROUP)) and session.meta(key) != identity[key]:
            session.close()
            raise InputError(
                f"this session is of {words}",
                where=str(path),
                rule="A session is continued with the arm, target and poses that it was begun with",
                way_out="Name a new file with -o",
            )
    try:
        session.set_meta(DRIFT_MM, drift_mm)
        session.set_meta(GROUP, poses.group)
    except BaseException:
        session.close()
        raise
    return session
