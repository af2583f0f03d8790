# SPDX-License-Identifier: MIT
"""What real rollers cost, for docs/guides/mujoco.md: python -m bench.figures.rollers (about four minutes)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from hil_sim.hil import run_hil
from hil_sim.metrics import on_path, tracking_rmse
from hil_sim.mujoco_world import MujocoWorld
from hil_sim.runs import run_in_process
from hil_sim.scenario import Scenario, load_scenario

SEEDS = (1, 2, 3)
SHOWN = {
    "demo": "slow robot, fixes",
    "no_slip": "slow robot, none",
    "fast": "fast robot, fixes",
    "fast_no_slip": "fast robot, none",
}
"""Scenarios, and in a few words what they are."""
_SPIN_DUTY, _SPIN_TICKS = 0.1, 4000


class _Weighed(MujocoWorld):
    """Keeps the load of every wheel at every 5th tick."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self.loads: list[list[float]] = []
        self._ticks = 0

    def step(self) -> None:
        """Go on by 1 ms."""
        super().step()
        self._ticks += 1
        if self._ticks % 5 == 0:
            self.loads.append(self.wheel_load_N)


def row(name: str, seeds: Sequence[int] = SEEDS) -> str:
    """Return a scenario's row of the table: ranges over seeds in MuJoCo and in our own world."""
    millimetres, milliradians, loads = [], [], []
    our_millimetres, our_milliradians = [], []
    for seed in seeds:
        scenario = load_scenario(name).with_seed(seed)
        world = _Weighed(scenario)
        run = run_hil(scenario, world=world)
        rmse = tracking_rmse(run.record)
        assert run.done
        assert rmse is not None
        millimetres.append(1e3 * rmse.position_m)
        milliradians.append(1e3 * rmse.theta_rad)
        shown = on_path(run.record)[4::5]
        ours = tracking_rmse(run_in_process(scenario).record)
        assert ours is not None
        our_millimetres.append(1e3 * ours.position_m)
        our_milliradians.append(1e3 * ours.theta_rad)
        loads += [load for load, counts in zip(world.loads, shown, strict=False) if counts]
    weighed = np.array(loads)
    return (
        f"| `{name}`: {SHOWN[name]} | {_range(millimetres)} | {_range(milliradians)} | "
        f"{_range(our_millimetres)} | {_range(our_milliradians)} | "
        f"{np.quantile(weighed, 0.999):.0f} | {100.0 * np.mean(weighed <= 0.0):.1f} |"
    )


def _range(values: Sequence[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:.2f}" if f"{low:.2f}" == f"{high:.2f}" else f"{low:.2f} to {high:.2f}"


def yaw_ripple(robot: str, seed: int = 1) -> float:
    """Return by how much [%] yaw over wheel speed swings about its mean, on a slow spin at a constant duty.

    It is half of the span from the 5th to the 95th percentile.
    """
    world = MujocoWorld(load_scenario("sitl", robot).with_seed(seed))
    wheels = len(world.parts.wheels)
    ratios = []
    for number in range(_SPIN_TICKS):
        world.apply((_SPIN_DUTY,) * wheels, (0.0,) * wheels)
        world.step()
        if number >= _SPIN_TICKS // 4:
            speeds = world.sense().wheel_rad_s
            assert speeds is not None
            ratios.append(world.gyro_rad_s[2] / float(np.mean(speeds)))
    low, high = np.quantile(ratios, [0.05, 0.95])
    return float(50.0 * (high - low) / math.fabs(float(np.mean(ratios))))


def table() -> Iterator[str]:
    """Yield the page's lines."""
    yield "| Scenario | RMSE [mm] | [mrad] | ours [mm] | ours [mrad] | load, 99.9 % below [N] | in the air [%] |"
    yield "|---|---|---|---|---|---|---|"
    for name in SHOWN:
        yield row(name)
    yield ""
    ripples = [yaw_ripple("fast_three_wheel", seed) for seed in SEEDS]
    yield f"Yaw of the fast robot on a slow spin swings by {_range(ripples)} % (seeds {', '.join(map(str, SEEDS))})."


if __name__ == "__main__":
    for line in table():
        print(line, flush=True)
