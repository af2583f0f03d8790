# SPDX-License-Identifier: MIT
"""The robot that commands talk to if several share a line: what ``omni --system`` gives."""

from __future__ import annotations

LAST_SYSTEM = 254
"""The largest SYS_ID; 255 are ground stations."""
RENAMED_AFTER_S = 1.5
"""A robot that has another system id is silent under its old one for longer than its heartbeats are apart."""
_default_system: int | None = None


def set_default_system(number: int | None) -> None:
    """Have commands talk to the robot with this system id; None: to the only one there is."""
    global _default_system
    _default_system = number


def default_system() -> int | None:
    """Return the number of :func:`set_default_system`."""
    return _default_system
