# SPDX-License-Identifier: MIT
"""What a batch is made of: runs of one scenario with consecutive seeds, one row of figures each."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim import metrics
from hil_sim.metrics import STATE_ARMED
from hil_sim.runs import Run, run_in_process
from hil_sim.scenario import Scenario, load_scenario
from omniwheel import __version__
from omniwheel.robots import parameter_table

ROW = np.dtype(
    [
        ("seed", "<i8"),
        ("ticks", "<i8"),
        ("faults", "<u4"),
        ("completed", "<f8"),
        *(
            (name, "<f8")
            for name in (
                "x_m",
                "y_m",
                "theta_rad",
                "position_m",
                "estimate_position_m",
                "estimate_theta_rad",
                "peak_wheel_rad_s",
                "peak_duty",
                "rms_duty",
                "saturated_share",
                "chatter",
            )
        ),
    ]
)


def run_rows(scenario: Scenario, first_seed: int, count: int) -> NDArray[Any]:
    """Run a scenario with ``count`` consecutive seeds and return their rows. Raises OmniError if a run is refused."""
    rows = np.zeros(count, ROW)
    for number in range(count):
        _fill(rows[number], run_in_process(scenario, first_seed + number))
    return rows


def _fill(row: Any, run: Run) -> None:
    estimate = metrics.estimator_rmse(run.record)
    figures: dict[str, float] = {
        **metrics.as_dict(metrics.tracking_rmse(run.record)),
        **metrics.as_dict(metrics.effort(run.record, run.scenario.robot.wheels)),
        "estimate_position_m": estimate.position_m,
        "estimate_theta_rad": estimate.theta_rad,
        "completed": float(run.done),
        "seed": run.scenario.seed,
        "ticks": run.ticks,
    }
    for name, value in figures.items():
        row[name] = value
    armed = np.flatnonzero(run.record["state"] == STATE_ARMED)
    seen = run.record["faults"][armed[0] if len(armed) else 0 :]
    row["faults"] = np.bitwise_or.reduce(seen)


@lru_cache(maxsize=1)
def identity() -> dict[str, Any]:
    """Return what two programs must have in common to compute the same numbers.

    ``probe`` is a digest over the rows of a short run: it tells apart builds that call themselves the same version.
    """
    rows = run_rows(load_scenario("demo").with_duration(1.0), 1, 8)
    return {
        "omniwheel": __version__,
        "parameter_schema": parameter_table().schema_version,
        "row": rows.dtype.descr,
        "probe": hashlib.sha256(rows.tobytes()).hexdigest()[:16],
    }
