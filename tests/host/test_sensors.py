# SPDX-License-Identifier: MIT
"""Gyro and floor-motion sensor in `omni monitor`: what the real firmware tells of them in a simulated world."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any
from unittest.mock import patch

import pytest
from rich.console import Console
from typer.testing import CliRunner

import omniwheel.robot
from hil_sim.lockstep import SteppedLink
from hil_sim.runs import new_world
from hil_sim.scenario import load_scenario
from omni.cli import app
from omni.cli.monitor import view
from omniwheel import FirmwareProcess
from omniwheel.dialect import mavlink
from omniwheel.robot import Robot, connect
from omniwheel.sensor_messages import RADIO_RATE_HZ, RATE_HZ, find_sensors, sensor_advice
from omniwheel.sensor_quality import (
    BIAS_LIMIT_RAD_S,
    FLOOR,
    GYRO,
    SENSORS,
    SILENT_S,
    WINDOW_S,
    FloorWatch,
    SensorQuality,
    gyro_quality,
    is_present,
    shown,
)
from omniwheel.telemetry import FlowState, GyroState

USED = GyroState(time_s=5.0, rate_rad_s=0.1, bias_rad_s=0.0123, bias_sd_rad_s=0.0004, used=True)
FITS = FlowState(
    time_s=5.0,
    x_m=1.0,
    y_m=0.0,
    turn_rad=0.0,
    nis=3.0,
    readings_used=532,
    readings_refused=3,
    readings_came=600,
    readings_lost=0,
    direction_off_rad=0.0,
    usable=True,
    leads=False,
)
AT_ONCE_S = 3.0


class StoppedLink(SteppedLink):
    """Simulated time, with one Ctrl-C at its end."""

    def read(self, timeout_s: float) -> bytes:
        try:
            return super().read(timeout_s)
        except KeyboardInterrupt:
            self.end_s = math.inf
            raise


@contextmanager
def linked(
    scenario: str, parameters: Mapping[str, float] | None = None, world: Mapping[str, float] | None = None
) -> Iterator[StoppedLink]:
    """A scenario's robot in its world, in simulated time; nobody is connected yet."""
    asked = load_scenario(scenario).with_parameters(parameters or {}).with_world(world or {})
    with FirmwareProcess(parameters=asked.parameter_values(), links=["tcp:127.0.0.1:0"], lockstep=True) as firmware:
        link = StoppedLink(firmware.open_link(), new_world(asked))
        link.end_s = math.inf
        yield link


@contextmanager
def in_world(scenario: str, **more: Any) -> Iterator[Robot]:
    with linked(scenario, **more) as link, connect(link, clock=link.clock_s) as robot:
        robot.pump(0.5)
        yield robot


def monitor(link: SteppedLink, *words: str) -> str:
    """Run `omni monitor` on a robot in simulated time; return what it prints."""

    def to_the_link(_url: object, **options: Any) -> Robot:
        return connect(link, clock=link.clock_s, **options)

    with patch.object(omniwheel.robot, "connect", to_the_link):
        result = CliRunner().invoke(app, ["monitor", "--link", "tcp:127.0.0.1:1", *words], env={"COLUMNS": "200"})
    assert result.exit_code == 0, (result.output, result.exception)
    return result.stdout


def words_of(robot: Robot) -> dict[str, SensorQuality]:
    return {quality.name: quality for quality in robot.status.sensors}


# ---- in words


def test_a_gyro_that_is_used_and_one_that_is_not() -> None:
    assert gyro_quality(USED) == SensorQuality("gyro", True, "used, bias +0.01230 rad/s, sd 0.00040")
    left_out = gyro_quality(replace(USED, used=False))
    assert (left_out.good, left_out.text) == (False, "not used: estimate from the wheels only")
    assert "omni bringup gyro" in left_out.advice


