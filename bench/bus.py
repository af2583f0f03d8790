# SPDX-License-Identifier: MIT
"""Benchmark: I2C bus time of an update of six channels. The figures are those of the budgets' page."""

from __future__ import annotations

from bench.options import Options
from bench.tables import Row, Table, with_ratios
from tests.parity.budget_page import UPDATES, bus_us

OURS = "three pair bursts (ours)"
CLOCK_kHz = 1000
TIME, RATIO = "µs at 1 MHz", "× ours"


def measure(_: Options) -> list[Table]:
    """Return the table."""
    rows = [Row(words, {TIME: float(bus_us(payloads, CLOCK_kHz))}) for words, payloads in UPDATES.items()]
    compared = [row for row in rows if row.label != "ALL_LED off"]
    note = "Computed from the bytes on the wire; the ratio is the same at every clock."
    return [Table("bus", "I²C: update of six channels", (TIME, RATIO), with_ratios(compared, TIME, OURS, RATIO), note)]
