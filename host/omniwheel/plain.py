# SPDX-License-Identifier: MIT
"""Plain data for JSON."""

from __future__ import annotations

import math
from typing import Any


def finite(value: Any) -> Any:
    """Return the same data with None for every number that JSON has no form for (NaN, infinity)."""
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
