# SPDX-License-Identifier: MIT
"""``omni plot``: draw a run's picture again, or any telemetry log."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from omni.cli.common import JsonOption, console, examples, new_path, print_json, redrawn_path
from omni.cli.log_options import PartOption
from omni.cli.options import ForceOption
from omni.cli.run_output import RunFolderError
from omniwheel.errors import OmniError

EXAMPLES = examples(
    "omni plot runs/demo-seed1", "omni plot runs/demo-seed1 --out demo.png", "omni plot drive.tlog --out drive.png"
)


def plot(
    run: Annotated[Path, typer.Argument(metavar="RUN|FILE.tlog", help="A run's folder, or a telemetry log.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="PNG file to write. \\[default: run.png in the run's folder]"),
    ] = None,
    part: PartOption = None,
    force: ForceOption = False,
    json_wanted: JsonOption = False,
) -> None:
    """Draw the picture of a finished run from its stored record, or what a telemetry log shows.

    A log of any program with our robot's messages will do: omni record, omni drive, MAVProxy.
    """
    from hil_sim.summary import PICTURE_FILE
    from omniwheel.drive_log.folder import DRIVE_FILE, TLOG_FILE
    from omniwheel.logs.run_folder import load_run
    from omniwheel.tlog_reader import ENDINGS

    if out is not None:
        new_path(out, "the picture", force=force)
    log = run / TLOG_FILE if run.is_dir() and (run / DRIVE_FILE).is_file() else run
    if log.suffix in ENDINGS:
        _plot_log(log, out, json_wanted, part, force)
        return
    if not run.exists():
        raise RunFolderError(
            f"{run} does not exist", hint="give a .tlog or .mcap file or the folder of a run; `omni runs` lists them"
        )
    if part is not None:
        raise typer.BadParameter("--part chooses a part of a telemetry log; a simulated run has none")
    try:
        summary, samples = load_run(run)
    except (OSError, ValueError, KeyError) as error:
        hint = "give the folder of a run, as printed by omni run"
        raise RunFolderError(f"{run} is not a run: {error}", hint=hint) from error
    target = run / PICTURE_FILE if out is None else out
    from hil_sim.run_picture import draw_run  # here, not above: matplotlib takes a second to import

    try:
        draw_run(summary, samples, target)
    except OmniError:
        raise
    except (ValueError, KeyError, TypeError, IndexError, OverflowError) as error:
        raise RunFolderError(f"{run} holds another kind of run: {error!r}", hint="repeat the run") from error
    if json_wanted:
        print_json({"picture": str(target)})
    else:
        console.print(escape(str(target)), soft_wrap=True)


def _plot_log(log: Path, out: Path | None, json_wanted: bool, part: int | None, force: bool) -> None:
    from hil_sim.summary import PICTURE_FILE
    from omniwheel.drive_log import draw_telemetry, read_record
    from omniwheel.drive_log.folder import TLOG_FILE
    from omniwheel.telemetry_picture import in_words

    record = read_record(log, part)
    if out is not None:
        target = out
    elif log.name == TLOG_FILE:
        target = redrawn_path(log.with_name(PICTURE_FILE), "the picture")
    else:  # a picture of that name may be anything
        target = new_path(log.with_suffix(".png"), "the picture", force=force)
    draw_telemetry(record, log.stem if log.name != TLOG_FILE else log.parent.name, target)
    if json_wanted:
        document = {"picture": str(target), "numbers": record.numbers(), "events": len(record.events)}
        document |= {"pose_jumps": [asdict(jump) for jump in record.jumps], "notes": list(record.notes)}
        print_json(document)
    else:
        console.print(f"{escape(str(target))}: {in_words(record.numbers())}")
        for note in record.notes:
            console.print(f"[yellow]{escape(note)}[/]")
