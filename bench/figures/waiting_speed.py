# SPDX-License-Identifier: MIT
"""How the ends of a lockstep link wait, and how fast it is then: python -m bench.figures.waiting_speed.

For docs/checks/performance.md. It drives the demo through a firmware process, alone and beside a program that keeps a
processor busy (a minute).
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from functools import partial

from hil_sim.hil import run_hil
from hil_sim.lockstep import ASLEEP, LOOKING, MEASURED, Waiting
from hil_sim.scenario import Scenario, load_scenario
from hil_sim.speed import alternate, machine

ROUNDS = 5
SECONDS = 60.0
TICK_S = 1e-3


@contextmanager
def busy() -> Iterator[None]:
    """Keep a processor busy meanwhile."""
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as program:
        try:
            yield
        finally:
            program.kill()


BESIDE: dict[str, Callable[[], AbstractContextManager[None]]] = {"none": nullcontext, "one that never sleeps": busy}
WAYS: dict[str, Waiting] = {"chosen by measuring": MEASURED, "always looking": LOOKING, "always asleep": ASLEEP}


def tick_s(scenario: Scenario, beside: str, way: str) -> float:
    """Run the scenario and return the wall time of a tick [s]."""
    with BESIDE[beside]():
        run = run_hil(scenario, waiting=WAYS[way])
    return run.wall_s / run.ticks


def table(rounds: int = ROUNDS, seconds: float = SECONDS) -> Iterator[str]:
    """Yield the page's lines."""
    scenario = replace(load_scenario("demo"), duration_s=seconds)
    measured = alternate(
        {f"{beside}, {way}": partial(tick_s, scenario, beside, way) for beside in BESIDE for way in WAYS}, rounds
    )
    yield f"| other program | {' | '.join(WAYS)} |"
    yield f"|---|{'---:|' * len(WAYS)}"
    for beside in BESIDE:
        factors = [TICK_S / measured[f"{beside}, {way}"].median for way in WAYS]
        yield f"| {beside} | {' | '.join(f'{factor:.1f}' for factor in factors)} |"
    yield ""
    yield f"*× real time; the demo, {seconds:g} s simulated, median of {rounds} runs in turn. {machine()}.*"


if __name__ == "__main__":
    sys.stdout.writelines(f"{line}\n" for line in table())
