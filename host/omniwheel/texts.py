# SPDX-License-Identifier: MIT
"""The robot's status texts, kept so that a refusal can be given with the robot's own words."""

from __future__ import annotations

from collections import deque

from omniwheel.connection import Connection
from omniwheel.dialect import Message
from omniwheel.telemetry import StatusText, decode

KEPT = 200
REASON_WAIT_S = 0.3
_QUIET_SEVERITY = 6
HELD_BY = "held by station "
STOPPED_BY = ("stopped by station ", HELD_BY)
"""How the robot begins to say that another station ended a motion."""
TAKEN_OVER_BY = "taken over by station "
"""The same of one that began another motion. Its own program hears it, too."""


class TextLog:
    """The last status texts, and which of them came since a mark."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._texts: deque[StatusText] = deque(maxlen=KEPT)
        self._count = 0
        connection.add_listener(self._take)

    def _take(self, message: Message) -> None:
        text = decode(StatusText, message)
        if text is not None:
            self._texts.append(text)
            self._count += 1

    @property
    def all(self) -> tuple[StatusText, ...]:
        """The last texts, oldest first."""
        return tuple(self._texts)

    def mark(self) -> int:
        """Return a mark of now for :meth:`reasons_since`."""
        return self._count

    def since(self, mark: int) -> tuple[StatusText, ...]:
        """Return the texts that came after ``mark``."""
        return tuple(self._texts)[-(self._count - mark) :] if self._count > mark else ()

    def reasons_since(self, mark: int) -> tuple[str, ...]:
        """Return warnings and worse since ``mark``, waiting a moment for the first: replies overtake texts."""
        self._connection.wait(lambda _: bool(self._reasons(mark)), 0.0 if self._reasons(mark) else REASON_WAIT_S)
        return self._reasons(mark)

    def _reasons(self, mark: int) -> tuple[str, ...]:
        texts = (text.text for text in self.since(mark) if text.severity < _QUIET_SEVERITY)
        return tuple(dict.fromkeys(texts))  # what is tried again is refused again
