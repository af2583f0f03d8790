# SPDX-License-Identifier: MIT
"""The helper that builds C and C++ for tests."""

from __future__ import annotations

import signal

from tests.native import untimed


def test_a_build_takes_nothing_of_the_time_limit_of_the_test_that_needs_it() -> None:
    own_s, _ = signal.getitimer(signal.ITIMER_REAL)
    signal.setitimer(signal.ITIMER_REAL, 50.0)
    try:
        with untimed():
            assert signal.getitimer(signal.ITIMER_REAL)[0] == 0.0
        assert 49.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 50.0
    finally:
        signal.setitimer(signal.ITIMER_REAL, own_s)
