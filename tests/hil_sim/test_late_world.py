# SPDX-License-Identifier: MIT
"""`omni sitl` on a computer that is late: a stop waits for no world, and the world takes the robot back afterwards."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import omniwheel.robot
from hil_sim.scenario import load_scenario
from hil_sim.sitl import Sitl, start_sitl
from omniwheel.robot import Robot
from tests.waiting import LONGEST_S, pass_time, wait_until


class Ticking:
    """A world that goes on in a thread of its own, and can be late."""

    def __init__(self, running: Sitl) -> None:
        self.running = running
        self.error: Exception | None = None
        self._go, self._still, self._end = threading.Event(), threading.Event(), threading.Event()
        self._go.set()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._end.is_set():
            if not self._go.is_set():
                self._still.set()
                self._go.wait()
                self._still.clear()
            try:
                self.running.advance(5)
            except Exception as error:
                self.error = error
                return

    def hold(self) -> None:
        self._go.clear()
        assert self._still.wait(LONGEST_S)

    def go_on(self) -> None:
        self._go.set()

    def close(self) -> None:
        self._end.set()
        self._go.set()
        self._thread.join(LONGEST_S)


@pytest.fixture
def world() -> Iterator[Ticking]:
    with start_sitl(load_scenario("sitl"), ["tcp:127.0.0.1:0"]) as running:
        one = Ticking(running)
        yield one
        one.close()


@pytest.fixture
def robot(world: Ticking) -> Iterator[Robot]:
    with omniwheel.robot.connect(world.running.urls[0]) as one:
        yield one


def until(robot: Robot, true: Callable[[], bool], what: str) -> None:
    wait_until(true, what, pause=lambda: robot.pump(0.02))


def in_loop(robot: Robot) -> bool:
    beat = robot.status.heartbeat
    return beat is not None and beat.hil


def armed(robot: Robot) -> bool:
    beat = robot.status.heartbeat
    return beat is not None and beat.armed


def test_a_robot_that_left_for_a_stop_is_in_its_world_again_after_the_release(world: Ticking, robot: Robot) -> None:
    until(robot, lambda: in_loop(robot), "not in the loop")
    world.hold()
    robot.estop()
    until(robot, lambda: not in_loop(robot), "the stop waited for the world")
    ticks = world.running.link.ticks
    world.go_on()
    robot.pump(2.0)
    assert world.running.link.ticks == ticks, "only a release leads on"
    beats = []
    robot.connection.add_listener(lambda m: beats.append(m) if m.get_type() == "HEARTBEAT" else None)
    robot.estop_clear()
    until(robot, lambda: in_loop(robot) and world.running.link.ticks > ticks + 100, "not taken back")
    assert len(beats) < 12, "one a second: what the loop has sent is no debt of its link's budget"
    robot.arm()
    robot.drive_duty([0.2, 0.2, 0.2], 0.5)
    assert world.error is None


def test_a_world_that_is_late_without_a_stop_keeps_its_armed_robot(world: Ticking, robot: Robot) -> None:
    until(robot, lambda: in_loop(robot), "not in the loop")
    robot.arm()
    until(robot, lambda: armed(robot), "not armed")
    world.hold()
    pass_time(1.5)
    world.go_on()
    robot.pump(1.5)
    assert in_loop(robot)
    assert armed(robot)


def test_a_firmware_that_is_late_goes_on_where_it_was(world: Ticking, robot: Robot) -> None:
    until(robot, lambda: in_loop(robot), "not in the loop")
    robot.arm()
    until(robot, lambda: armed(robot), "not armed")
    process = world.running.firmware.pid
    assert process is not None
    ticks = world.running.link.ticks
    os.kill(process, signal.SIGSTOP)
    try:
        pass_time(3.0)
    finally:
        os.kill(process, signal.SIGCONT)
    until(robot, lambda: world.running.link.ticks > ticks + 500, "the world stood still")
    assert in_loop(robot)
    assert armed(robot)
    assert world.error is None


@pytest.mark.full
def test_a_robot_that_was_stopped_before_waits_for_its_release(tmp_path: Path) -> None:
    """Its storage keeps the emergency stop; the program used to end, and then nobody could release it."""
    scenario, storage = load_scenario("sitl"), tmp_path / "storage"
    for start in ("fresh", "stopped", "released"):
        with start_sitl(scenario, ["tcp:127.0.0.1:0"], storage=storage, realtime_factor=0.0) as running:
            assert running.stopped == (start == "stopped")
            world = Ticking(running)
            with omniwheel.robot.connect(running.urls[0]) as robot:
                if start == "fresh":
                    until(robot, lambda: in_loop(robot), "not in the loop")
                    robot.estop()
                    robot.pump(2.0)
                if start == "stopped":
                    robot.estop_clear()
                until(robot, lambda: in_loop(robot) and robot.status.state != "failsafe", start)
                robot.pump(2.0)
            assert world.error is None
            world.close()
