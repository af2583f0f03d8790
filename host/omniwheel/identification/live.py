# SPDX-License-Identifier: MIT
"""Drives a connected robot through Appendix D's circles and spins and records what identification needs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from omniwheel.dialect import Message
from omniwheel.errors import IdentificationError
from omniwheel.frames import Twist
from omniwheel.identification.dataset import Dataset
from omniwheel.identification.excitation import LAP_S, MODULATION, MODULATION_S, RAMP_S
from omniwheel.identification.sources import from_messages
from omniwheel.robot import Robot

RATE_Hz = 50.0
BATTERY_Hz = 10.0
SEGMENTS = ("circle ccw", "circle cw", "spin ccw", "spin cw")
RECORDED = ("OMNI_WHEELS", "SYS_STATUS")


def excite(robot: Robot, duration_s: float, share: float, tell: Callable[[str], None]) -> Dataset:
    """Drive the four segments, ``duration_s`` each, with wheels at up to ``share`` of LIM_WHEEL; disarm at the end.

    The circles are about share * LIM_WHEEL * r * LAP_S / pi across. Raises IdentificationError if the robot stops itself.
    """
    speed_rad_s = share * robot.parameters["LIM_WHEEL"]
    seen: list[Message] = []
    remove = robot.connection.add_listener(lambda m: seen.append(m) if m.get_type() in RECORDED else None)
    radius_m, distance_m = robot.parameters["WHEEL_RADIUS"], robot.parameters["WHEEL_DIST"]
    try:
        robot.set_message_interval("OMNI_WHEELS", RATE_Hz)
        robot.set_message_interval("SYS_STATUS", BATTERY_Hz)
        robot.arm()
        for name in SEGMENTS:
            tell(name)
            for twist in segment(name, duration_s, speed_rad_s * radius_m, speed_rad_s * radius_m / distance_m):
                robot.set_velocity(*twist)
                robot.pump(1.0 / RATE_Hz)
                _require_driving(robot)
    finally:
        remove()
        robot.disarm()
    return from_messages(seen, robot.url, robot.parameters["BAT_V_NOM"], int(robot.parameters["WHEELS"]))


def segment(name: str, duration_s: float, speed_m_s: float, turn_rad_s: float) -> Iterator[Twist]:
    """Yield body velocities at RATE_Hz."""
    direction = 1.0 if name.endswith("ccw") else -1.0
    rows = round(duration_s * RATE_Hz)
    for row in range(rows):
        t = row / RATE_Hz
        ramp = 0.5 - 0.5 * math.cos(math.pi * min(t / RAMP_S, (duration_s - t) / RAMP_S, 1.0))
        if name.startswith("circle"):
            heading = direction * 2.0 * math.pi * t / LAP_S
            yield Twist(ramp * speed_m_s * math.cos(heading), ramp * speed_m_s * math.sin(heading), 0.0)
        else:
            swing = 1.0 - MODULATION + MODULATION * math.cos(2.0 * math.pi * t / MODULATION_S)
            yield Twist(0.0, 0.0, direction * ramp * swing * turn_rad_s)


def _require_driving(robot: Robot) -> None:
    status = robot.status
    if status.state in ("failsafe", "estop"):
        faults = ", ".join(status.safety.fault_history) if status.safety is not None else "unknown"
        raise IdentificationError(f"the robot stopped by itself: {faults}", hint="see `omni monitor`; was there room?")
