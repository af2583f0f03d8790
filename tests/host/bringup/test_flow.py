# SPDX-License-Identifier: MIT
"""The bring-up step on the sensor of motion over the floor, and what OMNI_FLOW says of a drive of known length."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from hil_sim.faults import Fault
from hil_sim.scenario import load_scenario
from omni_schema import FlowWiring
from omniwheel.bringup import check_flow
from omniwheel.bringup.person import NotReadyError
from omniwheel.robots import read_robot
from omniwheel.telemetry import FlowState
from tests.host.bringup.conftest import Bench, MakeBench
from tests.host.bringup.test_stops import failures


def in_world(
    make_bench: MakeBench, faults: Any = (), parameters: dict[str, float] | None = None, **numbers: float
) -> Bench:
    """Return a robot on the floor with such a sensor; ``numbers`` are the world's of it."""

    def change(config: Any) -> None:
        config.flow_rate_Hz = 50.0
        config.seed = 5
        config.motor_inertia_kg_m2 = 1.0  # so that the wheels keep the hand's speed between two steps
        for name, value in numbers.items():
            setattr(config, name, value)

    bench = make_bench(on_floor=True, faults=faults, change=change, parameters={"FLOW_MODE": 2.0, **(parameters or {})})
    bench.push_m = 0.928  # by the wheels, which stop late: the robot itself moves a metre
    return bench


def pushed(bench: Bench) -> float:
    """Return how far the hand has really pushed the robot [m]."""
    return math.hypot(float(bench.world.c.pose[0]), float(bench.world.c.pose[1]))


@pytest.mark.full
def test_a_sensor_that_is_right_passes_and_tells_its_figures(make_bench: MakeBench) -> None:
    bench = in_world(make_bench)
    result = check_flow(bench.robot, bench)
    assert result.ok, failures(result)
    names = [finding.name for finding in result.findings]
    assert names == ["readings", "rest", "whole", "turn", "direction", "scale", "turn again", "left"]
    assert result.measured["x_m"] == pytest.approx(float(bench.world.c.pose[0]), abs=0.01)
    assert result.measured["aside_y_m"] == pytest.approx(float(bench.world.c.pose[1]), abs=0.01)
    assert not bench.armed


@pytest.mark.full
@pytest.mark.parametrize("error", [-0.05, 0.03])
def test_its_scale_is_measured(make_bench: MakeBench, error: float) -> None:
    bench = in_world(make_bench, flow_scale_error=error)
    bench.aside_rad = 0.0
    result = check_flow(bench.robot, bench)
    scale, way = result.measured["scale"], pushed(bench) - result.measured["aside_x_m"] / (1.0 + error)
    assert scale * way == pytest.approx(1.0 / (1.0 + error), rel=0.005)


@pytest.mark.full
@pytest.mark.parametrize("mounted_deg", [1.5, 10.0, 90.0, -135.0, 180.0])
def test_the_direction_that_it_says_is_the_one_of_the_sensor(make_bench: MakeBench, mounted_deg: float) -> None:
    bench = in_world(make_bench, flow_angle_rad=math.radians(mounted_deg))
    result = check_flow(bench.robot, bench)
    assert list(failures(result)) == ([] if mounted_deg == 1.5 else ["direction"])
    off = math.remainder(math.radians(result.measured["angle_deg"] - mounted_deg), math.tau)
    assert off == pytest.approx(0.0, abs=math.radians(1.5))


@pytest.mark.full
def test_with_that_direction_it_passes(make_bench: MakeBench) -> None:
    bench = in_world(make_bench, parameters={"FLOW_ANGLE": -135.0}, flow_angle_rad=math.radians(-135.0))
    assert check_flow(bench.robot, bench).ok


@pytest.mark.full
def test_a_push_of_another_length_is_no_scale(make_bench: MakeBench) -> None:
    bench = in_world(make_bench)
    bench.push_m = 0.5
    result = check_flow(bench.robot, bench)
    assert list(failures(result)) == ["scale"]
    assert "FLOW_SCALE=" in result.advice[0]


def test_a_robot_that_nobody_pushes_fails(make_bench: MakeBench) -> None:
    bench = in_world(make_bench)
    bench.push_m = 0.0
    assert list(failures(check_flow(bench.robot, bench, wait_s=3.0))) == ["way"]
    assert not any("left" in text for text in bench.told), "a second push would tell nothing"


def test_a_sensor_that_sees_nothing_fails(make_bench: MakeBench) -> None:
    bench = in_world(make_bench, faults=[Fault("flow_stuck", 0.0)])
    result = check_flow(bench.robot, bench, wait_s=8.0)
    assert list(failures(result)) == ["way"]
    assert "pin 25" in result.advice[0]


def test_a_sensor_from_which_nothing_comes_fails_at_once(make_bench: MakeBench) -> None:
    bench = in_world(make_bench, faults=[Fault("flow_silent", 0.0)])
    bench.robot.pump(1.0)
    result = check_flow(bench.robot, bench)
    assert list(failures(result)) == ["readings"]
    assert "pin 25" in result.advice[0]
    assert bench.told == []


@pytest.mark.full
def test_a_sensor_that_starts_late_and_wheels_that_were_turned_before_are_fine(make_bench: MakeBench) -> None:
    """As with a chip that calibrates its gyro first, and after the check of the encoders."""
    turned = Fault("wheel_turned", 1.0, 2.0, wheel=0, value=1.0)
    bench = in_world(make_bench, faults=[Fault("flow_silent", 0.0, 0.7), turned])
    bench.robot.pump(4.0)
    result = check_flow(bench.robot, bench)
    assert result.ok, failures(result)


