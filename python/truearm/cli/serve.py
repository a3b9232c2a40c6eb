"""`truearm serve`: correct set-points that come over TCP."""

import asyncio
import ipaddress
import signal
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from truearm.cli.arguments import (
    CalibFile,
    Feature,
    LargestDeg,
    LargestMm,
    LargestStdMm,
    Moving,
    Task,
    features_of,
    joints_of,
    one_of,
)
from truearm.cli.console import print_json, say, tell, warn
from truearm.defaults import DEADLINE_S, HOLD_S, LARGEST_DEG, LARGEST_MM, LARGEST_STD_MM, RAMP_S
from truearm.errors import InputError, UsageError
from truearm.files import read_text
from truearm.interrupts import LOOKS_EVERY_S, Asked, asked_by

if TYPE_CHECKING:
    from truearm.serving import Server

LOOPBACK = "127.0.0.1"
DEFAULT_PORT = 7227
SHORTEST_TOKEN = 16


def command(
    calibration: CalibFile,
    port: Annotated[int, typer.Option(min=0, max=65535, help="TCP port; 0 takes a free one.")] = DEFAULT_PORT,
    address: Annotated[
        str, typer.Option(help="Address to listen on; another than loopback needs a token.")
    ] = LOOPBACK,
    token_file: Annotated[
        Path | None, typer.Option(metavar="FILE", help="File with the token that clients send first.")
    ] = None,
    tool_mm: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z", help="Tool point in the flange frame.  [default: the robot file's]"),
    ] = None,
    task: Task = "pose",
    moving: Moving = None,
    feature: Feature = None,
    largest_mm: LargestMm = LARGEST_MM,
    largest_deg: LargestDeg = LARGEST_DEG,
    largest_std_mm: LargestStdMm = LARGEST_STD_MM,
    ramp_s: Annotated[float, typer.Option(help="Time of the ramp up and down.")] = RAMP_S,
    hold_s: Annotated[
        float, typer.Option(help="How long a correction is held for want of a good one.")
    ] = HOLD_S,
    deadline_s: Annotated[float, typer.Option(help="Longest time between two set-points.")] = DEADLINE_S,
    as_json: Annotated[
        bool, typer.Option("--json", help="Say where it listens in one line of JSON.")
    ] = False,
) -> None:
    """Correct the set-points of controllers that cannot link the C library.

    Newline-delimited JSON over TCP; each connection is one robot's stream. Ctrl-C ends it.

    Examples:
      truearm serve controller.calib
      truearm serve controller.calib --port 0 --largest-mm 3 --json
      truearm serve palletiser.calib --task position --moving 1,2,3,5
    """
    from truearm.calibration import Calibration
    from truearm.compensation import Compensator
    from truearm.limits import Limits
    from truearm.limits import Task as WhatIsMet
    from truearm.serving import Server
    from truearm.solving import beyond_notices
    from truearm.streaming import CorrectionStream, StreamOptions

    token = _token(address, token_file)
    known = Calibration.load(calibration)
    limits = Limits(largest_mm=largest_mm, largest_deg=largest_deg, largest_std_mm=largest_std_mm)
    compensator = Compensator(
        known,
        task=one_of("--task", task, WhatIsMet),
        moving=joints_of(moving),
        limits=limits,
        features=features_of(feature),
    )
    options = StreamOptions(ramp_s=ramp_s, hold_s=hold_s, deadline_s=deadline_s)
    tool = _tool(tool_mm)
    CorrectionStream(compensator, options, tool=tool)
    warn(beyond_notices(known, compensator.features))
    server = Server(
        known.robot, lambda: CorrectionStream(compensator, options, tool=tool), token=token, told=tell
    )

    def listening(host: str, at: int) -> None:
        if as_json:
            print_json({"robot": known.robot.name, "address": host, "port": at}, on_one_line=True)
        else:
            say(f"Correcting set-points of {known.robot.name} on {host}:{at}; Ctrl-C ends.")

    asyncio.run(_serve(server, address, port, listening))


async def _serve(server: "Server", address: str, port: int, listening: Callable[[str, int], None]) -> None:
    with asked_by((signal.SIGINT, signal.SIGTERM), Asked()) as asked:
        running = await server.start(address, port)
        listening(*running.sockets[0].getsockname()[:2])
        try:
            while not asked:
                await asyncio.sleep(LOOKS_EVERY_S)
        finally:
            running.close()


def _token(address: str, file: Path | None) -> str | None:
    if file is None:
        if not _is_loopback(address):
            raise UsageError(
                f"{address} can be reached by others",
                where="--address",
                rule="Another address than loopback needs a token",
                way_out="Write a long random one to a file: --token-file FILE",
            )
        return None
    token = read_text(file).strip()
    if len(token) < SHORTEST_TOKEN:
        raise InputError(
            f"the token has {len(token)} characters",
            where=str(file),
            rule=f"At least {SHORTEST_TOKEN}",
            way_out="Make one: python -c 'import secrets; print(secrets.token_urlsafe())'",
        )
    return token


def _is_loopback(address: str) -> bool:
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return address == "localhost"


def _tool(text: str | None) -> list[float] | None:
    if text is None:
        return None
    from truearm.units import MM_PER_METRE

    try:
        point = [float(part) / MM_PER_METRE for part in text.split(",")]
    except ValueError:
        point = []
    if len(point) != 3:
        raise UsageError(f'"{text}"', where="--tool-mm", rule="Three numbers in mm, such as 0,0,120.5")
    return point
