# SPDX-License-Identifier: MIT
"""Bounds of the sliding mode controller: the super-twisting integral, and each axis's own gain in the margin."""

from __future__ import annotations

import pytest

from omniwheel._core import ffi, lib
from tests.core.test_position_controllers import TWISTING, Ismc, axes


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_integral_of_super_twisting_stays_within_one(sign: float) -> None:
    """An error that stays must not wind it up beyond what the gain k can give."""
    ismc = Ismc(switching=TWISTING, **{"lambda": [1e-6] * 3})
    for _ in range(4000):
        ismc.step([sign * 0.01] * 3)
    assert axes(ismc.state.twisting) == pytest.approx([sign] * 3, rel=1e-6)
    surface = axes(ismc.terms.surface)
    expected = [
        -k * sign * (abs(s / phi) ** 0.5 + 1.0)
        for k, s, phi in zip((0.05, 0.05, 0.2), surface, (0.01, 0.01, 0.03), strict=True)
    ]
    assert axes(ismc.terms.switching) == pytest.approx(expected, rel=1e-4)


def test_super_twisting_integrates_at_half_the_gain_per_layer_unless_held() -> None:
    ismc = Ismc(switching=TWISTING)
    ismc.step([0.005] * 3)
    per_step = [0.5 * 0.05 / 0.01 * 1e-3, 0.5 * 0.05 / 0.01 * 1e-3, 0.5 * 0.2 / 0.03 * 1e-3]
    assert axes(ismc.state.twisting) == pytest.approx(per_step, rel=1e-5)
    before = list(axes(ismc.state.twisting))
    ismc.step([0.005] * 3, hold=True)
    assert list(axes(ismc.state.twisting)) == before


def test_the_margin_of_an_axis_is_its_gain_less_its_slip() -> None:
    ismc = Ismc(k=[0.3, 0.5, 0.9])
    margin = ffi.new("omni_real_t[3]")
    lib.omni_ismc_gain_margin(ismc.config, ffi.new("omni_twist_t *", (-0.1, 0.7, -0.2)), margin)
    assert axes(margin) == pytest.approx([0.2, -0.2, 0.7], abs=1e-6)
