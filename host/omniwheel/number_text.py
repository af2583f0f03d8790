# SPDX-License-Identifier: MIT
"""Parsing and formatting of numbers, and finite data for JSON."""

from __future__ import annotations

import math
import re
from typing import Any

_TYPED = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?|[-+]?inf(inity)?", re.ASCII | re.IGNORECASE)


def parse_number(text: str) -> float:
    """Parse a typed number. Raises ValueError.

    Python's own ``float`` also takes 2_8 as 28, digits of other scripts, and nan.
    """
    if not is_number_text(text):
        raise ValueError(f"{text!r} is not a number")
    return float(text)


def is_number_text(text: str) -> bool:
    """Return whether this is a number in usual notation."""
    return _TYPED.fullmatch(text.strip()) is not None


def finite(value: Any) -> Any:
    """Return a copy of the data with None for NaN and infinity, which JSON lacks."""
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def shown(value: float | None, factor: float = 1.0, digits: int = 2) -> str:
    """Return a number times ``factor`` as text; a dash for none, and "<0.1" for what is more than 0 and rounds to 0."""
    if value is None:
        return "–"
    least = 10.0**-digits
    return f"<{least:.{digits}f}" if 0.0 < value * factor < 0.5 * least else f"{value * factor:.{digits}f}"
