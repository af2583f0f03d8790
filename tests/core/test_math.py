# SPDX-License-Identifier: MIT
"""The core's replacement for libm, against NumPy in double precision."""

from __future__ import annotations

import math
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniwheel._core import ffi, lib

PI_F = float(np.float32(math.pi))
NOT_FINITE = [math.nan, math.inf, -math.inf]


def angles(limit: float) -> st.SearchStrategy[float]:
    return st.floats(-limit, limit, width=32)


def sincos(angle: float) -> tuple[float, float]:
    out = ffi.new("float[2]")
    lib.omni_sincosf(angle, out, out + 1)
    return out[0], out[1]


def sample(limit: float, count: int) -> np.ndarray:
    """Return float32 numbers in [-limit, limit], dense near zero as well as near the ends."""
    rng = np.random.default_rng(1)
    wide = rng.uniform(-limit, limit, count)
    small = np.copysign(10.0 ** rng.uniform(-12, math.log10(limit), count), wide)
    return np.concatenate([wide, small]).astype(np.float32)


@pytest.mark.parametrize("limit", [1e4, 1e6])
def test_sine_and_cosine_agree_with_numpy(limit: float) -> None:
    x = sample(limit, 40000)
    got = np.array([sincos(float(a)) for a in x])
    exact = x.astype(np.float64)
    assert np.max(np.abs(got[:, 0] - np.sin(exact))) < 2e-7
    assert np.max(np.abs(got[:, 1] - np.cos(exact))) < 2e-7


def test_sine_and_cosine_are_right_around_every_multiple_of_a_quarter_turn() -> None:
    quarters = (np.arange(-6400, 6401) * (math.pi / 2)).astype(np.float32)
    for x in (quarters, np.nextafter(quarters, np.float32(1e9)), quarters + quarters[6401] / 2):
        got = np.array([sincos(float(a)) for a in x])
        exact = x.astype(np.float64)
        assert np.max(np.abs(got[:, 0] - np.sin(exact))) < 2e-7
        assert np.max(np.abs(got[:, 1] - np.cos(exact))) < 2e-7


def test_the_bits_are_the_same_on_every_machine() -> None:
    """The checksum was the same with gcc and clang, without and with optimisation, before it was written here."""
    patterns = (np.arange(20000, dtype=np.uint32) * np.uint32(2654435761)).view(np.float32)
    x = np.concatenate([patterns[np.isfinite(patterns)], (np.arange(-5000, 5000) * 0.37).astype(np.float32)])
    results = [(*sincos(float(a)), lib.omni_wrap_pi(float(a)), lib.omni_atan2f(float(a), 1.5)) for a in x]
    assert zlib.crc32(np.array(results, dtype="<f4").tobytes()) == 3831663928


def test_small_angles_keep_their_relative_precision() -> None:
    x = (10.0 ** np.random.default_rng(2).uniform(-30, -1, 5000)).astype(np.float32)
    got = np.array([sincos(float(a))[0] for a in x])
    assert np.max(np.abs(got / np.sin(x.astype(np.float64)) - 1.0)) < 2e-7


@given(angles(1e6))
def test_sine_is_odd_and_cosine_even_to_the_last_bit(angle: float) -> None:
    s, c = sincos(angle)
    assert sincos(-angle) == (-s, c)
    assert s * s + c * c == pytest.approx(1.0, abs=4e-7)
    assert max(abs(s), abs(c)) <= 1.0 + 1e-7


@pytest.mark.parametrize("angle", NOT_FINITE)
def test_no_angle_gives_nan(angle: float) -> None:
    assert all(math.isnan(value) for value in sincos(angle))
    assert math.isnan(lib.omni_wrap_pi(angle))


@pytest.mark.parametrize("angle", [1.1e6, -3e9, 1e20, -3.4e38])
def test_angles_beyond_reduction_count_as_zero(angle: float) -> None:
    assert sincos(angle) == (0.0, 1.0)
    assert lib.omni_wrap_pi(angle) == 0.0


