# SPDX-License-Identifier: MIT
"""A sensor of motion over the floor that is wrong: units, mount, a reading that repeats itself; a spoilt covariance."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.core.test_flow import ARM, RADIUS_M, SD_M, SPAN, TICK_S, Core, run


def test_a_covariance_that_rounding_has_spoilt_makes_nothing_of_nothing() -> None:
    """Without a gate, too: what is not a number must not get into the estimate."""
    core = Core()
    run(core, 1000, 0.5)
    core.config.flow_gate = 0.0
    for i in range(3):
        core.s.p[3 + i][3 + i] = -1.0
    before = core.x
    result = core.measure([0.01, 0.0, 0.0], 3)
    assert not result.within_gate
    assert math.isfinite(result.nis)
    assert core.x == pytest.approx(before, abs=1e-7)
    assert np.isfinite(core.p).all()
    assert np.isfinite([list(slot.move) for slot in core.s.history]).all()


def test_a_way_within_its_noise_proves_nothing_of_where_it_points() -> None:
    """A poor sensor, mounted backwards, on a slow robot: 1.2 mm a reading with a noise of 1 mm always fits."""
    core = Core()
    core.mount.r_xy = 1e-6
    run(core, 4000, 0.06, [-0.06 * SPAN * TICK_S, 0.0, 0.0])
    assert core.flow.readings_rejected == 0
    assert core.flow.readings_used == 0
    core.mount.r_xy = SD_M**2
    assert not run(core, 1000, 0.06, [-0.06 * SPAN * TICK_S, 0.0, 0.0])[-1]


@pytest.mark.parametrize(
    "factor", [[1000.0, 1000.0, 1.0], [39.37, 39.37, 1.0], [1e-3, 1e-3, 1.0], [1.0, 1.0, 57.3]], ids=str
)
def test_wrong_units_are_noticed_and_teach_nothing(factor: list[float]) -> None:
    """Millimetres, inches, kilometres; degrees of a robot that turns."""
    core = Core()
    wheels = core.matrix @ np.array([0.5, 0.0, 1.0]) / RADIUS_M * TICK_S / 0.95
    said = np.array([0.5 - ARM[1], ARM[0], 1.0]) * SPAN * TICK_S * factor
    for tick in range(2000):
        core.tick(wheels, list(said) if tick % SPAN == SPAN - 1 else None)
    assert not core.usable
    assert core.flow.readings_used == 0
    assert core.x[3:] == pytest.approx([0.0] * 3, abs=1e-6)


def test_a_reading_that_repeats_itself_is_noticed_when_the_speed_changes() -> None:
    core = Core()
    run(core, 2000, 0.5)
    x, said = core.x[0], [0.5 * SPAN * TICK_S, 0.0, 0.0]
    way = 0.0
    usable: list[bool] = []
    for _ in range(50):  # slows down at 0.5 m/s^2, then stands
        speed = max(0.5 - 0.5 * (way_s := len(usable) * SPAN * TICK_S), 0.0)
        usable += run(core, SPAN, speed, said)
        way += speed * SPAN * TICK_S
    assert way_s == pytest.approx(0.98)
    assert not usable[-1]
    assert core.x[0] - x == pytest.approx(way, abs=0.03)


def test_readings_that_repeat_themselves_may_differ_from_the_wheels_by_a_tenth_of_the_way() -> None:
    """Coarse steps at 1 m/s: it says 20 mm again and again, while the wheels slip a little more each time."""
    core = Core()
    said = [SPAN * TICK_S, 0.0, 0.0]
    for step in range(40):
        assert all(run(core, SPAN, 1.0 + 0.002 * step, said))
