# SPDX-License-Identifier: MIT
"""No number that anybody can send is converted to a whole number that cannot hold it.

Such a conversion ends the process here.
"""

from __future__ import annotations

import os
import random
import signal
from collections.abc import Callable

import pytest

from omniwheel.robots import parameter_table
from tests.firmware.client import mav
from tests.firmware.fake_robot import ARM, DISARM, HEARTBEAT, USB, FakeRobot, command, frame, library

pytestmark = pytest.mark.own_build
HUGE = (0.0, 1e-45, 1e-30, -1e-9, 0.5, -1.5, 255.0, 1e6, 4e9, -4e9, 1e10, 1e19, -1e19, 1e30, -3e38, 3.4e38)
START = mav.MAV_CMD_OMNI_TRAJECTORY_START
KINDS = range(8)
CHILD_S = 50
SETS = 3
"""Parameter sets that are tried per seed."""


@pytest.fixture(scope="module", autouse=True)
def _built() -> None:
    library(trapping=True)


def survives(act: Callable[[FakeRobot], None]) -> None:
    """Run this with a robot in a process of its own, and see that it comes to its end."""
    pid = os.fork()
    if pid == 0:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)  # no Python handler runs in a child that hangs in C
        signal.alarm(CHILD_S)  # a fork inherits no time limit
        act(FakeRobot(trapping=True))
        os._exit(0)
    _, status = os.waitpid(pid, 0)
    assert not os.WIFSIGNALED(status), signal.Signals(os.WTERMSIG(status)).name
    assert os.WEXITSTATUS(status) == 0


def put(robot: FakeRobot, name: str, value: float) -> None:
    robot.send(USB, frame("param_set", 1, 1, name.encode(), value, 9))
    robot.background()


def try_out(robot: FakeRobot) -> None:
    """Plan every path and drive a little along each."""
    for kind in KINDS:
        robot.send(USB, HEARTBEAT, command(START, float(kind), -1.0), ARM)
        robot.tick(20)
        robot.send(USB, DISARM)
        robot.tick(5)
        robot.look()


def test_a_limit_of_almost_nothing(  # the first that was found
) -> None:
    def act(robot: FakeRobot) -> None:
        robot.ready()
        put(robot, "LIM_DUTY", 1e-9)
        try_out(robot)

    survives(act)


@pytest.mark.parametrize("seed", range(3))
def test_parameters_at_and_near_their_ends(seed: int) -> None:
    def act(robot: FakeRobot) -> None:
        draw = random.Random(seed)
        robot.ready()
        infos = [info for info in parameter_table().values() if info.name != "SYS_ID"]
        for _ in range(SETS):
            for info in draw.sample(infos, 6):
                low, high = info.minimum, info.maximum
                near = (low, high, info.default, low + 1e-6 * (high - low), high - 1e-6 * (high - low), 1e-9, *HUGE)
                put(robot, info.name, draw.choice(near))
            try_out(robot)

    survives(act)


def test_every_number_of_every_command(  # most are refused; none may be converted before
) -> None:
    commands = [START, 60111, 60113, 60114, 60115, 60116, 60117, 176, 185, 245, 400, 511, 512]

    def act(robot: FakeRobot) -> None:
        robot.ready()
        for number in commands:
            for place in range(4):
                for value in HUGE:
                    numbers = [0.0] * 7
                    numbers[place] = value
                    robot.send(USB, command(number, *numbers))
                    robot.background()
            robot.look()
            robot.tick(3)
            robot.send(USB, command(mav.MAV_CMD_OMNI_ESTOP, 0.0))
            robot.tick(3)

    survives(act)
