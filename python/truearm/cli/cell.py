"""`truearm cell`: a virtual cell that speaks the real protocols, a check of a real one, and examples."""

import sys
import threading
from pathlib import Path
from typing import Annotated, Final

import typer

from truearm.cli.console import print_json, say, tell
from truearm.errors import InputError, UsageError, did_you_mean

ACTIONS: Final = ("simulate", "check", "example")
FAULTS: Final = "lost, delayed, duplicated, garbled, missed, outlier, restart, emergency_stop"


def command(
    action: Annotated[str, typer.Argument(metavar="simulate|check|example", help="What to do.")],
    cell: Annotated[
        str, typer.Argument(metavar="CELL", help="A cell file; for example: rv-m2, ur, tracker or playback.")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="FILE", help="Where the cell file goes.  [default: CELL.virtual.toml]"
        ),
    ] = None,
    speed: Annotated[
        float | None, typer.Option(metavar="X", help="Run the virtual clock X times as fast.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the virtual arm, its noise and faults.")] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND=SHARE", help="Make a share of the messages or contacts fail, as lost=0.05."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on stdout and nothing else.")] = False,
) -> None:
    """Work with measurement cells.

    simulate starts the devices of a cell file as virtual ones behind pseudo-terminals and TCP ports, writes a
    cell file with their addresses, and serves until Ctrl-C. check connects to the devices of a cell and asks
    them where they are; nothing moves but what connecting moves. example writes a cell file to begin with.

    Examples: truearm cell example rv-m2 -o cell.toml
    truearm cell simulate cell.toml --speed 20 --fault lost=0.05 -o virtual.toml
    truearm measure virtual.toml poses.csv -o session.db
    """
    if action not in ACTIONS:
        raise UsageError(
            f'there is no "{action}"',
            rule=f"One of {', '.join(ACTIONS)}",
            way_out=did_you_mean(action, ACTIONS),
        )
    if action == "example":
        _example(cell, output, as_json=as_json)
    elif action == "check":
        _check(Path(cell), as_json=as_json)
    else:
        target = output or Path(cell).with_suffix(".virtual.toml")
        _simulate(Path(cell), target, _changes(speed, seed, fault or []), as_json=as_json)


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
                f'"{given}" is no fault', where="--fault", rule=f"KIND=SHARE: {FAULTS}"
            ) from None
    return changes | ({"faults": shares} if shares else {})


def _simulate(cell: Path, target: Path, changes: dict[str, object], *, as_json: bool) -> None:
    import tomli_w  # noqa: PLC0415

    from truearm.cell.cell_file import parsed  # noqa: PLC0415
    from truearm.cell.virtual.launch import VirtualCell  # noqa: PLC0415
    from truearm.cli.until_interrupted import until_interrupted  # noqa: PLC0415
    from truearm.files import read_text, write_whole  # noqa: PLC0415

    if target.resolve() == cell.resolve():
        raise UsageError("this is the cell file itself", where=str(target), way_out="Name another with -o")
    content = parsed(read_text(cell), where=str(cell))
    section = dict(content.get("simulate", {}))
    faults = {**section.get("faults", {}), **changes.pop("faults", {})}  # type: ignore[dict-item]
    content["simulate"] = {**section, **changes, **({"faults": faults} if faults else {})}
    with VirtualCell(tomli_w.dumps(content), where=str(cell), folder=cell.parent) as virtual:
        write_whole(target, virtual.cell_toml())
        if as_json:
            print_json({"cell": str(target)})
        else:
            say(f"The virtual cell is ready. Its cell file: {target}")
            say(f"Try next, in another terminal: truearm measure {target} poses.csv -o session.db")
        sys.stdout.flush()
        until_interrupted(threading.Event())
    tell("The virtual cell has ended.")


def _check(cell: Path, *, as_json: bool) -> None:
    from truearm.cell.cell_file import Cell  # noqa: PLC0415
    from truearm.cell.protocols import Connected  # noqa: PLC0415

    known = Cell.load(cell)
    with Connected(known.sensor, known.robot):
        readings = known.robot.read_joints().tolist()
    if as_json:
        print_json({"robot": known.robot.address, "sensor": known.sensor.address, "readings": readings})
        return
    say(f"{known.sensor.name} at {known.sensor.address} answers.")
    say(f"{known.robot.name} at {known.robot.address} answers; its joints:")
    say("  " + ", ".join(f"{reading:.4f}" for reading in readings))


def _example(name: str, output: Path | None, *, as_json: bool) -> None:
    from truearm.cell.examples import EXAMPLES, example  # noqa: PLC0415
    from truearm.files import write_whole  # noqa: PLC0415

    if name not in EXAMPLES:
        way_out = did_you_mean(name, EXAMPLES)
        raise UsageError(
            f'there is no example "{name}"', rule=f"One of {', '.join(EXAMPLES)}", way_out=way_out
        )
    target = output or Path("cell.toml")
    if target.exists():
        raise InputError("there is such a file already", where=str(target), way_out="Name another with -o")
    write_whole(target, example(name))
    if as_json:
        print_json({"cell": str(target)})
    else:
        say(f"Cell file: {target}")
