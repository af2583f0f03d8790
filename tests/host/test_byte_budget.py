# SPDX-License-Identifier: MIT
from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniwheel.byte_budget import ByteBudget, MeteredLink


@given(
    st.floats(10.0, 1e5),
    st.integers(50, 200),
    st.lists(st.tuples(st.floats(0.0, 0.5), st.integers(1, 50)), max_size=60),
)
def test_no_stretch_of_time_gets_more_than_the_budget(rate: float, burst: int, steps: list[tuple[float, int]]) -> None:
    now = [0.0]
    budget = ByteBudget(rate, burst, lambda: now[0])
    sent: list[tuple[float, int]] = []
    for wait_s, count in steps:
        now[0] += wait_s
        if budget.admits(count):
            budget.charge(count)
            sent.append((now[0], count))
    for first in range(len(sent)):
        total = 0
        for time_s, count in sent[first:]:
            total += count
            assert total <= burst + rate * (time_s - sent[first][0]) + 1e-6


def test_a_budget_is_used_up_to_its_rate() -> None:
    now = [0.0]
    budget = ByteBudget(480.0, 86.0, lambda: now[0])
    sent = 0
    for _ in range(10_000):
        now[0] += 0.001
        if budget.admits(22):
            budget.charge(22)
            sent += 22
    assert sent == pytest.approx(4800 + 86, abs=22)


@pytest.mark.parametrize(("rate", "burst"), [(0.0, 1.0), (1.0, 0.0), (float("nan"), 1.0)])
def test_a_budget_must_be_positive(rate: float, burst: float) -> None:
    with pytest.raises(ValueError, match="positive"):
        ByteBudget(rate, burst, lambda: 0.0)


class Sink:
    url = "sink"
    data = b""
    closed = False

    def read(self, timeout_s: float) -> bytes:
        return b"answer"

    def write(self, data: bytes) -> None:
        self.data += data

    def close(self) -> None:
        self.closed = True


def test_a_metered_link_charges_everything_that_is_written() -> None:
    budget = ByteBudget(100.0, 50.0, lambda: 0.0)
    sink = Sink()
    link = MeteredLink(sink, budget)
    link.write(b"x" * 30)
    assert (link.bytes_written, len(sink.data), link.read(0.0), link.url) == (30, 30, b"answer", "sink")
    assert budget.admits(20)
    assert not budget.admits(21)
    link.close()
    assert sink.closed
