"""Commands that calibrate once more as a calibration was made."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from truearm.cli.command_words import calibrate_lacks, option_words, update_lacks, update_words
from truearm.errors import list_names, typed
from truearm.update_words import cause_words

if TYPE_CHECKING:
    from truearm.calibration import Calibration
    from truearm.fits.options import CalibrationOptions
    from truearm.measurements import Measurements
    from truearm.updating import UpdateOptions

FIELD: Final = "field"
"""Verdict of an update that the calibration no longer fits."""
SOME_FILE: Final = "OLD.csv"
NEW_FILE: Final = "MEASUREMENTS.csv"
FEWEST_ANEW: Final = 60
MOST_ANEW: Final = 200
"""Poses to plan where an arm is calibrated anew: as many as before, between these."""
NO_LONGER: Final = "the update found that the calibration no longer fits the arm"
BESIDE: Final = (
    'frame and tool were found anew since, and {groups} would be one set-up: rename it in the column "group" '
    "of one file to calibrate from both"
)
BASE_ANEW: Final = (
    "base or target were found anew since, and with the world as frame all rows are of one set-up"
)
ONE_SET_UP: Final = (
    "with the world as frame all rows are of one set-up, and these are of {groups}: where the target sits as "
    'it sat, write one name in the column "group" of all files to calibrate from all'
)
OTHERWISE: Final = "it was updated from with other options"
FROM_NO_FILE: Final = "The rows of {names} came from no file: write them to {files} first."


@dataclass(frozen=True)
class Again:
    """How a calibration is made once more.

    Attributes:
        command: The command.
        notes: What it leaves out, in sentences.
        calibration: That is made again.
        files: What it calibrates from, as far as it was measured already.
        apart: Calibrations before, the last one first, down to the one whose rows do not belong with the
            files; none where all rows do.
        options: How these were updated; None where none is apart, or the files do not tell.
        holds: Whether the calibration fitted the arm when it was last updated.
    """

    command: str
    notes: tuple[str, ...] = ()
    calibration: "Calibration | None" = None
    files: tuple[str, ...] = ()
    apart: "tuple[Calibration, ...]" = ()
    options: "UpdateOptions | None" = None
    holds: bool = True

    @property
    def update(self) -> "tuple[Calibration | None, tuple[Measurements, ...], UpdateOptions | None]":
        """The calibration to update where rows do not belong together, what was measured since, and how."""
        if not self.apart:
            return None, (), None
        *since, before = self.apart
        later = [known.rows.data for known in (self.calibration, *since) if known and known.rows]
        return before, tuple(later[::-1]), self.options

    def updates(self, file: Path, more: str) -> list[str]:
        """Commands that update the calibration before from all that was measured since, and one more file."""
        commands, known = list[str](), typed(file)
        for number in range(1, len(self.apart) + 1):
            former = "OLD.calib" if number == 1 else f"OLD{number}.calib"
            commands.append(f"truearm update --roll-back {known} -o {former}")
            known = former
        words = [*self.files, more, *([] if self.options is None else update_words(self.options))]
        given = " ".join(map(typed, words))
        return [*commands, f"truearm update {known} {given} -o NEW.calib"]


def calibrate_again(calibration: "Calibration", robot: str | None, more: str) -> Again:
    """The command that calibrates from the same files and others, with the options that were no defaults.

    After an update the files before it are among them, unless their rows do not belong with the later ones.

    Args:
        calibration: That is made again.
        robot: Name or file of the arm, where it is known.
        more: File of other measurements.
    """
    from truearm.cli.naming import name_of

    names, left_out, apart = _files(calibration)
    files = [_file_of(name) for name in names]
    options = _updated_with(calibration) if apart else None
    revision = calibration.revision
    notes = [*left_out, *_from_no_file(names), *calibrate_lacks(calibration.options)]
    return Again(
        _command([robot or name_of(calibration.robot), *files, more], calibration.options),
        (*notes, *([] if options is None else update_lacks(options))),
        calibration,
        tuple(files),
        tuple(apart),
        options,
        holds=revision is None or revision.report["verdict"] != FIELD,
    )


def plan_anew(calibration: "Calibration") -> str:
    """The command that plans as many poses as a calibration was learned from."""
    from truearm.cli.naming import name_of
    from truearm.rows.visits import pose_count

    learned = calibration.learned_from
    poses = calibration.validation.n_train_poses if learned is None else pose_count(learned.data)
    count = min(max(poses, FEWEST_ANEW), MOST_ANEW)
    return f"truearm plan {typed(name_of(calibration.robot))} -n {count} -o poses.csv"


def calibrate_anew(calibration: "Calibration") -> Again:
    """The command that calibrates from other measurements alone, with the options that were no defaults."""
    from truearm.cli.naming import name_of

    options = calibration.options
    return Again(_command([name_of(calibration.robot), NEW_FILE], options), tuple(calibrate_lacks(options)))


def _command(words: list[str], options: "CalibrationOptions") -> str:
    """Calibrate the arm that is named from the files behind it, with the options that were no defaults."""
    given = " ".join(typed(word) for word in (*words, *option_words(options)))
    return f"truearm calibrate {given} -o result"


def _file_of(name: str) -> str:
    """The file that measurements of a name were read from, or one for them where they came from no file."""
    return name if Path(name).suffix or Path(name).exists() else f"{name}.csv"


def _from_no_file(names: Sequence[str]) -> list[str]:
    """A sentence on what has to be written to files first, if there is any."""
    missing = [name for name in names if _file_of(name) != name]
    if not missing:
        return []
    return [FROM_NO_FILE.format(names=list_names(missing), files=list_names(map(_file_of, missing)))]


def _files(calibration: "Calibration") -> "tuple[list[str], list[str], list[Calibration]]":
    """Files whose rows belong together, the oldest first; sentences on those that do not, and
    the calibrations before, down to the one that was made from these.
    """
    if calibration.rows is None:
        return [SOME_FILE], [], []
    known = [calibration]
    while (revision := known[-1].revision) is not None:
        before = None if revision.file is None else known[-1].predecessor
        if before is None or before.rows is None:
            return [SOME_FILE, *_names(known)], [], []
        if why := _why_apart(revision.report, before, known):
            return _apart(known, before, why)
        known.append(before)
    return _names(known), [], []


def _apart(
    known: "list[Calibration]", before: "Calibration", why: str
) -> "tuple[list[str], list[str], list[Calibration]]":
    """The same where the rows of a calibration do not belong with those since, the last one first.

    Their rows make one update as far as they were updated alike: what one kept another may have found anew.
    """
    options = [_updated_with(each) for each in known]
    alike = next((k for k, other in enumerate(options) if other != options[0]), len(known))
    first = list_names(_names(known[alike - 1 : alike]))
    left_out = f"What was measured before {first} is left out: {why if alike == len(known) else OTHERWISE}."
    return _names(known[:alike]), [left_out], [*known, before][1 : alike + 1]


def _names(known: "Sequence[Calibration]") -> list[str]:
    """What the rows of calibrations were read from, the last one first, in the order in which they came."""
    rows = [each.rows.data for each in reversed(known) if each.rows is not None]
    return list(dict.fromkeys(file for data in rows for file in data.files))


def _updated_with(calibration: "Calibration") -> "UpdateOptions | None":
    """How a calibration was updated; None where it was not, or its file does not tell."""
    from truearm.updating import UpdateOptions

    told = None if calibration.revision is None else calibration.revision.report.get("options")
    return None if told is None else UpdateOptions(**told)


def _why_apart(report: Mapping[str, Any], before: "Calibration", since: "Sequence[Calibration]") -> str:
    """Why rows before an update cannot be calibrated from with later ones; "" where they can."""
    if report["verdict"] == FIELD:
        return NO_LONGER
    if found := cause_words(report):
        return f"the update found: {found.rstrip('.')}"
    moved = [str(offset["joint"]) for offset in report["offsets"] if offset["moved"]]
    if moved:
        return f"the update found that {'joint' if len(moved) == 1 else 'joints'} {', '.join(moved)} moved"
    data = [each.rows.data for each in (before, *since) if each.rows is not None]
    found_anew = {"frame", "base", "tool"} & set(report["estimated"])
    if before.arm.world_is_known:
        return _why_two_worlds(data) or (BASE_ANEW if found_anew else "")
    older, *later = map(_stated_groups, data)
    common = older & set[str]().union(*later)
    return BESIDE.format(groups=list_names(sorted(common))) if common and found_anew else ""


def _why_two_worlds(data: "Sequence[Measurements]") -> str:
    """Why rows are no single set-up, which they are to be where the world is the frame; "" where they are."""
    files = [name for rows in data if rows.default_group is not None for name in rows.files]
    names = list_names(dict.fromkeys(name for rows in data for name in rows.groups))
    return (
        ONE_SET_UP.format(groups=names)
        if len(set[str]().union(*map(_stated_groups, data), files)) > 1
        else ""
    )


def _stated_groups(data: "Measurements") -> set[str]:
    """Set-ups that a column names, which keep their names among other files."""
    called = data.default_group
    return set((data.group if called is None else data.group[called == ""]).tolist())
