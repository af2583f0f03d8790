# SPDX-License-Identifier: MIT
"""The PC firmware in a simulated world whose wiring may be wrong, in simulated time, with a person beside it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest

from hil_sim.faults import Fault
from hil_sim.lockstep import LockstepLink
from hil_sim.world import NO_POSE_SENSOR, World, world_config
from omniwheel import FirmwareProcess, Robot, connect
from omniwheel.link import open_link
from omniwheel.robots import read_robot

STAND = 1e-3
FLOOR = 0.6
REVOLUTION_RAD_S = math.pi
STEP_TICKS = 10


class SteppedLink(LockstepLink):
    """Runs a few ticks per read, which is finer than anything that these checks look at."""

    def read(self, timeout_s: float) -> bytes:
        data = self._take()
        if not data and timeout_s > 0.0:
            self.run(min(STEP_TICKS, max(1, round(timeout_s * 1e3))))
            data = self._take()
        return data


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
        self._moved = np.zeros(world.wheels)

    def tell(self, text: str) -> None:
        self.told.append(text)
        if text.startswith("Turn wheel "):
            self._turn(int(text.split()[2]) - 1)

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


MakeBench = Callable[..., Bench]


@pytest.fixture
def make_bench() -> Iterator[MakeBench]:
    """Build a bench: ``change`` edits hil_world_config_t, ``wrap`` the link, ``parameters`` are the firmware's."""
    with ExitStack() as stack:

        def make(
            *,
            robot: str = "three_wheel",
            on_floor: bool = False,
            faults: Sequence[Fault] = (),
            change: Callable[[Any], None] = lambda config: None,
            wrap: Callable[[LockstepLink], Any] = lambda link: link,
            parameters: dict[str, float] | None = None,
        ) -> Bench:
            file = read_robot(robot)
            config = world_config(
                file,
                pose_sensor=NO_POSE_SENSOR,
                faults=faults,
                friction_coefficient=FLOOR if on_floor else STAND,
            )
            change(config)
            firmware = stack.enter_context(FirmwareProcess(robot, lockstep=True, parameters=parameters or {}))
            world = World(config)
            link = SteppedLink(open_link(firmware.urls[0]), world)
            connected = stack.enter_context(connect(wrap(link), clock=link.clock_s))
            return Bench(connected, world, link)

        yield make


@pytest.fixture
def bench(make_bench: MakeBench) -> Bench:
    return make_bench()
