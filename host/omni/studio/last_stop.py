# SPDX-License-Identifier: MIT
"""Why the robot stopped, kept until it is armed again: its faults may be gone a moment later."""

from __future__ import annotations

import re
from typing import Any

from omniwheel.status import RobotStatus
from omniwheel.telemetry import StatusText

_CRITICAL = 2
"""Severity of the texts with which a robot explains a stop."""
_MOST_TEXTS = 8
_WHEEL = re.compile(r"\b(?:wheel|motor) (\d+)")
_FAILSAFE = "failsafe: "
_STOPPED = ("failsafe", "estop")


class LastStop:
    """Watches a robot's state and texts; one object per connection."""

    def __init__(self) -> None:
        self._texts: list[str] = []
        self._state = ""
        self._faults: tuple[str, ...] = ()

    def take(self, text: StatusText) -> None:
        """Keep a text that explains a stop. The robot may send it before or after its new state."""
        if text.severity <= _CRITICAL and text.text not in (*self._texts, *_STOPPED):
            self._texts = [*self._texts, text.text][-_MOST_TEXTS:]

    def update(self, status: RobotStatus) -> None:
        """Note a stop; forget it when the robot is armed."""
        if status.state == "armed":
            self._state, self._texts, self._faults = "", [], ()
        elif status.state in _STOPPED and self._state != status.state:
            self._state, self._faults = status.state, status.faults

    def as_json(self) -> dict[str, Any] | None:
        """Return what stopped the robot: state, cause, wheel, and values at the stop; None if nothing did."""
        if not self._state:
            return None
        causes = [text.removeprefix(_FAILSAFE) for text in self._texts if text.startswith(_FAILSAFE)]
        values = [text for text in self._texts if not text.startswith(_FAILSAFE)]
        wheel = next((int(found[1]) for found in map(_WHEEL.search, values) if found), None)
        cause = ", ".join(dict.fromkeys(causes)) or ", ".join(self._faults)
        return {"state": self._state, "cause": cause, "wheel": wheel, "values": values}
