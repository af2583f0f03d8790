# SPDX-License-Identifier: MIT
"""Single key presses from the terminal, and what they mean for driving."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from omniwheel.errors import OmniError
from omniwheel.frames import Twist

HOLD_S = 0.6
"""A key counts as held for this long, because terminals report presses and repeats but no releases."""

KEYS_HELP = "w/s or up/down forward, back   a/d or left/right sideways   q/e turn   space stop   x or Esc end"

_DIRECTIONS = {
    "w": (1, 0, 0),
    "s": (-1, 0, 0),
    "a": (0, 1, 0),
    "d": (0, -1, 0),
    "q": (0, 0, 1),
    "e": (0, 0, -1),
    " ": (0, 0, 0),
}
_ARROWS = {"A": "w", "B": "s", "D": "a", "C": "d"}
"""Last letter of an arrow key's escape sequence (ESC [ A or ESC O A): the key of the same direction."""
_ESCAPE = "\x1b"
_SEQUENCE_S = 0.05
"""A terminal sends the rest of an arrow key at once; ESC alone is the key Esc."""
_END_KEYS = ("x", "\x1b", "\x03", "\x04")
_KEY = re.compile(r"\x1b[\[O][0-9;]*[A-Za-z~]|.", re.DOTALL)


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
            self._direction = _DIRECTIONS.get(letter_of(key), (0, 0, 0))
            self._pressed_s = now_s
        return True

    def twist(self, now_s: float) -> Twist:
        """Return the body velocity wanted now."""
        if now_s - self._pressed_s > HOLD_S:
            return Twist(0.0, 0.0, 0.0)
        x, y, turn = self._direction
        return Twist(x * self._speed, y * self._speed, turn * self._turn)


def letter_of(key: str) -> str:
    """Return the letter that a key stands for: an arrow's is the one of the same direction."""
    return _ARROWS.get(key[-1], "") if key.startswith(_ESCAPE) and len(key) > 1 else key.lower()


def split_keys(typed: str) -> list[str]:
    """Split what a terminal sent into keys: an escape sequence is one key, everything else a key per character."""
    return _KEY.findall(typed)


@contextmanager
def raw_keys() -> Iterator[Callable[[], str]]:
    """Give a function that returns the key pressed since the last call, "" if none; the terminal is restored after."""
    if not sys.stdin.isatty():
        raise NoTerminalError("driving with keys needs a terminal", hint="use `omni drive velocity` in scripts")
    if sys.platform == "win32":
        import msvcrt

        yield lambda: msvcrt.getwch() if msvcrt.kbhit() else ""
        return
    import termios
    import tty

    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin)
    try:
        yield _Keys(sys.stdin.fileno()).next
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


class _Keys:
    """Reads keys from a terminal without Python's buffer, which would keep the rest of an arrow key for itself."""

    def __init__(self, file: int) -> None:
        self._file = file
        self._typed: list[str] = []

    def next(self) -> str:
        """Return the next key typed, "" if none."""
        if not self._typed and self._waits(0.0):
            text = self._read()
            if text == _ESCAPE and self._waits(_SEQUENCE_S):
                text += self._read()
            self._typed = split_keys(text)
        return self._typed.pop(0) if self._typed else ""

    def _waits(self, timeout_s: float) -> bool:
        import select

        return bool(select.select([self._file], [], [], timeout_s)[0])

    def _read(self) -> str:
        return os.read(self._file, 64).decode("utf-8", errors="replace") or "\x04"
