# SPDX-License-Identifier: MIT
from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from hil_sim.faults import Fault
from omniwheel.bringup import Result, check_motors
from omniwheel.bringup.person import NotReadyError
from tests.host.bringup.conftest import Bench, MakeBench


def failures(result: Result) -> dict[str, str]:
    return {finding.name: finding.advice for finding in result.findings if not finding.ok}


def swap_channels(config: Any) -> None:
    for channels in (config.in1_channel, config.in2_channel):
        channels[0], channels[1] = channels[1], channels[0]


def reverse(field: str, wheel: int) -> Callable[[Any], None]:
    def change(config: Any) -> None:
        getattr(config, field)[wheel] *= -1

    return change


@pytest.mark.full
@pytest.mark.parametrize("robot", ["three_wheel", "four_wheel"])
def test_good_motors_pass_and_the_robot_is_left_disarmed(make_bench: MakeBench, robot: str) -> None:
    bench = make_bench(robot=robot)
    result = check_motors(bench.robot, bench)
    assert result.ok, failures(result)
    bench.robot.pump(1.2)
    assert not bench.robot.status.armed
    assert not bench.armed
    assert result.measured["wheel_1"]["speed_over_model"] == pytest.approx(0.95, abs=0.1)
    assert 0.0 < result.measured["wheel_1"]["deadband_duty"] < 0.1


def test_nothing_moves_unless_the_person_agrees(bench: Bench) -> None:
    bench.agrees = False
    with pytest.raises(NotReadyError):
        check_motors(bench.robot, bench)
    assert all(abs(angle) < 1e-6 for angle in bench.world.c.wheel_angle_rad)


@pytest.mark.full
@pytest.mark.parametrize(
    ("answer", "line"), [(False, "[motor]: direction = [1, 1, -1]"), (None, "[motor]: direction = [1, 1, -1]")]
)
def test_a_reversed_motor_names_its_line(make_bench: MakeBench, answer: bool | None, line: str) -> None:
    bench = make_bench(change=reverse("motor_direction", 2))
    if answer is not None:
        bench.answers["clockwise"] = answer
    result = check_motors(bench.robot, bench)
    assert list(failures(result)) == ["motor 3 direction"]
    assert line in result.advice[0]


@pytest.mark.full
def test_a_reversed_encoder_is_told_from_a_reversed_motor_by_what_the_person_saw(make_bench: MakeBench) -> None:
    bench = make_bench(faults=[Fault("encoder_reversed", 0.0, wheel=2)])
    bench.answers["clockwise"] = True
    result = check_motors(bench.robot, bench)
    assert list(failures(result)) == ["motor 3 direction"]
    assert "[encoder]: direction = [1, 1, -1]" in result.advice[0]


@pytest.mark.full
def test_crossed_motors_name_both_and_the_channels(make_bench: MakeBench) -> None:
    bench = make_bench(change=swap_channels)
    bench.answers["itself turn"] = False
    result = check_motors(bench.robot, bench)
    assert set(failures(result)) == {"motor 1", "motor 2"}
    assert "[wiring]: in1_channel = [13, 9, 3] and in2_channel = [14, 8, 2]" in result.advice[0]


@pytest.mark.full
@pytest.mark.parametrize(
    ("kind", "turned", "advice"),
    [("motor_dead", False, "IN1 on PWM channel 13"), ("encoder_stuck", True, "encoder 2 is dead or stuck")],
)
def test_a_dead_motor_and_a_stuck_encoder(make_bench: MakeBench, kind: str, turned: bool, advice: str) -> None:
    bench = make_bench(faults=[Fault(kind, 0.0, wheel=1)])
    bench.answers["Did wheel 2 turn"] = turned
    result = check_motors(bench.robot, bench)
    assert list(failures(result)) == ["motor 2"]
    assert advice in result.advice[0]


def test_one_missing_input_of_a_bridge(make_bench: MakeBench) -> None:
    def change(config: Any) -> None:
        config.in2_channel[1] = 15

    bench = make_bench(change=change)
    result = check_motors(bench.robot, bench)
    assert "motor 2 direction" in failures(result)
    assert "IN2 on 14" in failures(result)["motor 2 direction"]


@pytest.mark.full
def test_wrong_counts_per_turn_show_in_the_speed(make_bench: MakeBench) -> None:
    def change(config: Any) -> None:
        config.counts_per_revolution = 2500

    bench = make_bench(change=change)
    result = check_motors(bench.robot, bench)
    assert set(failures(result)) == {f"motor {wheel} speed" for wheel in (1, 2, 3)}
    assert "counts_per_revolution = 2500" in result.advice[0]


def test_a_robot_that_stops_itself_is_not_blamed_on_a_motor(make_bench: MakeBench) -> None:
    bench = make_bench(faults=[Fault("battery_sag", 1.0, value=8.0)])
    bench.robot.pump(0.1)
    with pytest.raises(Exception, match="battery"):
        check_motors(bench.robot, bench)


def test_an_error_on_the_way_disarms(bench: Bench) -> None:
    def interrupt(text: str) -> None:
        if "wheel 2" in text:
            bench.robot.connection.add_listener(raise_interrupt)

    def raise_interrupt(message: Any) -> None:
        if message.get_type() == "OMNI_SAMPLE" and bench.armed:
            bench.robot.connection._listeners.remove(raise_interrupt)
            raise KeyboardInterrupt

    bench.show = interrupt  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        check_motors(bench.robot, bench)
    bench.robot.pump(1.5)
    assert not bench.robot.status.armed
    assert not bench.armed
