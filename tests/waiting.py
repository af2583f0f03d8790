# SPDX-License-Identifier: MIT
"""Waiting for another process or thread: the one place where tests read the wall clock.

A deadline only ends a test that would hang; no verdict depends on the speed of the machine. It is shorter than a test's
time limit (``timeout`` in pyproject.toml), so that the failure names what was waited for.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")
LONGEST_S = 50.0
PAUSE_S = 0.02


class Deadline:
    """One deadline for a whole wait, however many messages or attempts it takes. ``what`` is missing if it passes."""

    def __init__(self, what: object, seconds: float = LONGEST_S) -> None:
        self._what = what
        self._seconds = seconds
        self._end_s = time.monotonic() + seconds

    def left_s(self) -> float:
        """Return the time left [s], as the timeout of one step. Raises AssertionError when it is over."""
        left_s = self._end_s - time.monotonic()
        if left_s <= 0.0:
            what = self._what() if callable(self._what) else self._what
            raise AssertionError(f"{what} (waited {self._seconds:g} s)")
        return left_s


def pass_time(seconds: float = PAUSE_S) -> None:
    """Let time pass for programs under test: between two attempts, or because their own timers are the subject."""
    time.sleep(seconds)


def wait_until(
    condition: Callable[[], T], what: object, *, pause: Callable[[], object] = pass_time, seconds: float = LONGEST_S
) -> T:
    """Return the first true value of ``condition``, which is called with a ``pause`` in between.

    ``what`` says what did not happen; a function is called for it at the end.
    """
    deadline = Deadline(what, seconds)
    while not (found := condition()):
        deadline.left_s()
        pause()
    return found


def receive_until(
    receive: Callable[[float], T], wanted: Callable[[T], bool], what: object, *, seconds: float = LONGEST_S
) -> T:
    """Return the first message that is ``wanted``. ``receive`` takes the time [s] in which a message must come."""
    deadline = Deadline(what, seconds)
    while True:
        try:
            message = receive(deadline.left_s())
        except TimeoutError:
            continue  # the deadline's own words
        if wanted(message):
            return message


class Stopwatch:
    """For lower bounds only: a program that lives slower than real time. A busy machine cannot break those."""

    def __init__(self) -> None:
        self._begin_s = time.monotonic()

    @property
    def passed_s(self) -> float:
        """Time since it was made [s]."""
        return time.monotonic() - self._begin_s
