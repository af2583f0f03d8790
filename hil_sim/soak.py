# SPDX-License-Identifier: MIT
"""A long drive on the emulated processor's own timing: no missed tick, no lost byte, no drift of the clock."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from hil_sim.pins import PinsLink
from hil_sim.runs import new_world
from hil_sim.scenario import Scenario
from hil_sim.world import World
from omniwheel.connection import Connection
from omniwheel.dialect import mavlink
from omniwheel.emulated_firmware import EmulatedFirmware
from omniwheel.robot import Robot
from omniwheel.telemetry import Status

TICK_US = 1000
ICOUNT_SHIFT = 4
"""16 ns per instruction: 62 million a second, a tenth of a Teensy 4.0's clock."""
SETTLE_S = 2.0
SLICE_S = 0.25
WAITING_LIMIT = 400
"""Bytes for the robot that may wait for the line: a few commands, not a queue that grows."""
SLOWEST_M_S = 0.01
JITTER_US = 100
"""A tick may begin this late behind its timer: the interrupt waits for another one."""


@dataclass(frozen=True)
class SoakResult:
    """What the run showed; times in s and us, counts since the start. ``failures`` is empty if all is well."""

    simulated_s: float
    wall_s: float
    ticks: int
    overruns: int
    drift_us: float
    late_us_max: float
    bytes_waiting_max: int
    rx_errors: int
    tx_dropped: int
    i2c_errors: int
    tick_us_mean: float
    tick_us_max: float
    distance_m: float
    estimate_error_m_max: float
    state: str
    faults: tuple[str, ...]
    failures: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return all of it for JSON."""
        return asdict(self)


class _Watch:
    """Looks at every tick."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._first_us = 0
        self._last_us = 0
        self._ticks = 0
        self._at = (0.0, 0.0)
        self.late_us_max = 0.0
        self.missed = 0
        self.distance_m = 0.0

    def on_tick(self, time_us: int) -> None:
        if self._ticks == 0:
            self._first_us = time_us
        elif time_us - self._last_us > TICK_US + TICK_US // 2:
            self.missed += 1
        self._last_us = time_us
        self._ticks += 1
        self.late_us_max = max(self.late_us_max, abs(self.drift_us()))
        if self._ticks % 10 == 0:
            x, y, _ = self._world.truth
            self.distance_m += math.dist((x, y), self._at)
            self._at = (x, y)

    def drift_us(self) -> float:
        """Return how far the clock is from the count of ticks."""
        return float(self._last_us - self._first_us - (self._ticks - 1) * TICK_US)


def run_soak(
    scenario: Scenario,
    minutes: float,
    progress: Callable[[float, float], None] | None = None,
    *,
    shift: int = ICOUNT_SHIFT,
) -> SoakResult:
    """Drive the scenario's trajectory for so long in simulated time, on the emulated processor.

    Its laps are without end; the world and its faults are the scenario's, events are not played. A second link, a
    serial port without a reader, streams throughout. Raises what starting and arming a robot raises.
    """
    world = new_world(scenario)
    watch = _Watch(world)
    values = scenario.parameter_values()
    values.update({"TRJ_LAPS": 0.0, "LINK1_BUDGET": 8000.0})
    start = time.perf_counter()
    with EmulatedFirmware(parameters=values, pins=True, icount_shift=shift) as firmware:
        link = PinsLink(firmware.open_pins(), world, watch.on_tick)
        connection = Connection(link, clock=link.clock_s)
        connection.target_system = int(values["SYS_ID"])
        connection.target_component = mavlink.MAV_COMP_ID_AUTOPILOT1
        robot = Robot(connection, table=scenario.robot.table)
        robot.pump(SETTLE_S)
        robot.set_pose_estimate(*scenario.start_pose)
        robot.start_trajectory()
        robot.arm()
        drive = _Drive(robot, link, world)
        drive.until(minutes * 60.0, progress)
        status = robot.wait_for(Status)
        result = _result(link, watch, drive, status, time.perf_counter() - start)
        robot.disarm()
        return result


class _Drive:
    """Keeps the line served and remembers the worst that was seen."""

    def __init__(self, robot: Robot, link: PinsLink, world: World) -> None:
        self._robot = robot
        self._link = link
        self._world = world
        self.waiting_max = 0
        self.error_m_max = 0.0

    def until(self, end_s: float, progress: Callable[[float, float], None] | None) -> None:
        """Drive on, at most until the robot stops by itself."""
        while self._link.clock_s() < end_s and self._robot.status.state in ("armed", "disarmed", "unknown"):
            self._robot.pump(SLICE_S)
            self.waiting_max = max(self.waiting_max, self._link.waiting)
            tracking = self._robot.status.tracking
            if tracking is not None:
                x, y, _ = self._world.truth
                self.error_m_max = max(self.error_m_max, math.dist((x, y), tracking.pose[:2]))
            if progress is not None:
                progress(self._link.clock_s(), end_s)


def _result(link: PinsLink, watch: _Watch, drive: _Drive, status: Status, wall_s: float) -> SoakResult:
    checks = {
        f"{watch.missed} ticks came late or not at all": watch.missed > 0,
        f"{status.overruns} overruns counted by the firmware": status.overruns > 0,
        f"the firmware counted {status.ticks} ticks, the world {link.ticks}": abs(status.ticks - link.ticks) > TICK_US,
        f"the clock drifted by {watch.late_us_max:g} us": watch.late_us_max > JITTER_US,
        f"{status.rx_errors} receive errors": status.rx_errors > 0,
        f"{drive.waiting_max} bytes waited for the line": drive.waiting_max > WAITING_LIMIT,
        f"{status.i2c_errors} I2C errors": status.i2c_errors > 0,
        f"the robot is {status.state}: {', '.join(status.fault_history)}": status.state != "armed",
        "the robot did not move": watch.distance_m < SLOWEST_M_S * link.clock_s(),
    }
    return SoakResult(
        simulated_s=link.clock_s(),
        wall_s=wall_s,
        ticks=link.ticks,
        overruns=status.overruns,
        drift_us=watch.drift_us(),
        late_us_max=watch.late_us_max,
        bytes_waiting_max=drive.waiting_max,
        rx_errors=status.rx_errors,
        tx_dropped=status.tx_dropped,
        i2c_errors=status.i2c_errors,
        tick_us_mean=status.tick_us_mean,
        tick_us_max=status.tick_us_max,
        distance_m=watch.distance_m,
        estimate_error_m_max=drive.error_m_max,
        state=status.state,
        faults=status.fault_history,
        failures=tuple(text for text, failed in checks.items() if failed),
    )
