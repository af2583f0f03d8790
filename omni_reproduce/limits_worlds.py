# SPDX-License-Identifier: MIT
"""The estimate beside the posterior bound in random worlds: python -m omni_reproduce.limits_worlds --seed N.

A seed draws each world: robot, floor, size and time of slip, rate and noise of the fixes, gyro or not. The robot is
told the noise of its fixes and its gyro, as a data sheet does, and nothing of slip and floor. Cells are the errors of
its estimate, position in mm / heading in mrad, and in brackets the same over the bound. The bound is that for ideal
wheels, also beside real ones. Nothing is tuned to these worlds.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil_sim.batch import run_batch
from hil_sim.c_scenario import scenario_world
from hil_sim.table_command import say
from omni_reproduce import limits
from omni_reproduce.limits import WHEELS
from omni_reproduce.posterior_bound import STEP_S, Array
from omniwheel.presets import read_preset
from omniwheel.robots import parameter_table

FIRST_RUN = 9001
"""Seed of the first run in each world."""
PATHS = 2
"""Along so many paths the bound is computed; it differs little between them."""
SHIPPED, PRESET = "as shipped", "fixed_noise"
ROBOTS = {"demo": "three wheels", "four_wheel": "four wheels", "fast": "fast"}
FIX_RATES_HZ = (2.0, 5.0, 10.0, 20.0, 25.0, 50.0, 100.0)
SLIP_MAX, SLIP_TIME_S = (0.02, 0.3), (0.5, 10.0)
FIX_SD, GYRO_DENSITY = (0.0005, 0.02), (4.9e-5, 2e-4)
FRICTION, STIFFNESS_FACTOR = (0.4, 0.9), (0.5, 2.0)
"""Between these numbers a world is drawn: slip and friction evenly, the others by their logarithm."""
MONTE_CARLO = 0.05
"""By so much the root mean square over a few runs may be below the bound."""
TIES = 0.01
"""Errors that differ by a smaller share count as equal."""


@dataclass(frozen=True)
class World:
    """A drawn world: in words, and as a setting of ``limits.toml`` would have it."""

    title: str
    entry: dict[str, Any]


@dataclass(frozen=True)
class Outcome:
    """Errors in one world [mm, mrad]: the bound, and those of each (wheels, trial).

    ``stopped`` counts the runs in which the robot stopped by itself on the way. They count as far as they came.
    """

    bound: Array
    reached: dict[tuple[str, str], Array]
    stopped: int

    def ratio(self, wheels: str, trial: str) -> Array:
        """Return the error over the bound, (position, heading)."""
        return self.reached[wheels, trial] / self.bound


def trials() -> dict[str, Mapping[str, float]]:
    """Return the parameters that are tried in each world, by their name; the first is as shipped."""
    preset = read_preset(PRESET, parameter_table()).parameters
    return {SHIPPED: {}, f"preset {PRESET}": preset}


def draw(seed: int, number: int) -> World:
    """Return world ``number`` of a seed. It does not depend on how many are drawn."""
    random = np.random.default_rng([seed, number])

    def spread(low: float, high: float) -> float:
        return float(np.exp(random.uniform(np.log(low), np.log(high))))

    scenario = str(random.choice(list(ROBOTS)))
    slip_max = float(random.uniform(*SLIP_MAX))
    slip_time_s = max(1, round(spread(*SLIP_TIME_S) / STEP_S)) * STEP_S
    rate_Hz = float(random.choice(FIX_RATES_HZ))
    sd_xy_m, sd_theta_rad = spread(*FIX_SD), spread(*FIX_SD)
    friction = float(random.uniform(*FRICTION))
    stiffness = spread(*STIFFNESS_FACTOR)
    has_gyro, density = bool(random.random() < 0.5), spread(*GYRO_DENSITY)
    world = {
        "slip_max": slip_max,
        "slip_time_s": slip_time_s,
        "fix_rate_Hz": rate_Hz,
        "fix_sd_xy_m": sd_xy_m,
        "fix_sd_theta_rad": sd_theta_rad,
        "friction_coefficient": friction,
        "slip_stiffness_N_s_m": stiffness * stiffness_of(scenario),
    }
    parameters = {"EKF_R_XY": sd_xy_m, "EKF_R_TH": sd_theta_rad}
    if has_gyro:
        world |= {"gyro_rate_Hz": 1000.0, "gyro_noise_density": density}
        parameters |= {"GYRO_AXIS": 3, "GYRO_ND": density}
    title = (
        f"{ROBOTS[scenario]}{', gyro' if has_gyro else ''}; slip {100 * slip_max:.0f} % / {slip_time_s:.1f} s; "
        f"fixes {rate_Hz:g} Hz, {1e3 * sd_xy_m:.1f} mm, {1e3 * sd_theta_rad:.1f} mrad; "
        f"floor {friction:.2f}, x {stiffness:.2f}"
    )
    return World(title, {"title": title, "scenario": scenario, "world": world, "parameters": parameters})


def stiffness_of(scenario: str) -> float:
    """Return the traction per creep of a scenario's robot [N s/m]."""
    spec = {"setting": {"plain": {"scenario": scenario}}}
    return float(scenario_world(limits.scenario_of(spec, "plain", "real")).slip_stiffness_N_s_m)


