# SPDX-License-Identifier: MIT
"""Single key presses from the terminal, and what they mean for driving."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from omniwheel.errors import OmniError
from omniwheel.frames import Twist

HOLD_S = 0.6
"""A key counts as held for this long, because terminals report presses and repeats but no releases."""

KEYS_HELP = "w/s forward, back   a/d left, right   q/e turn   space stop   x end"

_DIRECTIONS = {
    "w": (1, 0, 0),
    "s": (-1, 0, 0),
    "a": (0, 1, 0),
    "d": (0, -1, 0),
    "q": (0, 0, 1),
    "e": (0, 0, -1),
    " ": (0, 0, 0),
}
_END_KEYS = ("x", "\x1b", "\x03", "\x04")


class NoTerminalError(OmniError):
    """Standard input is no terminal."""

    exit_code = 2


class KeyDriver:
    """Turns key presses into a body velocity that stops soon after the last press."""

    def __init__(self, speed_m_s: float, turn_rad_s: float) -> None:
        self._speed = speed_m_s
        self._turn = turn_rad_s
        self._direction = (0, 0, 0)
        self._pressed_s = float("-inf")

    def take(self, key: str, now_s: float) -> bool:
        """Take a key ("" for none); return False when it ends the drive. An unknown key stops the robot."""
        if key in _END_KEYS and key:
            return False
        if key:
            self._direction = _DIRECTIONS.get(key.lower(), (0, 0, 0))
            self._pressed_s = now_s
        return True

    def twist(self, now_s: float) -> Twist:
        """Return the body velocity wanted now."""
        if now_s - self._pressed_s > HOLD_S:
            return Twist(0.0, 0.0, 0.0)
        x, y, turn = self._direction
        return Twist(x * self._speed, y * self._speed, turn * self._turn)


@contextmanager
def raw_keys() -> Iterator[Callable[[], str]]:
    """Give a function that returns the key pressed since the last call, "" if none; the terminal is restored after."""
    if not sys.stdin.isatty():
        raise NoTerminalError("driving with keys needs a terminal", hint="use `omni drive velocity` in scripts")
    if sys.platform == "win32":
        import msvcrt

        yield lambda: msvcrt.getwch() if msvcrt.kbhit() else ""
        return
    import select
    import termios
    import tty

    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin)
    try:
        yield lambda: sys.stdin.read(1) if select.select([sys.stdin], [], [], 0)[0] else ""
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
