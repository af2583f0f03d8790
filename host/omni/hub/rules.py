# SPDX-License-Identifier: MIT
"""What a frame from a client is to the hub."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from enum import Enum, auto

from omniwheel.dialect import Message, is_command, mavlink, target_system
from omniwheel.stops import stop_of

NO_CLIENT = -1
"""The hub itself, where a client's number is asked for."""
HELLO = "this is "
"""How a text begins with which a client says its name."""
HANDED_OVER = "this was "
"""... and one that had the port itself until now."""
_SETPOINTS = ("SET_POSITION_TARGET_LOCAL_NED", "MANUAL_CONTROL", "OMNI_SETPOINT_DUTY")
_FIXES = ("VICON_POSITION_ESTIMATE", "ATT_POS_MOCAP", "OMNI_POSE_FIX")
_NEEDED = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT,
    mavlink.MAVLINK_MSG_ID_COMMAND_ACK,
    mavlink.MAVLINK_MSG_ID_STATUSTEXT,
    mavlink.MAVLINK_MSG_ID_PARAM_VALUE,
    mavlink.MAVLINK_MSG_ID_TIMESYNC,
}
"""Messages whose rates only the robot decides: no client can be without them."""
_LAST_MESSAGE = 2**24 - 1
_SHORTEST_US, _LONGEST_US = 1000.0, 4.0e9
"""Intervals that the robot takes (firmware/app/services/telemetry.cpp), beside 0 (as at boot) and -1 (off)."""


class Kind(Enum):
    """What the hub does with a frame depends on this."""

    STOP = auto()
    """Disarm, emergency stop, hold: from any client, at once."""
    MOVE = auto()
    """Arming and whatever else moves the robot or what it believes: from the client in command."""
    SETPOINT = auto()
    """The same as a stream, of which only the newest counts."""
    FIX = auto()
    """A measured pose: from any client, only the newest counts."""
    HEARTBEAT = auto()
    INTERVAL = auto()
    """A wish for one message's rate."""
    STREAM = auto()
    """A wish for the rate of a group of messages."""
    LIST = auto()
    """All parameters, please."""
    READ = auto()
    """One parameter, please."""
    NAME = auto()
    """The client says its name; for the hub alone."""
    OTHER = auto()


_MOVES = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
    mavlink.MAV_CMD_DO_SET_MODE,
    mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
    mavlink.MAV_CMD_OMNI_TRAJECTORY_START,
    mavlink.MAV_CMD_OMNI_HIL,
    mavlink.MAV_CMD_OMNI_SET_POSE,
    mavlink.MAV_CMD_OMNI_WAYPOINT,
    mavlink.MAV_CMD_OMNI_ESTOP,
    mavlink.MAV_CMD_OMNI_I2C_SCAN,
    mavlink.MAV_CMD_OMNI_OE_TEST,
    mavlink.MAV_CMD_OMNI_EXCITE,
}
_OTHER_KINDS = {
    **dict.fromkeys(_SETPOINTS, Kind.SETPOINT),
    **dict.fromkeys(_FIXES, Kind.FIX),
    "HEARTBEAT": Kind.HEARTBEAT,
    "SET_MODE": Kind.MOVE,
    "OMNI_HIL_SENSORS": Kind.MOVE,
    "REQUEST_DATA_STREAM": Kind.STREAM,
    "PARAM_REQUEST_LIST": Kind.LIST,
    "PARAM_REQUEST_READ": Kind.READ,
}


def is_disarm(message: Message) -> bool:
    """Return whether the message disarms."""
    arming = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
    return is_command(message) and bool(message.command == arming and message.param1 == 0.0)


def kind_of(message: Message) -> Kind:
    """Say what a message from a client is."""
    if stop_of(message) is not None:
        return Kind.STOP
    if is_command(message):
        if wish_of(message) is not None:
            return Kind.INTERVAL
        return Kind.MOVE if message.command in _MOVES else Kind.OTHER
    if message.get_type() == "STATUSTEXT" and str(message.text).startswith((HELLO, HANDED_OVER)):
        return Kind.NAME
    return _OTHER_KINDS.get(message.get_type(), Kind.OTHER)


def wish_of(message: Message) -> tuple[int, float] | None:
    """Return message and interval [µs] of a command that asks for a rate; None: any other, and what the robot judges.

    That is: numbers that are none or out of its range, and messages that every client needs.
    """
    if message.command != mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
        return None
    number, interval_us = float(message.param1), float(message.param2)
    if not 0.0 <= number <= _LAST_MESSAGE or int(number) in _NEEDED:
        return None
    takes = interval_us in (-1.0, 0.0) or _SHORTEST_US <= interval_us <= _LONGEST_US
    return (int(number), interval_us) if takes else None


def may_be_same(system: int, other: int) -> bool:
    """Return whether two system ids may mean one robot: 0 is every one."""
    return 0 in (system, other) or system == other


@dataclass(frozen=True)
class Target:
    """Whom a message is for; 0 is everybody."""

    system: int
    component: int

    def or_robot(self, robot: tuple[int, int]) -> tuple[int, int]:
        """Return from whom (system, component) the answer comes: everybody is the robot."""
        return self.system or robot[0], self.component or robot[1]


def target_of(message: Message) -> Target:
    """Return whom a message is for."""
    return Target(target_system(message), int(getattr(message, "target_component", 0)))


def source_of(message: Message) -> tuple[int, int]:
    """Return the system and component that sent a message."""
    return message.get_srcSystem(), message.get_srcComponent()


def receipt_of(message: Message) -> int:
    """Return the receipt of a numbered command (docs/reference/protocol.md, Commands); 0 for one without a number."""
    values = [message.param1, message.param2, message.param3, message.param4]
    if message.get_type() == "COMMAND_LONG":
        number, packed = message.param5, struct.pack("<7f", *values, message.param5, message.param6, message.param7)
    else:
        number, packed = message.x, struct.pack("<4f2if", *values, message.x, message.y, message.z)
    (receipt,) = struct.unpack("<i", struct.pack("<I", zlib.crc32(packed)))
    return int(receipt) if number != 0 else 0
