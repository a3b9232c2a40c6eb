"""Commands that calibrate once more as a calibration was made."""

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from truearm.errors import list_names, typed

if TYPE_CHECKING:
    from truearm.calibration import Calibration
    from truearm.measurements import Measurements
    from truearm.options import Options

RENAMED: Final = {"most_regions": "regions"}
"""Options of a calibration that the command calls otherwise."""
SAID_OTHERWISE: Final = frozenset({"by_purpose", "refit"})
"""Options that the command has another option for."""
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
        holds: Whether the calibration fitted the arm when it was last updated.
    """

    command: str
    notes: tuple[str, ...] = ()
    calibration: "Calibration | None" = None
    files: tuple[str, ...] = ()
    apart: "tuple[Calibration, ...]" = ()
    holds: bool = True

    @property
    def update(self) -> "tuple[Calibration | None, tuple[Measurements, ...]]":
        """The calibration to update where rows do not belong together, and what was measured since."""
        if not self.apart:
            return None, ()
        *since, before = self.apart
        later = [known.rows.data for known in (self.calibration, *since) if known and known.rows]
        return before, tuple(later[::-1])

    def updates(self, file: Path, more: str) -> list[str]:
        """Commands that update the calibration before from all that was measured since, and one more file."""
        commands, known = list[str](), typed(file)
        for number in range(1, len(self.apart) + 1):
            former = "OLD.calib" if number == 1 else f"OLD{number}.calib"
            commands.append(f"truearm update --roll-back {known} -o {former}")
            known = former
        files = " ".join(typed(word) for word in (*self.files, more))
        return [*commands, f"truearm update {known} {files} -o NEW.calib"]


def calibrate_again(calibration: "Calibration", robot: str | None, more: str) -> Again:
    """The command that calibrates from the same files and others, with the options that were no defaults.

    After an update the files before it are among them, unless their rows do not belong with the later ones.

    Args:
        calibration: That is made again.
        robot: Name or file of the arm, where it is known.
        more: File of other measurements.
    """
    from truearm.cli.naming import name_of

    files, left_out, apart = _files(calibration)
    words = [robot or name_of(calibration.robot), *files, more]
    notes = (*left_out, *_not_kept(calibration.options))
    revision = calibration.revision
    holds = revision is None or revision.report["verdict"] != FIELD
    return Again(_command(words, calibration.options), notes, calibration, tuple(files), tuple(apart), holds)


def plan_anew(calibration: "Calibration") -> str:
    """The command that plans as many poses as a calibration was learned from."""
    from truearm.cli.naming import name_of
    from truearm.visits import pose_count

    learned = calibration.learned_from
    poses = calibration.validation.n_train_poses if learned is None else pose_count(learned.data)
    count = min(max(poses, FEWEST_ANEW), MOST_ANEW)
    return f"truearm plan {typed(name_of(calibration.robot))} -n {count} -o poses.csv"


def calibrate_anew(calibration: "Calibration") -> Again:
    """The command that calibrates from other measurements alone, with the options that were no defaults."""
    from truearm.cli.naming import name_of

    options = calibration.options
    return Again(_command([name_of(calibration.robot), NEW_FILE], options), tuple(_not_kept(options)))


def _command(words: list[str], options: "Options") -> str:
    """Calibrate the arm that is named from the files behind it, with the options that were no defaults."""
    given = " ".join(typed(word) for word in (*words, *option_words(options)))
    return f"truearm calibrate {given} -o result"


def _not_kept(options: "Options") -> list[str]:
    """A sentence on options that the command cannot be told, if there are any."""
    missing = options_without_words(options)
    if not missing:
        return []
    given = ", ".join(f"{name}={value!r}" for name, value in missing.items())
    return [f"The command has no option for {given}: calibrate from Python to keep that."]


def _files(calibration: "Calibration") -> "tuple[list[str], list[str], list[Calibration]]":
    """Files whose rows belong together, the oldest first; sentences on those that do not, and
    the calibrations before, down to the one that was made from these.
    """
    if calibration.rows is None:
        return [SOME_FILE], [], []
    chain: list[Calibration] = []
    files, later = calibration.rows.data.files, [calibration.rows.data]
    while (revision := calibration.revision) is not None:
        before = None if revision.file is None else calibration.predecessor
        if before is None or before.rows is None:
            return [SOME_FILE, *files], [], []
        chain, older = [*chain, before], before.rows.data
        if why := _why_apart(revision.report, older, later):
            first = list_names(calibration.rows.data.files)
            return files, [f"What was measured before {first} is left out: {why}."], chain
        files, later, calibration = list(dict.fromkeys([*older.files, *files])), [older, *later], before
    return files, [], []


def _why_apart(report: Mapping[str, Any], older: "Measurements", later: list["Measurements"]) -> str:
    """Why rows before an update cannot be calibrated from with later ones; "" where they can."""
    if report["verdict"] == FIELD:
        return NO_LONGER
    moved = [str(offset["joint"]) for offset in report["offsets"] if offset["moved"]]
    if moved:
        return f"the update found that {'joint' if len(moved) == 1 else 'joints'} {', '.join(moved)} moved"
    common = _stated_groups(older) & set().union(*map(_stated_groups, later))
    found_anew = {"frame", "tool"} & set(report["estimated"])
    return BESIDE.format(groups=list_names(sorted(common))) if common and found_anew else ""


def _stated_groups(data: "Measurements") -> set[str]:
    """Set-ups that a column names, which keep their names among other files."""
    called = data.default_group
    return set((data.group if called is None else data.group[called == ""]).tolist())


def option_words(options: "Options") -> list[str]:
    """The options as `truearm calibrate` takes them, those that are no defaults."""
    from truearm.cli.calibrate import command
    from truearm.options import Options

    taken = inspect.signature(command).parameters
    usual, words = Options().to_dict(), list[str]()
    for name, value in options.to_dict().items():
        called = RENAMED.get(name, name)
        if name != "holdout" and called in taken and value != usual[name]:
            words += [_option(called), _word(value)]
    if not options.split.by_purpose and options.split.holdout_range is None:
        words += [_option("holdout"), _word(options.split.holdout)]
    return words if options.refit else [*words, _option("no_refit")]


def options_without_words(options: "Options") -> dict[str, Any]:
    """Options that are no defaults and that `truearm calibrate` cannot be told, by name."""
    from truearm.cli.calibrate import command
    from truearm.options import Options

    taken, usual = inspect.signature(command).parameters, Options().to_dict()
    return {
        name: value
        for name, value in options.to_dict().items()
        if RENAMED.get(name, name) not in taken and name not in SAID_OTHERWISE and value != usual[name]
    }


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _word(value: Any) -> str:  # noqa: ANN401
    return ",".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
