# SPDX-License-Identifier: MIT
"""Marks on the time axis: where parameters changed, by the robot's own count of its parameter sets."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

KEPT = 500
_TOGETHER_S = 0.5
"""A change and the new number of the parameter set that are no further apart belong together."""

Changes = Mapping[str, tuple[float, float]]


@dataclass
class Mark:
    """Something that happened at a time; ``changes`` {name: (before, after)}, empty if another program made it."""

    number: int
    time_s: float
    changes: dict[str, tuple[float, float]] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Return it as the page gets it."""
        return {"number": self.number, "time_s": self.time_s, "changes": {k: list(v) for k, v in self.changes.items()}}


class Marks:
    """Puts changes that the robot confirmed to the tick from which it used them."""

    def __init__(self) -> None:
        self._marks: deque[Mark] = deque(maxlen=KEPT)
        self._count = 0
        self._sequence: int | None = None
        self._waiting: dict[str, tuple[float, float]] = {}
        self._waiting_since_s = 0.0

    def all(self) -> list[Mark]:
        """Return the marks, oldest first."""
        return list(self._marks)

    def changed(self, changes: Changes, now_s: float) -> Mark | None:
        """Take changes that the robot confirmed; return the mark that they fill in, if it is there already."""
        last = self._marks[-1] if self._marks else None
        if last is not None and not last.changes and now_s - last.time_s <= _TOGETHER_S:
            last.changes.update(changes)
            return last
        if not self._waiting:
            self._waiting_since_s = now_s
        self._waiting.update(changes)
        return None

    def sequence(self, number: int, time_s: float) -> Mark | None:
        """Take the number of the parameter set in use; return a new mark if it is another one than before."""
        before, self._sequence = self._sequence, number
        if before is None or before == number:
            return None
        changes, self._waiting = self._waiting, {}
        return self._add(time_s, changes)

    def overdue(self, now_s: float) -> Mark | None:
        """Return a mark for changes whose number has not come: telemetry may be off, or the link slow."""
        if not self._waiting or now_s - self._waiting_since_s <= _TOGETHER_S:
            return None
        changes, self._waiting = self._waiting, {}
        return self._add(self._waiting_since_s, changes)

    def _add(self, time_s: float, changes: dict[str, tuple[float, float]]) -> Mark:
        self._count += 1
        mark = Mark(self._count, time_s, dict(changes))
        self._marks.append(mark)
        return mark
