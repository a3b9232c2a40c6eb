"""`truearm measure`: the automatic measurement process, resumable."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from truearm.cli.arguments import AsJson, CellFile
from truearm.cli.console import print_json, say, say_wrapped, suggest, tell, warn
from truearm.cli.interrupt import end_at_once
from truearm.cli.measure_progress import Teller
from truearm.errors import Notice, count_of, list_rows, typed
from truearm.units import MM_PER_METRE, to_si

if TYPE_CHECKING:
    from collections.abc import Sequence

    from truearm.cell.cell_file import Cell
    from truearm.cell.poses_file import Poses
    from truearm.cell.rehearsal import Planned, Rehearsal


def command(
    cell: CellFile,
    poses: Annotated[
        Path, typer.Argument(metavar="POSES", help="CSV file of joint readings to measure, in their order.")
    ],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="SESSION", help="Session file; continued if it is there."),
    ] = Path("session.db"),
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what would be done; nothing moves.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Measure poses with the robot and the sensor of a cell.

    First the frame is registered from a few contacts, then all poses are measured. Every reading is on disk
    before the next motion starts: after Ctrl-C, a fault or a loss of power the same command goes on where it
    was. Ctrl-C stops the robot, retracts the sensor and ends within 2 s. Connecting an RV-M2 drives it to its
    mechanical origin; nothing here can stop that motion.

    Examples:
      truearm measure cell.toml poses.csv --dry-run
      truearm measure cell.toml poses.csv -o session.db
    """
    from truearm.cell.cell_file import Cell
    from truearm.cell.checks import told_unchecked
    from truearm.cell.measuring import Process
    from truearm.cell.opening import open_session
    from truearm.cell.poses_file import Poses
    from truearm.cell.rehearsal import rehearse
    from truearm.cell.running import run
    from truearm.cell.summary import summary_of, told_skipped

    known = Cell.load(cell)
    wanted = Poses.read_csv(poses, known.arm)
    warn(_told_at_limits(wanted))
    if dry_run:
        _print_rehearsal(known, rehearse(known, wanted), as_json=as_json)
        if not as_json:
            suggest(f"truearm measure {typed(cell)} {typed(poses)} -o {typed(output)}")
        return
    try:
        with open_session(output, known, wanted) as session:
            warn(session.notices)
            with Teller() as teller:
                end = run(Process(known, session, teller.tell))
            found = summary_of(session)
    except KeyboardInterrupt:
        tell(f"The session is in {output}; the same command goes on with it.")
        end_at_once()
    warn([*told_skipped(found), *told_unchecked(found["unchecked"])])
    if as_json:
        print_json({"end": end, "session": str(output), **found})
        return
    say_wrapped(f"{end[0].upper()}{end[1:]}: {found['measured']} of {found['poses']} poses measured.")
    suggest(f"truearm session export {typed(output)} -o measurements.csv")


def _told_at_limits(poses: "Poses") -> list[Notice]:
    if not poses.at_limits:
        return []
    what = list_rows([pose + 1 for pose in poses.at_limits], "pose")
    return [
        Notice(
            "at_limits",
            f"{what}: a joint is at its limit on the side from which it is to come. Joints come there from "
            "anywhere, and the column approach is 0.",
        )
    ]


def _told_coarse(cell: "Cell") -> list[Notice]:
    """Which limits give way to the standard deviation in the section of the sensor, if it has one."""
    from truearm.cell.scatter import told_coarse

    stated_mm = getattr(cell.sensor_settings, "sigma_mm", None)
    if not isinstance(stated_mm, int | float) or not stated_mm > 0.0:
        return []
    words = told_coarse(to_si(stated_mm, "mm"), cell.file.process)
    return [Notice("coarse", f"{words[0].upper()}{words[1:]}.")] if words else []


def _away(cell: "Cell") -> str:
    """How far beside a pose the joints of an arm start, in words."""
    process = cell.file.process
    ways = {"revolute": f"{process.approach_deg:g} deg", "prismatic": f"{process.approach_mm:g} mm"}
    return " and ".join(way for kind, way in ways.items() if kind in cell.arm.joints)


def _nearer(beside: "Sequence[Planned]") -> str:
    """Which joints start nearer to which poses, as far as their limits allow, in words."""
    poses: dict[int, set[int]] = {}
    for each in beside:
        for joint in each.nearer:
            poses.setdefault(joint, set()).add(each.step.pose + 1)
    words = [f"joint {joint} at {list_rows(sorted(at), 'pose')}" for joint, at in sorted(poses.items())]
    return f"; nearer, since a limit is in the way, {', '.join(words)}" if words else ""


def _below(cell: "Cell", planned: "Planned") -> str:
    """How low the arm gets on the way to a step, in words, where that is below the floor."""
    floor_mm = cell.file.clearance.floor_mm
    if planned.lowest_m is None or floor_mm is None or MM_PER_METRE * planned.lowest_m >= floor_mm:
        return ""
    return f"  below the floor on the way, z = {MM_PER_METRE * planned.lowest_m:.0f} mm"


def _print_rehearsal(cell: "Cell", plan: "Rehearsal", *, as_json: bool) -> None:
    warn(_told_coarse(cell))
    if as_json:
        rows = [
            {
                "step": each.step.step,
                "kind": each.step.kind,
                "pose": each.step.pose + 1,
                "readings": each.step.readings.tolist(),
                "beside": None if each.beside is None else each.beside.tolist(),
                "point_in_world_mm": None
                if each.point_in_world is None
                else (MM_PER_METRE * each.point_in_world).tolist(),
                "problem": each.problem,
                "lowest_mm": None if each.lowest_m is None else MM_PER_METRE * each.lowest_m,
            }
            for each in plan.steps
        ]
        print_json({"seconds": plan.seconds, "steps": rows})
        return
    kinds = [each.step.kind for each in plan.steps]
    contacts, poses, checks = (kinds.count(kind) for kind in ("registration", "pose", "check"))
    say_wrapped(
        f"{count_of(contacts, 'contact')} for the frame, {count_of(poses, 'pose')}, "
        f"{count_of(checks, 'check')}: about {plan.seconds / 60:.0f} min."
    )
    beside = [each for each in plan.steps if each.beside is not None]
    if beside:
        say_wrapped(f"At {len(beside)} of them joints start {_away(cell)} beside the pose{_nearer(beside)}.")
    for each in plan.steps:
        place = (
            ""
            if each.point_in_world is None
            else " ".join(f"{MM_PER_METRE * x:7.1f}" for x in each.point_in_world)
        )
        problem = f"  cannot be measured: {each.problem}" if each.problem else _below(cell, each)
        say(f"{each.step.kind:>12} {each.step.pose + 1:5d}  {place}{problem}")
    if plan.refused:
        say_wrapped(f"{len(plan.refused)} of {len(plan.steps)} cannot be measured and would be skipped.")
    below = [each for each in plan.steps if _below(cell, each)]
    if below:
        text = (
            f"On the way to {len(below)} of {len(plan.steps)} arm or tool goes below the floor of the cell "
            "file, which the process does not look at: plan poses with --cell, or leave these out."
        )
        warn([Notice("below_floor", text)])
