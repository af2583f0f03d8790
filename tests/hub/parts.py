# SPDX-License-Identifier: MIT
"""Real parts around a hub: a cable that can be unplugged, and the programs of this project as processes."""

from __future__ import annotations

import json
import os
import pty
import select
import subprocess
import sys
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from omniwheel.errors import LinkError
from omniwheel.link import open_link

PROGRAM = str(Path(sys.executable).with_name("omni"))
WAIT_S = 60.0


class Cable:
    """A pseudo-terminal in front of a robot's TCP port. ``path`` leads to its end while it is plugged in."""

    def __init__(self, robot: str, path: Path) -> None:
        self.path = path
        self._robot = open_link(robot)
        self._ends: tuple[int, int] | None = None
        self._lock = threading.Lock()
        self._done = threading.Event()
        self.plug_in()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def plug_in(self) -> None:
        """Connect, under the same name but as another device."""
        master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(master, False)
        with self._lock:
            self._ends = (master, slave)
        self.path.symlink_to(os.ttyname(slave))

    def unplug(self) -> None:
        """Disconnect: whoever has the port open loses it."""
        self.path.unlink()
        with self._lock:
            assert self._ends is not None
            for end in self._ends:
                os.close(end)
            self._ends = None

    def close(self) -> None:
        """End."""
        self._done.set()
        self._thread.join()
        self._robot.close()
        if self._ends is not None:
            self.unplug()

    def _run(self) -> None:
        while not self._done.is_set():
            ends: list[Any] = [] if self._ends is None else [self._ends[0]]
            with suppress(OSError, ValueError):  # unplugged meanwhile
                select.select([self._robot, *ends], [], [], 0.05)
            try:
                data = self._robot.read(0.0)
            except LinkError:
                return
            with self._lock:
                if self._ends is None:
                    continue
                with suppress(OSError):  # nobody has the port open, or nobody reads
                    os.write(self._ends[0], data)
                with suppress(OSError):
                    self._robot.write(os.read(self._ends[0], 65536))


@contextmanager
def omni(*words: str, first_line: bool = True) -> Iterator[tuple[subprocess.Popen[str], Any]]:
    """Run ``omni`` with these words; with ``first_line`` wait for its first line, which is JSON."""
    with subprocess.Popen([PROGRAM, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            yield process, json.loads(process.stdout.readline()) if first_line else None
        finally:
            process.kill()
            process.communicate(timeout=WAIT_S)
