# SPDX-License-Identifier: MIT
"""Runs fault cases: the real firmware in the simulated world, in lockstep. What counts is the voltage on the motors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from hil_sim import core
from hil_sim.fault_cases import CIRCLE, EMERGENCY_STOP, FAULT_S, FaultCase, Kind
from hil_sim.hil import HilLoop
from hil_sim.metrics import STATE_ARMED
from hil_sim.scenario import Event, Scenario, parse_scenario
from hil_sim.world import World
from omniwheel.firmware_process import FirmwareProcess
from omniwheel.link import FileLink

BACK_S = 0.4
"""How long the robot drives again after the fault."""
TURN_TWIST = (0.0, 0.0, 0.35)
CIRCLE_PATH: dict[str, float | str | bool] = {
    "TRJ_TYPE": "circle",
    "TRJ_SIZE": 0.3,
    "TRJ_PERIOD": 20.0,
    "TRJ_RAMP": 0.5,
    "TRJ_ROT": "fixed",
}
CIRCLE_START = (0.3, 0.0, 0.0)


class RunningFirmware(Protocol):
    """What a started firmware offers."""

    def open_link(self, number: int = 0) -> FileLink:
        """Connect to one of its links."""


Firmware = Callable[..., AbstractContextManager[RunningFirmware]]
"""FirmwareProcess, or another class with its arguments."""


@dataclass(frozen=True)
class FaultResult:
    """What a case did. Times in seconds after the fault's start; the record has a row per tick from the start on.

    ``latency_s`` is the time to zero volts on all motors for good, None if they kept a voltage while the fault lasted.
    """

    case: FaultCase
    record: NDArray[Any]
    latency_s: float | None
    texts: tuple[str, ...]
    faults: tuple[str, ...]
    warnings: tuple[str, ...]
    stayed_armed: bool
    error_m: float
    moved_after: float
    values: dict[str, float]


def fault_scenario(case: FaultCase) -> Scenario:
    """Return the scenario that a case is."""
    circle = case.drive == CIRCLE
    start = list(CIRCLE_START if circle else (0.0, 0.0, 0.0))
    document = {
        "scenario": {"name": case.name, "description": case.what, "robot": "three_wheel", "seed": 1},
        "parameters": {**(CIRCLE_PATH if circle else {}), **case.parameters},
        "world": {"output_enable_wired": 1.0, "start_pose": start, **case.world},
        "fault": [_entry(kind, case) for kind in case.faults],
    }
    return parse_scenario(document, case.name)


def _entry(kind: Kind, case: FaultCase) -> dict[str, Any]:
    lasts_s = case.lasts_s if kind.for_s is None else kind.for_s
    entry: dict[str, Any] = {"kind": kind.name, "start_s": FAULT_S, "stop_s": FAULT_S + lasts_s}
    entry.update({} if kind.wheel is None else {"wheel": kind.wheel})
    entry.update({} if kind.value is None else {"value": kind.value})
    return entry


@contextmanager
def firmware_loop(
    scenario: Scenario, firmware: Firmware = FirmwareProcess, world: World | None = None
) -> Iterator[HilLoop]:
    """Start firmware in the scenario's world, or in one that goes on, and tell the robot where it stands."""
    with firmware(parameters=scenario.parameter_values(), lockstep=True) as running:
        base = running.open_link()
        try:
            loop = HilLoop(scenario, base, world)
            loop.advance(1)
            loop.place()
            yield loop
        finally:
            base.close()


def command(loop: HilLoop, name: str) -> None:
    """Give a command of scenario files now."""
    loop.apply(Event(at_s=0.0, command=name))


def start_driving(loop: HilLoop, drive: str) -> None:
    """Arm and drive: turn on the spot by velocity setpoints, or round a circle by the on-board trajectory."""
    if drive == CIRCLE:
        command(loop, "trajectory_start")
    command(loop, "arm")
    if drive != CIRCLE:
        loop.apply(Event(at_s=0.0, velocity=TURN_TWIST))


def run_case(case: FaultCase, firmware: Firmware = FirmwareProcess) -> FaultResult:
    """Run one case."""
    scenario = fault_scenario(case)
    with firmware_loop(scenario, firmware) as loop:
        start_driving(loop, case.drive)
        chunks = [loop.advance(round(FAULT_S * 1e3) - loop.ticks)]
        chunks.append(loop.advance(round(case.lasts_s * 1e3)))
        moved = _recovery(case, loop, chunks)
        texts = tuple(text.text for text in loop.robot.texts.all)
        return _result(case, np.concatenate(chunks), texts, moved, loop.values)


def _recovery(case: FaultCase, loop: HilLoop, chunks: list[NDArray[Any]]) -> float:
    """Stop, arm and drive again if the robot stopped; return the largest duty while it drives after the fault."""
    chunks.append(loop.advance(20))
    if case.stops is not None:
        command(loop, "disarm")
        chunks.append(loop.advance(150))
        if case.stops == EMERGENCY_STOP:
            loop.robot.estop_clear()
            chunks.append(loop.advance(10))
        start_driving(loop, case.drive)
    back = loop.advance(round(BACK_S * 1e3))
    chunks.append(back)
    armed = back[back["state"] == STATE_ARMED]
    command(loop, "disarm")
    chunks.append(loop.advance(10))
    return float(np.abs(armed["duty"][-100:]).max()) if len(armed) else 0.0


def _result(
    case: FaultCase, record: NDArray[Any], texts: tuple[str, ...], moved: float, values: dict[str, float]
) -> FaultResult:
    tick = np.rint(record["time_s"] * 1e3)
    start = round(FAULT_S * 1e3)
    during = record[(tick >= start) & (tick < start + round(case.lasts_s * 1e3))]
    bits = int(np.bitwise_or.reduce(during["faults"]))
    error = np.hypot(*(during["truth"] - during["reference"])[:, :2].T) if case.drive == CIRCLE else np.zeros(1)
    return FaultResult(
        case=case,
        record=record,
        latency_s=_latency(during),
        texts=texts,
        faults=tuple(core.fault_names(bits)),
        warnings=tuple(core.warning_names(bits)),
        stayed_armed=bool(np.all(during["state"] == STATE_ARMED)),
        error_m=float(error.max()),
        moved_after=moved,
        values=dict(values),
    )


def _latency(during: NDArray[Any]) -> float | None:
    """Time to zero volts for good [s]."""
    powered = np.flatnonzero(np.any(during["duty"] != 0.0, axis=1))
    if len(powered) == 0:
        return 0.0
    if powered[-1] + 1 >= len(during):
        return None
    return float(round(during["time_s"][powered[-1] + 1] - FAULT_S, 6))
