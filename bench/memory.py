# SPDX-License-Identifier: MIT
"""Benchmark: what a Monte Carlo study needs in memory. As a program: does so many runs and prints its peak in KiB."""

from __future__ import annotations

import resource
import sys
from dataclasses import replace

from bench import build
from bench.options import Options
from bench.tables import Row, Table
from hil_sim.batch import row_dtype, run_batch
from hil_sim.loop_speed import SCENARIO
from hil_sim.scenario import load_scenario
from tests.native import ROOT

PEAK = "peak, MB"
FEW = 8
DURATION_S = 0.6
"""Long enough to be armed and on the way."""


def measure(options: Options) -> list[Table]:
    """Return the table."""
    many = options.pick(256, 2048)
    rows = []
    for count in (FEW, many):
        options.say(f"memory of {count} runs")
        rows.append(Row(f"{count} runs", {PEAK: peak_kib(count) / 1024.0}))
    note = (
        "Resident memory of a whole Python process that does them in one call and keeps their rows "
        f"({row_dtype().itemsize} bytes a run). Python with NumPy and this package loaded is most of it."
    )
    return [Table("memory", "Monte Carlo: memory", (PEAK,), tuple(rows), note)]


def peak_kib(count: int) -> int:
    """Return the peak of a process of its own [KiB]."""
    return int(build.call([sys.executable, "-m", "bench.memory", str(count)], folder=ROOT))


if __name__ == "__main__":
    run_batch(replace(load_scenario(SCENARIO), duration_s=DURATION_S), 1, int(sys.argv[1]))
    sys.stdout.write(f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss}\n")
