# SPDX-License-Identifier: MIT
"""What the robot says about its firmware (AUTOPILOT_VERSION)."""

from __future__ import annotations

from dataclasses import dataclass

from omniwheel.dialect import Message

_RELEASE_TYPES = {0: "-dev", 64: "-alpha", 128: "-beta", 192: "-rc", 255: ""}


@dataclass(frozen=True)
class RobotVersion:
    """Firmware version, git revision (first 8 bytes, hex; "" if unknown), hardware id."""

    firmware: str
    git_hash: str
    uid: int

    def __str__(self) -> str:
        return f"{self.firmware} ({self.git_hash})" if self.git_hash else self.firmware


def version_from_message(message: Message) -> RobotVersion:
    """Decode AUTOPILOT_VERSION."""
    number = int(message.flight_sw_version)
    release = _RELEASE_TYPES.get(number & 0xFF, "")
    firmware = f"{number >> 24 & 0xFF}.{number >> 16 & 0xFF}.{number >> 8 & 0xFF}{release}"
    return RobotVersion(
        firmware, bytes(message.flight_custom_version).rstrip(b"\0").decode("ascii", "replace"), message.uid
    )
