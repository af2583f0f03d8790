# SPDX-License-Identifier: MIT
"""Plain data for JSON, and numbers for people."""

from __future__ import annotations

import math
import re
from typing import Any

_TYPED = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?|[-+]?inf(inity)?", re.ASCII | re.IGNORECASE)


def typed_number(text: str) -> float:
    """Read a number that somebody typed. Raises ValueError.

    Python's own ``float`` also takes 2_8 as 28, digits of other scripts, and nan.
    """
    if not is_typed_number(text):
        raise ValueError(f"{text!r} is not a number")
    return float(text)


def is_typed_number(text: str) -> bool:
    """Say whether this is a number as people write it."""
    return _TYPED.fullmatch(text.strip()) is not None


def finite(value: Any) -> Any:
    """Return the same data with None for every number that JSON has no form for (NaN, infinity)."""
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
