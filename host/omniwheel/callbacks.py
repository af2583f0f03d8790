# SPDX-License-Identifier: MIT
"""Calls a program's callbacks in a thread of their own, so that a slow one holds up neither link nor heartbeat."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, Full, Queue

from omniwheel.connection import Connection

WAITING = 10_000
"""Calls that wait at most; what comes while so many wait is dropped, with one warning."""
_END_S = 2.0


def warn_of_drops(cause: str, kept: int) -> None:
    """Warn that telemetry is dropped because a program takes it too slowly."""
    warnings.warn(
        f"{cause}: {kept} messages wait, further ones are dropped; take less time, or lower the rate: "
        "set_message_interval(name, hz)",
        RuntimeWarning,
        stacklevel=2,
    )


class Callbacks:
    """The thread; it starts with the first call."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._calls: Queue[Callable[[], object] | None] = Queue(WAITING)
        self._has_warned = False
        self._thread = threading.Thread(target=self._run, name="omniwheel callbacks", daemon=True)
        self._thread.start()

    def call(self, action: Callable[[], object]) -> None:
        """Have ``action`` called soon."""
        try:
            self._calls.put_nowait(action)
        except Full:
            if not self._has_warned:
                self._has_warned = True
                warn_of_drops("callbacks are slower than the telemetry", WAITING)

    def close(self) -> None:
        """End the thread after the call that is under way."""
        with suppress(Empty):
            while True:
                self._calls.get_nowait()
        self._calls.put(None)
        if threading.current_thread() is not self._thread:
            self._thread.join(_END_S)

    def _run(self) -> None:
        while (action := self._calls.get()) is not None:
            try:
                action()
            except Exception as error:  # the program's own: it hears of it where it pumps
                self._connection.raise_in_pump(error)
