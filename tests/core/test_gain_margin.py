# SPDX-License-Identifier: MIT
"""Condition (44) at run time: the margin that the tick reports, and its warning."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

from omniwheel._core import lib
from tests.core.test_robot import Bench

CIRCLE = {"TRJ_TYPE": 3.0, "TRJ_PERIOD": 30.0, "TRJ_ROT": 0.0, "CTL_MODE": float(lib.OMNI_CTL_MODE_ISMC)}


def driving(robot_name: str = "three_wheel", ticks: int = 3000, **parameters: float) -> tuple[Bench, Any]:
    bench = Bench(robot_name)
    bench.arm()
    bench.follow(**CIRCLE, **parameters)
    return bench, bench.tick(count=ticks)


def warned(out: Any) -> bool:
    return bool(out.faults & lib.OMNI_WARN_ISMC_GAIN)


def sensitivity(bench: Bench, out: Any) -> Any:
    """World twist per slip ratio, from the geometry."""
    n = bench.wheels
    angles = np.radians([bench.values[lib.OMNI_PARAM_W1_ANGLE + i] for i in range(n)])
    distance, radius = (bench.values[p] for p in (lib.OMNI_PARAM_WHEEL_DIST, lib.OMNI_PARAM_WHEEL_RADIUS))
    b = np.column_stack([-np.sin(angles), np.cos(angles), np.full(n, distance)])
    c, s = math.cos(out.pose.theta), math.sin(out.pose.theta)
    to_world = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return to_world @ np.linalg.pinv(b) @ np.diag([radius * out.wheel_rad_s[i] for i in range(n)])


@pytest.mark.parametrize("robot_name", ["three_wheel", "four_wheel"])
@pytest.mark.parametrize("mode", ["POSE", "SLIP"])
def test_margin_is_k_less_three_sigma_of_the_slip_error(robot_name: str, mode: str) -> None:
    bench, out = driving(robot_name, EKF_MODE=float(getattr(lib, f"OMNI_EKF_MODE_{mode}")))
    looked_at = {out.ismc_margin[0]}
    while out.ismc_margin[0] in looked_at:  # it is looked at in every eighth tick
        out = bench.tick()
    n, ekf = bench.wheels, bench.robot.estimator.pose_ekf
    rows = sensitivity(bench, out)
    cover, left = np.eye(n) * bench.values[lib.OMNI_PARAM_EKF_P_SLIP] ** 2, np.zeros(n)
    if mode == "SLIP":  # no fix has come, so nothing is fed forward
        cover = np.array([[ekf.p[3 + i][3 + j] for j in range(n)] for i in range(n)])
        left = np.array([ekf.error_state[i] for i in range(n)])
    bound = np.abs(rows @ left) + 3.0 * np.sqrt(np.diag(rows @ cover @ rows.T))
    k = np.array([0.03, 0.03, 0.1])
    np.testing.assert_allclose([out.ismc_margin[i] for i in range(3)], k - bound, atol=1e-6)
    assert np.all(bound > 1e-4)


def test_a_gain_too_small_warns_after_half_a_second_and_stops_nothing() -> None:
    bench, out = driving(ISMC_K_XY=0.001)
    assert warned(out)
    assert out.state == lib.OMNI_STATE_ARMED
    assert min(out.ismc_margin[0], out.ismc_margin[1]) < 0.0
    bench.config = bench.configure(ISMC_K_XY=0.03)
    lib.omni_robot_set_config(bench.robot, bench.config)
    assert warned(bench.tick(count=300))
    assert not warned(bench.tick(count=300))
    bench.config = bench.configure(ISMC_K_XY=0.001)
    lib.omni_robot_set_config(bench.robot, bench.config)
    assert not warned(bench.tick(count=300))
    assert warned(bench.tick(count=300))
    out = bench.tick(lib.OMNI_EVENT_DISARM, count=2)
    assert not warned(out)
    assert out.ismc_margin[0] == 0.0


def test_the_margin_is_looked_at_in_every_eighth_tick() -> None:
    bench, _ = driving()
    seen = [bench.tick().ismc_margin[0] for _ in range(80)]
    changes = [i for i in range(1, 80) if seen[i] != seen[i - 1]]
    assert len(changes) == 10
    assert {later - earlier for earlier, later in itertools.pairwise(changes)} == {8}


def test_the_defaults_cover_and_super_twisting_is_not_judged() -> None:
    assert not warned(driving()[1])
    twisting = driving(ISMC_K_XY=0.001, ISMC_SWITCH=float(lib.OMNI_ISMC_SWITCH_SUPER_TWISTING))[1]
    assert twisting.ismc_margin[0] < 0.0
    assert not warned(twisting)


def test_other_controllers_have_no_margin() -> None:
    bench = Bench()
    bench.arm()
    bench.follow(**{**CIRCLE, "CTL_MODE": float(lib.OMNI_CTL_MODE_P), "ISMC_K_XY": 0.001})
    out = bench.tick(count=3000)
    assert out.ismc_margin[0] == 0.0
    assert not warned(out)
