# SPDX-License-Identifier: MIT
"""``omni stop``: the emergency stop from the command line, and its release."""

from __future__ import annotations

from typing import Annotated

import typer

from omniwheel.cli.common import (
    JsonOption,
    LinkOption,
    TimeoutOption,
    console,
    examples,
    link_url,
    print_json,
    say_if_shared,
)
from omniwheel.limits import DEFAULT_TIMEOUT_S

EXAMPLES = examples("omni stop", "omni stop --disarm", "omni stop --release --link tcp:127.0.0.1:5760")

_SAID = {
    "stopped": "stopped; release it with: omni stop --release",
    "released": "released: the robot is disarmed",
    "disarmed": "disarmed",
}


def stop(
    release: Annotated[
        bool, typer.Option("--release", help="Release the emergency stop instead. The robot is then disarmed.")
    ] = False,
    disarm: Annotated[
        bool, typer.Option("--disarm", help="Only disarm: motors off, no stop to release. Ends a failsafe, too.")
    ] = False,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Stop the robot at once: an emergency stop. It stays until --release, also over a restart.

    The stop goes out at once, before the robot has been heard, and again until a robot confirms it. It stops every
    robot that receives it. Exit code 1: none has confirmed it. Do not rely on it alone: a button that cuts the motors'
    supply works without a computer.
    """
    from omniwheel.robot import connect

    if release and disarm:
        raise typer.BadParameter("--release and --disarm exclude each other")
    with connect(link_url(link), timeout_s=timeout, stop_at_once=not (release or disarm)) as robot:
        if disarm:
            robot.disarm()
        elif release:
            robot.estop_clear()
        else:
            robot.estop()
        say_if_shared(robot)
    state = "disarmed" if disarm else "released" if release else "stopped"
    if as_json:
        print_json({"state": state})
    else:
        console.print(_SAID[state])
