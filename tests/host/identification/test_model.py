# SPDX-License-Identifier: MIT
"""The model against an independent integration of its equations and against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from omniwheel.errors import IdentificationError
from omniwheel.identification.model import COULOMB_WIDTH_rad_s, Layout, Model
from tests.host.identification.conftest import TRUE

Array = NDArray[np.float64]
ROWS, DT_S = 12, 0.02


def reference(layout: Layout, values: Array, voltage: Array, start: Array) -> Array:
    """Integrate wheel by wheel: forces on each axis are summed, nothing is taken from the model's matrices."""
    gain, coulomb, inertia, inertia_theta, drag, dry = values
    n = len(layout.angle_rad)

    def wheel(q: Array, i: int) -> float:
        alpha = layout.angle_rad[i]
        return float(-np.sin(alpha) * q[0] + np.cos(alpha) * q[1] + q[2])

    def rates(q: Array, volts: Array) -> list[float]:
        push = np.zeros(3)
        for i, alpha in enumerate(layout.angle_rad):
            w = wheel(q, i)
            net = volts[i] - gain * w - coulomb * w / np.hypot(w, COULOMB_WIDTH_rad_s)
            push += net * np.array([-np.sin(alpha), np.cos(alpha), 1.0])
            axle = np.array([np.cos(alpha), np.sin(alpha), 0.0])
            across = float(axle @ q)
            push -= dry * across / np.hypot(across, COULOMB_WIDTH_rad_s) * axle
        along = [(push[k] - n / 2 * drag * q[k]) / (n / 2 * inertia) for k in (0, 1)]
        return [*along, push[2] / (n * inertia_theta)]

    q, speeds = start, []
    for row in voltage:
        q = solve_ivp(lambda _, x, row=row: rates(x, row), (0.0, DT_S), q, rtol=1e-9, atol=1e-11).y[:, -1]
        speeds.append([wheel(q, i) for i in range(n)])
    return np.array(speeds)


@pytest.mark.parametrize("wheels", [3, 4])
def test_the_model_is_the_integral_of_its_equations(wheels: int) -> None:
    layout = Layout(0.05, 0.2, np.radians(30.0) + np.arange(wheels) * 2.0 * np.pi / wheels)
    draw = np.random.default_rng(wheels)
    voltage, start = draw.uniform(-8.0, 8.0, (ROWS, wheels)), draw.uniform(-1.0, 1.0, 3)
    dt = np.full((1, ROWS), DT_S)
    mean, end = Model.floor(layout).simulate(TRUE[None], dt, voltage[None], start[None])
    expected = reference(layout, TRUE, voltage, start)
    np.testing.assert_allclose(end[0, 0], expected, atol=2e-3)
    assert np.abs(mean[0, 0] - expected).max() > 0.01


def test_a_wheel_on_a_stand_settles_where_friction_leaves_it() -> None:
    voltage = np.full((1, 50, 1), 5.0)
    _, end = Model.stand((0,)).simulate(
        np.array([[3.6, 0.13, 0.03]]), np.full((1, 50), DT_S), voltage, np.zeros((1, 1))
    )
    assert end[0, 0, -1, 0] == pytest.approx((5.0 - 0.13) / 3.6, rel=1e-4)


def test_a_wheel_below_its_coulomb_voltage_hardly_moves() -> None:
    voltage = np.full((1, 50, 1), 0.1)
    _, end = Model.stand((0,)).simulate(
        np.array([[3.6, 0.13, 0.03]]), np.full((1, 50), DT_S), voltage, np.zeros((1, 1))
    )
    assert 0.0 < end[0, 0, -1, 0] < COULOMB_WIDTH_rad_s


def test_lanes_and_segments_do_not_mix(layout: Layout) -> None:
    draw = np.random.default_rng(1)
    values = TRUE * draw.uniform(0.9, 1.1, (3, 1))  # of the same rates, hence simulated in the same steps
    voltage, start = draw.uniform(-5.0, 5.0, (2, ROWS, 3)), draw.uniform(-1.0, 1.0, (2, 3))
    dt = np.full((2, ROWS), DT_S)
    model = Model.floor(layout)
    together, _ = model.simulate(values, dt, voltage, start)
    for lane in range(3):
        for segment in range(2):
            part = slice(segment, segment + 1)
            alone, _ = model.simulate(values[lane : lane + 1], dt[part], voltage[part], start[part])
            np.testing.assert_allclose(together[lane, segment], alone[0, 0], rtol=1e-12)


def test_uneven_wheels_are_refused() -> None:
    with pytest.raises(IdentificationError, match="spaced evenly"):
        Layout(0.05, 0.2, np.radians([0.0, 90.0, 240.0]))
