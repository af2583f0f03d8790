# SPDX-License-Identifier: MIT
"""``omni monitor --message``: the fields of any message of the dialect, as the robot sends them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import typer

from omni.cli.common import console, print_json
from omniwheel.errors import CommandRefusedError
from omniwheel.number_text import finite

if TYPE_CHECKING:
    from omniwheel.dialect import Message
    from omniwheel.robot import Robot

PERIOD_S = 1.0


def known_names(names: Sequence[str]) -> list[str]:
    """Return the messages' names in capitals. Raises BadParameter for one that the dialect does not have."""
    from omni_schema.errors import did_you_mean
    from omniwheel.dialect import mavlink

    known = {message.msgname for message in mavlink.mavlink_map.values()}
    for name in names:
        if name.upper() not in known:
            raise typer.BadParameter(f"unknown message {name}{did_you_mean(name, known)}")
    return [name.upper() for name in names]


def show_messages(robot: Robot, names: Sequence[str], *, once: bool, as_json: bool) -> None:
    """Print each message's fields: once, or every second until Ctrl-C. JSON is one object by name."""
    if as_json:
        print_json({name: _fields(_next(robot, name)) for name in names})
        return
    try:
        while True:
            for name in names:
                values = "  ".join(f"{field}={value}" for field, value in _fields(_next(robot, name)).items())
                console.print(f"{name}  {values}", markup=False, soft_wrap=True)
            if once:
                return
            robot.pump(PERIOD_S)
    except KeyboardInterrupt:
        return


def _next(robot: Robot, name: str) -> Message:
    """Request the message; one that cannot be requested, such as HEARTBEAT, is waited for."""
    try:
        return robot.commands.request_message(name, robot.timeout_s)
    except CommandRefusedError:
        return next(robot.messages(name))


def _fields(message: Message) -> dict[str, Any]:
    return {name: finite(value) for name, value in message.to_dict().items() if name != "mavpackettype"}
