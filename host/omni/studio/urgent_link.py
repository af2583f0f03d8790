# SPDX-License-Identifier: MIT
"""A link on which a stop from another thread waits for nothing."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from omniwheel.link import Link

SLICE_S = 0.004
"""How long a stop waits at most while the link is being read."""


class UrgentLink:
    """Wraps a link and reads it in short slices. Between two slices it does what is urgent.

    Whatever the thread that owns the link waits for, an answer or a whole list of parameters, it waits by reading.
    """

    def __init__(self, link: Link) -> None:
        self.url = link.url
        self._link = link
        self._urgent: list[Callable[[], None]] = []
        self._lock = threading.Lock()
        self.between: Callable[[], None] | None = None
        """Called between two slices by the thread that reads. What it raises ends whatever is waited for."""

    @property
    def notice(self) -> str:
        """What the user should know of this link, such as that other programs share it."""
        return str(getattr(self._link, "notice", ""))

    def interrupt(self, action: Callable[[], None]) -> None:
        """Have ``action`` called by the thread that reads, before it waits again. From any thread."""
        with self._lock:
            self._urgent.append(action)

    def read(self, timeout_s: float) -> bytes:
        """Return what has come, waiting up to ``timeout_s``; what is urgent is done first."""
        end_s = time.monotonic() + timeout_s
        while True:
            self._do_urgent()
            if self.between is not None:
                self.between()
            left_s = end_s - time.monotonic()
            data = self._link.read(max(0.0, min(left_s, SLICE_S)))
            if data or left_s <= SLICE_S:
                return data

    def write(self, data: bytes) -> None:
        """Send all of ``data``."""
        self._link.write(data)

    def close(self) -> None:
        """Close the link."""
        self._link.close()

    def _do_urgent(self) -> None:
        while True:
            with self._lock:
                if not self._urgent:
                    return
                action = self._urgent.pop(0)
            action()  # what it raises leaves the others for the next read
