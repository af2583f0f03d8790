# SPDX-License-Identifier: MIT
"""CTL_PERIOD: position controllers step every so many ticks and hold what they want of the wheels."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

from omniwheel._core import ffi, lib
from tests.core.test_robot import Bench

PERIOD = 20
MODES = ["ISMC", "P", "PD", "PID", "TORQUE"]
PATH = {"TRJ_TYPE": 3.0, "TRJ_PERIOD": 30.0, "TRJ_ROT": 0.0, "EKF_MODE": float(lib.OMNI_EKF_MODE_POSE)}


def driving(mode: str, **parameters: float) -> Bench:
    bench = Bench()
    bench.arm()
    bench.follow(**PATH, CTL_MODE=float(getattr(lib, f"OMNI_CTL_MODE_{mode}")), **parameters)
    bench.tick(count=2000)
    return bench


def held(bench: Bench) -> tuple[float, ...]:
    """What the controller wants of the wheels."""
    if bench.config.controller == lib.OMNI_CTL_MODE_TORQUE:
        return tuple(bench.robot.control.demand.torque_N_m[0:3])
    return tuple(bench.outputs.wheel_reference[0:3])


@pytest.mark.parametrize("mode", MODES)
def test_the_output_changes_once_per_period(mode: str) -> None:
    bench = driving(mode, CTL_PERIOD=float(PERIOD))
    wanted = []
    for _ in range(10 * PERIOD):
        bench.tick()
        wanted.append(held(bench))
    changed = [i for i in range(1, len(wanted)) if wanted[i] != wanted[i - 1]]
    assert 9 <= len(changed) <= 10
    assert {b - a for a, b in itertools.pairwise(changed)} == {PERIOD}


@pytest.mark.parametrize("mode", MODES)
def test_each_controller_tracks_at_50_hz(mode: str) -> None:
    bench = driving(mode, CTL_PERIOD=float(PERIOD))
    error = 0.0
    for _ in range(2000):
        terms: Any = bench.tick().terms
        error = max(error, math.hypot(terms.error[0], terms.error[1]))
    assert bench.outputs.state == lib.OMNI_STATE_ARMED
    assert error < 0.006


def test_integrals_take_the_longer_step() -> None:
    for period in (1, 50):
        config = Bench(CTL_PERIOD=float(period)).config
        assert config.ismc.step_s == pytest.approx(period * 1e-3)
        assert config.fl.step_s == pytest.approx(period * 1e-3)


def test_another_controller_starts_at_once() -> None:
    bench = driving("P", CTL_PERIOD=100.0)
    bench.config = bench.configure(CTL_MODE=float(lib.OMNI_CTL_MODE_TORQUE))
    lib.omni_robot_set_config(bench.robot, bench.config)
    bench.tick()
    assert np.any(np.array(held(bench)) != 0.0)


@pytest.mark.parametrize("period", [1.0, 20.0])
def test_torque_control_goes_to_a_pose_and_holds_it(period: float) -> None:
    bench = Bench(CTL_MODE=float(lib.OMNI_CTL_MODE_TORQUE), CTL_PERIOD=period)
    bench.arm()
    for _ in range(400):
        bench.command(lib.OMNI_SETPOINT_POSE, pose=(0.2, -0.1, 0.5))
        out = bench.tick(count=10)
    assert out.state == lib.OMNI_STATE_ARMED
    assert (out.pose.x, out.pose.y, out.pose.theta) == pytest.approx((0.2, -0.1, 0.5), abs=2e-3)
    bench.command(lib.OMNI_SETPOINT_NONE)
    out = bench.tick(count=1000)
    assert (out.pose.x, out.pose.y, out.pose.theta) == pytest.approx((0.2, -0.1, 0.5), abs=2e-3)
    assert max(abs(out.duty[i]) for i in range(3)) < 0.02


def test_torque_curve_parameters_are_checked_together() -> None:
    bench = Bench()
    config, bad = ffi.new("omni_robot_config_t *"), ffi.new("int32_t *")
    for name, value in {"DT_C1": 0.3, "DT_C2": 0.2, "DT_C3": 0.6, "DT_C4": 0.8}.items():
        bench.values[lib.omni_param_find(name.encode())] = value
    assert lib.omni_robot_config(config, bench.values, bad) == lib.OMNI_ERR_RANGE
    assert bad[0] == lib.OMNI_PARAM_DT_C2
    assert Bench(DT_DEAD=0.25).config.torque_curve.duty[0] == pytest.approx(0.4)
    assert Bench().config.torque_curve.torque_max_N_m == pytest.approx(1.05 * 12.0 / 2.7)
    assert Bench(DT_TAU_MAX=2.0).config.direct_torque.torque_limit_N_m == 2.0
