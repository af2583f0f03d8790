# SPDX-License-Identifier: MIT
"""Which of the sensors in :mod:`omniwheel.sensor_quality` a robot has, and asking it to tell of them.

It tells only if asked, and one without the sensor tells zeros. So its parameters are looked at first.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress

from omniwheel.errors import CommandRefusedError, OmniError, VersionMismatchError
from omniwheel.robot import Robot
from omniwheel.sensor_quality import SENSORS, Sensor, sensors_of

RATE_HZ = 2.0
"""For a person who reads numbers."""
RADIO_RATE_HZ = 0.5
"""On a slow radio. Both messages need 45 bytes per second there, of the 480 that a line of 9600 baud gives."""
_GONE_S = 3.0


def find_sensors(robot: Robot) -> tuple[Sensor, ...]:
    """Return the sensors that a robot has. Raises LinkTimeoutError.

    A robot with another table of parameters may not know one of ours, and would be asked for it for many seconds. So
    of such a robot only those count that have come already.
    """
    try:
        robot.require_same_parameters()
    except (VersionMismatchError, CommandRefusedError):
        return sensors_of(robot.parameters.known)
    return sensors_of({sensor.parameter: robot.parameters[sensor.parameter] for sensor in SENSORS})


def ask_for(robot: Robot, sensors: Iterable[Sensor], rate_hz: float | None) -> None:
    """Have the robot tell of these sensors; None ends it. An older firmware that has no such message is left alone."""
    for sensor in sensors:
        with suppress(CommandRefusedError):
            robot.set_message_interval(sensor.kind.message, rate_hz)


@contextmanager
def sensor_advice(robot: Robot, rate_hz: float) -> Iterator[tuple[Sensor, ...]]:
    """Have the robot tell of its sensors, and yield which it has. At the end it tells no more."""
    sensors = find_sensors(robot)
    ask_for(robot, sensors, rate_hz)
    try:
        yield sensors
    finally:
        if robot.status.heartbeat_age_s < _GONE_S:  # one that is gone would be asked for many seconds
            with suppress(OmniError):
                ask_for(robot, sensors, None)
