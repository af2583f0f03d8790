# SPDX-License-Identifier: MIT
"""``pwm1,pwm2,pwm3,pwm4*``: how the four-wheel robot is told its motors' PWM, and how often a radio can carry that.

A line has 8 to 20 bytes. 9600 baud carry 960 bytes per second: 50 lines of 20 bytes, 1000 bytes per second, do not fit.
What did not fit would wait in the modem and make every later line older. So the radio is given no more than it can
carry. A line that repeats the last one is skipped. While the wire is busy, a newer line takes the place of the one
that could not go. Four full-length numbers then go out 43 times per second (six steps of seven), the usual shorter ones
at every step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from omniwheel.byte_budget import BITS_PER_BYTE, ByteBudget
from omniwheel.errors import LinkError
from omniwheel.limits import HOST_CONTROL_FULL_PWM, HOST_CONTROL_MOTORS, RADIO_BAUD
from omniwheel.link import Link

FULL_PWM = HOST_CONTROL_FULL_PWM
MOTORS = HOST_CONTROL_MOTORS
END = b"*"
MAX_LINE_BYTES = MOTORS * len(f"-{FULL_PWM}") + MOTORS - 1 + len(END)
DEFAULT_BAUD = RADIO_BAUD
USABLE_SHARE = 0.95
"""Of the baud rate: the modem's clock and ours differ, and a full wire drains no backlog."""
BACKLOG_BYTES = 9
"""Bytes that may still be on their way when the next line goes: 9 ms at 9600 baud."""
KEEPALIVE_S = 0.09
"""An unchanged line is sent again at the first step after this: the last may be lost, a robot may watch for silence."""
STOP_LINES = 5

PwmLine = tuple[int, int, int, int]
STOP: PwmLine = (0, 0, 0, 0)


def format_line(pwm: Sequence[int]) -> bytes:
    """Return the line for four whole numbers from -255 to 255; ValueError for anything else."""
    if len(pwm) != MOTORS:
        raise ValueError(f"{len(pwm)} PWM values; the robot takes {MOTORS}")
    for value in pwm:
        if isinstance(value, bool) or not isinstance(value, int) or abs(value) > FULL_PWM:
            raise ValueError(f"a PWM of {value!r}; must be a whole number from -{FULL_PWM} to {FULL_PWM}")
    return ",".join(str(value) for value in pwm).encode("ascii") + END


def parse_line(line: bytes) -> PwmLine:
    """Return the four numbers of a line, its ``*`` included; ValueError says what is wrong with it."""
    body = line.removesuffix(END)
    words = body.split(b",")
    if body == line or len(words) != MOTORS or len(line) > MAX_LINE_BYTES:
        raise ValueError(f"{line!r} is not pwm1,pwm2,pwm3,pwm4*")
    values = [_number(word, line) for word in words]
    return values[0], values[1], values[2], values[3]


def _number(word: bytes, line: bytes) -> int:
    digits = word.removeprefix(b"-")
    if not (digits.isdigit() and int(digits) <= FULL_PWM):
        raise ValueError(f"{line!r}: {word!r} is not a PWM from -{FULL_PWM} to {FULL_PWM}")
    return int(word)


class PwmRadio:
    """Sends PWM lines over a link as far as ``baud`` allows; the newest wins, nothing queues."""

    def __init__(self, link: Link, clock: Callable[[], float], *, baud: float = DEFAULT_BAUD) -> None:
        self.lines = 0
        self.bytes = 0
        self.unchanged = 0
        self.held_back = 0
        self._link = link
        self._clock = clock
        self._budget = ByteBudget(USABLE_SHARE * baud / BITS_PER_BYTE, MAX_LINE_BYTES + BACKLOG_BYTES, clock)
        self._last: bytes = b""
        self._last_s = float("-inf")

    def offer(self, pwm: Sequence[int]) -> bool:
        """Send this PWM now if it is news and the wire has room; return whether it went out."""
        line = format_line(pwm)
        now_s = self._clock()
        if line == self._last and now_s - self._last_s < KEEPALIVE_S:
            self.unchanged += 1
            return False
        if not self._budget.admits(len(line)):
            self.held_back += 1
            return False
        self._write(line, now_s)
        return True

    def stop(self) -> None:
        """Send the stop line at once, budget or not."""
        self._write(format_line(STOP), self._clock())

    def stop_for_good(self, pause: Callable[[], None]) -> None:
        """Send the stop line several times with a ``pause`` behind each: the robot keeps the last PWM that it got.

        A write that fails does not end this: the next one may go out. Raises LinkError or OSError if none did.
        """
        failure: LinkError | OSError | None = None
        sent = 0
        for _ in range(STOP_LINES):
            try:
                self.stop()
                sent += 1
            except (LinkError, OSError) as error:
                failure = error
            pause()
        if failure is not None and sent == 0:
            raise failure

    def _write(self, line: bytes, now_s: float) -> None:
        self._link.write(line)
        self._budget.charge(len(line))
        self._last, self._last_s = line, now_s
        self.lines += 1
        self.bytes += len(line)
