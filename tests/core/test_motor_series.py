# SPDX-License-Identifier: MIT
"""The motor's exponential keeps single precision whatever the norm of the model, at the ends of each halving too."""

from __future__ import annotations

import numpy as np
import pytest

from tests.core.test_motor import discretise, exact


@pytest.mark.parametrize("norm", [0.3, 0.49, 0.51, 0.75, 0.99, 1.5, 1.99, 7.9])
def test_the_series_is_as_precise_as_the_numbers_for_every_norm(norm: float) -> None:
    """The last row of M T is the largest, with the sum `norm`. One halving too few would err 20 times as much."""
    step, inductance, constant = 1e-3, 1e-3, 0.2
    resistance = norm * inductance / step - constant
    constants = (1.0, 0.1, constant, resistance, inductance)
    a, b = discretise(constants, step)
    a_exact, b_exact = exact(constants, step)
    largest = max(1.0, np.abs(a_exact).max())
    assert np.abs(a - a_exact).max() <= 1.2e-7 * largest
    assert np.abs(b - b_exact).max() <= 1.5e-7 * np.abs(b_exact).max()
