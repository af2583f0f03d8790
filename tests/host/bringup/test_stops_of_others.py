# SPDX-License-Identifier: MIT
"""An emergency stop that a check did not make ends the check with an error, and stays on."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from omniwheel.bringup import check_motors, check_output_enable, check_stop_button, check_stops
from omniwheel.bringup.other_stops import OtherStopError, safety_of
from omniwheel.dialect import mavlink
from omniwheel.errors import ArmingRefusedError
from tests.host.bringup.conftest import Bench, MakeBench

CHECKS = [check_stops, check_stop_button]
OWN_STOP_ON, SILENT, LATER = "own stop on", "setpoints missing", "heartbeats missing"


def with_stranger(make_bench: MakeBench) -> tuple[Bench, Callable[[], None]]:
    bench = make_bench(stranger=True)
    assert bench.stranger is not None
    return bench, bench.stranger.stop


def assert_still_stopped(bench: Bench) -> None:
    bench.robot.pump(0.5)
    assert safety_of(bench.robot).state == "estop"
    with pytest.raises(ArmingRefusedError):
        bench.robot.arm()


@pytest.mark.parametrize("check", CHECKS)
def test_a_check_releases_no_stop_that_was_on_before_it(make_bench: MakeBench, check: Callable[..., object]) -> None:
    bench, stop = with_stranger(make_bench)
    stop()
    with pytest.raises(OtherStopError):
        check(bench.robot, bench)
    assert_still_stopped(bench)


def after(bench: Bench, call: str, number: int, action: Callable[[], None]) -> None:
    """Do something right after the robot's method ``call`` was called for the ``number``-th time."""
    original = getattr(bench.robot, call)
    calls = []

    def wrapped(*arguments: object) -> None:
        calls.append(call)
        original(*arguments)
        if len(calls) == number:
            action()

    setattr(bench.robot, call, wrapped)


STOP_POINTS = {OWN_STOP_ON: ("estop", 1), "wheels turning": ("set_duty", 5), SILENT: ("arm", 3), LATER: ("arm", 4)}
"""After which call of the robot the other station presses; the second arming is the one that the stop refuses."""


@pytest.mark.parametrize("point", STOP_POINTS)
def test_a_stop_of_another_station_ends_the_check_of_the_stops_and_stays_on(make_bench: MakeBench, point: str) -> None:
    bench, stop = with_stranger(make_bench)
    after(bench, *STOP_POINTS[point], stop)
    with pytest.raises(OtherStopError):
        check_stops(bench.robot, bench)
    assert_still_stopped(bench)


def test_a_stop_of_another_station_ends_the_check_of_the_button(make_bench: MakeBench) -> None:
    bench, stop = with_stranger(make_bench)
    after(bench, "set_duty", 10, stop)
    with pytest.raises(OtherStopError):
        check_stop_button(bench.robot, bench)
    assert_still_stopped(bench)


def test_a_stop_while_the_button_is_let_go_is_not_released_with_the_buttons(make_bench: MakeBench) -> None:
    bench, stop = with_stranger(make_bench)
    bench.presses = True
    show = bench.show

    def told(text: str) -> None:
        if text.startswith("Release the stop button"):
            stop()
        show(text)

    bench.show = told  # type: ignore[method-assign]
    with pytest.raises(OtherStopError):
        check_stop_button(bench.robot, bench)
    assert_still_stopped(bench)


@pytest.mark.parametrize("check", [check_motors, check_output_enable])
def test_the_other_checks_name_the_stop_too(make_bench: MakeBench, check: Callable[..., object]) -> None:
    bench, stop = with_stranger(make_bench)
    after(bench, "set_duty", 5, stop)
    with pytest.raises(OtherStopError, match="254"):
        check(bench.robot, bench)
    assert_still_stopped(bench)


def test_a_program_of_the_same_numbers_is_known_by_its_answer(make_bench: MakeBench) -> None:
    """As through a hub, which hands the robot's answers to every program."""
    bench = make_bench()
    robot = bench.robot

    def stop_as_another_program() -> None:
        to = robot.connection
        numbers = (1.0, 0.0, 0.0, 0.0, 40000.0, 0.0, 0.0)
        target = (to.target_system, to.target_component)
        robot.send(mavlink.MAVLink_command_long_message(*target, mavlink.MAV_CMD_OMNI_ESTOP, 0, *numbers))

    after(bench, "estop", 1, stop_as_another_program)
    with pytest.raises(OtherStopError):
        check_stops(robot, bench)
    assert_still_stopped(bench)


def test_a_check_that_is_ended_from_outside_releases_nothing(bench: Bench) -> None:
    """As by STOP on the studio's page, whose message has the robot's own sender."""

    class EndedError(Exception):
        pass

    def end() -> None:
        raise EndedError

    after(bench, "estop", 1, end)
    with pytest.raises(EndedError):
        check_stops(bench.robot, bench)
    assert_still_stopped(bench)
