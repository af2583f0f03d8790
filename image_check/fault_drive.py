# SPDX-License-Identifier: MIT
"""An image under way at the bench: steered and told its pose over USB, while a fault of the world comes and goes.

The pins show what the world's last millisecond was, spread over the next one. So what the wheels and the supply do is
at the wires :data:`SHOWN_S` later; what happens to the bus is there at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from emulated_teensy.machine import Channel
from hil_sim.fault_bench import CIRCLE_PATH, CIRCLE_START, TURN_TWIST
from hil_sim.fault_cases import CIRCLE, FaultCase, Kind
from hil_sim.faults import KINDS
from image_check.bench import Bench
from omniwheel._core import lib
from omniwheel.dialect import Message
from omniwheel.robot import Robot
from omniwheel.telemetry import Health, Status, Tracking, decode
from omniwheel.timesync import TimeSync

STEP_S = 0.001
FINE_S = 0.00025
"""How often the bridges are looked at while it matters when they go off."""
SHOWN_S = 0.001
SETPOINT_S = 0.05
TELEMETRY_HZ = 100.0
_AT_ONCE = ("i2c_nack", "i2c_stuck", "chip_power", "link_silence", "stop_button")


def shown_s(kinds: Sequence[Kind]) -> float:
    """Return how much later than in the world these faults are at the wires."""
    return 0.0 if any(kind.name in _AT_ONCE for kind in kinds) else SHOWN_S


def install(bench: Bench, kinds: Sequence[Kind], start_s: float, lasts_s: float) -> None:
    """Let these faults come to the bench's world."""
    config = bench.world.c.config
    config.fault_count = len(kinds)
    for slot, kind in zip(config.fault, kinds, strict=False):
        slot.kind = KINDS[kind.name]
        slot.wheel = 0 if kind.wheel is None else kind.wheel - 1
        slot.start_s = start_s
        slot.stop_s = start_s + (lasts_s if kind.for_s is None else kind.for_s)
        slot.value = 0.0 if kind.value is None else kind.value


@dataclass
class Seen:
    """The observations of a drive. Times on the robot's clock since power-on.

    ``off_since_s``: all bridge inputs are low since then; None: one is high. ``error_m``: largest distance of the robot
    from where its path was.
    """

    off_since_s: float | None = None
    was_on: bool = False
    faults: set[str] = field(default_factory=set)
    texts: list[str] = field(default_factory=list)
    error_m: float = 0.0
    bus_us: int = 0


class Drive:
    """A client at the robot's USB port that steers it: a turn by setpoints, or the circle that it drives by itself.

    ``seen`` is what there was to see. ``deaf``: sends, but does not read.
    """

    def __init__(self, bench: Bench, drive: str) -> None:
        self.bench = bench
        self.robot: Robot = bench.connect()
        self.seen = Seen()
        self.deaf = False
        self._circle = drive == CIRCLE
        self._time = TimeSync(self.robot.connection)
        self._steers = False
        self._next_s = -math.inf
        self.robot.connection.add_listener(self._listen)

    def show_reason(self) -> None:
        """Ask the robot for the telemetry that is looked at here."""
        for kind in (Status, Health, Tracking):
            self.robot.set_message_interval(kind.message, TELEMETRY_HZ)

    def prepare(self) -> None:
        """Give the robot its path and its place."""
        if self._circle:
            self.robot.parameters.set_many(dict(CIRCLE_PATH))
            self.robot.set_pose_estimate(*CIRCLE_START)

    def start(self) -> None:
        """Arm and drive."""
        if self._circle:
            self.robot.start_trajectory()
        self.robot.arm()
        self.steer()

    def steer(self) -> None:
        """Go on steering a robot that drives."""
        self._steers = True

    def stop(self) -> None:
        """Disarm."""
        self._steers = False
        self.robot.disarm()

    def run(self, duration_s: float, step_s: float = STEP_S) -> None:
        """Steer for so long."""
        end_s = self.bench.clock_s() + duration_s
        while self.bench.clock_s() < end_s - 1e-9:
            self._serve()
            self.bench.advance(min(step_s, end_s - self.bench.clock_s()))
            self._look()

    @property
    def _silent(self) -> bool:
        return bool(lib.hil_world_fault_active(self.bench.world.c, lib.HIL_FAULT_LINK_SILENCE, lib.HIL_MAX_WHEELS))

    def _serve(self) -> None:
        if self._silent:
            self.robot.connection.feed(self.bench.take(Channel.USB))
            return
        if self.deaf:
            self.robot.connection.beat()
        else:
            self.robot.pump(0.0)
        if self.bench.world.c.config.fix_rate_Hz > 0.0:
            self._time.serve()
            self._pass_fix()
        if self._steers and not self._circle and self.bench.clock_s() >= self._next_s:
            self._next_s = self.bench.clock_s() + SETPOINT_S
            self.robot.set_velocity(*TURN_TWIST)

    def _pass_fix(self) -> None:
        sensors = self.bench.world.sense()
        if sensors.has_fix and self._time.synchronised:
            x, y, theta = (float(number) for number in sensors.fix.pose)
            self.robot.send_pose_fix(x, y, theta, self._time.robot_time_us(float(sensors.fix.taken_us) * 1e-6))

    def _look(self) -> None:
        if self.bench.powered:
            self.seen.off_since_s = None
            self.seen.was_on = True
        elif self.seen.off_since_s is None:
            self.seen.off_since_s = self.bench.clock_s()

    def _listen(self, message: Message) -> None:
        status = decode(Status, message)
        if status is not None:
            self.seen.faults.update(status.faults, status.fault_history)
        health = decode(Health, message)
        if health is not None:
            self.seen.bus_us = max(self.seen.bus_us, health.i2c_us)
        tracking = decode(Tracking, message)
        if tracking is not None and self._circle and tracking.phase != "none":
            truth = self.bench.world.truth
            error_m = math.hypot(truth[0] - tracking.reference.x, truth[1] - tracking.reference.y)
            self.seen.error_m = max(self.seen.error_m, error_m)
        if message.get_type() == "STATUSTEXT":
            self.seen.texts.append(message.text)


def begin_fixes(bench: Bench, case: FaultCase) -> None:
    """Let the case's pose sensor begin now."""
    config = bench.world.c.config
    for name, value in case.world.items():
        setattr(config, name, value)
    rate_Hz = float(config.fix_rate_Hz)
    bench.world.c.fixes_taken = math.ceil(float(bench.world.c.time_us) * 1e-6 * rate_Hz)
