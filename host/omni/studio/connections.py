# SPDX-License-Identifier: MIT
"""Connections to the studio's web server, bounded: idle ones must not use up the file descriptors of a stop."""

from __future__ import annotations

import asyncio
import itertools
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

FIRST_REQUEST_S = 10.0
"""A connection whose first request is not whole by then is closed."""
MOST_CONNECTIONS = 200
"""For one more, the idle one that was opened first is closed."""
_order = itertools.count()


class BoundedProtocol(H11Protocol):  # type: ignore[misc]
    """An HTTP connection; one that becomes a page's socket is not counted here any more."""

    def connection_made(self, transport: asyncio.Transport) -> None:
        """Take a connection, and close the oldest idle one if there are too many."""
        super().connection_made(transport)
        self._opened = next(_order)
        self._deadline = self.loop.call_later(FIRST_REQUEST_S, self._close_if_unused)
        if len(self.connections) > MOST_CONNECTIONS:
            others = [one for one in self.connections if isinstance(one, BoundedProtocol) and one is not self]
            idle = [one for one in others if one.is_idle]
            oldest = min(idle, key=lambda one: one._opened, default=self)
            self.connections.discard(oldest)  # its end comes later: the next one looks for another
            oldest.transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        """Handle the connection's end."""
        self._deadline.cancel()
        super().connection_lost(exc)

    @property
    def is_idle(self) -> bool:
        """Whether no request is under way."""
        return self.cycle is None or bool(self.cycle.response_complete)

    def _close_if_unused(self) -> None:
        if self.cycle is None and self in self.connections:
            self.transport.close()


def bounded() -> dict[str, Any]:
    """Return uvicorn's settings for these connections. Few are accepted in one go, so that idle ones close first."""
    return {"http": BoundedProtocol, "backlog": MOST_CONNECTIONS // 4}
