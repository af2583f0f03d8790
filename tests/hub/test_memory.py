# SPDX-License-Identifier: MIT
"""What the hub keeps over hours in which the robot's line never pauses."""

from __future__ import annotations

import pytest

from tests.hub.bench import Bench
from tests.long_lines import ROUND_S, growth

ROUNDS = 600
LARGEST_GROWTH_BYTES = 32 * 1024


@pytest.mark.full
def test_hours_of_telemetry_leave_the_hub_as_large_as_it_was() -> None:
    bench = Bench()
    numbers = [bench.hub.join(name) for name in ("one", "other")]
    handed_on = 0

    def take(piece: bytes) -> None:
        nonlocal handed_on
        bench.now_s += ROUND_S
        bench.hub.from_port(piece)
        handed_on += sum(len(bench.hub.to_client(number)) for number in numbers)
        while bench.hub.to_port():
            pass

    assert growth(take, ROUNDS) < LARGEST_GROWTH_BYTES
    assert handed_on > 100 * ROUNDS
