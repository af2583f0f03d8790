# SPDX-License-Identifier: MIT
"""The generated MAVLink dialect ``omni``, importable as an ordinary pymavlink dialect.

Importing this module makes ``pymavlink.dialects.v20.omni`` available; :func:`install` tells mavutil to use it.
"""

from __future__ import annotations

import importlib
import os
from typing import Any, Protocol

from omniwheel.paths import dialect_dir

os.environ.setdefault("MAVLINK20", "1")  # pymavlink reads it when it is imported
_v20 = importlib.import_module("pymavlink.dialects.v20")


class Message(Protocol):
    """A message of the dialect; its fields are attributes, named as in the XML."""

    def get_type(self) -> str:
        """Return the message's name."""
        ...

    def get_msgbuf(self) -> bytearray:
        """Return the frame as it was on the wire."""
        ...

    def get_srcSystem(self) -> int:
        """Return the sender's system id."""
        ...

    def get_srcComponent(self) -> int:
        """Return the sender's component id."""
        ...

    def __getattr__(self, name: str) -> Any: ...


TRIAL_KEEP, TRIAL_BEGIN, TRIAL_BACK, TRIAL_ASK = 0.0, 1.0, 2.0, 3.0
"""Actions of MAV_CMD_OMNI_TRIAL, its first parameter: docs/reference/protocol.md."""


HUB_COMPONENT = 241
"""MAV_COMP_ID_UART_BRIDGE: as this component of the robot's system the hub speaks."""


def _load() -> Any:
    folder = str(dialect_dir())
    if folder not in _v20.__path__:
        _v20.__path__.append(folder)
    return importlib.import_module("pymavlink.dialects.v20.omni")


mavlink: Any = _load()
"""The dialect module: message classes, enums and constants, as pymavlink generates them."""


def install() -> None:
    """Make pymavlink's own ``mavutil`` use the dialect, for programs that work with mavutil directly."""
    mavutil = importlib.import_module("pymavlink.mavutil")
    mavutil.set_dialect("omni")


def take_bytes(parser: Any, data: bytes) -> list[Message]:
    """Return the messages that ``data`` completes, BAD_DATA among them. ``parser`` is a ``mavlink.MAVLink``.

    Afterwards the parser keeps no more than an unfinished frame. By itself, pymavlink's keeps every byte that came,
    until a read ends exactly where a frame does. On a line that never pauses that can be megabytes.
    """
    messages: list[Message] = parser.parse_buffer(data) or []
    del parser.buf[: parser.buf_index]
    parser.buf_index = 0
    return messages


def decoded(frame: bytes) -> Message | None:
    """Return the message of one whole frame; None if it is none of the dialect. Its signature is not checked."""
    if not frame:
        return None
    try:
        message: Message = mavlink.MAVLink(None).decode(bytearray(frame))
    except mavlink.MAVError:
        return None
    return message


def is_autopilot(message: Message) -> bool:
    """Return whether a message is the heartbeat of an autopilot: of a robot, not of a station or another component."""
    if message.get_type() != "HEARTBEAT" or message.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
        return False
    others = (mavlink.MAV_TYPE_GCS, mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_TYPE_ADSB)
    return message.type not in others


def tells_time(message: Message) -> bool:
    """Return whether a message is an autopilot's answer to TIMESYNC."""
    autopilot = message.get_srcComponent() == mavlink.MAV_COMP_ID_AUTOPILOT1
    return autopilot and message.get_type() == "TIMESYNC" and bool(message.tc1 != 0)


def is_addressed(message: Message) -> bool:
    """Return whether a message says whom it is for, or is one that does no harm to a robot that it is not meant for."""
    return "target_system" in message.fieldnames or message.get_type() in ("HEARTBEAT", "TIMESYNC")


def is_command(message: Message) -> bool:
    """Return whether the message is a command, which the robot acknowledges."""
    return message.get_type() in ("COMMAND_LONG", "COMMAND_INT")


def target_system(message: Message) -> int:
    """Return the system id that a message is for; 0: every one."""
    if message.get_type() == "MANUAL_CONTROL":
        return int(message.target)
    return int(getattr(message, "target_system", 0))


def enum_name(enum: str, value: int, prefix: str = "") -> str:
    """Return the name of an enum's value without ``prefix``, or the number as text if it has none."""
    entry = mavlink.enums[enum].get(value)
    return str(entry.name).removeprefix(prefix) if entry is not None else str(value)