@pytest.mark.parametrize("angle", [90.0, 180.0])
def test_wheels_with_an_angle_are_told_to_have_none(make_bench: MakeBench, angle: float) -> None:
    """Left over from another sensor; any advice on cables would be wrong then."""
    bench = in_world(make_bench, parameters={"FLOW_ANGLE": angle})
    result = check_flow(bench.robot, bench, file=with_chip("Pinpoint"))
    assert list(failures(result)) == ["FLOW_ANGLE"]
    assert bench.told == []


@pytest.mark.full
def test_readings_that_are_lost_on_the_way_are_no_scale(make_bench: MakeBench) -> None:
    bench = in_world(make_bench, flow_drop_probability=0.08)
    result = check_flow(bench.robot, bench)
    assert list(failures(result)) == ["whole"]
    assert "scale" not in result.measured


@pytest.mark.full
def test_the_world_for_practice_passes(make_bench: MakeBench) -> None:
    """Scenario ``push``: nobody has to be there, the pushes come by themselves."""
    practice = load_scenario("push")

    def change(config: Any) -> None:
        config.flow_rate_Hz = practice.world["flow_rate_Hz"]

    bench = make_bench(on_floor=True, faults=practice.faults, change=change, parameters=practice.parameters)
    bench.push_m = 0.0
    result = check_flow(bench.robot, bench)
    assert result.ok, failures(result)
    assert float(bench.world.c.pose[0]) == pytest.approx(1.0, abs=0.02)
    assert float(bench.world.c.pose[1]) == pytest.approx(0.5, abs=0.02)


def with_chip(name: str) -> Any:
    """Return a robot file with this sensor."""
    file = read_robot("three_wheel")
    return replace(file, board=replace(file.board, flow=FlowWiring(file.table.flow_chips[name])))


@pytest.mark.full
@pytest.mark.parametrize(("mounted_deg", "advice"), [(180.0, 'write "x" into reversed'), (90.0, "exchange the cables")])
def test_measuring_wheels_are_put_right_not_turned(make_bench: MakeBench, mounted_deg: float, advice: str) -> None:
    bench = in_world(make_bench, flow_angle_rad=math.radians(mounted_deg))
    result = check_flow(bench.robot, bench, file=with_chip("Pinpoint"))
    assert list(failures(result)) == ["direction"]
    assert advice in result.advice[0]
    assert "FLOW_ANGLE" not in result.advice[0]


@pytest.mark.full
@pytest.mark.parametrize("chip", ["OTOS", "Pinpoint"])
def test_a_sensor_that_counts_y_the_wrong_way_is_found(make_bench: MakeBench, chip: str) -> None:
    """Pushed to the right in place of the left, it reads what such a sensor reads of a push to the left."""
    bench = in_world(make_bench)
    bench.aside_rad = -math.pi / 2.0
    result = check_flow(bench.robot, bench, file=with_chip(chip))
    assert list(failures(result)) == ["left"]
    assert ('write "y" into reversed' if chip == "Pinpoint" else "upside down") in result.advice[0]


@pytest.mark.full
def test_a_second_push_that_does_not_come_fails(make_bench: MakeBench) -> None:
    bench = in_world(make_bench)
    plain = bench.show
    bench.show = lambda text: None if "left" in text else plain(text)  # type: ignore[method-assign]
    assert list(failures(check_flow(bench.robot, bench, wait_s=15.0))) == ["left"]


def test_without_one_it_passes_unless_the_file_has_one(bench: Bench) -> None:
    assert check_flow(bench.robot, bench, file=read_robot("three_wheel")).ok
    assert list(failures(check_flow(bench.robot, bench, file=with_chip("OTOS")))) == ["flow"]
    assert bench.questions == []


def test_nobody_agrees_nothing_is_asked(make_bench: MakeBench) -> None:
    bench = in_world(make_bench)
    bench.agrees = False
    with pytest.raises(NotReadyError):
        check_flow(bench.robot, bench)
    assert bench.told == []


def test_a_drive_of_known_length_tells_scale_and_direction(make_bench: MakeBench) -> None:
    """The sensor reads 3 % too little and is turned by 5 degrees more than it was told."""

    def change(config: Any) -> None:
        config.flow_rate_Hz = 50.0
        config.flow_scale_error = -0.03
        config.flow_angle_rad = 0.0873

    bench = make_bench(on_floor=True, change=change, parameters={"FLOW_MODE": 2.0, "CTL_MODE": 0.0})
    robot, world = bench.robot, bench.world
    robot.set_message_interval("OMNI_FLOW", 20)
    first = robot.wait_for(FlowState)
    assert first.usable
    start = list(world.c.pose)
    robot.arm()
    robot.repeat(lambda: robot.set_velocity(0.15, 0.0, 0.0), 4.0)
    robot.disarm()
    robot.pump(1.0)
    last = robot.wait_for(FlowState)
    way = float(world.c.pose[0]) - start[0]
    assert way > 0.5
    x, y = last.x_m - first.x_m, last.y_m - first.y_m
    assert x == pytest.approx(0.97 * way, rel=0.01)
    assert y / x == pytest.approx(-0.0873, abs=0.01), "it says that the robot went aside the other way"
    assert last.turn_rad - first.turn_rad == pytest.approx(float(world.c.pose[2]) - start[2], abs=5e-3)
    assert last.readings_used + last.readings_refused > 100
    robot.set_message_interval("OMNI_FLOW", None)


def test_a_robot_that_has_none_tells_nothing_of_it(make_bench: MakeBench) -> None:
    bench = make_bench(on_floor=True)
    bench.robot.set_message_interval("OMNI_FLOW", 20)
    state = bench.robot.wait_for(FlowState)
    assert (state.x_m, state.readings_used, state.readings_refused, state.usable) == (0.0, 0, 0, False)
