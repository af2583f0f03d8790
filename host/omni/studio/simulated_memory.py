# SPDX-License-Identifier: MIT
"""The non-volatile memory of the simulated robots of one studio: a restarted simulation finds what was stored."""

from __future__ import annotations

import itertools
from pathlib import Path
from tempfile import TemporaryDirectory

from omni.studio.simulated import Simulation
from omniwheel import files


class SimulatedMemory:
    """A file for each choice of scenario, robot and processor, until :meth:`close`.

    A new robot starts before the one before has ended, and a firmware holds its file alone. So each gets a copy.
    """

    def __init__(self) -> None:
        self._folder: TemporaryDirectory[str] | None = None
        self._numbers = itertools.count(1)
        self._files: dict[tuple[str, ...], Path] = {}

    def copy_for(self, wanted: Simulation) -> Path:
        """Return a new file with what the last such robot has stored; it does not exist yet if there is nothing."""
        if self._folder is None:
            self._folder = TemporaryDirectory(prefix="omni-studio-")
        path = Path(self._folder.name) / f"{next(self._numbers)}.bin"
        last = self._files.get(_key(wanted))
        if last is not None and last.is_file():
            files.write_bytes(path, last.read_bytes())
        return path

    def keep(self, wanted: Simulation, path: Path) -> None:
        """Note that the robot with this file has started: the next such robot gets a copy of it."""
        self._files[_key(wanted)] = path

    def close(self) -> None:
        """Forget everything. The robots have ended before."""
        self._files.clear()
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None


def _key(wanted: Simulation) -> tuple[str, ...]:
    return wanted.scenario, wanted.robot or "", wanted.processor, wanted.image
