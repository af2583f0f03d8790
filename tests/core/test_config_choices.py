# SPDX-License-Identifier: MIT
"""Which gains a controller gets, and that no two bridge inputs share a channel."""

from __future__ import annotations

from itertools import combinations

import pytest

from omniwheel._core import ffi, lib
from tests.core.test_robot import Bench


@pytest.mark.parametrize(("mode", "kd", "ki"), [("P", False, False), ("PD", True, False), ("PID", True, True)])
def test_a_controller_has_the_gains_that_its_name_says(mode: str, kd: bool, ki: bool) -> None:
    gains = {"FL_KP_XY": 1.5, "FL_KP_TH": 2.5, "FL_KD_XY": 0.25, "FL_KD_TH": 0.5, "FL_KI_XY": 0.75, "FL_KI_TH": 1.25}
    bench = Bench()
    fl = bench.configure(CTL_MODE=float(getattr(lib, f"OMNI_CTL_MODE_{mode}")), **gains).fl
    assert list(fl.kp) == [1.5, 1.5, 2.5]
    assert list(fl.kd) == ([0.25, 0.25, 0.5] if kd else [0.0] * 3)
    assert list(fl.ki) == ([0.75, 0.75, 1.25] if ki else [0.0] * 3)


@pytest.mark.parametrize("robot_name", ["three_wheel", "four_wheel"])
def test_two_bridge_inputs_on_one_channel_are_refused_and_named(robot_name: str) -> None:
    bench = Bench(robot_name)
    firsts = [lib.OMNI_PARAM_W1_IN1_CH + i for i in range(bench.wheels)]
    inputs = firsts + [lib.OMNI_PARAM_W1_IN2_CH + i for i in range(bench.wheels)]
    config, bad = ffi.new("omni_robot_config_t *"), ffi.new("int32_t *")
    for one, other in combinations(inputs, 2):
        kept = bench.values[other]
        bench.values[other] = bench.values[one]
        assert lib.omni_robot_config(config, bench.values, bad) == lib.OMNI_ERR_RANGE
        assert bad[0] == other
        bench.values[other] = kept
        assert lib.omni_robot_config(config, bench.values, bad) == lib.OMNI_OK
