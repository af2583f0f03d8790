# SPDX-License-Identifier: MIT
"""The default face of the library: a thread serves the link, so that a program may sleep and compute."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from omni_schema import Robot as RobotFile
from omniwheel.connection import Recorder
from omniwheel.limits import DEFAULT_TIMEOUT_S
from omniwheel.link import Link
from omniwheel.robot import Robot
from omniwheel.robot import connect as _connect
from omniwheel.simulation import DEFAULT_ROBOT, REAL_TIME, SimulatedRobot
from omniwheel.simulation import simulate as _simulate


def connect(
    url: str | Link | None = None,
    *,
    timeout_s: float = DEFAULT_TIMEOUT_S,
    system_id: int | None = None,
    heartbeat: bool = True,
    recorder: Recorder | None = None,
    signing_key: bytes | None = None,
    record: bool = True,
) -> Robot:
    """Connect to a robot and serve its link in a thread until ``robot.close()``, or the end of the ``with`` block.

    ``url``: a serial port, ``tcp:host:port``, ``udp:host:port`` or ``udpout:host:port``; None: the only Teensy that is
    plugged in. With ``record``, ``robot.run`` is everything since. The rest is as of
    :func:`omniwheel.robot.connect`, and so is what it raises.
    """
    return _connect(
        url,
        timeout_s=timeout_s,
        system_id=system_id,
        heartbeat=heartbeat,
        recorder=recorder,
        signing_key=signing_key,
        record=record,
        background=True,
    )


def simulate(
    robot: str | Path | RobotFile = DEFAULT_ROBOT,
    *,
    world: Any = None,
    scenario: Any = None,
    seed: int | None = 0,
    speed: str = REAL_TIME,
    record: bool = True,
) -> SimulatedRobot:
    """Simulate a robot with its real firmware until ``robot.close()``, or the end of the ``with`` block.

    ``robot``: a name (three_wheel, four_wheel, fast_three_wheel), a robot file or a description of one. ``scenario``:
    a name or file; None: a floor with slip, and pose fixes. ``world``: another one than the built-in, as "mujoco".
    ``seed``: of its random numbers. With ``speed`` "max" there is no thread: simulated time passes only while a method
    of the robot waits, so use ``robot.sleep``, not ``time.sleep``. The rest is as of
    :func:`omniwheel.simulation.simulate`.
    """
    return _simulate(robot, world=world, scenario=scenario, seed=seed, speed=speed, record=record)
