# SPDX-License-Identifier: MIT
"""Spikes of an encoder: a Hampel filter on the counts per period, and the fastest a wheel can turn."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from omniwheel.logs.log import Array, Mask, WheelLog
from omniwheel.logs.mapping import Spikes

_SD_PER_MAD = 1.4826  # standard deviation per median absolute deviation of a normal distribution


def reject_spikes(log: WheelLog, spikes: Spikes) -> tuple[Mask, tuple[float, ...]]:
    """Return which counts are no spikes (n, wheels) and the noise of the good ones per wheel [counts per period].

    A count is a spike if it is further from the median of its window than ``threshold`` robust standard
    deviations, or faster than ``max_rad_s``. The distance is one count at least: quantisation must not be rejected.
    """
    rate = log.counts / np.maximum(np.round(log.step_s / log.period_s), 1.0)[:, None]
    half = max(1, round(spikes.window_s / log.period_s))
    centre = running_median(rate, half)
    spread = _SD_PER_MAD * running_median(np.abs(rate - centre), half)
    limit = spikes.max_rad_s * log.period_s / log.rad_per_count
    good = (np.abs(rate - centre) <= spikes.threshold * np.maximum(spread, 1.0)) & (np.abs(rate) <= limit)
    noise = tuple(
        float(np.std((rate - centre)[good[:, wheel], wheel])) if good[:, wheel].any() else float("nan")
        for wheel in range(log.wheels)
    )
    return good & log.good, noise


def running_median(table: Array, half: int) -> Array:
    """Median of the rows within ``half`` rows, per column; the ends repeat the first and last row."""
    padded = np.pad(table, ((half, half), (0, 0)), mode="edge")
    return np.asarray(np.median(sliding_window_view(padded, 2 * half + 1, axis=0), axis=-1))
