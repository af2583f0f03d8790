# SPDX-License-Identifier: MIT
from __future__ import annotations

from typing import Any

import pytest

from hil_sim.faults import Fault
from omniwheel.bringup import check_i2c
from omniwheel.bringup.sequence import bring_up
from omniwheel.errors import CommandRefusedError
from omniwheel.robots import read_robot
from tests.host.bringup.conftest import Bench, MakeBench
from tests.native import ROOT


def set_field(name: str, value: Any) -> Any:
    return lambda config: setattr(config, name, value)


def test_a_wired_board_passes(bench: Bench) -> None:
    result = check_i2c(bench.robot)
    assert result.ok
    assert result.measured["addresses"] == [0x40]


@pytest.mark.full
def test_a_robot_without_the_chip_is_not_asked_for_it(make_bench: MakeBench) -> None:
    """Its bridges hang at the processor's own pins: the walk ended at a bus that is not there."""
    path = str(ROOT / "shared/robots/examples/three_wheel_pins.toml")
    bench = make_bench(robot=path)
    walk = bring_up(bench.robot, bench, file=read_robot(path))
    first = next(walk)
    assert (first.check, first.ok) == ("link", True)
    assert next(walk).check == "encoders"


def test_another_device_beside_it_is_named_and_no_fault(make_bench: MakeBench) -> None:
    result = check_i2c(make_bench(change=set_field("i2c_stranger", 0x68)).robot)
    assert result.ok
    assert any("0x68" in finding.seen for finding in result.findings)


def test_no_board_at_all_sends_to_the_wires(make_bench: MakeBench) -> None:
    result = check_i2c(make_bench(faults=[Fault("i2c_nack", 0.0)]).robot)
    assert not result.ok
    assert "pin 18" in result.advice[0]
    assert "pull-ups" in result.advice[0]


def test_another_board_alone_is_not_the_one(make_bench: MakeBench) -> None:
    def change(config: Any) -> None:
        config.pca9685_address = 0x01  # outside of what is asked
        config.i2c_stranger = 0x68

    result = check_i2c(make_bench(change=change).robot)
    assert not result.ok
    assert "not at 0x40" in result.advice[0] or "0x68" in result.findings[-1].seen


def test_a_board_with_a_closed_jumper_is_told_to_open_it(make_bench: MakeBench) -> None:
    result = check_i2c(make_bench(change=set_field("pca9685_address", 0x42)).robot)
    assert not result.ok
    assert "0x42: open its address jumpers" in result.advice[0]


def test_a_stuck_bus_is_told_apart_from_a_silent_one(make_bench: MakeBench) -> None:
    result = check_i2c(make_bench(faults=[Fault("i2c_stuck", 0.0)]).robot)
    assert not result.ok
    assert "SDA and SCL" in result.advice[0]
    assert result.measured["stuck"]


def test_an_armed_robot_is_left_alone(bench: Bench) -> None:
    bench.robot.arm()
    with pytest.raises(CommandRefusedError, match="disarm first"):
        check_i2c(bench.robot)
