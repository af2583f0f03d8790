# SPDX-License-Identifier: MIT
"""Answers that wait for one page, in a bounded buffer: a page that does not read takes no more memory than this."""

from __future__ import annotations

from collections import deque

MOST_ANSWERS = 64
MOST_BYTES = 8 << 20
"""More than a page with the largest plots asks for at once."""


class Outbox:
    """First in, first out. Full, it takes nothing more: for a page that does not read, only stops are done."""

    def __init__(self) -> None:
        self._answers: deque[str | bytes] = deque()
        self._size = 0

    @property
    def is_full(self) -> bool:
        """Whether it takes no more."""
        return len(self._answers) >= MOST_ANSWERS or self._size >= MOST_BYTES

    def put(self, answer: str | bytes) -> None:
        """Add an answer, if there is room."""
        if not self.is_full:
            self._answers.append(answer)
            self._size += len(answer)

    def pop(self) -> str | bytes | None:
        """Take the oldest answer out; None: there is none."""
        if not self._answers:
            return None
        answer = self._answers.popleft()
        self._size -= len(answer)
        return answer
