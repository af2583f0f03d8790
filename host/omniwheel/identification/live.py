# SPDX-License-Identifier: MIT
"""Drives a connected robot through Appendix D's runs, or steps on a stand, and records what identification needs."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from omniwheel.dialect import Message
from omniwheel.identification.dataset import Dataset
from omniwheel.identification.excitation import PERIOD_S
from omniwheel.identification.sources import from_messages
from omniwheel.robot import Robot

Array = NDArray[np.float64]
REST_S = 0.5
RECORDED = ("OMNI_SAMPLE", "VICON_POSITION_ESTIMATE")


def excite(robot: Robot, profiles: Mapping[str, Array], tell: Callable[[str], None]) -> Dataset:
    """Put duties (rows of PERIOD_S, wheels) on the motors, one table after the other; disarm at the end.

    Open loop, as in Appendix D: nothing holds the robot on a path. Raises StoppedError.
    """
    seen: list[Message] = []
    parameters = {name: robot.parameters[name] for name in _needed(int(robot.parameters["WHEELS"]))}
    remove = robot.connection.add_listener(lambda m: seen.append(m) if m.get_type() in RECORDED else None)
    try:
        robot.set_message_interval("OMNI_SAMPLE", 1.0 / PERIOD_S)
        robot.arm()
        for name, duty in profiles.items():
            tell(name)
            _play(robot, duty)
            robot.drive_duty([0.0] * duty.shape[1], REST_S)
    finally:
        remove()
        robot.disarm()
        robot.set_message_interval("OMNI_SAMPLE", None)
    return from_messages(seen, robot.url, parameters)


def _needed(wheels: int) -> tuple[str, ...]:
    return ("WHEELS", "ENC_CPR", *(f"W{wheel + 1}_ENC_DIR" for wheel in range(wheels)))


def _play(robot: Robot, duty: Array) -> None:
    start = robot.connection.clock()
    for number, row in enumerate(duty):
        robot.set_duty(row.tolist())
        robot.pump(max(start + (number + 1) * PERIOD_S - robot.connection.clock(), 0.0))
        robot.guard.check()
