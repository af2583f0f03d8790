# SPDX-License-Identifier: MIT
"""Lines for a person from a program that must not wait for one."""

from __future__ import annotations

import os
import queue
import threading
import time
from contextlib import suppress

STDERR = 2
MOST_LINES = 1000
"""That wait; what is said beyond them is lost."""
LAST_S = 0.5
"""How long the end of a program waits for its last lines."""


class Diary:
    """Writes lines to standard error in a thread of its own.

    A terminal that was paused with Ctrl-S, a pager that nobody scrolls or a full disk then holds up no stop.
    """

    def __init__(self) -> None:
        self._lines: queue.Queue[str] = queue.Queue(MOST_LINES)
        threading.Thread(target=self._run, daemon=True).start()

    def say(self, line: str) -> None:
        """Write a line soon."""
        with suppress(queue.Full):
            self._lines.put_nowait(line)

    def close(self) -> None:
        """Give what was said last a moment to be written."""
        end_s = time.monotonic() + LAST_S
        while self._lines.unfinished_tasks and time.monotonic() < end_s:
            time.sleep(0.01)

    def _run(self) -> None:
        while True:
            data = f"{self._lines.get()}\n".encode(errors="replace")
            with suppress(OSError):  # nobody reads it any more, or there is no room
                while data:
                    data = data[os.write(STDERR, data) :]
            self._lines.task_done()
