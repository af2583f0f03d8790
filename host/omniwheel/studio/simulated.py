# SPDX-License-Identifier: MIT
"""A simulated robot for the page: ``omni sitl`` as a child process."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence

from omniwheel.errors import FirmwareStartError

_END_S = 5.0


class SimulatedRobot:
    """A firmware with its world in real time, until :meth:`close`. Raises FirmwareStartError if it does not start."""

    def __init__(self, scenario: str, robot: str | None, seed: int) -> None:
        self.scenario = scenario
        command = [sys.executable, "-m", "omniwheel", "sitl", scenario, "--port", "0", "--json", "--seed", str(seed)]
        command.append("--end-with-stdin")  # it ends with this program, however that ends
        if robot:
            command += ["--robot", robot]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.url, self.robot = self._ready(command)

    def _ready(self, command: Sequence[str]) -> tuple[str, str]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        try:
            ready = json.loads(line)
            return str(ready["links"][0]), str(ready["robot"])
        except (ValueError, KeyError, IndexError, TypeError) as error:
            _, said = self._process.communicate()
            words = said.strip().splitlines()
            raise FirmwareStartError(words[0] if words else f"{' '.join(command)} did not start") from error

    @property
    def running(self) -> bool:
        """Whether it has not ended by itself."""
        return self._process.poll() is None

    def close(self) -> None:
        """End it."""
        self._process.terminate()
        try:
            self._process.communicate(timeout=_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
