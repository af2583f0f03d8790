# SPDX-License-Identifier: MIT
"""The bring-up step on the gyro: a robot in the simulated world rests, and somebody turns it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from hil_sim.faults import Fault
from omni_schema import GyroWiring
from omniwheel.bringup import check_gyro
from omniwheel.bringup.person import NotReadyError
from omniwheel.robots import read_robot
from tests.host.bringup.conftest import Bench, MakeBench
from tests.host.bringup.test_stops import failures


def in_world(make_bench: MakeBench, axis: int = 3, faults: Any = (), **numbers: float) -> Bench:
    """Return a robot that believes that axis z points up; ``axis`` and ``numbers`` are the world's gyro's."""

    def change(config: Any) -> None:
        config.gyro_rate_Hz = 1000.0
        config.gyro_axis = axis
        config.seed = 5
        config.motor_inertia_kg_m2 = 1.0  # so that the wheels keep the hand's speed between two steps
        for name, value in numbers.items():
            setattr(config, name, value)

    return make_bench(on_floor=True, faults=faults, change=change, parameters={"GYRO_AXIS": 3.0})


@pytest.mark.full
def test_a_gyro_that_is_right_passes_and_tells_its_figures(make_bench: MakeBench) -> None:
    bench = in_world(make_bench)
    result = check_gyro(bench.robot, bench)
    assert result.ok, failures(result)
    assert [finding.name for finding in result.findings] == ["readings", "bias", "noise", "sign", "scale"]
    assert result.measured["bias_rad_s"] == pytest.approx(float(bench.world.c.gyro_bias[2]), abs=3e-4)
    turned = float(bench.world.c.pose[2]) % math.tau + math.tau  # the heavy wheels coast a little further than a turn
    assert result.measured["angle_rad"] == pytest.approx(turned, rel=0.01)
    assert not bench.armed


@pytest.mark.full
def test_its_scale_is_measured(make_bench: MakeBench) -> None:
    """Both gyros see the same turn of a hand."""
    scales = [
        check_gyro(bench.robot, bench).measured["scale"]
        for bench in (in_world(make_bench), in_world(make_bench, gyro_scale_error=0.03))
    ]
    assert scales[0] / scales[1] == pytest.approx(1.03, abs=0.002)


@pytest.mark.full
def test_a_wrong_sign_is_told_with_the_line_that_mends_it(make_bench: MakeBench) -> None:
    bench = in_world(make_bench, axis=-3)
    result = check_gyro(bench.robot, bench)
    assert list(failures(result)) == ["sign"]
    assert "axis = -3" in result.advice[0]


def test_a_turn_by_another_angle_is_no_scale(make_bench: MakeBench) -> None:
    bench = in_world(make_bench)
    bench.turn_rad = math.pi
    result = check_gyro(bench.robot, bench)
    assert list(failures(result)) == ["scale"]
    assert "exactly one turn" in result.advice[0]


def test_a_robot_that_nobody_turns_fails(make_bench: MakeBench) -> None:
    bench = in_world(make_bench)
    bench.turn_rad = 0.0
    assert list(failures(check_gyro(bench.robot, bench, wait_s=3.0))) == ["turn"]


def test_a_silent_gyro_is_told_before_anybody_turns_anything(make_bench: MakeBench) -> None:
    bench = in_world(make_bench, faults=[Fault("gyro_silent", 0.0)])
    result = check_gyro(bench.robot, bench)
    assert list(failures(result)) == ["readings"]
    assert "SDA to pin 17" in result.advice[0]
    assert bench.told == []


@pytest.mark.full
def test_a_large_bias_is_told(make_bench: MakeBench) -> None:
    bench = in_world(make_bench, faults=[Fault("gyro_offset", 0.0, value=0.08)])
    assert "bias" in failures(check_gyro(bench.robot, bench))


def test_without_a_gyro_it_passes_unless_the_file_has_one(bench: Bench) -> None:
    file = read_robot("three_wheel")
    assert check_gyro(bench.robot, bench, file=file).ok
    wired = replace(file, board=replace(file.board, gyro=GyroWiring(file.table.gyro_chips["ICM-42688-P"], 3, 0x68)))
    assert list(failures(check_gyro(bench.robot, bench, file=wired))) == ["gyro"]
    assert bench.questions == []


def test_nobody_agrees_nothing_is_asked(make_bench: MakeBench) -> None:
    bench = in_world(make_bench)
    bench.agrees = False
    with pytest.raises(NotReadyError):
        check_gyro(bench.robot, bench)
