"""`truearm cell simulate`: the devices of a cell file as virtual ones that speak the real protocols."""

import sys
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from truearm.cli.arguments import AsJson, CellFile
from truearm.cli.console import print_json, say, suggest, tell
from truearm.errors import UsageError, typed

FAULTS: Final = (
    "lost, delayed, duplicated, garbled, restart and emergency_stop are shares of the messages, missed and "
    "outlier of the contacts; drift_mm_per_contact is a length"
)


def command(
    cell: CellFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="FILE", help="Where the cell file goes.  [default: CELL.virtual.toml]"
        ),
    ] = None,
    speed: Annotated[
        float | None, typer.Option(metavar="X", help="Run the virtual clock X times as fast.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of the virtual arm, its noise and faults.")
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND=SHARE",
            help=f"Make a share of the messages or contacts fail, as lost=0.05. {FAULTS}.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Start the devices of a cell file as virtual ones, each a process behind a pseudo-terminal or TCP port.

    A cell file with their addresses is written; the devices are served until Ctrl-C.

    Examples:
      truearm cell simulate cell.toml -o virtual.toml
      truearm cell simulate cell.toml --speed 20 --fault lost=0.05
    """
    target = output or cell.with_suffix(".virtual.toml")
    changes = _changes(speed, seed, fault or [])
    import tomli_w

    from truearm.cell.virtual.launch import VirtualCell
    from truearm.cli.until_interrupted import until_interrupted
    from truearm.files import check_output, parsed, read_text, write_whole

    content = parsed(read_text(cell), where=str(cell))
    check_output(target, cell, *_named_in(content, cell.parent))
    section = dict(content.get("simulate", {}))
    faults = {**section.get("faults", {}), **changes.pop("faults", {})}  # type: ignore[dict-item]
    content["simulate"] = {**section, **changes, **({"faults": faults} if faults else {})}
    with VirtualCell(tomli_w.dumps(content), where=str(cell), folder=cell.parent) as virtual:
        write_whole(target, virtual.cell_toml())
        if as_json:
            print_json({"cell": str(target)})
        else:
            say(f"The virtual cell is ready. Its cell file: {target}")
            measure = f"truearm measure {typed(target)} poses.csv -o session.db"
            suggest(measure, when="Try next, in another terminal:")
        sys.stdout.flush()
        until_interrupted()
    tell("The virtual cell has ended.")


def _named_in(content: dict[str, Any], folder: Path) -> list[str]:
    """What a cell file names that may be a file beside it: its arm, and a recording."""
    sensor = content.get("sensor")
    names = [content.get("arm"), sensor.get("file") if isinstance(sensor, dict) else None]
    return [str(folder / name) for name in names if isinstance(name, str)]


def _changes(speed: float | None, seed: int | None, faults: list[str]) -> dict[str, object]:
    """What options say of the section [simulate]."""
    changes: dict[str, object] = {} if speed is None else {"speed": speed}
    if seed is not None:
        changes["seed"] = seed
    shares = {}
    for given in faults:
        kind, _, share = given.partition("=")
        try:
            shares[kind] = float(share)
        except ValueError:
            raise UsageError(
                f'"{given}" is no fault', where="--fault", rule=f"KIND=SHARE. {FAULTS}"
            ) from None
    return changes | ({"faults": shares} if shares else {})
