# SPDX-License-Identifier: MIT
"""How good the core's estimate of the currents is: ``python -m tests.hil_sim.current_page [--write]``."""

from __future__ import annotations

import sys

import numpy as np

from tests.hil_sim.motor_drive import Drive, load_scenario
from tests.hil_sim.rollers_page import PAGE
from tests.page_tables import main

SCENARIOS = ("demo", "four_wheel", "fast")
TICKS = 600


def errors(name: str) -> tuple[float, float, float]:
    """Return the estimate's error, the true current (both RMS) and the stall current [A].

    Starts, a reversal, a turn and a stop, with encoders that count.
    """
    drive = Drive(load_scenario(name), SAFE_I=900.0)
    speed = 0.6 * float(drive.config.limits.speed_m_s if name == "fast" else 0.15)
    wrong, right = [], []
    for twist in ((speed, 0.0, 0.0), (-speed, 0.0, 0.0), (0.0, speed, 0.5), (0.0, 0.0, 0.0)):
        for run in drive.ticks(TICKS, twist):
            true_A = np.array(drive.true_A())
            wrong.append(np.array(list(run.outputs.current_A)[: drive.wheels]) - true_A)
            right.append(true_A)
    wrong_A, right_A = (float(np.sqrt(np.mean(np.square(values)))) for values in (wrong, right))
    return wrong_A, right_A, drive.stall_A


def table() -> list[str]:
    """Return the lines of the table."""
    lines = ["| scenario | error (RMS) | true current (RMS) | standing still, full voltage |", "|---|---:|---:|---:|"]
    for name in SCENARIOS:
        lines.append(f"| `{name}` | " + " | ".join(f"{value:.2f} A" for value in errors(name)) + " |")
    return lines


def tables() -> dict[str, list[str]]:
    """Return the table with the name of its place in the page."""
    return {"current-estimate": table()}


if __name__ == "__main__":
    sys.exit(main("tests.hil_sim.current_page", __doc__, PAGE, tables))
