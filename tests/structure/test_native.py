# SPDX-License-Identifier: MIT
"""The helper that builds C and C++ for tests."""

from __future__ import annotations

import faulthandler
import os
import signal
from contextlib import suppress

import pytest

from tests.native import untimed
from tests.waiting import wait_until


def test_a_build_takes_nothing_of_the_time_limit_of_the_test_that_needs_it() -> None:
    own_s, _ = signal.getitimer(signal.ITIMER_REAL)
    signal.setitimer(signal.ITIMER_REAL, 50.0)
    try:
        with untimed():
            assert signal.getitimer(signal.ITIMER_REAL)[0] == 0.0
        assert 49.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 50.0
    finally:
        signal.setitimer(signal.ITIMER_REAL, own_s)


@pytest.mark.parametrize("armed", [False, True])
def test_a_forked_test_builds_whatever_watches_its_parent(armed: bool) -> None:
    if armed:
        faulthandler.dump_traceback_later(50.0)
    child = os.fork()
    if child == 0:
        with untimed():
            os._exit(0)
    try:
        assert wait_until(lambda: ended(child), "the child's end", seconds=10.0) == (child, 0)
    finally:
        faulthandler.cancel_dump_traceback_later()
        with suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)


def ended(child: int) -> tuple[int, int] | None:
    """Return a child's number and status once it has ended."""
    found = os.waitpid(child, os.WNOHANG)
    return found if found[0] else None
