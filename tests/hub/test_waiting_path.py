# SPDX-License-Identifier: MIT
"""Behind a hub all programs may be one station to the robot: what waits there of one must not start for another."""

from __future__ import annotations

import pytest

from omni.hub.in_command import IDLE_S
from omniwheel.dialect import HUB_COMPONENT, mavlink
from tests.hub.bench import ARM, Bench, Station, beat, command

START, STOP = mavlink.MAV_CMD_OMNI_TRAJECTORY_START, mavlink.MAV_CMD_OMNI_TRAJECTORY_STOP


def waiting() -> tuple[Bench, Station, Station]:
    """Return a bench on which the path of the first station waits for arming."""
    bench = Bench()
    first, second = bench.join("first"), bench.join("second")
    bench.robot_is(armed=False)
    first.send(command(START, 3.0, 1.0, count=1))
    bench.run()
    return bench, first, second


def moves(bench: Bench) -> list[tuple[int, int]]:
    """Return component and number of the commands about motion, in their order."""
    return [
        (m.get_srcComponent(), m.command)
        for _, m in bench.sent
        if m.get_type() == "COMMAND_LONG" and m.command in (START, STOP, ARM)
    ]


def test_the_path_of_a_program_that_goes_is_forgotten() -> None:
    bench, first, second = waiting()
    bench.leave(first)
    bench.run()
    assert moves(bench) == [(190, START), (HUB_COMPONENT, STOP)]
    assert not second.results(STOP), "nobody has asked for it"


def test_the_path_of_a_program_that_stays_is_forgotten_before_another_arms() -> None:
    bench, first, second = waiting()
    for _ in range(round(IDLE_S) + 1):
        first.send(beat())
        second.send(beat())
        bench.run(1.0, 0.01)
    second.send(command(ARM, 1.0, count=2))
    bench.run()
    assert moves(bench) == [(190, START), (HUB_COMPONENT, STOP), (190, ARM)]


def test_the_arming_of_its_own_program_starts_it() -> None:
    bench, first, _ = waiting()
    first.send(command(ARM, 1.0, count=2))
    bench.run()
    bench.robot_is(armed=True)
    bench.run()
    bench.leave(first)
    bench.run()
    assert moves(bench) == [(190, START), (190, ARM)]


def test_a_path_of_an_armed_robot_does_not_wait() -> None:
    bench = Bench()
    first = bench.join("first")
    bench.robot_is(armed=True)
    first.send(command(START, 3.0, 1.0, count=1))
    bench.run()
    bench.leave(first)
    bench.run()
    assert moves(bench) == [(190, START)]


def test_another_robot_on_the_line_forgets_its_own() -> None:
    bench = Bench()
    first = bench.join("first")
    bench.robot_is(armed=False)
    start = command(START, 3.0, 1.0, count=1)
    start.target_system = 2
    first.send(start)
    bench.run()
    bench.leave(first)
    bench.run()
    assert [m.target_system for m in bench.commands(STOP)] == [2]


@pytest.mark.parametrize("system", [254, 255])
def test_the_robot_hears_a_station_before_its_first_motion(system: int) -> None:
    """While a robot is armed only the heartbeats of the program in command pass: another one would be refused there."""
    bench = Bench()
    first, second = bench.join("first"), bench.join("second", system)
    first.send(command(ARM, 1.0))
    bench.run()
    bench.robot_is(armed=True)
    second.send(beat(), command(STOP))
    bench.run(0.1)
    bench.sent.clear()
    second.send(command(START, 3.0, 1.0, count=1))
    bench.run()
    names = [(m.get_srcSystem(), m.get_type()) for _, m in bench.sent if m.get_srcComponent() == 190]
    assert names == [(system, "HEARTBEAT"), (system, "COMMAND_LONG")]
