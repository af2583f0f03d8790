# SPDX-License-Identifier: MIT
"""The example of a controller outside the tree: its gains are LQR's, and it drives as well as the tree's own."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from tests.recipes.drive import CIRCLE, OWN_PACKAGES, drive, run_program, scenario
from tests.recipes.recipe import ROOT, Scratch

EXAMPLE = ROOT / "examples" / "controllers" / "lqr"
_GAINS = (
    OWN_PACKAGES
    + """
from omniwheel.core_config import robot_config
from omniwheel.robots import read_robot
robot = read_robot("three_wheel")
lqr = robot_config({**robot.parameter_values(), **json.loads(sys.argv[2])}, robot.table, 1).lqr
print(json.dumps([list(lqr.k), list(lqr.k_i)]))
"""
)
_LANES = (
    OWN_PACKAGES
    + """
from hil_sim.batch import run_batches
from hil_sim.metrics import tracking_rmse
from hil_sim.runs import run_in_process
from hil_sim.scenario import load_scenario
scenario = load_scenario("demo").with_duration(3.0)
mode = scenario.robot.table["CTL_MODE"].values["lqr"]
scenario = scenario.with_parameters({"CTL_MODE": float(mode)})
together = [float(row["position_m"]) for part in run_batches(scenario, 1, 8) for row in part.rows]
alone = [tracking_rmse(run_in_process(scenario.with_seed(seed)).record).position_m for seed in (1, 8)]
print(json.dumps([together, alone]))
"""
)


def copied_to(folder: Path) -> Path:
    """Return a copy of the example in a path with a blank, beside the tree."""
    return Path(shutil.copytree(EXAMPLE, folder / "my controllers" / "lqr"))


def check(copy: Scratch) -> None:
    """Compare the gains with SciPy's, and drives in Python, in lanes and with the firmware with each other and pid."""
    accepted = {"LQR_E_XY": 0.05, "LQR_Z_XY": 0.03, "LQR_V_XY": 0.2, "LQR_E_TH": 0.1, "LQR_Z_TH": 0.02, "LQR_V_TH": 0.7}
    k, k_i = json.loads(run_program(copy, _GAINS, json.dumps(accepted)))
    for axis, suffix in ((0, "XY"), (1, "XY"), (2, "TH")):
        wanted = riccati_gains(*(accepted[f"LQR_{letter}_{suffix}"] for letter in "EZV"))
        np.testing.assert_allclose([k[axis], k_i[axis]], wanted, rtol=1e-5)
    pid = drive(copy, scenario(f'{CIRCLE}\nCTL_MODE = "pid"'))
    lqr = drive(copy, scenario(f'{CIRCLE}\nCTL_MODE = "lqr"'))
    assert lqr["faults"] == []
    assert lqr["farthest_m"] > 0.2
    assert lqr["rmse_m"] < 1.2 * pid["rmse_m"]
    together, alone = json.loads(run_program(copy, _LANES))
    assert together[::7] == pytest.approx(alone, rel=1e-5)
    over_the_link = drive(copy, scenario(f'{CIRCLE}\nCTL_MODE = "lqr"'), firmware=True)
    assert over_the_link["faults"] == []
    assert over_the_link["rmse_m"] < 1.2 * pid["rmse_m"]


def riccati_gains(e: float, z: float, v: float) -> list[float]:
    """Return SciPy's gains of e' = v, z' = e for the weights 1/E², 1/Z² and 1/V²."""
    a, b = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[1.0], [0.0]])
    r = np.array([[1.0 / v**2]])
    solution = solve_continuous_are(a, b, np.diag([1.0 / e**2, 1.0 / z**2]), r)
    gains: list[float] = (np.linalg.inv(r) @ b.T @ solution)[0].tolist()
    return gains
