# SPDX-License-Identifier: MIT
"""What presets do on real wheels and on ideal ones, for docs/guides/tuning.md: ``python -m tests.host.preset_page``.

``--write`` puts the tables into the page. A run is 40 s of the demo's path for the slow robots and 20 s of the scenario
``fast`` for the fast one; a run without fixes is of ``no_slip`` or ``fast_no_slip``.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from hil_sim import metrics
from hil_sim.runs import faults_seen, run_in_process
from hil_sim.scenario import load_scenario
from hil_sim.world import IDEAL_WHEELS
from omniwheel._core import lib
from omniwheel.presets import preset_names, read_preset
from omniwheel.robots import parameter_table
from tests.page_tables import main, with_tables

PAGE = Path(__file__).parents[2] / "docs" / "guides" / "tuning.md"
PRESETS = (
    "default",
    "fixed_noise",
    "report_p",
    "report_pd",
    "report_pid",
    "report_ismc",
    "report_ismc_motor",
    "report_torque",
    "original",
)
ROBOTS = {"three_wheel": "demo", "four_wheel": "demo", "fast_three_wheel": "fast"}
WITHOUT_FIXES = {"demo": "no_slip", "fast": "fast_no_slip"}
SECONDS = {"demo": 40.0, "fast": 20.0}


@dataclass(frozen=True)
class Driven:
    """A run: position RMSE [mm], share of the time at a limit, chatter, and the fault that stopped it or ""."""

    error_mm: float
    at_limit: float
    chatter: float
    fault: str


@cache
def driven(preset: str, robot: str, *, ideal: bool = False, fixes: bool = True) -> Driven:
    """Drive a robot with a preset's gains."""
    way = ROBOTS[robot]
    scenario = load_scenario(way if fixes else WITHOUT_FIXES[way], robot).with_duration(SECONDS[way])
    table = parameter_table()
    if preset == "fixed_noise":  # it is no controller: what it changes shows beside the defaults
        scenario = scenario.with_parameters(read_preset("default", table).parameters)
    scenario = scenario.with_parameters(read_preset(preset, table).parameters)
    if not fixes:  # the same dead reckoning for all, whatever filter a preset brings
        scenario = scenario.with_parameters({"EKF_MODE": lib.OMNI_EKF_MODE_ODOMETRY})
    run = run_in_process(scenario.with_world(IDEAL_WHEELS if ideal else {}))
    effort = metrics.effort(run.record, scenario.robot.wheels)
    error = 1e3 * metrics.tracking_rmse(run.record).position_m
    return Driven(error, effort.saturated_share, effort.chatter, " ".join(faults_seen(run)[0]))


def shown(error_mm: float) -> str:
    """Return an error with two digits."""
    return f"{error_mm:.0f}" if error_mm >= 10.0 else f"{error_mm:.1f}"


def cell(runs: Iterable[Driven]) -> str:
    """Return real wheels' error / ideal wheels', with the fault that ended the first."""
    real, ideal = runs
    return f"{shown(real.error_mm)} / {shown(ideal.error_mm)}" + (f", stopped: {real.fault}" if real.fault else "")


def errors_table(*, fixes: bool) -> list[str]:
    """Return position errors of every preset and robot [mm], on real / on ideal wheels."""
    lines = ["| Preset | three-wheel robot | four-wheel robot | fast robot |", "|---|---:|---:|---:|"]
    for preset in PRESETS:
        cells = [cell(driven(preset, robot, ideal=ideal, fixes=fixes) for ideal in (False, True)) for robot in ROBOTS]
        lines.append(f"| `{preset}` | {' | '.join(cells)} |")
    return lines


def tables() -> dict[str, list[str]]:
    """Return the page's tables, of fresh runs."""
    assert sorted(PRESETS) == [name for name in preset_names() if not name.startswith("radio_")]
    return {
        "presets": errors_table(fixes=True),
        "presets-no-fixes": errors_table(fixes=False),
    }


def written() -> str:
    """Return the page with the tables of fresh runs."""
    return with_tables(PAGE, tables())


if __name__ == "__main__":
    sys.exit(main("tests.host.preset_page", __doc__, PAGE, tables))
