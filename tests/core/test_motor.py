# SPDX-License-Identifier: MIT
"""The motor model against SciPy's matrix exponential."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from omniwheel._core import ffi, lib

Array = npt.NDArray[np.float64]
FIELDS = ("inertia_kg_m2", "viscous_N_m_s", "constant_N_m_A", "resistance_ohm", "inductance_H")
REPORT = (0.01, 1.0, 1.05, 2.7, 0.0014)
NAMED = {
    "report": REPORT,
    "report_code": (0.001, 0.1, 0.01, 1.0, 0.1),
    "table_3": (0.001, 1.0, 1.05, 0.04, 0.001),
    "gearmotor": (2e-4, 2e-4, 0.3, 2.0, 1e-3),
    "frictionless": (1e-3, 0.0, 0.1, 1.0, 1e-3),
}


def motor(constants: tuple[float, ...]) -> Any:
    return ffi.new("omni_motor_config_t *", dict(zip(FIELDS, constants, strict=True)))


def discretise(constants: tuple[float, ...], step: float) -> tuple[Array, Array]:
    out = ffi.new("omni_motor_discrete_t *")
    assert lib.omni_motor_discretise(motor(constants), step, out) == lib.OMNI_OK
    return np.array([list(row) for row in out.a]), np.array(list(out.b))


def exact(constants: tuple[float, ...], step: float) -> tuple[Array, Array]:
    j, b, k, r, ind = (float(np.float32(c)) for c in constants)
    m = np.zeros((4, 4))
    m[0, 1] = 1.0
    m[1, 1:3] = [-b / j, k / j]
    m[2, 1:] = [-k / ind, -r / ind, 1 / ind]
    full = expm(m * float(np.float32(step)))
    return full[:3, :3], full[:3, 3]


@pytest.mark.parametrize("name", NAMED)
@pytest.mark.parametrize("step", [1e-4, 1e-3, 0.02])
def test_discretisation_agrees_with_scipy(name: str, step: float) -> None:
    a, b = discretise(NAMED[name], step)
    a_exact, b_exact = exact(NAMED[name], step)
    np.testing.assert_allclose(a, a_exact, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(b, b_exact, rtol=1e-5, atol=1e-7)


@given(
    st.floats(1e-5, 1.0),
    st.floats(0.0, 2.0),
    st.floats(1e-3, 5.0),
    st.floats(0.01, 20.0),
    st.floats(1e-5, 0.1),
    st.floats(1e-4, 0.1),
)
def test_any_motor_keeps_its_steady_state(j: float, b: float, k: float, r: float, ind: float, step: float) -> None:
    """After long enough one volt gives the speed that the statics say, and the discretisation stays stable."""
    constants = (j, b, k, r, ind)
    a, _ = discretise(constants, step)
    a_exact, _ = exact(constants, step)
    assert np.max(np.abs(np.linalg.eigvals(a[1:, 1:]))) <= 1.0 + 1e-6
    assert a[0, 0] == 1.0
    assert not a[1:, 0].any()
    scale = np.sqrt(np.outer([1 / j, 1 / ind], [j, ind]))  # to units of square root energy, where |A| <= 1
    np.testing.assert_allclose(a[1:, 1:] / scale, a_exact[1:, 1:] / scale, rtol=0, atol=1e-4)


def test_angle_row_is_the_integral_of_the_speed() -> None:
    step, volts = 1e-3, 6.0
    a, b = discretise(REPORT, step)
    fine_a, fine_b = exact(REPORT, step / 1000)
    x = np.array([0.0, 1.0, 0.5])
    fine = x.copy()
    for _ in range(1000):
        fine = fine_a @ fine + fine_b * volts
    np.testing.assert_allclose(a @ x + b * volts, fine, rtol=1e-5)


@pytest.mark.parametrize("name", NAMED)
def test_speed_gain_is_the_voltage_at_constant_speed(name: str) -> None:
    j, b, k, r, ind = NAMED[name]
    steady = np.linalg.solve([[-b / j, k / j], [-k / ind, -r / ind]], [0.0, -1.0 / ind])
    assert lib.omni_motor_speed_gain(motor(NAMED[name])) == pytest.approx(1.0 / steady[0], rel=1e-5)


@pytest.mark.parametrize("name", NAMED)
def test_acceleration_gain_is_the_voltage_that_accelerates_the_inertia(name: str) -> None:
    j, _, k, r, _ = NAMED[name]
    assert lib.omni_motor_acceleration_gain(motor(NAMED[name])) == pytest.approx(r * j / k, rel=1e-6)


def refusal(constants: tuple[float, ...], step: float) -> int:
    out = ffi.new("omni_motor_discrete_t *")
    before = bytes(ffi.buffer(out))
    result = lib.omni_motor_discretise(motor(constants), step, out)
    assert bytes(ffi.buffer(out)) == before
    return int(result)


@pytest.mark.parametrize("slot", range(6))
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_constants_that_are_not_finite_are_refused(slot: int, value: float) -> None:
    numbers = [*REPORT, 1e-3]
    numbers[slot] = value
    assert refusal(tuple(numbers[:5]), numbers[5]) == lib.OMNI_ERR_NOT_FINITE


@pytest.mark.parametrize(
    ("slot", "value"), [(0, 0), (1, -1), (2, 0), (3, 0), (4, 0), (4, -1e-3), (5, 0), (5, -1), (5, 1.5), (4, 1e-30)]
)
def test_constants_out_of_range_are_refused(slot: int, value: float) -> None:
    numbers = [*REPORT, 1e-3]
    numbers[slot] = value
    assert refusal(tuple(numbers[:5]), numbers[5]) == lib.OMNI_ERR_RANGE


def test_an_inductance_so_small_that_the_voltage_gain_is_no_number_is_refused() -> None:
    """Here the system's own rates are moderate, so that the input's column alone decides."""
    assert refusal((1.0, 0.0, 1e-30, 1e-30, 1e-40), 1e-1) == lib.OMNI_ERR_RANGE
