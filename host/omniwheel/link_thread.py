# SPDX-License-Identifier: MIT
"""A thread that serves a connection, so that a program may sleep and compute.

All reading, and every listener, is in this thread. It reads the link without the connection's monitor, and holds the
monitor while it hands out what came. A method of another thread holds the monitor too, and lets go of it only while it
waits (:meth:`LinkThread.await_messages`). So a method sees no message between two of its own waits, as if there were no
thread, and no answer comes between its request and its wait.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

from omniwheel.errors import LinkLostError, OmniError

SLICE_S = 0.05
"""Longest wait for bytes: something that is to be repeated from now on begins so late at most."""
_END_S = 6.0
"""A read ends after SLICE_S, a write after link.WRITE_TIMEOUT_S."""


class Served(Protocol):
    """What the thread needs of a connection."""

    @property
    def monitor(self) -> threading.Condition:
        """What guards it."""
        ...

    def send_due(self) -> float:
        """Send what is due; return the time until more is due [s]."""
        ...

    def read(self, timeout_s: float) -> bytes:
        """Read the link."""
        ...

    def feed(self, data: bytes) -> object:
        """Hand out the messages in these bytes."""
        ...

    def raise_in_pump(self, error: Exception) -> None:
        """Have the next pump raise this."""
        ...


class LinkThread:
    """Serves one connection from :meth:`start` to :meth:`stop`, or until the link is lost."""

    def __init__(self, served: Served) -> None:
        self._served = served
        self._monitor = served.monitor
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="omniwheel link", daemon=True)
        self._end: BaseException | None = None
        """Why it ended by itself."""

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread. Other threads that wait, or send from now on, get LinkLostError."""
        self._ending.set()
        if not self.is_current:
            self._thread.join(_END_S)
        self._end = self._end or LinkLostError("this program has closed the connection")
        with self._monitor:
            self._monitor.notify_all()

    @property
    def is_current(self) -> bool:
        """Whether this is called from the thread itself."""
        return threading.current_thread() is self._thread

    def check(self) -> None:
        """Raise what ended the thread, such as LinkLostError."""
        if isinstance(self._end, OmniError):
            raise copy_of(self._end)
        if self._end is not None:
            raise self._end

    def await_messages(self, timeout_s: float) -> None:
        """Let go of the monitor until messages have come, for ``timeout_s`` at most. Raises what ended the thread."""
        self.check()
        if timeout_s > 0.0:
            self._monitor.wait(timeout_s)
            self.check()

    def _run(self) -> None:
        try:
            while not self._ending.is_set():
                self._serve_once()
        except BaseException as error:
            self._end = error
        with self._monitor:
            self._monitor.notify_all()

    def _serve_once(self) -> None:
        with self._monitor:
            due_s = self._guarded(self._served.send_due)
        data = self._served.read(max(0.0, min(SLICE_S, due_s)))
        if data:
            with self._monitor:
                self._served.feed(data)
                self._monitor.notify_all()

    def _guarded(self, send_due: Callable[[], float]) -> float:
        """Send what is due. An error of a repeated action is that of the next method that waits; the link goes on."""
        try:
            return send_due()
        except LinkLostError:
            raise
        except OmniError as error:
            self._served.raise_in_pump(error)
            return SLICE_S


def copy_of(error: OmniError) -> OmniError:
    """Return an error to raise again: each raising has a traceback of its own."""
    again = type(error).__new__(type(error))
    again.args = error.args
    with suppress(AttributeError):
        vars(again).update(vars(error))
    return again
