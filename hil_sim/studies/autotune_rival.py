# SPDX-License-Identifier: MIT
"""What ``omni optimize`` finds for a drawn robot if it knows the true one, beside what autotune found.

It searches the same gains. Motors, friction and inertia it need not find: they are set to the truth.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.c_scenario import scenario_world
from hil_sim.studies import optimize
from hil_sim.studies.autotune_robot import FRESH_SEED, TEXT, judge
from hil_sim.studies.drawn_robots import DrawnRobot, draw_robot
from hil_sim.studies.figures import parse_number
from hil_sim.studies.pools import LocalPool
from hil_sim.studies.space import Axis
from omniwheel.errors import OmniError

TRIALS, RUNS = 200, 8
SEARCH_SEED = 2_000_000
"""The search's seeds; robots are judged on others."""
ROW = np.dtype(
    [
        ("seed", "<u8"),
        ("why", f"S{TEXT}"),
        ("simulated_s", "<f8"),
        ("wall_s", "<f8"),
        *(
            (f"{name}_{side}", "<f8")
            for name in ("completed", "position_m", "theta_rad")
            for side in ("autotune", "rival")
        ),
    ]
)


def rival_row(seed: int, tuned: Mapping[str, float], trials: int = TRIALS) -> NDArray[Any]:
    """Search the best gains of a seed's robot, judge both sets of parameters on fresh seeds, and return its ROW."""
    started = time.perf_counter()
    drawn = draw_robot(seed)
    row = np.zeros(1, ROW)
    row["seed"], row["simulated_s"] = seed, 0.0
    known = known_values(drawn)
    sides = {"autotune": dict(tuned)}
    try:
        sides["rival"] = {**known, **_best(drawn, known, trials)}
    except OmniError as error:
        row["why"] = str(error).encode()[:TEXT]
    for side in ("autotune", "rival"):
        rows = judge(drawn, sides[side]) if side in sides else None
        for name in ("completed", "position_m", "theta_rad"):
            row[f"{name}_{side}"] = math.nan if rows is None else np.mean(rows[name])
    row["wall_s"] = time.perf_counter() - started
    return row


def known_values(drawn: DrawnRobot) -> dict[str, float]:
    """Return the true robot's motors, inertia and friction as parameters."""
    truth = drawn.truth.parameter_values()
    values = {name: truth[name] for name in ("MOT_K", "MOT_B", "MOT_J", "KF_J", "MOT_R", "MOT_L")}
    friction = scenario_world(drawn.judging_scenario()).motor_coulomb_N_m * truth["MOT_R"] / truth["MOT_K"]
    return {**values, "WS_FF_S": min(friction, drawn.believed.table["WS_FF_S"].maximum)}


def axes(drawn: DrawnRobot) -> list[Axis]:
    """Return the gains that are searched, and their ranges."""
    truth, table = drawn.truth.parameter_values(), drawn.believed.table
    gain = truth["MOT_K"] + truth["MOT_R"] * truth["MOT_B"] / truth["MOT_K"]
    ranges = {
        "WS_P": (0.2 * gain, 40.0 * gain),
        "WS_I": (1.0 * gain, 1000.0 * gain),
        "KF_Q_W": (0.2, 20.0),
        "ISMC_LAM_XY": (0.5, 30.0),
        "ISMC_LAM_TH": (0.5, 30.0),
        "ISMC_PHI_XY": (0.1 * truth["ISMC_PHI_XY"], 30.0 * truth["ISMC_PHI_XY"]),
        "ISMC_PHI_TH": (0.1 * truth["ISMC_PHI_TH"], min(3.0, 30.0 * truth["ISMC_PHI_TH"])),
    }
    return [
        Axis(name, float(np.float32(low)), float(np.float32(min(high, table[name].maximum))), (), log=True)
        for name, (low, high) in ranges.items()
    ]


def _best(drawn: DrawnRobot, known: Mapping[str, float], trials: int) -> dict[str, float]:
    plan = optimize.Plan(
        scenario=drawn.judging_scenario().with_parameters(known),
        axes=axes(drawn),
        minimise=parse_number("position_m.mean"),
        constraints=(),
        trials=trials,
        runs=RUNS,
        first_seed=SEARCH_SEED,
        batch_runs=RUNS,
    )
    assert FRESH_SEED < SEARCH_SEED
    with TemporaryDirectory() as folder, optimize.open_study(plan, Path(folder) / "rival") as study:
        return optimize.run_study(plan, study, LocalPool(1)).best.values
