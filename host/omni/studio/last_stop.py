# SPDX-License-Identifier: MIT
"""Why the robot stopped, kept until it is armed again: its faults may be gone a moment later."""

from __future__ import annotations

import re
from typing import Any

from omniwheel.telemetry import Status, StatusText

_CRITICAL = 2
"""Severity of the texts with which a robot explains a stop."""
_MOST_TEXTS = 8
_WHEEL = re.compile(r"\b(?:wheel|motor) (\d+)")
_FAILSAFE = "failsafe: "
_STOPPED = ("failsafe", "estop")


class LastStop:
    """Watches a robot's state and texts; one object per robot."""

    def __init__(self) -> None:
        self._state = ""
        self._faults: tuple[str, ...] = ()
        self._texts: list[str] = []
        self._present = ""
        self._early: list[str] = []
        """Texts since the last status message: they explain a stop only if the next one tells of it."""

    def take(self, text: StatusText) -> None:
        """Keep a text that explains a stop. The robot may send it before or after its new state."""
        if text.severity > _CRITICAL or text.text in _STOPPED:
            return
        if self._present in _STOPPED:
            self._texts = _with(self._texts, text.text)
        else:
            self._early = _with(self._early, text.text)

    def expect_status(self) -> None:
        """Begin a connection to the same robot: its first texts explain no stop that is known already."""
        self._present, self._early = "", []

    def update(self, status: Status) -> None:
        """Note a stop; forget it when the robot is armed. Call it for each status message: a drive may be short."""
        if status.state == "armed":
            self._state, self._texts, self._faults = "", [], ()
        before = self._present or self._state
        if status.state in _STOPPED and status.state != before:
            if before not in _STOPPED:
                self._texts = self._early
            self._state, self._faults = status.state, status.faults
        self._present, self._early = status.state, []

    def as_json(self) -> dict[str, Any] | None:
        """Return what stopped the robot: state, cause, wheel, and values at the stop; None if nothing did."""
        if not self._state:
            return None
        failsafes = [text.removeprefix(_FAILSAFE) for text in self._texts if text.startswith(_FAILSAFE)]
        causes = [fault for text in failsafes for fault in text.split(", ")]  # each text names all so far
        values = [text for text in self._texts if not text.startswith(_FAILSAFE)]
        wheel = next((int(found[1]) for found in map(_WHEEL.search, values) if found), None)
        cause = ", ".join(dict.fromkeys(causes)) or ", ".join(self._faults)
        return {"state": self._state, "cause": cause, "wheel": wheel, "values": values}


def _with(texts: list[str], text: str) -> list[str]:
    return texts if text in texts else [*texts, text][-_MOST_TEXTS:]
