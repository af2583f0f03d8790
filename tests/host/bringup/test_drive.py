# SPDX-License-Identifier: MIT
from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from hil_sim.faults import Fault
from omniwheel.bringup import Result, check_drive
from omniwheel.robots import find_robot_file
from tests.host.bringup.conftest import Bench, MakeBench


def failures(result: Result) -> dict[str, str]:
    return {finding.name: finding.advice for finding in result.findings if not finding.ok}


def watch(bench: Bench) -> None:
    """Answer from the world's truth: what a person sees who looks where the robot went."""
    last = [bench.world.truth.copy()]

    def saw(question: str) -> bool | None:
        moved = bench.world.truth - last[0]
        last[0] = bench.world.truth.copy()
        if "forward" in question:
            return bool(moved[0] > 0.1 and abs(moved[1]) < 0.1)
        if "left" in question:
            return bool(moved[1] > 0.1 and abs(moved[0]) < 0.1)
        return bool(moved[2] > 1.0)

    bench.saw = saw  # type: ignore[method-assign]


@pytest.mark.full
@pytest.mark.parametrize("robot", ["three_wheel", "four_wheel"])
def test_a_good_robot_drives_its_square(make_bench: MakeBench, robot: str) -> None:
    bench = make_bench(robot=robot, on_floor=True)
    watch(bench)
    result = check_drive(bench.robot, bench)
    assert result.ok, failures(result)
    assert result.measured["forward"][0] == pytest.approx(0.2, abs=0.02)
    assert result.measured["turn_left"][2] == pytest.approx(math.pi / 2, abs=0.1)
    assert not bench.armed


@pytest.mark.full
def test_small_wheels_take_longer_instead_of_failing(make_bench: MakeBench, tmp_path: Path) -> None:
    small = tmp_path / "small.toml"
    text = find_robot_file("three_wheel").read_text(encoding="utf-8")
    small.write_text(text.replace("wheel_radius_m = 0.0508", "wheel_radius_m = 0.03"), encoding="utf-8")
    bench = make_bench(robot=str(small), on_floor=True)
    assert bench.robot.parameters["WHEEL_RADIUS"] == pytest.approx(0.03)
    watch(bench)
    result = check_drive(bench.robot, bench)
    assert result.ok, failures(result)
    assert result.measured["turn_left"][2] == pytest.approx(math.pi / 2, abs=0.1)


def test_everything_the_wrong_way_round_is_seen_by_the_person_only(make_bench: MakeBench) -> None:
    def change(config: Any) -> None:
        for wheel in range(3):
            config.motor_direction[wheel] *= -1
            config.encoder_direction[wheel] *= -1

    bench = make_bench(on_floor=True, change=change)
    watch(bench)
    result = check_drive(bench.robot, bench)
    assert list(failures(result)) == ["forward: observed"]
    assert "invert [motor] direction and [encoder] direction" in result.advice[0]


def test_wheels_in_another_order_are_seen(make_bench: MakeBench) -> None:
    def change(config: Any) -> None:
        config.wheel_angle_rad[1], config.wheel_angle_rad[2] = config.wheel_angle_rad[2], config.wheel_angle_rad[1]

    bench = make_bench(on_floor=True, change=change)
    watch(bench)
    result = check_drive(bench.robot, bench)
    assert not result.ok
    assert "wheel 2: 120°" in result.advice[0]


def test_a_reversed_motor_ends_the_drive_with_the_robot_s_reason(make_bench: MakeBench) -> None:
    bench = make_bench(on_floor=True, faults=[Fault("motor_dead", 0.0, wheel=1)])
    result = check_drive(bench.robot, bench)
    assert list(failures(result)) == ["forward"]
    assert "failsafe: stall" in result.findings[-1].seen
    assert not bench.armed
