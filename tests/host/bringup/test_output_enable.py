# SPDX-License-Identifier: MIT
"""The bring-up step on the output-enable pin: the PC firmware over its link, in worlds wired rightly and wrongly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hil_sim.faults import Fault
from omniwheel import FirmwareProcess
from omniwheel.bringup import Assumed, check_output_enable
from omniwheel.bringup.person import NotReadyError
from omniwheel.robot import connect
from omniwheel.robots import read_robot
from tests.host.bringup.conftest import Bench, MakeBench
from tests.host.bringup.test_stops import failures


def tied_to_ground(config: Any) -> None:
    """Wire OE to ground although the robot file gives it a pin."""
    config.output_enable_wired = False


def pulled_up_to(level_V: float) -> Callable[[Any], None]:
    return lambda config: setattr(config, "output_enable_rest_V", level_V)


def at_rest_and_disarmed(bench: Bench) -> bool:
    bench.robot.pump(1.0)
    still = float(np.abs(bench.world.wheel_rad_s).max()) < 1e-2
    return still and not bench.armed and not bench.robot.status.armed


@pytest.mark.parametrize("robot", ["three_wheel", "four_wheel"])
def test_a_wired_pin_with_its_pull_up_stops_the_wheels_twice(make_bench: MakeBench, robot: str) -> None:
    bench = make_bench(robot=robot)
    result = check_output_enable(bench.robot, bench, file=read_robot(robot))
    assert result.ok, failures(result)
    assert [finding.name for finding in result.findings] == ["pin", "pull-up"]
    assert result.measured["pin_s"] < 0.5
    assert result.measured["pull_up_s"] < 0.5
    assert any("unplug the Teensy" in line for line in bench.told)
    assert at_rest_and_disarmed(bench)
    bench.robot.arm()  # nothing is left over


def test_an_oe_that_is_tied_to_ground_is_noticed_and_the_bus_stops_the_wheels(make_bench: MakeBench) -> None:
    bench = make_bench(change=tied_to_ground)
    result = check_output_enable(bench.robot, bench)
    assert list(failures(result)) == ["pin"], "without the wire there is no pull-up to look at"
    assert "the wheels turned until they were stopped" in result.findings[0].seen
    assert "not tied to ground" in result.advice[0]
    assert result.measured["pin_s"] > 1.4, "they turned for the whole trial"
    assert at_rest_and_disarmed(bench)


def test_ten_kiloohm_against_ten_kiloohm_is_noticed(make_bench: MakeBench) -> None:
    """The processor drives the pin well; let go of, it is at 1.65 V, and the chip may go on."""
    bench = make_bench(change=pulled_up_to(1.65))
    result = check_output_enable(bench.robot, bench)
    assert list(failures(result)) == ["pull-up"]
    assert "1 kOhm from OE to 3.3 V" in result.advice[0]
    assert result.measured["pin_s"] < 0.2
    assert at_rest_and_disarmed(bench)


@pytest.mark.parametrize(("level_V", "ok"), [(2.3, False), (2.32, True), (3.3, True)])
def test_the_level_that_counts_is_the_data_sheets(make_bench: MakeBench, level_V: float, ok: bool) -> None:
    bench = make_bench(change=pulled_up_to(level_V))
    assert check_output_enable(bench.robot, bench).ok == ok


def test_a_robot_file_without_the_pin_passes_with_a_word_and_moves_nothing(bench: Bench) -> None:
    file = read_robot("three_wheel")
    bare = replace(file, board=replace(file.board, output_enable_pin=None))
    result = check_output_enable(bench.robot, bench, file=bare)
    assert result.ok
    assert "only the I2C bus can stop a motor" in result.findings[0].seen
    assert bench.questions == []


def test_a_firmware_without_the_pin_passes_with_a_word_and_is_never_armed() -> None:
    """The PC's own board has no pin, and no wheels either."""
    with FirmwareProcess() as firmware, connect(firmware.urls[0]) as robot:
        result = check_output_enable(robot, Assumed())
        assert result.ok
        assert "only the I2C bus can stop a motor" in result.findings[0].seen
        robot.pump(0.2)
        assert not robot.status.armed


def test_wheels_that_do_not_turn_prove_nothing(make_bench: MakeBench) -> None:
    bench = make_bench(faults=[Fault("motor_dead", 0.0, wheel=wheel) for wheel in range(3)])
    result = check_output_enable(bench.robot, bench)
    assert "omni bringup motors" in result.advice[0]
    assert at_rest_and_disarmed(bench)


def test_a_stop_of_another_kind_is_not_taken_for_the_pins(make_bench: MakeBench) -> None:
    bench = make_bench(change=tied_to_ground, faults=[Fault("encoder_invalid", 2.0, stop_s=2.5)])
    result = check_output_enable(bench.robot, bench)
    assert not result.ok
    assert "stopped by itself: encoder" in result.findings[-1].seen
    assert at_rest_and_disarmed(bench)


def test_nobody_agrees_nothing_moves(bench: Bench) -> None:
    bench.agrees = False
    with pytest.raises(NotReadyError):
        check_output_enable(bench.robot, bench)
    assert not bench.armed
