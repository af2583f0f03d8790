# SPDX-License-Identifier: MIT
"""Clock offset and frame of a ground truth are found, and its scale is left alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniwheel.errors import LogError
from omniwheel.logs.alignment import align
from omniwheel.logs.log import Array, Truth

TIME = np.arange(0.0, 12.0, 0.01)


def curve(time: Array) -> Array:
    """An irregular path that rests before 0 s and after 11 s."""
    t = np.clip(time, 0.0, 11.0)
    return np.column_stack((np.sin(0.5 * t) + 0.1 * t, 0.6 * np.cos(0.8 * t) + 0.03 * t**1.5))


def truth(offset: float, rotation: float, mirrored: bool, scale: float = 1.0, start: float = -1.0) -> Truth:
    time = np.arange(start, 13.0, 1.0 / 30.0)
    c, s = np.cos(rotation), np.sin(rotation)
    xy = scale * curve(time) * ((1.0, -1.0) if mirrored else (1.0, 1.0))
    return Truth(time + offset, xy @ np.array([[c, s], [-s, c]]) + (0.3, -0.7), np.full(len(time), np.nan))


@pytest.mark.full
@given(offset=st.floats(-3.0, 3.0), rotation=st.floats(-3.1, 3.1), mirrored=st.booleans(), given_to=st.booleans())
def test_clock_and_frame_are_found(offset: float, rotation: float, mirrored: bool, given_to: bool) -> None:
    known = truth(offset, rotation, mirrored)
    found = align(TIME, curve(TIME), known, mirrored=mirrored if given_to else None)
    assert found.offset_s == pytest.approx(offset, abs=0.006)
    assert found.offset_low_s <= found.offset_s <= found.offset_high_s
    assert found.mirrored == mirrored
    assert np.cos(found.rotation_rad - rotation) == pytest.approx(1.0, abs=1e-4)
    assert found.rms_m < 5e-3
    assert found.scale == pytest.approx(1.0, abs=5e-3)
    there = found.to_truth(curve(TIME))
    assert np.allclose(found.to_robot(there), curve(TIME), atol=1e-12)


def test_the_scale_is_measured_but_not_applied() -> None:
    found = align(TIME, curve(TIME), truth(0.5, 1.0, False, scale=0.7))
    assert found.scale == pytest.approx(0.7, abs=2e-3)
    spread = np.sqrt(np.mean(np.sum((curve(TIME) - curve(TIME).mean(axis=0)) ** 2, axis=1)))
    assert found.rms_m == pytest.approx(0.3 * spread, rel=0.02)


def test_a_straight_path_is_not_called_mirrored() -> None:
    time = np.arange(0.0, 5.0, 0.01)
    line = np.column_stack((np.clip(time - 1.0, 0.0, 3.0), np.zeros_like(time)))
    assert not align(time, line, Truth(time, line, np.full(len(time), np.nan)), mirrored=None).mirrored


def test_a_truth_of_another_time_is_refused() -> None:
    with pytest.raises(LogError, match="cover 80%"):
        align(TIME, curve(TIME), truth(100.0, 0.0, False))


def test_an_offset_may_not_leave_out_what_it_cannot_explain() -> None:
    """The truth starts 1 s into the run, in motion; nothing fits perfectly, and the offset stays within the gap."""
    found = align(TIME, curve(TIME), truth(0.0, 0.0, False, start=1.0))
    assert abs(found.offset_s) < 0.3
    assert 0.85 < found.overlap <= 1.0