@pytest.mark.parametrize(("bias", "good"), [(0.99, True), (-0.99, True), (1.01, False), (-1.01, False)])
def test_a_bias_that_no_sound_gyro_has(bias: float, good: bool) -> None:
    quality = gyro_quality(replace(USED, bias_rad_s=bias * BIAS_LIMIT_RAD_S))
    assert (quality.good, not quality.advice) == (good, good)


def floor(*states: FlowState) -> SensorQuality:
    watch = FloorWatch()
    for state in states:
        watch.take(state)
    quality = watch.quality()
    assert quality is not None
    return quality


def test_a_floor_sensor_that_fits() -> None:
    assert FloorWatch().quality() is None
    assert floor(FITS) == SensorQuality("floor odometry", True, "used 532, rejected 3, lost 0")


@pytest.mark.parametrize(
    ("change", "text", "advice"),
    [
        ({"readings_came": 0, "usable": False}, "no readings", "check its wires"),
        ({"usable": False}, "used 532, rejected 3, lost 0; not usable", "the robot's messages give the reason"),
        ({"readings_refused": 80}, "used 532, rejected 80, lost 0", "13 % of its readings were rejected"),
        ({"readings_lost": 70}, "used 532, rejected 3, lost 70", "12 % of its readings were lost"),
        ({"direction_off_rad": math.radians(21.3)}, "used 532", "misaligned by -21°: add -21.3 to FLOW_ANGLE"),
        ({"direction_off_rad": 0.4, "usable": False, "readings_refused": 500}, "not usable", "to FLOW_ANGLE"),
    ],
)
def test_what_is_wrong_with_a_floor_sensor_and_what_to_do(change: dict[str, Any], text: str, advice: str) -> None:
    quality = floor(replace(FITS, **change))
    assert not quality.good
    assert text in quality.text
    assert advice in quality.advice


def test_a_few_degrees_and_a_few_readings_are_no_reason_to_warn() -> None:
    assert floor(replace(FITS, direction_off_rad=math.radians(4.0))).good
    assert floor(replace(FITS, readings_used=10, readings_refused=9)).good
    assert floor(replace(FITS, readings_came=20, readings_lost=19)).good


def test_one_that_leads_is_said_and_nothing_has_to_be_done() -> None:
    quality = floor(replace(FITS, leads=True))
    assert quality.good
    assert quality.text.endswith("it overrides the wheels, which spin or slide")


def test_before_it_has_proved_itself_nothing_is_wrong() -> None:
    quality = floor(replace(FITS, readings_used=0, readings_refused=0))
    assert quality.good
    assert quality.text.endswith("not yet verified by a drive")


def minute(refused_first: int, refused_then: int) -> list[FlowState]:
    """Half a minute and another one of 50 readings a second; of each second so many are refused."""
    states, refused = [], 0
    for step in range(int(2 * WINDOW_S) + 1):
        states.append(replace(FITS, time_s=5.0 + step, readings_used=50 * step - refused, readings_refused=refused))
        refused += refused_first if step < WINDOW_S else refused_then
    return states


def test_the_last_half_minute_counts() -> None:
    """What was refused before is over, and what is refused now is not hidden by the hours before."""
    assert not floor(*minute(25, 0)[: int(WINDOW_S)]).good
    assert floor(*minute(25, 0)).good
    late = floor(*minute(0, 8))
    assert "16 % of its readings were rejected" in late.advice


def test_a_robot_that_restarts_counts_anew() -> None:
    states = [*minute(0, 0), replace(FITS, readings_used=30, readings_refused=30, readings_came=60)]
    assert "50 % of its readings were rejected" in floor(*states).advice


def test_what_is_old_or_of_before_a_restart_is_not_shown_as_present() -> None:
    assert is_present(USED, None)
    assert is_present(USED, USED.time_s + 0.9 * SILENT_S)
    assert not is_present(USED, USED.time_s + 1.1 * SILENT_S)
    assert not is_present(USED, USED.time_s - 2.0)
    (nothing,) = shown([GYRO], [])
    assert nothing.text == "no report from the robot"
    assert shown([], [gyro_quality(USED)]) == [], "a robot without one shows none"


