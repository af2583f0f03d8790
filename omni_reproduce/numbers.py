# SPDX-License-Identifier: MIT
"""Numbers as the tables show them: three significant digits, the same decimals for a mean and its deviation."""

from __future__ import annotations

import math

from omni_reproduce.experiment import Row

NOTHING = "–"
_DIGITS = 3
_SMALLEST_PLAIN, _LARGEST_PLAIN = 1e-4, 1e5


def number(value: float | None) -> str:
    """Return a number with three significant digits, a dash for none."""
    if value is None or not math.isfinite(value):
        return NOTHING
    if value == 0.0:
        return "0"
    if not _SMALLEST_PLAIN <= abs(value) < _LARGEST_PLAIN:
        return f"{value:.{_DIGITS - 1}e}"
    return f"{value:.{_decimals(value)}f}"


def mean_and_sd(mean: float | None, sd: float | None) -> str:
    """Return ``mean ± sd``, or the mean alone if there is no deviation."""
    if mean is None or sd is None or not math.isfinite(sd):
        return number(mean)
    if mean != 0.0 and not _SMALLEST_PLAIN <= abs(mean) < _LARGEST_PLAIN:
        return f"{number(mean)} ± {sd:.0e}"
    decimals = _decimals(mean if mean != 0.0 else sd)
    if sd > 0.0 and round(sd, decimals) == 0.0:
        decimals = min(decimals + 2, 6)
    return f"{mean:.{decimals}f} ± {sd:.{decimals}f}"


def ratio(row: Row) -> str:
    """Return ours over published, a dash where one of them is missing or zero."""
    if row.ours is None or not row.published:
        return NOTHING
    return f"{row.ours / row.published:.2f}"


def _decimals(value: float) -> int:
    return max(_DIGITS - 1 - math.floor(math.log10(abs(value))), 0) if value != 0.0 else 0
