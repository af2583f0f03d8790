# SPDX-License-Identifier: MIT
"""A robot's line that never pauses, for tests of what a program keeps over hours."""

from __future__ import annotations

import gc
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from omni.studio.signals import KINDS
from omniwheel.dialect import Message, mavlink
from omniwheel.telemetry import Fix

HELD_BYTES = 5
"""Of the last frame, which come with the next piece."""
ROUND_S = 2.4
"""Robot's time between two rounds of messages."""
SPOKEN = ("HEARTBEAT", "STATUSTEXT", *(kind.message for kind in KINDS))
_IDS = {kind.msgname: number for number, kind in mavlink.mavlink_map.items()}


def blank(name: str, **fields: float | bytes) -> Message:
    """Return a message of this name with these fields; all others are 0."""
    kind = mavlink.mavlink_map[_IDS[name]]
    values: dict[str, object] = {}
    for field, type_name, length in zip(kind.fieldnames, kind.fieldtypes, _lengths(kind), strict=True):
        values[field] = b"" if type_name == "char" else [0] * length if length else 0
    message: Message = kind(**{**values, **fields})
    return message


def _lengths(kind: type) -> list[int]:
    """Return the arrays' lengths in the order of the names, 0 for a single number."""
    return [kind.array_lengths[kind.ordered_fieldnames.index(name)] for name in kind.fieldnames]  # type: ignore[attr-defined]


class NeverPausing:
    """What one robot says, in pieces that end inside a frame, as they do on a line that is always busy."""

    def __init__(self) -> None:
        self._codec = mavlink.MAVLink(None, 1, 1)
        self._held = b""
        self._round = 0
        self.sent_bytes = 0

    def piece(self) -> bytes:
        """Return the next piece: the end of the frame before, and a round of messages without its last bytes."""
        self._round += 1
        time_ms = round(1000 * ROUND_S * self._round)
        frames = self._held + b"".join(self._frame(name, time_ms) for name in SPOKEN)
        self._held = frames[-HELD_BYTES:]
        self.sent_bytes += len(frames) - HELD_BYTES
        return frames[:-HELD_BYTES]

    def _frame(self, name: str, time_ms: int) -> bytes:
        fields: dict[str, float | bytes] = {}
        names = mavlink.mavlink_map[_IDS[name]].fieldnames
        if "time_boot_ms" in names:
            fields["time_boot_ms"] = time_ms
        if name == Fix.message:
            fields["number"] = self._round
        if name == "STATUSTEXT":
            fields = {"severity": 6, "text": b"round %d" % self._round}
        frame = bytes(blank(name, **fields).pack(self._codec))
        self._codec.seq = (self._codec.seq + 1) % 256
        return frame


@contextmanager
def traced() -> Iterator[Callable[[], int]]:
    """Count memory while the context lasts; the function returns how many bytes there are."""

    def held() -> int:
        gc.collect()
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        yield held
    finally:
        tracemalloc.stop()


def growth(take: Callable[[bytes], None], rounds: int, first: int = 300) -> int:
    """Return by how many bytes the program grows in so many rounds, after the ``first`` that fill what has a size."""
    line = NeverPausing()
    with traced() as held:
        for _ in range(first):
            take(line.piece())
        before = held()
        for _ in range(rounds):
            take(line.piece())
        return held() - before


class SilentLink:
    """A link on which nothing comes; what is sent goes nowhere."""

    url = "tcp:127.0.0.1:5760"

    def read(self, timeout_s: float) -> bytes:
        """Return nothing."""
        return b""

    def write(self, data: bytes) -> None:
        """Forget it."""

    def close(self) -> None:
        """Do nothing."""
