# SPDX-License-Identifier: MIT
"""The PWM line and what a 9600-baud radio is given of it."""

from __future__ import annotations

import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniwheel.host_control.pwm_line import (
    BACKLOG_BYTES,
    KEEPALIVE_S,
    MAX_LINE_BYTES,
    STOP,
    PwmRadio,
    format_line,
    parse_line,
)

pwm = st.tuples(*[st.integers(-255, 255)] * 4)


@given(pwm)
def test_a_line_reads_back_as_it_was_written(values: tuple[int, int, int, int]) -> None:
    line = format_line(values)
    assert parse_line(line) == values
    assert len(line) <= MAX_LINE_BYTES == 20


def test_the_line_is_the_reports() -> None:
    assert format_line((1, -20, 255, 0)) == b"1,-20,255,0*"


@pytest.mark.parametrize("values", [(1, 2, 3), (1, 2, 3, 4, 5), (256, 0, 0, 0), (0, -256, 0, 0), (1.0, 0, 0, 0),
                                    (float("nan"), 0, 0, 0), (True, 0, 0, 0)])  # fmt: skip
def test_what_is_no_pwm_is_not_sent(values: tuple[Any, ...]) -> None:
    with pytest.raises(ValueError, match="PWM"):
        format_line(values)


DAMAGED = (
    b"",
    b"*",
    b"1,2,3*",
    b"1,2,3,4",
    b"1,2,3,4,5*",
    b"1,2,3,256*",
    b"1,2,3,x*",
    b"1,,3,4*",
    b"1,2,3,--4*",
    b"1,2,3, 4*",
    b"1,2,3,4**",
    b"1,2,3,4\n*",
    b"000000000001,2,3,255*",
)


@pytest.mark.parametrize("line", DAMAGED)
def test_a_damaged_line_is_refused(line: bytes) -> None:
    with pytest.raises(ValueError, match=r"PWM|pwm"):
        parse_line(line)


@given(st.binary(max_size=40))
def test_any_bytes_are_four_numbers_in_range_or_a_value_error(line: bytes) -> None:
    try:
        values = parse_line(line)
    except ValueError:
        return
    assert all(-255 <= value <= 255 for value in values)


class Wire:
    """A serial line: bytes leave one after another."""

    url = "wire"

    def __init__(self, baud: float) -> None:
        self.now_s = 0.0
        self.free_s = 0.0
        self.lines: list[tuple[float, bytes]] = []
        self.longest_backlog_s = 0.0
        self._byte_s = 10.0 / baud

    def clock(self) -> float:
        return self.now_s

    def read(self, timeout_s: float) -> bytes:
        return b""

    def write(self, data: bytes) -> None:
        self.longest_backlog_s = max(self.longest_backlog_s, self.free_s - self.now_s)
        self.free_s = max(self.free_s, self.now_s) + len(data) * self._byte_s
        self.lines.append((self.now_s, data))

    def close(self) -> None:
        pass


def drive(wire: Wire, seconds: float, values: Any) -> PwmRadio:
    """Offer PWM 50 times per second."""
    radio = PwmRadio(wire, wire.clock, baud=9600)
    for step in range(round(seconds * 50)):
        wire.now_s = step * 0.02
        radio.offer(values(step))
    return radio


def test_the_worst_case_stays_within_9600_baud_and_never_queues() -> None:
    wire = Wire(9600)
    radio = drive(wire, 60.0, lambda step: (-255, -200 - step % 50, -255, -254))
    assert radio.bytes / 60.0 < 912.0
    assert radio.lines / 60.0 == pytest.approx(50.0 * 6 / 7, rel=0.01)
    assert radio.held_back == 3000 - radio.lines
    assert wire.longest_backlog_s <= BACKLOG_BYTES * 10.0 / 9600
    gaps = [after - before for (before, _), (after, _) in zip(wire.lines, wire.lines[1:], strict=False)]
    assert max(gaps) <= 0.041  # two steps at most, and what then goes is that step's own PWM
    assert all(parse_line(line)[1] == -200 - round(time_s / 0.02) % 50 for time_s, line in wire.lines)


def test_ordinary_lines_all_go() -> None:
    random_numbers = random.Random(1)
    wire = Wire(9600)
    radio = drive(wire, 20.0, lambda step: tuple(random_numbers.randint(-255, 255) for _ in range(4)))
    assert radio.lines == 1000
    assert radio.held_back == 0


def test_an_unchanged_line_is_repeated_only_to_keep_alive() -> None:
    wire = Wire(9600)
    radio = drive(wire, 10.0, lambda step: (10, 10, 10, 10))
    assert radio.lines == 100
    assert KEEPALIVE_S < 0.1
    assert radio.unchanged == 500 - radio.lines


def test_a_stop_goes_at_once_even_on_a_full_wire() -> None:
    wire = Wire(9600)
    radio = PwmRadio(wire, wire.clock)
    assert radio.offer((-255, -255, -255, -255))
    assert not radio.offer((-254, -255, -255, -255))
    radio.stop()
    assert wire.lines[-1] == (0.0, format_line(STOP))
