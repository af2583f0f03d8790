# SPDX-License-Identifier: MIT
"""How often messages come at their rate at boot, which the robot does not tell: measured on its own clock."""

from __future__ import annotations

from collections import deque
from statistics import median

from omniwheel.dialect import mavlink

STATUS, STATE, WHEELS = 2, 6, 10
"""Groups of REQUEST_DATA_STREAM; 0 is all of them."""
_NAMES = {
    STATUS: ("SYS_STATUS", "OMNI_STATUS", "OMNI_HEALTH", "BATTERY_STATUS"),
    STATE: ("LOCAL_POSITION_NED", "ATTITUDE", "OMNI_TRACKING", "POSITION_TARGET_LOCAL_NED", "ODOMETRY"),
    WHEELS: ("OMNI_WHEELS", "OMNI_CONTROL"),
}
GROUPS = {
    group: tuple(int(getattr(mavlink, f"MAVLINK_MSG_ID_{name}")) for name in names) for group, names in _NAMES.items()
}
"""The messages of each group (shared/link/telemetry.toml)."""
AT_BOOT = frozenset(number for numbers in GROUPS.values() for number in numbers)
"""Messages that may come without being asked for."""
LEARN_S = 3.0
"""A message that does not come in this time while it has its rate at boot is not streamed at boot."""
LEARN_SLOW_S = 15.0
"""... and one that comes once, but not twice in this time, neither."""
_KEPT = 8
_NEEDED = 2
NEVER_US = float("inf")


def messages_of(group: int) -> tuple[int, ...]:
    """Return the messages of a group of REQUEST_DATA_STREAM; none of a group that the robot does not know."""
    return tuple(AT_BOOT) if group == 0 else GROUPS.get(group, ())


class BootRates:
    """Intervals of the messages that come at their rate at boot."""

    def __init__(self) -> None:
        self._boot_ms: dict[int, deque[int]] = {}
        self._learning_since_s: dict[int, float] = {}

    def hear(self, message: int, boot_ms: int) -> None:
        """Take note of a message that has come at its rate at boot; ``boot_ms`` is the robot's clock."""
        heard = self._boot_ms.setdefault(message, deque(maxlen=_KEPT))
        if heard and boot_ms < heard[-1]:
            heard.clear()
        heard.append(boot_ms)

    def is_heard(self, message: int) -> bool:
        """Return whether a message has come at its rate at boot."""
        return message in self._boot_ms

    def interval_us(self, message: int, now_s: float) -> float | None:
        """Return how often a message comes at boot; NEVER_US: not at all; None: not known yet, ask again.

        The median of the last intervals: lost and requested messages make single ones wrong.
        """
        heard = self._boot_ms.get(message, deque())
        if len(heard) >= _NEEDED:
            return 1e3 * median(after - before for before, after in zip(list(heard), list(heard)[1:], strict=False))
        learnt_s = now_s - self._learning_since_s.setdefault(message, now_s)
        unknown = message in AT_BOOT and learnt_s < (LEARN_SLOW_S if heard else LEARN_S)
        return None if unknown else NEVER_US
