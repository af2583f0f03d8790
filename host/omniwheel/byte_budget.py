# SPDX-License-Identifier: MIT
"""How much a slow radio may be given: a leaky bucket of bytes, and a link that fills it with all it sends."""

from __future__ import annotations

from collections.abc import Callable

from omniwheel.link import Link

BITS_PER_BYTE = 10
"""On a serial line with one start and one stop bit."""


class ByteBudget:
    """At most ``bytes_s`` bytes per second in the long run and ``burst_bytes`` at once.

    In any time t no more than ``burst_bytes + bytes_s t`` bytes are admitted. What waits in a modem is then never more
    than ``burst_bytes``, so that nothing grows old in a queue. ``clock`` gives seconds.
    """

    def __init__(self, bytes_s: float, burst_bytes: float, clock: Callable[[], float]) -> None:
        if not (bytes_s > 0.0 and burst_bytes > 0.0):
            raise ValueError(f"a budget of {bytes_s} B/s and {burst_bytes} B at once; both must be positive")
        self.bytes_s = bytes_s
        self.burst_bytes = burst_bytes
        self._clock = clock
        self._level = 0.0
        self._drained_s = clock()

    def admits(self, count: int) -> bool:
        """Return whether ``count`` bytes may be sent now."""
        return self._drain() + count <= self.burst_bytes

    def charge(self, count: int) -> None:
        """Take note of ``count`` bytes sent, admitted or not."""
        self._level = self._drain() + count

    def _drain(self) -> float:
        now_s = self._clock()
        self._level = max(0.0, self._level - self.bytes_s * (now_s - self._drained_s))
        self._drained_s = now_s
        return self._level


class MeteredLink:
    """A link whose written bytes are all counted and charged to a budget."""

    def __init__(self, base: Link, budget: ByteBudget) -> None:
        self.url = base.url
        self.bytes_written = 0
        self._base = base
        self._budget = budget

    def read(self, timeout_s: float) -> bytes:
        """Return what has come, b"" if nothing did in time."""
        return self._base.read(timeout_s)

    def write(self, data: bytes) -> None:
        """Send all of ``data``."""
        self._base.write(data)
        self.bytes_written += len(data)
        self._budget.charge(len(data))

    def close(self) -> None:
        """Close the link."""
        self._base.close()
