# SPDX-License-Identifier: MIT
"""Clocks and counters of 16 and 32 bits, which begin again at their end."""

from __future__ import annotations

import numpy as np

from omniwheel.logs.log import Array

CLOCKS_S = tuple(2.0**bits * unit for bits in (16, 32) for unit in (1e-6, 1e-3))
"""After so long a counter of microseconds or milliseconds begins again."""
COUNTERS = (2.0**16, 2.0**32)
LONGEST_GAP_S = 1.0
"""A clock that has wrapped goes on within this time; another step back is no wrap."""
_SMALL = 0.25
"""A step of more than this share of a counter's range is none."""


def unwrapped_clock(time_s: Array) -> Array:
    """Return times (n,) [s] that go on where the logger's clock began again; other steps back stay."""
    step = np.diff(time_s)
    if not np.any(step < 0.0):
        return time_s
    for range_s in CLOCKS_S:
        ahead = step + range_s
        if np.ptp(time_s) >= range_s:
            continue
        wraps = (step < 0.0) & (ahead > 0.0) & (ahead <= min(LONGEST_GAP_S, _SMALL * range_s))
        if wraps.any():
            return np.asarray(time_s + range_s * np.concatenate(([0.0], np.cumsum(wraps))))
    return time_s


def counter_steps(counts: Array) -> Array:
    """Return what running counters (n, wheels) went on since the row before; 0 in the first row."""
    step = np.diff(counts, axis=0, prepend=counts[:1])
    span = _range(counts)
    if span == 0.0:
        return step
    around = step - span * np.round(step / span)
    wraps = (np.abs(step) > 0.5 * span) & (np.abs(around) < _SMALL * span)
    return np.asarray(np.where(wraps, around, step))


def signed_steps(steps: Array) -> Array:
    """Return increments (n, wheels) of which the negative ones may have been logged without their sign."""
    span = _range(steps)
    unsigned = span > 0.0 and bool(np.all(steps >= 0.0))
    backward = steps > (1.0 - _SMALL) * span
    return np.asarray(np.where(backward, steps - span, steps)) if unsigned else steps


def _range(counts: Array) -> float:
    """Return the range of the counters that hold these values, with or without a sign; 0 if no counter does."""
    if not len(counts) or not np.all(counts == np.round(counts)):
        return 0.0
    low, high = float(np.min(counts)), float(np.max(counts))
    return next(
        (span for span in COUNTERS if (low >= 0.0 and high < span) or (-span / 2 <= low and high < span / 2)), 0.0
    )
