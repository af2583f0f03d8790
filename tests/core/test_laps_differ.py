# SPDX-License-Identifier: MIT
"""Plans whose laps differ, or whose laps hardly exist."""

from __future__ import annotations

import numpy as np
import pytest

from omniwheel._core import lib
from tests.core.test_trajectory import Plan, wheel_motion


def test_the_demand_of_all_laps_counts_where_they_differ() -> None:
    """The heading swings so slowly that only later laps ask for the most of a wheel."""
    options = {"type": "line", "rotation": "sine", "rotation_cycles": 0.03, "rotation_amplitude_rad": 1.5}
    plan = Plan({**options, "laps": 7.0, "scale": False})
    samples = [plan.path(float(u)) for u in np.linspace(0.0, plan.c.duration_s, 8001)]
    poses, firsts, seconds = (np.array([sample[part] for sample in samples]) for part in range(3))
    wheels = np.abs(wheel_motion(poses, firsts, seconds)[0]).max(axis=0)
    assert wheels[:1000].max() < 0.98 * wheels.max()
    assert plan.c.peak_wheel_rad_s == pytest.approx(wheels.max(), rel=2e-3)


@pytest.mark.parametrize("laps", [1e-11, 1e-10, 5e-10, 1e-9])
def test_an_identification_of_some_nanoseconds_is_finite(laps: float) -> None:
    plan = Plan({"type": "identify", "laps": laps, "period_s": 20.0})
    if plan.result == lib.OMNI_OK:
        assert all(np.isfinite(part).all() for u in (0.0, 1e-9, 5e-9, 1.0) for part in plan.path(u))
