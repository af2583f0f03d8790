# SPDX-License-Identifier: MIT
"""``omni plot``: draw a run's picture again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil_sim.summary import REPORT_FILE
from omniwheel.cli.common import JsonOption, console, examples, print_json, writable_path
from omniwheel.cli.run_output import RunFolderError
from omniwheel.errors import OmniError
from omniwheel.logs.run_folder import load_run

EXAMPLES = examples("omni plot runs/demo-seed1", "omni plot runs/demo-seed1 --out demo.png")


def plot(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.")],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Where to draw. \\[default: report.png of the run]")
    ] = None,
    json_wanted: JsonOption = False,
) -> None:
    """Draw the picture of a finished run from its stored record."""
    try:
        summary, samples = load_run(run)
    except (OSError, ValueError, KeyError) as error:
        hint = "give the folder of a run, as printed by omni demo, hil and sim"
        raise RunFolderError(f"{run} is not a run: {error}", hint=hint) from error
    target = writable_path(out, "the picture") if out is not None else run / REPORT_FILE
    from hil_sim.run_picture import draw_run  # here, not above: matplotlib takes a second to import

    try:
        draw_run(summary, samples, target)
    except OmniError:
        raise
    except (ValueError, KeyError, TypeError, IndexError, OverflowError) as error:
        raise RunFolderError(f"{run} holds another kind of run: {error!r}", hint="run it again") from error
    if json_wanted:
        print_json({"report": str(target)})
    else:
        console.print(str(target))
