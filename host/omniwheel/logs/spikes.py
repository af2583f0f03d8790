# SPDX-License-Identifier: MIT
"""Spikes of an encoder: a Hampel filter on the counts per period, and the fastest a wheel can turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from omniwheel.logs.log import Array, Mask, WheelLog
from omniwheel.logs.mapping import Spikes

_ADDS_UP = 0.5
"""Size of the correlation that the noise of counts has which add up."""
_CLEAR_COUNTS = 1.0
"""Below it a count's noise is that of rounding, and says nothing."""
OUTLIER_SD = 4.0
"""Robust standard deviations from the median of its window beyond which a count is an outlier."""
_SD_PER_MAD = 1.4826  # standard deviation per median absolute deviation of a normal distribution


@dataclass(frozen=True)
class Noise:
    """Of the counts about their median, per wheel: standard deviation [counts per row], correlation with the next.

    Both leave outliers out. ``outlier_share`` is the share of the counts further than ``OUTLIER_SD`` from their median.

    The error of an angle that was read goes into one count and out of the next: such noise has a correlation of -0.5.
    Near 0 each count has an error of its own, as a difference over less than a row has.
    """

    counts: tuple[float, ...]
    correlation: tuple[float, ...]
    outlier_share: tuple[float, ...]


def reject_spikes(log: WheelLog, spikes: Spikes) -> tuple[Mask, Noise]:
    """Return which counts are no spikes (n, wheels), and the noise of those that are no outliers.

    A count is a spike if it is further from the median of its window than ``threshold`` robust standard
    deviations, or faster than ``max_rad_s``. The distance is one count at least: quantisation must not be rejected.
    An outlier of counts that add up is no spike unless ``spikes`` says so.
    """
    rate = log.counts if log.sample_s > 0.0 else log.counts_per_period
    half = max(1, round(spikes.window_s / log.period_s))
    centre = running_median(rate, half)
    spread = _SD_PER_MAD * running_median(np.abs(rate - centre), half)
    limit = spikes.max_rad_s / log.quantum_rad_s
    off, unit = np.abs(rate - centre), np.maximum(spread, 1.0)
    good = (off <= spikes.threshold * unit) & (np.abs(rate) <= limit)
    usual = off <= OUTLIER_SD * unit
    found = [_noise((rate - centre)[:, wheel], (usual & good)[:, wheel]) for wheel in range(log.wheels)]
    counts, correlation = zip(*found, strict=True)
    shares = tuple(float(share) for share in 1.0 - usual.mean(axis=0))
    return good & log.good, Noise(counts, correlation, shares)


def count_noise_warning(log: WheelLog, counts: Sequence[float], correlation: Sequence[float]) -> str:
    """Say what the noise of the counts contradicts in the mapping; "" if nothing.

    Slow changes of the true speed, which a median follows late, raise the correlation: only what is clear is said.
    """
    told = float(np.nanmean(correlation)) if np.any(np.isfinite(correlation)) else float("nan")
    if log.sample_s > 0.0 and told < -0.5 * _ADDS_UP:
        return (
            f"The noise of a count has a correlation of {told:+.2f} with the next one's, as counts that add up have: "
            "check sample_s under [wheels]."
        )
    if log.sample_s == 0.0 and abs(told) < 0.5 * _ADDS_UP and min(counts) > _CLEAR_COUNTS:
        return (
            f"The noise of a count ({min(counts):.1f} counts or more) has a correlation of {told:+.2f} with the next "
            "one's; where rows share their readings it is near -0.5. If each count is the difference over a shorter "
            "time than a row, set sample_s under [wheels]."
        )
    return ""


def _noise(off: Array, good: Mask) -> tuple[float, float]:
    """Standard deviation of what is good, and how far one row tells the next (NaN where nothing does)."""
    if not good.any():
        return float("nan"), float("nan")
    both = good[1:] & good[:-1]
    spread = float(np.mean(off[good] ** 2))
    told = float(np.mean((off[1:] * off[:-1])[both])) / spread if both.any() and spread > 0.0 else float("nan")
    return float(np.std(off[good])), told


def running_median(table: Array, half: int) -> Array:
    """Median of the rows within ``half`` rows, per column; the ends repeat the first and last row."""
    padded = np.pad(table, ((half, half), (0, 0)), mode="edge")
    return np.asarray(np.median(sliding_window_view(padded, 2 * half + 1, axis=0), axis=-1))
