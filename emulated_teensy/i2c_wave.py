# SPDX-License-Identifier: MIT
"""An I2C bus as an oscilloscope shows it: edges, the times between them, and the bytes they mean (NXP UM10204)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from math import isfinite

from omniwheel._core import ffi, lib

START, STOP = "start", "stop"


@dataclass(frozen=True)
class Edge:
    """Levels of the lines from a time on."""

    time_ns: float
    scl: int
    sda: int


@dataclass
class Wave:
    """What happened: ``START``, ``STOP`` and (byte, acknowledged); and the times [ns] that UM10204 limits."""

    events: list[str | tuple[int, bool]] = field(default_factory=list)
    low_ns: list[float] = field(default_factory=list)
    high_ns: list[float] = field(default_factory=list)
    period_ns: list[float] = field(default_factory=list)
    start_hold_ns: list[float] = field(default_factory=list)
    start_setup_ns: list[float] = field(default_factory=list)
    stop_setup_ns: list[float] = field(default_factory=list)
    data_setup_ns: list[float] = field(default_factory=list)
    data_hold_ns: list[float] = field(default_factory=list)
    free_ns: list[float] = field(default_factory=list)

    @property
    def bytes(self) -> list[int]:
        """The bytes alone."""
        return [event[0] for event in self.events if isinstance(event, tuple)]


def least(times_ns: list[float]) -> float:
    """The least time, of those whose beginning was seen."""
    return min(time for time in times_ns if isfinite(time))


def edges_of(machine: object) -> list[Edge]:
    """Take the edges since the last call from a chip."""
    buffer = ffi.new("rt1062_edge_t[]", lib.RT1062_EDGES)
    count = lib.rt1062_i2c_edges(machine, buffer, lib.RT1062_EDGES)
    return [Edge(edge.time_ps / 1000, int(edge.scl != 0), int(edge.sda != 0)) for edge in buffer[0:count]]


def read_wave(edges: list[Edge]) -> Wave:
    """Tell what the edges mean; both lines are high before the first one.

    What comes before the first START is the rest of a transfer: its bits make no bytes.
    """
    wave = Wave()
    bits: list[int] = []
    framed = False
    scl_rose = scl_fell = sda_moved = stopped = started = float("nan")
    for before, now in _pairs(edges):
        if now.scl and before.scl and now.sda != before.sda:
            bits = []
            wave.events.append(STOP if now.sda else START)
            if now.sda:
                wave.stop_setup_ns.append(now.time_ns - scl_rose)
                stopped = now.time_ns
            else:
                framed = True
                wave.start_setup_ns.append(now.time_ns - scl_rose)
                wave.free_ns.append(now.time_ns - stopped)
                started = now.time_ns
        elif now.scl and not before.scl:
            wave.low_ns.append(now.time_ns - scl_fell)
            wave.data_setup_ns.append(now.time_ns - sda_moved)
            scl_rose = now.time_ns
            if framed:
                bits.append(now.sda)
            if len(bits) == 9:
                wave.events.append((int("".join(map(str, bits[:8])), 2), not bits[8]))
                bits = []
        elif before.scl and not now.scl:
            if wave.events and wave.events[-1] == START and not bits:
                wave.start_hold_ns.append(now.time_ns - started)
            else:
                wave.high_ns.append(now.time_ns - scl_rose)
                wave.period_ns.append(now.time_ns - scl_fell)
            scl_fell = now.time_ns
        if now.sda != before.sda:
            sda_moved = now.time_ns
            if not now.scl:
                wave.data_hold_ns.append(now.time_ns - scl_fell)
    return wave


def _pairs(edges: list[Edge]) -> Iterator[tuple[Edge, Edge]]:
    before = Edge(0.0, 1, 1)
    for edge in edges:
        yield before, edge
        before = edge


@dataclass(frozen=True)
class Limits:
    """UM10204, table 10: least times [ns]."""

    period: float
    low: float
    high: float
    start_hold: float
    start_setup: float
    stop_setup: float
    data_setup: float
    free: float


LIMITS = {
    100_000: Limits(10_000, 4700, 4000, 4000, 4700, 4000, 250, 4700),
    400_000: Limits(2500, 1300, 600, 600, 600, 600, 100, 1300),
    1_000_000: Limits(1000, 500, 260, 260, 260, 260, 50, 500),
}
"""By the speed of the bus [Hz]."""
_ROUNDING_ns = 1.0


def violations(wave: Wave, limits: Limits) -> list[str]:
    """Return a sentence for each time that is shorter than the specification allows."""
    found = []
    for name in (limit.name for limit in fields(Limits)):
        times = getattr(wave, f"{name}_ns")
        slack_ns = _ROUNDING_ns if name == "period" else 0.0
        if times and least(times) < getattr(limits, name) - slack_ns:
            found.append(
                f"{name.replace('_', ' ')} {least(times):.0f} ns, at least {getattr(limits, name):g} ns are required"
            )
    return found
