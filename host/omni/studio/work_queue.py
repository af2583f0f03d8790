# SPDX-License-Identifier: MIT
"""What waits for the robot's thread, in order."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any, TypeVar

from omniwheel.errors import LinkError
from omniwheel.robot import Robot

T = TypeVar("T")
SETPOINT, DISARM, STOP = "setpoint", "disarm", "stop"
"""Kinds of work of which only the newest waits."""


@dataclass(frozen=True, eq=False)
class Work:
    """One thing to do with the robot, and who waits for it."""

    call: Callable[[Robot], Any]
    kind: str
    future: Future[Any] = field(default_factory=Future)


class WorkQueue:
    """First in, first out. Of setpoints only the newest waits: a robot must not follow old ones, one by one.

    Stops that wait for their confirmation are never dropped.
    """

    def __init__(self) -> None:
        self._waiting: deque[Work] = deque()
        self._lock = threading.Lock()

    def put(self, call: Callable[[Robot], T], *, kind: str = "") -> Future[T]:
        """Add something. Of a ``kind`` only the newest waits; the others count as done."""
        work = Work(call, kind)
        with self._lock:
            overtaken = [other for other in self._waiting if kind and other.kind == kind]
            for other in overtaken:
                self._waiting.remove(other)
            self._waiting.append(work)
        for other in overtaken:
            if other.future.set_running_or_notify_cancel():
                other.future.set_result(None)
        return work.future

    def get(self) -> Work | None:
        """Return the oldest job that was not abandoned, None if there is none."""
        while True:
            with self._lock:
                if not self._waiting:
                    return None
                work = self._waiting.popleft()
            if work.future.set_running_or_notify_cancel():  # not if the page that asked has gone
                return work

    def drop(self) -> None:
        """Forget everything that waits but stops, and tell those who asked."""
        with self._lock:
            dropped = [work for work in self._waiting if work.kind not in (DISARM, STOP)]
            for work in dropped:
                self._waiting.remove(work)
        for work in dropped:
            if work.future.set_running_or_notify_cancel():
                work.future.set_exception(LinkError("not done: cancelled by a stop or by loss of the link"))
