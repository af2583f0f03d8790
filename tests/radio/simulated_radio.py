# SPDX-License-Identifier: MIT
"""A ground station behind a modelled radio and a MemoryRobot behind the other end, all in simulated time."""

from __future__ import annotations

from omniwheel.radio_model import Radio, RadioSettings
from tests.radio.memory_robot import RADIO, TICK_S, MemoryRobot


class RadioLink:
    """A link whose reads make robot and radio go on, ``step_ticks`` at a time."""

    url = "radio"

    def __init__(self, robot: MemoryRobot, settings: RadioSettings, *, seed: int = 1, step_ticks: int = 2) -> None:
        self.radio = Radio(settings, seed)
        self._robot = robot
        self._step_ticks = step_ticks

    def clock_s(self) -> float:
        """Return the simulated time."""
        return self._robot.ticks * TICK_S

    def step(self) -> None:
        """Go on."""
        self._robot.run(self._step_ticks)
        now_s = self.clock_s()
        self._robot.write(RADIO, self.radio.up.take(now_s))
        self.radio.down.put(self._robot.read(RADIO), now_s)

    def read(self, timeout_s: float) -> bytes:
        """Return what has come; if there is nothing, wait up to ``timeout_s`` for it."""
        end_s = self.clock_s() + timeout_s
        while not (data := self.radio.down.take(self.clock_s())) and self.clock_s() < end_s:
            self.step()
        return data

    def write(self, data: bytes) -> None:
        """Send towards the robot."""
        self.radio.up.put(data, self.clock_s())

    def close(self) -> None:
        """Nothing to close."""
