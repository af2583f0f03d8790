# SPDX-License-Identifier: MIT
"""The PC firmware in a simulated world whose wiring may be wrong, in simulated time, with a person beside it."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest

from hil_sim.faults import Fault
from hil_sim.lockstep import LockstepLink
from hil_sim.world import NO_POSE_SENSOR, World, world_config
from omniwheel import FirmwareProcess
from omniwheel.bringup import HandMotion
from omniwheel.dialect import mavlink
from omniwheel.link import FileLink, open_link
from omniwheel.robot import Robot, connect
from omniwheel.robots import read_robot
from tests.waiting import wait_until

STAND = 1e-6
FLOOR = 0.6
REVOLUTION_RAD_S = math.pi
STEP_TICKS = 10
PUSH_M_S = 0.1
"""Of a push of a metre."""
HEADER, CHECKSUM = 10, 2


class SteppedLink(LockstepLink):
    """Runs a few ticks per read, which is finer than anything that these checks look at."""

    def read(self, timeout_s: float) -> bytes:
        data = self._take()
        if not data and timeout_s > 0.0:
            self.run(min(STEP_TICKS, max(1, round(timeout_s * 1e3))))
            data = self._take()
        return data


class RadioLink:
    """The robot's first link, lossy and slow on request; the world hangs on its second one, and reading moves it on."""

    def __init__(self, base: FileLink, world: LockstepLink) -> None:
        self.url = "radio"
        self.loss = 0.0
        self.delay_s = 0.0
        self.written = 0
        self.extra = b""
        self._base = base
        self._world = world
        self._random = random.Random(1)
        self._late: list[tuple[float, bytes]] = []

    def clock_s(self) -> float:
        return self._world.clock_s()

    def read(self, timeout_s: float) -> bytes:
        if timeout_s > 0.0:
            self._world.run(min(STEP_TICKS, max(1, round(timeout_s * 1e3))), self._world.drop_received)
            self._world.drop_received()
        for frame in frames_of(self._base.read(0.0)):
            if self._random.random() >= self.loss:
                self._late.append((self.clock_s() + self.delay_s, frame))
        due = [frame for due_s, frame in self._late if due_s <= self.clock_s()]
        self._late = [entry for entry in self._late if entry[0] > self.clock_s()]
        extra, self.extra = self.extra, b""
        return extra + b"".join(due)

    def write(self, data: bytes) -> None:
        self.written += len(data)
        if self._random.random() >= self.loss:
            self._base.write(data)

    def close(self) -> None:
        self._base.close()
        self._world.close()


def frames_of(data: bytes) -> list[bytes]:
    """Split unsigned MAVLink 2 frames."""
    found = []
    while data:
        length = HEADER + data[1] + CHECKSUM
        found.append(data[:length])
        data = data[length:]
    return found


class Stranger:
    """Another ground station, on the robot's second link."""

    def __init__(self, link: FileLink, world: LockstepLink) -> None:
        self._link = link
        self._world = world
        self._codec: Any = mavlink.MAVLink(None, 254, 190)
        self._codec.robust_parsing = True

    def stop(self) -> None:
        """Press the emergency stop; return once the robot has taken it."""
        message = mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_OMNI_ESTOP, 0, 1.0, *[0.0] * 6)
        self._link.write(bytes(message.pack(self._codec)))
        wait_until(self._is_answered, "the robot answers no stop", pause=lambda: self._world.run(1))

    def _is_answered(self) -> bool:
        messages = self._codec.parse_buffer(self._link.read(0.0)) or ()
        return any(message.get_type() == "COMMAND_ACK" for message in messages)


