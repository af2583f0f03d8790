# SPDX-License-Identifier: MIT
"""The batch engine as studies use it: rows of runs, and what tells two engines apart."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.batch import BLOCK, STATUSES, Cancel, row_dtype, run_batch
from hil_sim.runs import run_in_process
from hil_sim.scenario import Scenario, load_scenario
from omniwheel import __version__
from omniwheel.errors import CoreError
from omniwheel.robots import parameter_table

ROW = row_dtype()
RUNS_AT_ONCE = BLOCK
OK = next(number for number, name in STATUSES.items() if name == "ok")


def run_rows(scenario: Scenario, first_seed: int, count: int, cancel: Cancel | None = None) -> NDArray[Any]:
    """Run a scenario with ``count`` consecutive seeds and return their rows.

    Raises OmniError or WorldError if none of them can be run: their settings are refused.
    """
    rows = run_batch(scenario, first_seed, count, cancel).rows
    if np.all(rows["status"] != OK):
        run_in_process(scenario, first_seed)  # raises, and knows the words
        raise CoreError(f"the runs cannot be started: {STATUSES[int(rows['status'][0])]}")
    return rows


@lru_cache(maxsize=1)
def identity() -> dict[str, Any]:
    """Return what two programs must have in common to compute the same numbers.

    ``probe`` is a digest over the rows of a few short runs: it tells apart builds of one version.
    """
    rows = run_rows(load_scenario("demo").with_duration(1.0), 1, RUNS_AT_ONCE)
    return {
        "omniwheel": __version__,
        "parameter_schema": parameter_table().schema_version,
        "row": list(ROW.names or ()),
        "probe": hashlib.sha256(rows.tobytes()).hexdigest()[:16],
    }
