# SPDX-License-Identifier: MIT
"""A link through a hub, in simulated time: the robot's own link on one side, any number of clients on the other."""

from __future__ import annotations

from typing import Any

from omni.hub.core import Hub
from tests.hub.bench import WIDE


class BehindHub:
    """The link of the first client. ``robot`` is the link that advances the simulation when it is read."""

    url = "hub"

    def __init__(self, robot: Any, name: str) -> None:
        self.hub = Hub(WIDE, robot.clock_s)
        self.hub.port_opened()
        self._robot = robot
        self._number = self.hub.join(name)

    def read(self, timeout_s: float) -> bytes:
        """Let the simulation go on; return what the hub has for the first client."""
        self._serve()
        self.hub.from_port(self._robot.read(timeout_s))
        self._serve()
        return self.hub.to_client(self._number)

    def write(self, data: bytes) -> None:
        """Give the hub what the first client sends."""
        self.hub.from_client(self._number, data)
        self._serve()

    def clock_s(self) -> float:
        """Return the simulated time."""
        return float(self._robot.clock_s())

    def close(self) -> None:
        """Leave the robot's link open: it is the test's."""

    def _serve(self) -> None:
        while frame := self.hub.to_port():
            self._robot.write(frame)
