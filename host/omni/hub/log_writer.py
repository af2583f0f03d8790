# SPDX-License-Identifier: MIT
"""Log lines to standard error from a program that must not block on it."""

from __future__ import annotations

import os
import queue
import threading
import time
from contextlib import suppress

STDERR = 2
MOST_LINES = 1000
"""Capacity of the queue; further lines are dropped."""
LAST_S = 0.5
"""Time limit for writing the last lines at the end of a program."""


class LogWriter:
    """Writes lines to standard error in a thread of its own.

    So a terminal paused with Ctrl-S, a waiting pager or a full disk delays no stop.
    """

    def __init__(self) -> None:
        self._lines: queue.Queue[str] = queue.Queue(MOST_LINES)
        threading.Thread(target=self._run, daemon=True).start()

    def write(self, line: str) -> None:
        """Queue a line."""
        with suppress(queue.Full):
            self._lines.put_nowait(line)

    def close(self) -> None:
        """Wait up to LAST_S for the last lines."""
        end_s = time.monotonic() + LAST_S
        while self._lines.unfinished_tasks and time.monotonic() < end_s:
            time.sleep(0.01)

    def _run(self) -> None:
        while True:
            data = f"{self._lines.get()}\n".encode(errors="replace")
            with suppress(OSError):  # closed by its reader, or the disk is full
                while data:
                    data = data[os.write(STDERR, data) :]
            self._lines.task_done()
