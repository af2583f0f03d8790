# SPDX-License-Identifier: MIT
"""Fetches a log that the robot keeps in its memory: MAVLink's log protocol, as ground stations speak it.

The robot sends pieces of 90 bytes; pieces that were lost are asked for again. What comes twice does no harm.
"""

from __future__ import annotations

from collections.abc import Callable

from omniwheel.connection import Connection
from omniwheel.dialect import Message, mavlink
from omniwheel.errors import LinkTimeoutError, LogError

PIECE = 90
PATIENCE_S = 1.5
"""Silence after which what is missing is asked for once more."""
TRIES = 20
"""Requests in a row that nothing came of."""
MOST_BYTES = 1 << 24
_ALL = 0xFFFF

Progress = Callable[[int, int], None]
"""Called with the bytes that have come and with all there are."""


class LogDownload:
    """Fetches the robot's logs over one connection."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    @property
    def _target(self) -> tuple[int, int]:
        return self._connection.target_system, self._connection.target_component

    def size(self) -> int:
        """Return how many bytes the robot's newest log has; 0: there is none, or it is not finished."""
        for _ in range(TRIES):
            self._connection.send(mavlink.MAVLink_log_request_list_message(*self._target, 0, _ALL))
            entry = self._connection.wait(lambda m: m.get_type() == "LOG_ENTRY", PATIENCE_S)
            if entry is not None:
                return int(entry.size) if entry.num_logs else 0
        raise LinkTimeoutError("the robot does not respond to the log list request")

    def await_log(self, timeout_s: float) -> int:
        """Return the size of the newest log as soon as it is finished. Raises LogError if that takes too long."""
        end = self._connection.clock() + timeout_s
        while True:
            size = self.size()
            if size > 0:
                return size
            if self._connection.clock() >= end:
                raise LogError(
                    f"the robot has no finished log after {timeout_s:g} s", hint="check that a log was started"
                )
            self._connection.pump(0.05)

    def fetch(self, size: int, progress: Progress | None = None) -> bytes:
        """Return the log's bytes. Raises LogError, or LinkTimeoutError if the robot goes silent."""
        if size > MOST_BYTES:
            raise LogError(f"the robot's log has {size} bytes, which is impossible")
        pieces: dict[int, bytes] = {}
        remove = self._connection.add_listener(lambda m: _keep(m, pieces, size))
        total = -(-size // PIECE)
        tries = 0
        try:
            while len(pieces) < total:
                tries = self._round(pieces, size, tries)
                if progress is not None:
                    progress(min(len(pieces) * PIECE, size), size)
        finally:
            remove()
            self._connection.send(mavlink.MAVLink_log_request_end_message(*self._target))
        return b"".join(pieces[i] for i in range(total))

    def _round(self, pieces: dict[int, bytes], size: int, tries: int) -> int:
        """Ask for the first gap, and take what comes of it; return how many rounds in a row brought nothing."""
        total, before = -(-size // PIECE), len(pieces)
        first = next(i for i in range(total) if i not in pieces)
        last = next((i for i in range(first, total) if i in pieces), total)
        request = mavlink.MAVLink_log_request_data_message(*self._target, 0, first * PIECE, (last - first) * PIECE)
        self._connection.send(request)
        while last - 1 not in pieces:
            if self._connection.wait(lambda m: m.get_type() == "LOG_DATA", PATIENCE_S) is None:
                break
        if len(pieces) > before:
            return 0
        if tries >= TRIES:
            raise LinkTimeoutError("the robot stopped sending its log", hint="check its power and the link")
        return tries + 1


def _keep(message: Message, pieces: dict[int, bytes], size: int) -> None:
    if message.get_type() != "LOG_DATA" or message.id != 0 or message.ofs % PIECE or message.ofs >= size:
        return
    if message.count == min(PIECE, size - message.ofs):
        pieces[message.ofs // PIECE] = bytes(message.data[: message.count])
