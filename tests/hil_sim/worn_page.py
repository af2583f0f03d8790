# SPDX-License-Identifier: MIT
"""What worn wheels, patches, play and a slope cost: ``python -m tests.hil_sim.worn_page [--write]`` (a minute)."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace

from hil_sim.metrics import tracking_rmse
from hil_sim.patches import FloorPatch
from hil_sim.runs import run_in_process
from hil_sim.scenario import Scenario, load_scenario
from tests.hil_sim.rollers_page import PAGE
from tests.page_tables import main

SEEDS = (1, 2, 3)
SCENARIOS = ("demo", "no_slip", "fast", "fast_no_slip")
ACROSS = FloorPatch((0.1, 0.4), (-0.5, 0.5), 0.1)
"""Covers three of the eight petals in part."""


def changed(scenario: Scenario) -> dict[str, Scenario]:
    """Return the scenario as it is, and with each of the changes that the table has, by their names there."""
    return {
        "as shipped": scenario,
        "one wheel with half its friction": replace(scenario, wheel_numbers={"wheel_friction": (0.5, 1.0, 1.0)}),
        "one wheel with three times its drag": replace(scenario, wheel_numbers={"wheel_drag": (3.0, 1.0, 1.0)}),
        "a patch with a tenth of the friction": replace(scenario, patches=(ACROSS,)),
        "play of 0.01 rad (0.6°)": scenario.with_world({"backlash_rad": 0.01}),
        "play of 0.05 rad (2.9°)": scenario.with_world({"backlash_rad": 0.05}),
        "slope of 0.035 rad (2°)": scenario.with_world({"floor_slope_rad": 0.035}),
    }


def errors(scenario: Scenario, seeds: Sequence[int] = SEEDS) -> list[tuple[float, float]]:
    """Return tracking errors on the path of each seed: RMSE in mm and mrad."""
    found = []
    for seed in seeds:
        run = run_in_process(scenario.with_seed(seed))
        assert run.done, f"{scenario.name} with seed {seed} does not finish"
        rmse = tracking_rmse(run.record)
        found.append((1e3 * rmse.position_m, 1e3 * rmse.theta_rad))
    return found


def _range(values: Sequence[float]) -> str:
    low, high = (f"{value:.2f}" if value < 100.0 else f"{value:.0f}" for value in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"


def table(seeds: Sequence[int] = SEEDS) -> list[str]:
    """Return the lines of the table: for each change and scenario the range over the seeds."""
    head = " | ".join(f"`{name}` [mm] | [mrad]" for name in SCENARIOS)
    lines = [f"| What | {head} |", "|---|" + "---:|" * (2 * len(SCENARIOS))]
    found = {
        name: {what: errors(one, seeds) for what, one in changed(load_scenario(name)).items()} for name in SCENARIOS
    }
    for what in found[SCENARIOS[0]]:
        cells = [_range([error[part] for error in found[name][what]]) for name in SCENARIOS for part in (0, 1)]
        lines.append(f"| {what} | {' | '.join(cells)} |")
    return lines


def tables() -> dict[str, list[str]]:
    """Return the table with the name of its place in the page."""
    return {"worn-wheels": table()}


if __name__ == "__main__":
    sys.exit(main("tests.hil_sim.worn_page", __doc__, PAGE, tables))
