# SPDX-License-Identifier: MIT
"""Wheel kinematics against NumPy's pseudo-inverse and SciPy's null space, and against the report's robots."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.linalg import null_space

from omniwheel._core import ffi, lib

Array = npt.NDArray[np.float64]


def as_float32(values: Sequence[float]) -> Array:
    return np.array(values, dtype=np.float32).astype(np.float64)


class Layout:
    """Wheel radii, distances and bearings as the core sees them (float32), with B in double precision."""

    def __init__(self, radius_m: Sequence[float], distance_m: Sequence[float], angle_rad: Sequence[float]) -> None:
        self.radius = as_float32(radius_m)
        self.distance = as_float32(distance_m)
        self.angle = as_float32(angle_rad)
        self.wheels = len(self.angle)
        self.b = np.column_stack([-np.sin(self.angle), np.cos(self.angle), self.distance])

    def __repr__(self) -> str:
        return f"Layout({list(self.radius)}, {list(self.distance)}, {list(self.angle)})"

    def init(self) -> tuple[int, Any]:
        config = ffi.new("omni_kinematics_config_t *", {"wheels": self.wheels})
        for i in range(self.wheels):
            config.radius_m[i] = self.radius[i]
            config.distance_m[i] = self.distance[i]
            config.angle_rad[i] = self.angle[i]
        k = ffi.new("omni_kinematics_t *")
        return lib.omni_kinematics_init(k, config), k

    def kinematics(self) -> Any:
        result, k = self.init()
        assert result == lib.OMNI_OK
        return k


def even(wheels: int, radius: float = 0.05, distance: float = 0.2, first_deg: float = 0.0) -> Layout:
    angles = [math.radians(first_deg + 360.0 * i / wheels) for i in range(wheels)]
    return Layout([radius] * wheels, [distance] * wheels, angles)


def matrix(rows: Any, count: int, width: int) -> Array:
    return np.array([[rows[i][j] for j in range(width)] for i in range(count)])


def condition(b: Array) -> float:
    scaled = b / np.array([1.0, 1.0, b[:, 2].mean()])
    return float(np.linalg.cond(scaled))


def inverse(k: Any, body: Sequence[float], slip: Sequence[float] | None = None) -> Array:
    out = ffi.new("float[4]")
    pointer = ffi.NULL if slip is None else ffi.new("float[4]", list(slip))
    lib.omni_kinematics_inverse(k, ffi.new("omni_twist_t *", list(body)), pointer, out)
    return np.array(list(out))[: k.wheels]


def forward(k: Any, wheel: Sequence[float], slip: Sequence[float] | None = None) -> Array:
    out = ffi.new("omni_twist_t *")
    pointer = ffi.NULL if slip is None else ffi.new("float[4]", list(slip))
    lib.omni_kinematics_forward(k, ffi.new("float[4]", list(wheel)), pointer, out)
    return np.array([out.vx, out.vy, out.wz])


@st.composite
def layouts(draw: st.DrawFn) -> Layout:
    """Wheels anywhere, each with its own size and distance, as long as they can produce every motion."""
    wheels = draw(st.sampled_from([3, 4]))
    radii = draw(st.lists(st.floats(0.01, 0.2), min_size=wheels, max_size=wheels))
    distances = draw(st.lists(st.floats(0.05, 1.0), min_size=wheels, max_size=wheels))
    angles = draw(st.lists(st.floats(-math.pi, math.pi), min_size=wheels, max_size=wheels))
    layout = Layout(radii, distances, angles)
    assume(condition(layout.b) < 12.0)
    return layout


numbers = st.floats(-5.0, 5.0, width=32)
twists = st.tuples(numbers, numbers, numbers)


@pytest.mark.full
@given(layouts())
def test_matrices_agree_with_numpy(layout: Layout) -> None:
    k = layout.kinematics()
    expected = np.linalg.pinv(layout.b)
    got = matrix(k.b_pinv, 3, 4)
    for row in range(3):
        scale = np.abs(expected[row]).max()
        np.testing.assert_allclose(got[row, : layout.wheels], expected[row], rtol=0, atol=1e-5 * scale)
    np.testing.assert_allclose(matrix(k.b, layout.wheels, 3), layout.b, rtol=0, atol=2e-7)
    assert not np.any(got[:, layout.wheels :])


@given(layouts())
def test_null_vector_agrees_with_scipy(layout: Layout) -> None:
    k = layout.kinematics()
    null = np.array(list(k.null))
    assert k.has_null == (layout.wheels == 4)
    if layout.wheels == 3:
        assert not np.any(null)
        return
    expected = null_space(layout.b.T)[:, 0]
    assert null[0] >= 0
    assert np.linalg.norm(null) == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(null * np.sign(null @ expected), expected, rtol=0, atol=1e-5)


@given(layouts(), twists)
def test_inverse_then_forward_gives_the_twist_back(layout: Layout, body: tuple[float, float, float]) -> None:
    k = layout.kinematics()
    wheel = inverse(k, body)
    np.testing.assert_allclose(wheel, layout.b @ body / layout.radius, rtol=1e-5, atol=1e-4)
    size = np.abs(body).max() + 1e-3
    np.testing.assert_allclose(
        forward(k, list(wheel)), body, rtol=0, atol=2e-5 * size / min(layout.distance.min(), 1.0)
    )


@given(layouts(), twists, st.lists(st.floats(-0.25, 0.25, width=32), min_size=4, max_size=4))
def test_known_slip_is_compensated(layout: Layout, body: tuple[float, float, float], slip: list[float]) -> None:
    k = layout.kinematics()
    wheel = inverse(k, body, slip)
    without = inverse(k, body)
    np.testing.assert_allclose(
        layout.radius * (wheel - without), slip[: layout.wheels], rtol=0, atol=1e-5 * (1 + np.abs(body).max())
    )
    size = np.abs(body).max() + 1.0
    np.testing.assert_allclose(forward(k, list(wheel), slip), body, rtol=0, atol=1e-4 * size / layout.distance.min())


@given(layouts(), twists, st.lists(st.floats(-0.25, 0.25, width=32), min_size=4, max_size=4))
def test_residual_is_the_slip_along_the_null_direction(
    layout: Layout, body: tuple[float, float, float], slip: list[float]
) -> None:
    k = layout.kinematics()
    wheel = ffi.new("float[4]", list(inverse(k, body, slip)))
    expected = float(np.array(list(k.null)) @ slip) if layout.wheels == 4 else 0.0
    assert lib.omni_kinematics_slip_residual(k, wheel) == pytest.approx(expected, abs=3e-6 * (1 + np.abs(body).max()))


def test_the_reports_four_wheel_platform() -> None:
    distance = 0.195
    k = even(4, 0.03175, distance, 45.0).kinematics()
    b = matrix(k.b, 4, 3)
    np.testing.assert_allclose(b.T @ b, np.diag([2.0, 2.0, 4 * distance**2]), rtol=0, atol=1e-6)
    np.testing.assert_allclose(list(k.null), [0.5, -0.5, 0.5, -0.5], rtol=0, atol=1e-6)
    # a commanded spin turns the robot at that rate, which the printed eq. 21 does not
    np.testing.assert_allclose(forward(k, list(inverse(k, (0, 0, 1)))), [0, 0, 1], rtol=0, atol=1e-6)
    assert np.all(inverse(k, (0, 0, 1)) > 0)


@given(st.floats(-10, 10, width=32), st.lists(st.floats(-20, 20, width=32), min_size=3, max_size=3))
def test_the_three_wheel_platforms_own_matrix_with_its_sign_turned(theta: float, wheel: list[float]) -> None:
    r, distance = 0.0508, 0.2632
    k = even(3, r, distance).kinematics()
    body = ffi.new("omni_twist_t *", list(forward(k, wheel)))
    world = lib.omni_twist_to_world(body, theta)
    s, c, root = math.sin(theta), math.cos(theta), math.sqrt(3)
    builders = r * np.array(
        [
            [2 / 3 * s, c / root - s / 3, -c / root - s / 3],
            [-2 / 3 * c, s / root + c / 3, -s / root + c / 3],
            [-1 / (3 * distance)] * 3,
        ]
    )
    np.testing.assert_allclose([world.vx, world.vy, world.wz], -builders @ wheel, rtol=0, atol=1e-5)


@given(st.floats(-1000, 1000, width=32), twists)
def test_world_and_body_twists_are_rotations_of_each_other(theta: float, twist: tuple[float, float, float]) -> None:
    world = ffi.new("omni_twist_t *", list(twist))
    body = lib.omni_twist_to_body(world, theta)
    rotation = np.array([[math.cos(theta), math.sin(theta)], [-math.sin(theta), math.cos(theta)]])
    np.testing.assert_allclose([body.vx, body.vy], rotation @ twist[:2], rtol=0, atol=5e-6)
    back = lib.omni_twist_to_world(ffi.new("omni_twist_t *", body), theta)
    np.testing.assert_allclose([back.vx, back.vy, back.wz], twist, rtol=0, atol=5e-6)


def assert_refused(layout: Layout, expected: int) -> None:
    result, k = layout.init()
    assert result == expected
    assert bytes(ffi.buffer(k)) == bytes(ffi.sizeof("omni_kinematics_t"))


@pytest.mark.parametrize(
    "angles_deg",
    [
        [30, 30, 30],
        [0, 180, 0],
        [10, 190, 10, 190],
        [45, 45, 45, 45.001],
    ],
)
def test_wheels_that_cannot_produce_every_motion_are_refused(angles_deg: list[float]) -> None:
    n = len(angles_deg)
    assert_refused(Layout([0.05] * n, [0.2] * n, [math.radians(a) for a in angles_deg]), lib.OMNI_ERR_SINGULAR)


@pytest.mark.parametrize("wheels", [0, 1, 2, 5, 255])
def test_other_wheel_counts_are_refused(wheels: int) -> None:
    k = ffi.new("omni_kinematics_t *")
    config = ffi.new("omni_kinematics_config_t *", {"wheels": wheels})
    assert lib.omni_kinematics_init(k, config) == lib.OMNI_ERR_RANGE


@pytest.mark.parametrize("field", ["radius", "distance", "angle"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_not_finite_are_refused(field: str, value: float) -> None:
    layout = even(4)
    getattr(layout, field)[2] = value
    assert_refused(layout, lib.OMNI_ERR_NOT_FINITE)


@pytest.mark.parametrize(("field", "value"), [("radius", 0.0), ("radius", -1.0), ("distance", 0.0), ("angle", 2e6)])
def test_numbers_out_of_range_are_refused(field: str, value: float) -> None:
    layout = even(3)
    getattr(layout, field)[1] = value
    assert_refused(layout, lib.OMNI_ERR_RANGE)