# ---- the real firmware


def test_the_monitor_shows_a_line_for_each_sensor() -> None:
    with linked("gyro", parameters={"FLOW_MODE": 2.0}, world={"flow_rate_Hz": 50.0}) as link:
        link.end_s = 4.0
        seen = monitor(link)
    assert "gyro  used, bias " in seen
    assert "floor odometry  used 0, rejected 0, lost 0; not yet verified by a drive" in seen


@pytest.mark.parametrize(("scenario", "key", "name"), [("gyro", "gyro", "gyro"), ("flow", "floor_motion", FLOOR.name)])
def test_a_program_gets_numbers_and_words(scenario: str, key: str, name: str) -> None:
    with linked(scenario) as link:
        link.run(2000, link.drop_received)
        found = json.loads(monitor(link, "--json"))
    other = {"gyro": "floor_motion", "floor_motion": "gyro"}[key]
    assert found[key]["time_s"] > 2.0
    assert found[other] is None
    assert [(one["name"], one["good"], one["advice"]) for one in found["sensors"]] == [(name, True, "")]
    if key == "gyro":
        assert found["gyro"]["used"] is True
        assert 0.0 < found["gyro"]["bias_sd_rad_s"] < 0.001, "it has learned its bias at rest"
    else:
        assert found["floor_motion"]["readings_came"] > 40


@pytest.mark.parametrize("words", [(), ("--json",)])
def test_a_robot_without_sensors_shows_nothing_and_is_asked_for_nothing(words: tuple[str, ...]) -> None:
    with linked("demo") as link, patch.object(Robot, "set_message_interval") as asked:
        link.end_s = 3.0
        seen = monitor(link, *words)
    asked.assert_not_called()
    if words:
        found = json.loads(seen)
        assert (found["gyro"], found["floor_motion"], found["sensors"]) == (None, None, [])
    else:
        assert "wheel" in seen
        assert "gyro" not in seen
        assert "floor" not in seen


def test_a_gyro_from_which_nothing_comes_is_a_warning() -> None:
    with linked("demo", parameters={"GYRO_AXIS": 3.0}) as link:
        link.run(2000, link.drop_received)
        seen = monitor(link, "--once")
    assert "gyro  not used: estimate from the wheels only" in seen
    assert "`omni bringup gyro`" in seen


def test_the_monitor_leaves_the_rate_as_it_was() -> None:
    calls: list[tuple[str, float | None]] = []
    real = Robot.set_message_interval

    def noted(robot: Robot, name: str, rate_hz: float | None) -> None:
        calls.append((name, rate_hz))
        real(robot, name, rate_hz)

    with linked("gyro") as link, patch.object(Robot, "set_message_interval", noted):
        link.end_s = 5.0
        monitor(link)
    assert calls == [("OMNI_GYRO", RATE_HZ), ("OMNI_GYRO", None)]


def test_after_that_the_robot_tells_no_more() -> None:
    with in_world("gyro") as robot:
        came: list[str] = []
        robot.connection.add_listener(lambda message: came.append(message.get_type()))
        with sensor_advice(robot, RATE_HZ):
            robot.pump(3.0)
        assert came.count("OMNI_GYRO") == pytest.approx(3.0 * RATE_HZ, abs=2)
        came.clear()
        robot.pump(3.0)
    assert "OMNI_TRACKING" in came
    assert "OMNI_GYRO" not in came


