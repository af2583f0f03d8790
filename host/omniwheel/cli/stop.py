# SPDX-License-Identifier: MIT
"""``omni stop``: the emergency stop from the command line, and its release."""

from __future__ import annotations

from typing import Annotated

import typer

from omniwheel.cli.common import JsonOption, LinkOption, TimeoutOption, console, examples, link_url, print_json
from omniwheel.robot import DEFAULT_TIMEOUT_S, connect

EXAMPLES = examples("omni stop", "omni stop --release --link tcp:127.0.0.1:5760")


def stop(
    release: Annotated[
        bool, typer.Option("--release", help="Release the emergency stop instead. The robot is then disarmed.")
    ] = False,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Stop the robot at once: an emergency stop. It outlives a restart and leaves only by --release.

    Exit code 1: the robot did not confirm it. A button that cuts the motors' supply works without a computer.
    """
    with connect(link_url(link), timeout_s=timeout) as robot:
        if release:
            robot.estop_clear()
        else:
            robot.estop()
        state = "released" if release else "stopped"
    if as_json:
        print_json({"state": state})
    else:
        console.print("released: the robot is disarmed" if release else "stopped; release it with: omni stop --release")