def test_arc_tangent_agrees_with_numpy() -> None:
    rng = np.random.default_rng(3)
    directions = rng.uniform(-math.pi, math.pi, 40000)
    lengths = 10.0 ** rng.uniform(-15, 15, directions.size)
    y = (lengths * np.sin(directions)).astype(np.float32)
    x = (lengths * np.cos(directions)).astype(np.float32)
    got = np.array([lib.omni_atan2f(float(a), float(b)) for a, b in zip(y, x, strict=True)])
    assert np.max(np.abs(got - np.arctan2(y.astype(np.float64), x.astype(np.float64)))) < 5e-7


@pytest.mark.parametrize(
    ("y", "x", "expected"),
    [(0, 0, 0), (0, 1, 0), (1, 0, math.pi / 2), (-1, 0, -math.pi / 2), (0, -1, math.pi), (1, 1, math.pi / 4)],
)
def test_arc_tangent_on_the_axes(y: float, x: float, expected: float) -> None:
    assert lib.omni_atan2f(y, x) == pytest.approx(expected, abs=2e-7)


@pytest.mark.parametrize("bad", NOT_FINITE)
@pytest.mark.parametrize("other", [0.0, 1.0, -1.0, math.inf])
def test_arc_tangent_of_no_number_is_nan(bad: float, other: float) -> None:
    assert math.isnan(lib.omni_atan2f(bad, other))
    assert math.isnan(lib.omni_atan2f(other, bad))


@given(angles(1e6))
def test_wrapping_keeps_the_direction(angle: float) -> None:
    wrapped = lib.omni_wrap_pi(angle)
    assert -PI_F <= wrapped < PI_F
    turns = (angle - wrapped) / (2 * math.pi)
    assert abs(turns - round(turns)) * 2 * math.pi < 5e-7


@given(angles(3.125))
def test_wrapping_leaves_wrapped_angles_alone(angle: float) -> None:
    assert lib.omni_wrap_pi(angle) == angle


@pytest.mark.parametrize("angle", [PI_F, -PI_F, 3 * PI_F])
def test_half_a_turn_wraps_to_the_lower_end(angle: float) -> None:
    assert abs(abs(lib.omni_wrap_pi(angle)) - math.pi) < 1e-6
    assert -PI_F <= lib.omni_wrap_pi(angle) < PI_F


@given(st.floats(width=32, allow_nan=False))
def test_square_root_is_exact_and_never_nan(value: float) -> None:
    expected = float(np.sqrt(np.float32(value))) if value > 0 else 0.0
    assert lib.omni_sqrtf(value) == expected


@given(st.floats(width=32), st.floats(-100, 0, width=32), st.floats(0, 100, width=32))
def test_clamp(value: float, low: float, high: float) -> None:
    expected = low if math.isnan(value) else min(max(value, low), high)
    assert lib.omni_clampf(value, low, high) == expected


@given(st.floats(width=32))
def test_sign_magnitude_and_finiteness(value: float) -> None:
    assert lib.omni_signf(value) == (0.0 if math.isnan(value) else np.sign(value))
    assert lib.omni_is_finite(value) == math.isfinite(value)
    if not math.isnan(value):
        assert lib.omni_absf(value) == abs(value)


@pytest.mark.parametrize("bad", NOT_FINITE)
@pytest.mark.parametrize("slot", range(3))
def test_poses_and_twists_with_one_bad_component_are_not_finite(bad: float, slot: int) -> None:
    good = [1.0, -2.0, 3.0]
    assert lib.omni_pose_is_finite(ffi.new("omni_pose_t *", good))
    assert lib.omni_twist_is_finite(ffi.new("omni_twist_t *", good))
    good[slot] = bad
    assert not lib.omni_pose_is_finite(ffi.new("omni_pose_t *", good))
    assert not lib.omni_twist_is_finite(ffi.new("omni_twist_t *", good))
