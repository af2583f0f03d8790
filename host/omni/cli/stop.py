# SPDX-License-Identifier: MIT
"""``omni stop``: the emergency stop from the command line, and its release."""

from __future__ import annotations

from typing import Annotated

import typer

from omni.cli.common import (
    JsonOption,
    LinkOption,
    TimeoutOption,
    console,
    examples,
    link_url,
    note_if_shared,
    print_json,
)
from omniwheel.default_system import default_system
from omniwheel.errors import OmniError, SeveralRobotsError
from omniwheel.limits import DEFAULT_TIMEOUT_S

EXAMPLES = examples("omni stop", "omni stop --disarm", "omni stop --release --link tcp:127.0.0.1:5760")

_SAID = {
    "stopped": "stopped; release it with: omni stop --release",
    "released": "released: the robot is disarmed",
    "disarmed": "disarmed",
}


def stop(
    release: Annotated[bool, typer.Option("--release", help="Release the e-stop. The robot is then disarmed.")] = False,
    disarm: Annotated[
        bool, typer.Option("--disarm", help="Only disarm: motors off, no latched e-stop. Also ends a failsafe.")
    ] = False,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Stop the robot at once: an emergency stop. It stays until --release, also over a restart.

    The stop goes out at once, before the robot has been heard, and again until a robot confirms it. It stops every
    robot that receives it, and each that is heard has to confirm it; with --system only that one. --disarm disarms all
    of them, too; --release wants one. Exit code 1: one has not confirmed it. Do not rely on it alone: a button that
    cuts the motors' supply works without a computer.
    """
    if release and disarm:
        raise typer.BadParameter("--release and --disarm exclude each other")
    state = "disarmed" if disarm else "released" if release else "stopped"
    systems = _stop(link_url(link), state, timeout)
    if as_json:
        print_json({"state": state, "systems": systems})
    else:
        which = f"robots {' and '.join(map(str, systems))}: " if len(systems) > 1 else ""
        console.print(f"{which}{_SAID[state]}")


def _stop(url: str, state: str, timeout_s: float) -> list[int]:
    """Bring the robot, or all on the line unless it is a release, into a state; return their system ids."""
    try:
        return [_stop_one(url, state, timeout_s, default_system())]
    except SeveralRobotsError as error:
        if state == "released":
            raise
        systems = error.systems
    problem: OmniError | None = None
    for system in systems:  # one that does not answer keeps no other one from being stopped
        try:
            _stop_one(url, state, timeout_s, system)
        except OmniError as error:
            problem = error
    if problem is not None:
        raise problem
    return list(systems)


def _stop_one(url: str, state: str, timeout_s: float, system: int | None) -> int:
    from omniwheel.robot import connect

    with connect(url, timeout_s=timeout_s, system_id=system, stop_at_once=state == "stopped") as robot:
        if state == "disarmed":
            robot.disarm()
        elif state == "released":
            robot.estop_clear()
        else:
            robot.estop()
        note_if_shared(robot)
        return robot.connection.target_system
