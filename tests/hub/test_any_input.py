# SPDX-License-Identifier: MIT
"""Whatever comes from a program or from the port, the hub goes on and a stop still passes."""

from __future__ import annotations

import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniwheel.dialect import mavlink
from tests.hub.bench import WIDE, Bench, command

STOP = mavlink.MAV_CMD_OMNI_ESTOP


def stops(bench: Bench) -> None:
    """Check that a stop from a new program goes out next."""
    bench.run(3.0, 0.5)
    bench.sent.clear()
    bench.join("stopper").send(command(STOP, 1.0))
    bench.run(3.0, 0.5)
    assert bench.sent[0][1].command == STOP


@given(st.lists(st.tuples(st.booleans(), st.binary(max_size=200)), max_size=8))
def test_noise(pieces: list[tuple[bool, bytes]]) -> None:
    bench = Bench()
    station = bench.join("noisy")
    for from_port, data in pieces:
        if from_port:
            bench.hub.from_port(data)
        else:
            bench.hub.from_client(station.number, data)
        bench.run()
    bench.leave(station)
    bench.hub.port_lost()
    bench.hub.port_opened()
    bench._parser = mavlink.MAVLink(None)
    stops(bench)


def any_message(chance: random.Random) -> Any:
    """Return a message of any kind with any bytes in its fields."""
    kind = mavlink.mavlink_map[chance.choice(sorted(mavlink.mavlink_map))]
    values = kind.unpacker.unpack(chance.randbytes(kind.unpacker.size))
    fields = []
    for order in kind.orders:
        at, count = sum(kind.lengths[:order]), kind.lengths[order]
        value = values[at]
        fields.append(value if count == 1 or isinstance(value, bytes) else list(values[at : at + count]))
    return kind(*fields)


@pytest.mark.parametrize("seed", range(3))
def test_any_message_from_anybody(seed: int) -> None:
    chance = random.Random(seed)
    bench = Bench(WIDE)
    bench.answers = False
    for _ in range(1500):
        if len(bench.stations) < 3:
            bench.join(f"{chance.random()}", system=chance.randrange(1, 256))
        message = any_message(chance)
        message.pack(mavlink.MAVLink(None, chance.randrange(256), chance.randrange(256)))
        frame = bytes(message.get_msgbuf())
        action = chance.random()
        if action < 0.4:
            bench.hub.from_port(frame)
        elif action < 0.97:
            bench.hub.from_client(chance.choice(bench.stations).number, frame)
        elif action < 0.98:
            bench.hub.port_lost()
            bench.hub.port_opened()
        else:
            bench.leave(chance.choice(bench.stations))
        bench.run(0.02, 0.02)
    stops(bench)