@pytest.mark.full
def test_the_messages_come_as_rarely_as_asked_for() -> None:
    with in_world("gyro", parameters={"FLOW_MODE": 2.0}, world={"flow_rate_Hz": 50.0}) as robot:
        came: dict[str, int] = {}

        def count(message: Any) -> None:
            came[message.get_type()] = came.get(message.get_type(), 0) + len(message.get_msgbuf())

        remove = robot.connection.add_listener(count)
        with sensor_advice(robot, RADIO_RATE_HZ) as sensors:
            assert sensors == SENSORS
            robot.pump(20.0)
        remove()
    bytes_s = (came["OMNI_GYRO"] + came["OMNI_FLOW"]) / 20.0
    assert 30.0 < bytes_s < 50.0, "of the 480 that a radio of 9600 baud may bring"


@pytest.mark.full
@pytest.mark.parametrize("mounted_deg", [20.0, -30.0])
def test_a_floor_sensor_that_points_elsewhere_is_put_right_by_the_advice(mounted_deg: float) -> None:
    with (
        in_world("flow", parameters={"CTL_MODE": 0.0}, world={"flow_angle_rad": math.radians(mounted_deg)}) as robot,
        sensor_advice(robot, RATE_HZ),
    ):
        drive_in_two_directions(robot)
        quality = words_of(robot)[FLOOR.name]
        assert "not usable: estimate from the wheels only" in quality.text
        advised = float(quality.advice.split(": add ")[1].split()[0])
        assert advised == pytest.approx(mounted_deg, abs=2.0)
        robot.parameters["FLOW_ANGLE"] += advised
        drive_in_two_directions(robot)
        quality = words_of(robot)[FLOOR.name]
        assert (quality.good, quality.advice) == (True, "")


def drive_in_two_directions(robot: Robot) -> None:
    robot.arm()
    for velocity in ((0.15, 0.0, 0.0), (0.0, 0.15, 0.0), (-0.15, 0.0, 0.0), (0.0, -0.15, 0.0)):
        robot.repeat(partial(robot.set_velocity, *velocity), 5.0)
    robot.disarm()
    robot.pump(1.0)


# ---- another firmware


def test_an_older_firmware_is_neither_waited_for_nor_complained_about(fake_robot: Callable[..., Any]) -> None:
    fake = fake_robot()
    del fake.values["GYRO_AXIS"], fake.values["FLOW_MODE"]
    fake.command_results[mavlink.MAV_CMD_REQUEST_MESSAGE] = mavlink.MAV_RESULT_UNSUPPORTED
    with connect(fake, clock=fake.clock) as robot:
        begin_s = fake.now_s
        assert find_sensors(robot) == ()
        assert fake.now_s - begin_s < AT_ONCE_S
        robot.parameters.download()
        assert find_sensors(robot) == ()


def test_a_firmware_that_has_no_such_message_is_left_alone(fake_robot: Callable[..., Any]) -> None:
    fake = fake_robot()
    fake.values["GYRO_AXIS"] = 3.0
    fake.command_results[mavlink.MAV_CMD_REQUEST_MESSAGE] = mavlink.MAV_RESULT_UNSUPPORTED
    fake.command_results[mavlink.MAV_CMD_SET_MESSAGE_INTERVAL] = mavlink.MAV_RESULT_UNSUPPORTED
    with connect(fake, clock=fake.clock) as robot:
        robot.parameters.download()
        with sensor_advice(robot, RATE_HZ) as sensors:
            assert sensors == (GYRO,)
            console = Console(width=200, record=True, file=io.StringIO())
            console.print(view(robot, 3, sensors))
    assert "gyro  no report from the robot" in console.export_text()


def test_a_robot_that_is_gone_is_not_asked_at_the_end(fake: Any, robot: Robot) -> None:
    fake.values["GYRO_AXIS"] = 3.0
    fake.command_results[mavlink.MAV_CMD_REQUEST_MESSAGE] = mavlink.MAV_RESULT_UNSUPPORTED
    robot.parameters.download()
    with sensor_advice(robot, RATE_HZ):
        fake.silent = True
        robot.pump(5.0)
        end_s = fake.now_s
    assert fake.now_s - end_s < AT_ONCE_S
