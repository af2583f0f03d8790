# SPDX-License-Identifier: MIT
"""The face without a thread: messages come and go only while a method of the robot waits.

The same methods as with :func:`omniwheel.connect`. For simulated time, where equal programs give equal bytes, and for
programs that have a loop of their own. A program that computes calls ``robot.sleep(...)`` at least once a second. If it
stops doing so the robot stops, too.

>>> from omniwheel import sync
>>> with sync.simulate(speed="max") as robot:   # doctest: +SKIP
...     robot.arm()
...     robot.drive_to(0.5, 0.0)
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from omni_schema import Robot as RobotFile
from omniwheel.connection import Recorder
from omniwheel.limits import DEFAULT_TIMEOUT_S
from omniwheel.link import Link
from omniwheel.robot import Robot
from omniwheel.robot import connect as _connect
from omniwheel.simulation import DEFAULT_ROBOT, MAX, SimulatedRobot
from omniwheel.simulation import simulate as _simulate

__all__ = ["Robot", "SimulatedRobot", "connect", "simulate"]


def connect(
    url: str | Link | None = None,
    *,
    timeout_s: float = DEFAULT_TIMEOUT_S,
    system_id: int | None = None,
    heartbeat: bool = True,
    clock: Callable[[], float] = time.monotonic,
    recorder: Recorder | None = None,
    signing_key: bytes | None = None,
    record: bool = True,
) -> Robot:
    """Connect to a robot, as :func:`omniwheel.connect`, without a thread; ``clock`` is that of a simulated link."""
    return _connect(
        url,
        timeout_s=timeout_s,
        system_id=system_id,
        heartbeat=heartbeat,
        clock=clock,
        recorder=recorder,
        signing_key=signing_key,
        record=record,
    )


def simulate(
    robot: str | Path | RobotFile = DEFAULT_ROBOT,
    *,
    world: Any = None,
    scenario: Any = None,
    seed: int | None = 0,
    speed: str = MAX,
    record: bool = True,
) -> SimulatedRobot:
    """Simulate a robot, as :func:`omniwheel.simulate`, without a thread; in simulated time unless told otherwise."""
    return _simulate(robot, world=world, scenario=scenario, seed=seed, speed=speed, record=record, background=False)
