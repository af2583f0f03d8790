# SPDX-License-Identifier: MIT
"""Benchmark: downloading all parameters over a radio at 9600 baud, in simulated time."""

from __future__ import annotations

import statistics

from bench.options import Options
from bench.peers.ardupilot_download import VALUE_BYTES, download_s
from bench.tables import Cell, Row, Table, with_ratios
from omniwheel.radio_model import RadioSettings
from omniwheel.robots import parameter_table
from tests.radio.download_page import ours_s

BAUD = 9600
OURS = "ours: firmware and client, telemetry going on"
PEERS = {
    "ArduPilot's way: streamed within 30 % of the line": True,
    "one at a time, as older ground stations": False,
}
LINE = "the line alone, filled"
RADIOS = {
    "no loss, s": RadioSettings(baud=BAUD),
    "a fifth lost, 200 ms each way, s": RadioSettings(baud=BAUD, loss=0.2, latency_s=0.2),
}


def measure(options: Options) -> list[Table]:
    """Return the table."""
    seeds = range(options.seed, options.seed + options.pick(1, 3))
    count = len(parameter_table())
    cells: dict[str, dict[str, Cell]] = {label: {} for label in (OURS, *PEERS, LINE)}
    for heading, radio in RADIOS.items():
        options.say(f"parameter download, {heading}")
        cells[OURS][heading] = statistics.mean(ours_s(radio, seed, signed=False) for seed in seeds)
        for label, streamed in PEERS.items():
            cells[label][heading] = statistics.mean(download_s(count, radio, streamed, seed) for seed in seeds)
    cells[LINE] = {next(iter(RADIOS)): count * VALUE_BYTES * RadioSettings(baud=BAUD).character_s}
    rows = [Row(label, found) for label, found in cells.items()]
    columns = []
    for heading in RADIOS:
        ratio = f"× ours, {heading.split(',')[0]}"
        rows = list(with_ratios(rows, heading, OURS, ratio))
        columns += [heading, ratio]
    note = (
        f"{count} parameters, profile `radio_{BAUD}`, simulated time, mean over {len(seeds)} radio seeds "
        f"from {options.seed}. The peers are a model of their timing and send nothing else."
    )
    return [Table("download", f"parameters at {BAUD} baud", tuple(columns), tuple(rows), note)]