class Bench:
    """A robot, the world it is in, and somebody who turns wheels, agrees to everything and says what really moved.

    ``hands`` are radians per wheel that the person turns it by when told to.
    """

    def __init__(self, robot: Robot, world: World, link: LockstepLink) -> None:
        self.robot = robot
        self.world = world
        self.link = link
        self.told: list[str] = []
        self.questions: list[str] = []
        self.answers: dict[str, bool] = {}
        self.agrees = True
        self.hands = [2 * math.pi] * world.wheels
        self.presses = False
        self.turn_rad = 2 * math.pi
        self.push_m = 1.0
        self.push_rad = 0.0
        self.aside_rad = math.pi / 2.0
        self.stranger: Stranger | None = None
        self._moved = np.zeros(world.wheels)

    def show(self, text: str) -> None:
        self.told.append(text)
        if text.startswith("Turn wheel "):
            self._turn(int(text.split()[2]) - 1)
        if text.startswith("Turn the robot"):
            self._turn_robot()
        if text.startswith("Push the robot"):
            aside = "to its left" in text
            self._push_robot(0.5 * self.push_m if aside else self.push_m, self.aside_rad if aside else self.push_rad)
        if self.presses and "the stop button" in text:
            self._press("keep it pressed" in text)

    def move_by_hand(self, _motion: HandMotion, text: str) -> None:
        self.show(text)

    def confirm(self, question: str) -> bool:
        assert not self.armed
        self.questions.append(question)
        return self.agrees

    def saw(self, question: str) -> bool | None:
        assert not self.armed
        self.questions.append(question)
        return next((answer for words, answer in self.answers.items() if words in question), None)

    @property
    def armed(self) -> bool:
        return any(bridge > 0.0 for bridge in [*self.world.c.in1, *self.world.c.in2])

    def _press(self, pressed: bool) -> None:
        """Press the stop button a little later, or let it go."""
        config = self.world.c.config
        at_s = self.link.clock_s() + 0.5
        if pressed:
            fault = config.fault[config.fault_count]
            config.fault_count += 1
            fault.kind, fault.start_s, fault.stop_s = Fault("stop_button", 0.0).kind, at_s, math.inf
        else:
            config.fault[config.fault_count - 1].stop_s = at_s

    def _turn_robot(self) -> None:
        """Take hold of the robot on the floor: all wheels turn along. ``turn_rad`` counter-clockwise."""
        config = self.world.c.config
        lever = float(config.wheel_distance_m[0]) / float(config.wheel_radius_m[0])
        self.hands = [self.turn_rad * lever] * self.world.wheels
        for wheel in range(self.world.wheels):
            self._turn(wheel)

    def _push_robot(self, way_m: float, direction_rad: float) -> None:
        """Push the robot on the floor along its own axes: its wheels roll along."""
        config = self.world.c.config
        start_s = self.link.clock_s() + 0.5
        for wheel in range(self.world.wheels):
            rolled_m = way_m * math.sin(direction_rad - float(config.wheel_angle_rad[wheel]))
            fault = config.fault[config.fault_count]
            config.fault_count += 1
            fault.kind, fault.wheel = Fault("wheel_turned", 0.0).kind, wheel
            fault.value = rolled_m / float(config.wheel_radius_m[wheel]) * PUSH_M_S
            fault.start_s, fault.stop_s = start_s, start_s + 1.0 / PUSH_M_S

    def _turn(self, wheel: int) -> None:
        """Book a hand in the world, a little later."""
        if not self.hands[wheel]:
            return
        config = self.world.c.config
        fault = config.fault[config.fault_count]
        config.fault_count += 1
        fault.kind = Fault("wheel_turned", 0.0).kind
        fault.wheel = wheel
        fault.value = math.copysign(REVOLUTION_RAD_S, self.hands[wheel])
        fault.start_s = self.link.clock_s() + 0.5
        fault.stop_s = fault.start_s + abs(self.hands[wheel]) / REVOLUTION_RAD_S


@pytest.fixture
def radio() -> Iterator[tuple[Robot, RadioLink]]:
    """A robot in a world, connected over a radio."""
    with FirmwareProcess(lockstep=True, links=["tcp:127.0.0.1:0"] * 2) as firmware:
        world = LockstepLink(open_link(firmware.urls[1]), World(world_config(read_robot("three_wheel"))))
        link = RadioLink(open_link(firmware.urls[0]), world)
        with connect(link, clock=link.clock_s) as robot:
            yield robot, link


MakeBench = Callable[..., Bench]


@pytest.fixture
def make_bench() -> Iterator[MakeBench]:
    """Build a bench: ``change`` edits hil_world_config_t, ``parameters`` are the firmware's."""
    with ExitStack() as stack:

        def make(
            *,
            robot: str = "three_wheel",
            on_floor: bool = False,
            faults: Sequence[Fault] = (),
            change: Callable[[Any], None] = lambda config: None,
            parameters: dict[str, float] | None = None,
            stranger: bool = False,
        ) -> Bench:
            file = read_robot(robot)
            config = world_config(
                file,
                pose_sensor=NO_POSE_SENSOR,
                faults=faults,
                friction_coefficient=FLOOR if on_floor else STAND,
            )
            change(config)
            links = ["tcp:127.0.0.1:0"] * (2 if stranger else 1)
            firmware = stack.enter_context(
                FirmwareProcess(robot, lockstep=True, parameters=parameters or {}, links=links)
            )
            world = World(config)
            link = SteppedLink(open_link(firmware.urls[0]), world)
            connected = stack.enter_context(connect(link, clock=link.clock_s))
            bench = Bench(connected, world, link)
            if stranger:
                bench.stranger = Stranger(open_link(firmware.urls[1]), link)
            return bench

        yield make


@pytest.fixture
def bench(make_bench: MakeBench) -> Bench:
    return make_bench()
