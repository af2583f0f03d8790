# SPDX-License-Identifier: MIT
"""Telemetry as typed, immutable values in our frame and SI units, decoded from MAVLink.

Wheel arrays have four entries; a three-wheel robot's last one is zero. ``time_s`` is the robot's clock.

The build writes the classes of our own messages into ``telemetry_gen``, from ``shared/link/telemetry.toml``. Here are
those of standard messages, which need more than a name and a scale.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from omniwheel import telemetry_gen
from omniwheel.dialect import Message, enum_name, mavlink
from omniwheel.frames import Pose, Twist, flip
from omniwheel.telemetry_gen import *  # noqa: F403
from omniwheel.telemetry_parts import Telemetry, TelemetryT, decode, fault_names, state_name

__all__ = [
    "Battery",
    "Heartbeat",
    "LocalPosition",
    "Odometry",
    "StatusText",
    "Telemetry",
    "TelemetryT",
    "decode",
    "fault_names",
    "state_name",
]
__all__ += telemetry_gen.__all__
_MS, _US = 1e-3, 1e-6


@dataclass(frozen=True)
class Heartbeat(Telemetry):
    """What the robot is doing: ``mode`` is hold, pose, velocity, trajectory or duty."""

    message = "HEARTBEAT"
    armed: bool
    hil: bool
    mode: str
    system_status: str

    @classmethod
    def decoded(cls, m: Message) -> Heartbeat:
        """Return the values of a message ``HEARTBEAT``."""
        return cls(
            armed=bool(m.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED),
            hil=bool(m.base_mode & mavlink.MAV_MODE_FLAG_HIL_ENABLED),
            mode=enum_name("OMNI_MODE", m.custom_mode & 0xFFFF, "OMNI_MODE_").lower(),
            system_status=enum_name("MAV_STATE", m.system_status, "MAV_STATE_").lower(),
        )


@dataclass(frozen=True)
class LocalPosition(Telemetry):
    """Pose estimate's position and world velocity, from the standard LOCAL_POSITION_NED."""

    message = "LOCAL_POSITION_NED"
    time_s: float
    x_m: float
    y_m: float
    vx_m_s: float
    vy_m_s: float

    @classmethod
    def decoded(cls, m: Message) -> LocalPosition:
        """Return the values of a message ``LOCAL_POSITION_NED``."""
        x, y, _ = flip(m.x, m.y, 0.0)
        vx, vy, _ = flip(m.vx, m.vy, 0.0)
        return cls(m.time_boot_ms * _MS, x, y, vx, vy)


@dataclass(frozen=True)
class Odometry(Telemetry):
    """Estimated world pose and body twist, from the standard ODOMETRY."""

    message = "ODOMETRY"
    time_s: float
    pose: Pose
    twist: Twist

    @classmethod
    def decoded(cls, m: Message) -> Odometry:
        """Return the values of a message ``ODOMETRY``."""
        x, y, theta = flip(m.x, m.y, 2.0 * math.atan2(m.q[3], m.q[0]))
        return cls(m.time_usec * _US, Pose(x, y, math.remainder(theta, math.tau)), Twist(*flip(m.vx, m.vy, m.yawspeed)))


@dataclass(frozen=True)
class Battery(Telemetry):
    """Supply voltage, nan if it is not measured."""

    message = "SYS_STATUS"
    voltage_V: float

    @classmethod
    def decoded(cls, m: Message) -> Battery:
        """Return the values of a message ``SYS_STATUS``."""
        measured = m.voltage_battery not in (0, 0xFFFF)
        return cls(m.voltage_battery / 1e3 if measured else math.nan)


@dataclass(frozen=True)
class StatusText(Telemetry):
    """A line of text from the robot; ``severity`` as in syslog: 0 emergency ... 7 debug."""

    message = "STATUSTEXT"
    severity: int
    text: str

    @classmethod
    def decoded(cls, m: Message) -> StatusText:
        """Return the values of a message ``STATUSTEXT``."""
        text = m.text.decode(errors="replace") if isinstance(m.text, bytes) else str(m.text)
        return cls(m.severity, text.rstrip("\0"))
