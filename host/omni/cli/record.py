# SPDX-License-Identifier: MIT
"""``omni record``: write what goes over a link to a telemetry log."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from omni.cli.common import (
    JsonOption,
    LinkOption,
    TimeoutOption,
    examples,
    new_path,
    note,
    open_robot,
    print_json,
)
from omni.cli.options import ForceOption
from omniwheel.errors import LinkLostError, OmniError, OutputFileError
from omniwheel.limits import DEFAULT_TIMEOUT_S
from omniwheel.tlog import TlogWriter

EXAMPLES = examples("omni record run.tlog", "omni record run.tlog --duration 60 --link tcp:127.0.0.1:5760")
_SLICE_S = 0.5


def record(
    out: Annotated[Path, typer.Argument(metavar="OUT.tlog", help="Log to write; MAVProxy and QGroundControl open it.")],
    duration: Annotated[
        float, typer.Option("--duration", "-d", min=0.0, metavar="S", help="Default: until Ctrl-C.", show_default=False)
    ] = math.inf,
    force: ForceOption = False,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Record every MAVLink frame of a link, both directions, with time stamps."""
    new_path(out, "record", force=force)
    lost: OmniError | None = None
    with TlogWriter(out) as log:
        try:
            with open_robot(link, timeout_s=timeout, recorder=log.write) as robot:
                note(f"recording to {escape(str(out))}; Ctrl-C ends", quiet=as_json)
                end = robot.connection.clock() + duration
                while (left := end - robot.connection.clock()) > 0.0:
                    robot.pump(min(left, _SLICE_S))
                    log.flush_if_due()
        except KeyboardInterrupt:
            note("", quiet=as_json)
        except (LinkLostError, OutputFileError) as error:
            lost = error
    note(f"{log.frames} frames in {escape(str(out))}", quiet=as_json)
    if lost is not None:
        raise lost
    if as_json:
        print_json({"file": str(out), "frames": log.frames})
