# SPDX-License-Identifier: MIT
"""What the robot says about its firmware (AUTOPILOT_VERSION)."""

from __future__ import annotations

from dataclasses import dataclass

from omniwheel.dialect import Message

_RELEASE = 255


@dataclass(frozen=True)
class RobotVersion:
    """Firmware version, its first 16 hex digits of the git commit ("" if unknown), and the parameter table it has.

    ``dirty`` means built from a changed work tree; ``schema_crc`` is the ``crc`` of its ``omni_schema.ParameterTable``.
    ``serial_number``: the board's, on a Teensy the one of its USB port; 0 where there is none.
    ``wiring_id``: ``omni_schema.wiring_id`` of the robot that it was built for; 0 on a PC.
    """

    firmware: str
    git_hash: str
    dirty: bool
    schema_version: int
    schema_crc: int
    serial_number: int = 0
    wiring_id: int = 0

    def __str__(self) -> str:
        git = f" ({self.git_hash[:8]}{', changed' if self.dirty else ''})" if self.git_hash else ""
        return self.firmware + git


def version_from_message(message: Message) -> RobotVersion:
    """Decode AUTOPILOT_VERSION."""
    number = int(message.flight_sw_version)
    commit = bytes(message.flight_custom_version)
    return RobotVersion(
        firmware=f"{number >> 24 & 0xFF}.{number >> 16 & 0xFF}.{number >> 8 & 0xFF}",
        git_hash=commit.hex() if any(commit) else "",
        dirty=number & 0xFF != _RELEASE,
        schema_version=int(message.middleware_sw_version),
        schema_crc=int(message.os_sw_version),
        serial_number=int(message.uid),
        wiring_id=int(message.board_version),
    )
