# SPDX-License-Identifier: MIT
"""A sensor on a bus of its own that fails for a while: what the robot says meanwhile, and when it is over."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from hil_sim.fault_cases import Kind
from hil_sim.scenario import Scenario
from image_check.bench import Bench, CheckError
from image_check.fault_drive import install
from omniwheel.telemetry import Status

STEP_S = 0.02
TROUBLE_S = 1.0
BACK_S = 1.5


@dataclass
class Sensor:
    """A sensor that fails. ``fault``: the warning's name. ``texts`` and ``status``: what the robot has said so far.

    ``meanwhile``: what the robot does for so many seconds while it is waited for.
    """

    bench: Bench
    fault: str
    texts: list[str]
    status: list[Status]
    meanwhile: Callable[[float], None]


def on_floor(scenario: Scenario) -> Scenario:
    """Return the scenario with its robot on the floor. The world has the sensors that the robot file names."""
    return replace(scenario, world={})


def world_fault(bench: Bench, name: str) -> tuple[Callable[[], None], Callable[[], None]]:
    """Return what begins a fault of the world and what ends it: it ends by itself after TROUBLE_S."""

    def begin() -> None:
        install(bench, [Kind(name)], float(bench.world.c.time_us) * 1e-6, TROUBLE_S)

    return begin, lambda: None


def held_line(bench: Bench, pin: int) -> tuple[Callable[[], None], Callable[[], None]]:
    """Return what pulls a pin low, and what lets it go."""
    return lambda: bench.machine.drive_pin(pin, 0), lambda: bench.machine.drive_pin(pin, None)


def fail(sensor: Sensor, word: str, again: str, begin: Callable[[], None], end: Callable[[], None]) -> str:
    """Let it fail for a while. Return how long each answer took; CheckError for one that does not come."""
    bench, texts, status = sensor.bench, sensor.texts, sensor.status
    texts.clear()
    start_s = bench.clock_s()
    begin()
    wait(sensor, lambda: word in texts, TROUBLE_S, f"it does not send “{word}”", texts)
    said_s = bench.clock_s() - start_s
    wait(sensor, lambda: sensor.fault in status[-1].faults, TROUBLE_S, f"it does not warn of {sensor.fault}", [])
    sensor.meanwhile(max(STEP_S, TROUBLE_S - (bench.clock_s() - start_s)))
    end()
    back_s = bench.clock_s()
    wait(sensor, lambda: again in texts, BACK_S, "readings do not resume", texts)
    again_s = bench.clock_s() - back_s
    wait(sensor, lambda: sensor.fault not in status[-1].faults, BACK_S, "the warning does not clear", [])
    return f"“{word}” after {1e3 * said_s:.0f} ms, readings again {1e3 * again_s:.0f} ms after its end"


def wait(sensor: Sensor, condition: Callable[[], bool], limit_s: float, problem: str, texts: Sequence[str]) -> None:
    """Go on until something is so. Raises CheckError."""
    end_s = sensor.bench.clock_s() + limit_s
    while not condition():
        if sensor.bench.clock_s() >= end_s:
            raise CheckError(f"{problem} within {limit_s:g} s; said: {', '.join(texts) or 'nothing'}")
        sensor.meanwhile(STEP_S)