def outcome_of(world: World, seeds: int) -> Outcome:
    """Compute the bound of a world, and drive in it on both kinds of wheels with each trial's parameters."""
    spec = {"experiment": {"seed": FIRST_RUN}, "setting": {"drawn": world.entry}}
    bound, _ = limits.bound_and_informed_filter(spec, "drawn", PATHS)
    reached, stopped = {}, 0
    for wheels in WHEELS:
        base = limits.scenario_of(spec, "drawn", wheels)
        for trial, parameters in trials().items():
            rows = run_batch(base.with_parameters(parameters), FIRST_RUN, seeds).rows
            errors = 1e3 * np.stack([rows["estimate_position_m"], rows["estimate_theta_rad"]], axis=1)
            stopped += int(np.count_nonzero(rows["completed"] < 1.0))
            reached[wheels, trial] = np.sqrt(np.mean(errors**2, axis=0))
    return Outcome(bound, reached, stopped)


def row(number: int, world: World, outcome: Outcome) -> str:
    """Return a world's line of the table."""
    title = f"{world.title} ({outcome.stopped} runs stopped)" if outcome.stopped else world.title
    cells = [str(number), title, _pair(outcome.bound)]
    for wheels in WHEELS:
        for trial in trials():
            cells.append(f"{_pair(outcome.reached[wheels, trial])} ({_pair(outcome.ratio(wheels, trial))})")
    return f"| {' | '.join(cells)} |"


def summary(outcomes: Sequence[Outcome]) -> list[str]:
    """Return in words how near the bound the estimates are, and how often a trial is better than the defaults."""
    lines = []
    shipped, *others = trials()
    for wheels in WHEELS:
        ratios = {trial: np.array([outcome.ratio(wheels, trial) for outcome in outcomes]) for trial in trials()}
        for trial, found in ratios.items():
            median, worst = _pair(np.nanmedian(found, axis=0)), _pair(np.nanmax(found, axis=0))
            lines.append(f"Over the bound on {wheels} wheels, {trial}: median {median}, worst {worst}.")
        for trial in others:
            change = ratios[trial] / ratios[shipped]
            better, worse = (change < 1.0 - TIES).sum(axis=0), (change > 1.0 + TIES).sum(axis=0)
            lines.append(
                f"On {wheels} wheels {trial} is better by more than {100 * TIES:.0f} % in {better[0]} / {better[1]} of "
                f"{len(outcomes)} worlds, and worse in {worse[0]} / {worse[1]}."
            )
    stopped = sum(outcome.stopped for outcome in outcomes)
    return [*lines, f"Runs in which the robot stopped by itself: {stopped}. They count as far as they came."]


def _pair(values: Array) -> str:
    return f"{values[0]:.2f} / {values[1]:.2f}"


def table(seed: int, worlds: int, seeds: int, say: Callable[[str], None]) -> list[Outcome]:
    """Say the table's lines, each as soon as it is known, and what they come to; return the outcomes."""
    cells = [f"{wheels} wheels, {trial}" for wheels in WHEELS for trial in trials()]
    say(f"| | world | bound | {' | '.join(cells)} |")
    say("|---" * (3 + len(cells)) + "|")
    outcomes = []
    for number in range(1, worlds + 1):
        world = draw(seed, number)
        outcomes.append(outcome_of(world, seeds))
        say(row(number, world, outcomes[-1]))
    say("")
    for line in summary(outcomes):
        say(line)
    return outcomes


def below_bound(outcomes: Sequence[Outcome]) -> list[int]:
    """Return the numbers of worlds, from 1, in which an estimate on ideal wheels is better than can be.

    A mean over few runs may be lower than what it estimates, so MONTE_CARLO is allowed.
    """
    ratios = [[outcome.ratio("ideal", trial).min() for trial in trials()] for outcome in outcomes]
    return [number for number, found in enumerate(ratios, start=1) if min(found) < 1.0 - MONTE_CARLO]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m omni_reproduce.limits_worlds", description=__doc__)
    parser.add_argument("--worlds", type=int, default=20, help="how many (20)")
    parser.add_argument("--seed", type=int, default=1, help="that draws the worlds (1)")
    parser.add_argument("--seeds", type=int, default=8, help="runs of each cell (8)")
    chosen = parser.parse_args(arguments)
    for name, least in (("worlds", 1), ("seeds", 1), ("seed", 0)):
        if getattr(chosen, name) < least:
            parser.error(f"--{name} is {getattr(chosen, name)}; {least} or more are needed")
    low = below_bound(table(chosen.seed, chosen.worlds, chosen.seeds, say))
    if low:
        worlds = ", ".join(map(str, low))
        sys.stderr.write(f"error: below the bound, so it is wrong there or these are too few runs: worlds {worlds}\n")
        sys.exit(1)


if __name__ == "__main__":
    main()
