# SPDX-License-Identifier: MIT
"""Clocks and counters of 16 and 32 bits, which begin again at their end; and counters that a restart sets to zero."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from omniwheel.logs.log import Array, Mask

CLOCKS_S = tuple(2.0**bits * unit for bits in (16, 32) for unit in (1e-6, 1e-3))
"""After so long a counter of microseconds or milliseconds begins again."""
COUNTERS = (2.0**16, 2.0**32)
LONGEST_GAP_S = 1.0
"""A clock that has wrapped goes on within this time; another step back is no wrap."""
_SMALL = 0.25
"""A step of more than this share of a counter's range is none."""
_USUAL_QUANTILE = 0.99
"""So many of the rows count no faster than what a log's wheels usually do at most."""
_NEIGHBOURS = 5
"""Rows on each side whose speeds a row's own is compared with."""
_SLACK_COUNTS = 10.0
"""A wheel at rest may be nudged by so much in one row."""
_CAME_BACK = 0.2
"""A later step that undoes one but for this share of it: the counter was misread in between, it did not restart."""


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


def counted_on(counts: Array, steps: Array, periods: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the steps of counters that go on where a restart set them to zero, and the rows in which that was.

    ``counts`` and ``steps`` (n, wheels) are running counts and what they went on by, ``periods`` (n,) how many periods
    each row lasts. A restart is a step that no row around it explains, to a count that the wheel may have turned since
    zero. What a wheel turned before the restart, in that row, is lost.
    """
    most = np.maximum(_usual(steps, periods), _around(np.abs(steps) / periods[:, None])) * periods[:, None]
    sudden = np.abs(steps) > 2.0 * most + _SLACK_COUNTS
    near_zero = np.abs(counts) <= most + _SLACK_COUNTS
    restarts = [
        int(row)
        for row in np.flatnonzero(np.any(sudden & near_zero, axis=1))
        if any(not _comes_back(steps[:, w], near_zero[:, w], int(row)) for w in np.flatnonzero(sudden[row]))
    ]
    found = np.array(restarts, dtype=np.int64)
    going_on = steps.copy()
    from_zero = near_zero[found] & (np.abs(counts[found]) < np.abs(steps[found]))
    going_on[found] = np.where(from_zero, counts[found], steps[found])
    return going_on, found


def _usual(steps: Array, periods: Array) -> float:
    """Return the counts per period that a log's wheels seldom exceed."""
    return float(np.quantile(np.abs(steps) / periods[:, None], _USUAL_QUANTILE))


def _around(rates: Array) -> Array:
    """Return the largest of the rates (n, wheels) in the rows around each, without its own."""
    padded = np.pad(rates, ((_NEIGHBOURS, _NEIGHBOURS), (0, 0)))
    largest = np.max(sliding_window_view(padded, _NEIGHBOURS, axis=0), axis=-1)
    return np.asarray(np.maximum(largest[: len(rates)], largest[_NEIGHBOURS + 1 :]))


def _comes_back(steps: Array, near_zero: Mask, row: int) -> bool:
    """Say whether a later step of a wheel undoes one: a counter that restarted never gets back to where it was."""
    left = np.abs(steps[row + 1 :] + steps[row])
    return bool(np.any((left <= _CAME_BACK * abs(steps[row])) & ~near_zero[row + 1 :]))


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
