# SPDX-License-Identifier: MIT
"""Which messages stop a robot. The hub and links with several peers send these first, or further than others."""

from __future__ import annotations

from enum import IntEnum, auto

from omniwheel.dialect import Message, is_command, mavlink

_PX4_LOITER = (4, 3)
"""Main mode and sub mode."""
_PACKED = 2.0**16
"""From here on a number holds both modes."""


class Stop(IntEnum):
    """Kinds of stops, the most urgent first."""

    ESTOP = auto()
    DISARM = auto()
    HOLD = auto()
    """The robot stays armed, or leaves a loop or an excitation."""


def _asks_to_hold(custom_mode: float, sub_mode: float) -> bool:
    """As the firmware reads a mode (firmware/app/link/flight_mode.h): the whole number, or main mode and sub mode."""
    if custom_mode == 0.0:
        return True
    if _PACKED <= custom_mode < 2.0**32:
        return (int(custom_mode) >> 16 & 0xFF, int(custom_mode) >> 24) == _PX4_LOITER
    return (custom_mode, sub_mode) == _PX4_LOITER


def _stop_of(command: int, param1: float) -> Stop | None:
    """As in firmware/app/link/stops.cpp; holding the pose and leaving host-in-the-loop are stops here, too."""
    if command == mavlink.MAV_CMD_OMNI_ESTOP:
        return Stop.ESTOP if param1 != 0.0 else None
    if command == mavlink.MAV_CMD_DO_FLIGHTTERMINATION:
        return Stop.ESTOP if param1 > 0.5 else None
    if command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
        return Stop.DISARM if param1 == 0.0 else None
    if command in (mavlink.MAV_CMD_OMNI_HIL, mavlink.MAV_CMD_OMNI_EXCITE):
        return Stop.HOLD if param1 == 0.0 else None
    return Stop.HOLD if command == mavlink.MAV_CMD_OMNI_TRAJECTORY_STOP else None


def stop_of(message: Message) -> Stop | None:
    """Return which stop a message is; None: none."""
    if message.get_type() == "SET_MODE":
        return Stop.HOLD if _asks_to_hold(message.custom_mode, 0.0) else None
    if not is_command(message):
        return None
    if message.command == mavlink.MAV_CMD_DO_SET_MODE:
        return Stop.HOLD if _asks_to_hold(message.param2, message.param3) else None
    return _stop_of(message.command, message.param1)
