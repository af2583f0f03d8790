# SPDX-License-Identifier: MIT
"""The report's least squares: its arithmetic is right, its data were not."""

from __future__ import annotations

import numpy as np
import pytest

from omniwheel.errors import IdentificationError
from omniwheel.identification.regression import Discrete, continuous, inputs, least_squares, wrapped_by_atan

TABLE_8 = Discrete((1.0046, 1.0009, 0.90876), (-2.5307e-5, -1.4863e-5, -1.9563e-4), (-2.2487e-3, -1.9972e-4, 7.7180e-2))
T = 0.02


def test_what_follows_of_table_8_and_what_does_not() -> None:
    found = continuous(TABLE_8, T, 3.4, 0.195)
    assert found["a11"] == pytest.approx(0.22963, rel=1e-3)
    assert found["a33"] == pytest.approx(-4.7835, rel=1e-4)
    assert found["beta_1"] == pytest.approx(1.9668e-5, rel=1e-3)
    assert found["f1"] == pytest.approx(-0.112, rel=2e-3)
    assert found["f2"] == pytest.approx(-9.98e-3, rel=1e-3)
    assert found["f3"] == pytest.approx(4.05, rel=1e-2)
    assert np.log(1.00099) / T == pytest.approx(0.04926, rel=5e-3)
    assert abs(found["beta_2"]) != pytest.approx(318.7, rel=0.1)
    assert pytest.approx(0.156, rel=1e-3) == 255.0 * 0.195 / 318.7


def test_a_linear_system_is_recovered_exactly() -> None:
    draw = np.random.default_rng(4)
    before, u = draw.standard_normal((200, 3)), draw.standard_normal((200, 4))
    after = before * TABLE_8.a + inputs(u) * TABLE_8.b + np.array(TABLE_8.f)
    found = least_squares(before, after, u)
    np.testing.assert_allclose([found.a, found.b, found.f], [TABLE_8.a, TABLE_8.b, TABLE_8.f], rtol=1e-9)
    signed = before * TABLE_8.a + inputs(u) * TABLE_8.b + np.sign(before) * TABLE_8.f
    found = least_squares(before, signed, u, sign_terms=True)
    np.testing.assert_allclose(found.f, TABLE_8.f, rtol=1e-9)


@pytest.mark.parametrize("rate_rad_s", [0.5, 1.5, 2.39])
def test_wrapping_makes_a_pure_integrator_look_damped(rate_rad_s: float) -> None:
    """Spins both ways, 40 s each, with nothing but theta' = b u: the wrap alone gives a = 1 - 6 w T / pi."""
    steps = 2000
    turned = rate_rad_s * T * np.arange(steps + 1, dtype=np.float64)
    parts = [(wrapped_by_atan(sign * turned), sign) for sign in (1.0, -1.0)]
    before = np.concatenate([heading[:-1] for heading, _ in parts])
    after = np.concatenate([heading[1:] for heading, _ in parts])
    u = np.concatenate([np.full((steps, 4), sign) for _, sign in parts])
    draw = np.random.default_rng(1)
    moving = draw.standard_normal((2 * steps, 2))
    found = least_squares(
        np.column_stack((moving, before)), np.column_stack((moving, after)), u + 0.1 * draw.standard_normal(u.shape)
    )
    assert found.a[2] == pytest.approx(1.0 - 6.0 * rate_rad_s * T / np.pi, abs=0.01)


def test_what_the_equation_cannot_take_is_refused() -> None:
    states, u = np.zeros((10, 3)), np.zeros((10, 4))
    with pytest.raises(IdentificationError, match="rank-deficient"):
        least_squares(states, states, u)
    with pytest.raises(IdentificationError, match="four-wheel"):
        least_squares(states, states, u[:, :3])
