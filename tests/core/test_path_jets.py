# SPDX-License-Identifier: MIT
"""The smooth step that legs, ramps and lead-ins are made of, against the polynomial that its definition gives."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest

from omniwheel import _core


class Jet(ctypes.Structure):
    """A value and its first three derivatives."""

    _fields_ = [("d", ctypes.c_float * 4)]


CORE = ctypes.CDLL(_core.__file__)
CORE.omni_quintic.restype = Jet
CORE.omni_quintic.argtypes = [ctypes.c_float]


def smooth_step() -> np.polynomial.Polynomial:
    """Return the polynomial of degree five from 0 to 1 that begins and ends with two derivatives of zero."""
    powers = np.arange(6)
    rows = [np.where(powers == order, 1.0, 0.0) for order in range(3)]
    rows += [np.ones(6), powers, powers * (powers - 1)]
    return np.polynomial.Polynomial(np.linalg.solve(np.array(rows), [0, 0, 0, 1, 0, 0]))


@pytest.mark.parametrize("order", range(4))
def test_the_smooth_step_and_its_derivatives_are_those_of_its_definition(order: int) -> None:
    exact = smooth_step().deriv(order) if order else smooth_step()
    for p in np.linspace(0.0, 1.0, 41).astype(np.float32):
        assert CORE.omni_quintic(float(p)).d[order] == pytest.approx(exact(float(p)), abs=6e-6 * 10**order)
