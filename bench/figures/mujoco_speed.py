# SPDX-License-Identifier: MIT
"""How long MuJoCo's world takes for a tick, for docs/guides/mujoco.md: python -m bench.figures.mujoco_speed (30 s).

It is the processor's time of the world alone, without firmware and link: the least of several rounds.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator

from hil_sim.mujoco_world import MujocoWorld
from hil_sim.scenario import load_scenario
from hil_sim.speed import alternate, machine

ROBOTS = {"three_wheel": "slow, three wheels", "fast_three_wheel": "fast, three wheels", "four_wheel": "four wheels"}
ROUNDS, TICKS = 20, 250
DUTY = 0.3
"""Of every wheel: the robot spins on the spot, and its rollers hand over all the time."""


class Driven:
    """A robot's world, driven by constant duties."""

    def __init__(self, robot: str) -> None:
        self.world = MujocoWorld(load_scenario("sitl", robot))
        self._wheels = len(self.world.parts.wheels)

    def tick_s(self, ticks: int = TICKS) -> float:
        """Go on, and return the processor's time of a tick [s]."""
        start = time.thread_time()
        for _ in range(ticks):
            self.world.ahead()
            self.world.apply((DUTY,) * self._wheels, (0.0,) * self._wheels)
            self.world.step()
            self.world.sense()
        return (time.thread_time() - start) / ticks


def table(rounds: int = ROUNDS) -> Iterator[str]:
    """Yield the page's lines."""
    driven = {robot: Driven(robot) for robot in ROBOTS}
    spreads = alternate({robot: world.tick_s for robot, world in driven.items()}, rounds)
    yield "| Robot | degrees of freedom | µs per tick | × real time |"
    yield "|---|---:|---:|---:|"
    for robot, words in ROBOTS.items():
        least_s = spreads[robot].least
        yield f"| {words} | {driven[robot].world.model.nv} | {1e6 * least_s:.0f} | {1e-3 / least_s:.1f} |"
    yield ""
    yield f"*Processor's time of the world alone, least of {rounds} rounds. {machine()}.*"


if __name__ == "__main__":
    sys.stdout.writelines(f"{line}\n" for line in table())
