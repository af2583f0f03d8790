# SPDX-License-Identifier: MIT
"""The scenarios in which a recipe's result is driven, and how a copy runs them."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from typing import Any

from tests.recipes.recipe import Scratch, call

OWN_PACKAGES = """
import json, sys
sys.meta_path = [finder for finder in sys.meta_path if "Editable" not in type(finder).__name__
                 and "ScikitBuild" not in type(finder).__name__]
sys.path.insert(0, sys.argv[1])
from pathlib import Path
import omniwheel._core
assert Path(omniwheel._core.__file__).is_relative_to(sys.argv[1]), omniwheel._core.__file__
"""
"""How a program finds the copy's packages, in the folder of its first argument, and nobody else's."""

_DRIVE = (
    OWN_PACKAGES
    + """
import numpy as np
from hil_sim.hil import run_hil
from hil_sim.metrics import tracking_rmse
from hil_sim.runs import faults_seen, run_in_process
from hil_sim.scenario import load_scenario
scenario = load_scenario(sys.argv[2])
run = run_hil(scenario, sys.argv[4] or None) if sys.argv[3] == "firmware" else run_in_process(scenario)
rmse = tracking_rmse(run.record)
faults, warnings = faults_seen(run)
truth = run.record["truth"]
way = float(np.hypot(*(truth - truth[0])[:, :2].T).max())
last_m = float(np.hypot(*(truth[-1] - truth[-2])[:2]))
said = {"rmse_m": float(rmse.position_m), "farthest_m": way, "faults": faults, "done": run.done, "last_m": last_m}
print(json.dumps(said))
"""
)
_SCENARIO = """
[scenario]
name = "recipe"
description = "a path, driven with what a page has added"
robot = "{robot}"
seed = 1
duration_s = {duration}

[parameters]
EKF_MODE = "odometry"
TRJ_SIZE = 0.3
{parameters}

{more}

[[event]]
at_s = 0.5
command = "trajectory_start"

[[event]]
at_s = 0.5
command = "arm"
"""
ESTOP_AT_5_S = """
[[event]]
at_s = 5.0
command = "estop"
"""
CIRCLE = 'TRJ_TYPE = "circle"\nTRJ_PERIOD = 10.0'


def scenario(parameters: str = CIRCLE, *, more: str = "", duration: str = "8.0", robot: str = "three_wheel") -> str:
    """Return a scenario whose path is 0.3 m large; ``parameters`` and ``more`` are lines of it."""
    return _SCENARIO.format(parameters=parameters, more=more, duration=duration, robot=robot)


def drive(copy: Scratch, text: str, *, firmware: bool = False, link: str = "") -> Mapping[str, Any]:
    """Run a scenario in the simulated world with this copy, and say what came of it.

    With ``firmware`` the copy's firmware drives, over a link: a process of its own, or the one behind ``link``.
    ``rmse_m`` on the path, ``farthest_m`` from where it stood, ``faults`` since arming, ``done``: the path is over,
    ``last_m``: how far it moved in the last sample.
    """
    path = copy.root / "build" / "recipe.toml"
    path.write_text(text, encoding="utf-8")
    result: Mapping[str, Any] = json.loads(run_program(copy, _DRIVE, str(path), "firmware" if firmware else "", link))
    return result


def run_program(copy: Scratch, program: str, *arguments: str) -> str:
    """Run a Python program that begins with OWN_PACKAGES; return its last line."""
    command = [sys.executable, "-c", program, str(copy.packages()), *arguments]
    return call(command, copy.root).splitlines()[-1]
