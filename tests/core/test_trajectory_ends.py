# SPDX-License-Identifier: MIT
"""A plan looks at the very first and the very last instant of its path, and at both of its ramps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from omniwheel._core import lib
from tests.core.test_trajectory import Plan, wheel_motion

SPEED_V_S = 3.62
STEEP = {"ramp_s": 0.05, "margin": 1.0, "wheel_limit_rad_s": 100.0, "ff_acceleration_V_s2": 0.3}


def peaks(plan: Plan) -> tuple[float, float]:
    """Return the largest wheel speed and voltage of the path, both ends included."""
    samples = [plan.path(float(u)) for u in np.linspace(0.0, plan.c.duration_s, 4001)]
    poses, firsts, seconds = (np.array([sample[part] for sample in samples]) for part in range(3))
    wheels, changes = wheel_motion(poses, firsts, seconds)
    return np.abs(wheels).max(), np.abs(SPEED_V_S * wheels + plan.config["ff_acceleration_V_s2"] * changes).max()


@pytest.mark.parametrize(
    ("laps", "what"),
    [(0.3, "line"), (0.05, "line"), (0.02, "swing"), (0.2, "heavy swing"), (1.3, "line")],
    ids=lambda value: str(value),
)
def test_the_demand_at_both_ends_of_the_path_counts(laps: float, what: str) -> None:
    """A line that is cut off asks most where it ends, a swing where it begins."""
    cases: dict[str, dict[str, Any]] = {
        "line": {"type": "line", "rotation": "fixed"},
        "swing": {"type": "hold", "rotation": "sine", "rotation_cycles": 1.0},
    }
    cases["heavy swing"] = {**cases["swing"], "ff_acceleration_V_s2": 3.62 / (2 * np.pi / 20.0)}
    plan = Plan({**cases[what], "laps": laps, "scale": False})
    wheel_rad_s, voltage_V = peaks(plan)
    assert plan.c.peak_wheel_rad_s == pytest.approx(wheel_rad_s, rel=1e-4)
    assert plan.c.peak_voltage_V == pytest.approx(voltage_V, rel=1e-4)


def largest_voltage(plan: Plan, end_us: int) -> float:
    poses, rates, accelerations, _ = plan.sample(np.arange(0, end_us, 500))
    wheels, changes = wheel_motion(poses, rates, accelerations)
    return float(np.abs(SPEED_V_S * wheels + STEEP["ff_acceleration_V_s2"] * changes).max())


def test_a_steep_ramp_down_from_the_fastest_point_keeps_the_voltage() -> None:
    plan = Plan({"type": "line", "rotation": "fixed", "laps": 0.5, "period_s": 1.5, **STEEP}, at=(0.0, 0.0, 0.0))
    assert plan.result == lib.OMNI_OK
    assert 0.95 * 12.0 / 1.05 <= largest_voltage(plan, plan.end_us()) <= 12.0 * 1.003


def test_a_steep_ramp_up_of_a_path_without_end_keeps_the_voltage() -> None:
    options = {"type": "circle", "rotation": "fixed", "laps": 0.0, "period_s": 12.0, **STEEP}
    plan = Plan(options, at=(0.5, 0.0, 0.0))
    assert plan.c.duration_s < 0.0
    assert plan.c.lead_in_s == 0.0
    assert 0.95 * 12.0 / 1.05 <= largest_voltage(plan, 3_000_000) <= 12.0 * 1.003
