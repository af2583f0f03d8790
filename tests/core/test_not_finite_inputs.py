# SPDX-License-Identifier: MIT
"""A single number that is none, in any place, stops: in the estimate, and in the original law's inputs."""

from __future__ import annotations

import math

import pytest

from omniwheel._core import lib
from tests.core.test_gain_margin import driving
from tests.core.test_position_controllers import Original, axes
from tests.core.test_robot import Bench, silent


@pytest.mark.parametrize("member", ["x", "y", "theta"])
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_an_estimate_that_is_no_number_stops_the_motors(member: str, bad: float) -> None:
    bench = Bench()
    bench.arm()
    bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.1, 0.0, 0.0))
    assert not silent(bench.tick(count=20))
    setattr(bench.robot.estimator.pose_ekf.pose, member, bad)
    out = bench.tick()
    assert out.faults & lib.OMNI_FAULT_NOT_FINITE
    assert silent(out)


@pytest.mark.parametrize("supply_V", [1001.0, 1e15, -1e15, 3e38, math.inf, math.nan])
def test_a_supply_that_nothing_has_stops_the_motors_and_leaves_the_estimate_a_number(supply_V: float) -> None:
    bench = Bench()
    bench.arm()
    bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.1, 0.0, 0.0))
    assert not silent(bench.tick(count=20))
    bench.inputs.battery_V = supply_V
    out = bench.tick()
    assert out.faults & lib.OMNI_FAULT_NOT_FINITE
    assert silent(out)
    assert abs(out.pose.x) + abs(out.pose.y) < 1.0
    assert all(sd < 1.0 for sd in out.pose_sd)


@pytest.mark.parametrize("which", ["pose", "reference", "rate"])
@pytest.mark.parametrize("member", range(3))
def test_the_original_law_gives_nothing_for_any_input_that_is_no_number(which: str, member: int) -> None:
    law = Original()
    inputs = {"pose": [0.1, 0.1, 0.1], "reference": [0.2, 0.1, 0.0], "rate": [0.1, 0.0, 0.0]}
    for _ in range(20):
        law.step((5, 5, 5), inputs["pose"], inputs["reference"], inputs["rate"])
    assert any(axes(law.state.voltage_V))
    inputs[which][member] = math.nan
    for _ in range(20):
        volts = law.step((5, 5, 5), inputs["pose"], inputs["reference"], inputs["rate"])
    assert list(volts) == [0.0] * 3


@pytest.mark.parametrize(("parameter", "axis"), [("ISMC_K_XY", 0), ("ISMC_K_TH", 2)])
def test_a_gain_too_small_on_one_axis_warns(parameter: str, axis: int) -> None:
    _, out = driving("three_wheel", 3000, **{parameter: 1e-4})
    assert out.ismc_margin[axis] < 0.0
    assert out.ismc_margin[2 - axis] > 0.0
    assert out.faults & lib.OMNI_WARN_ISMC_GAIN
