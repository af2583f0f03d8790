# SPDX-License-Identifier: MIT
"""Parameter sets for tests of the stores: every value is within its range, so that it is loaded again."""

from __future__ import annotations

import random

from omni_schema import as_float32, load_parameters
from tests.native import ROOT

TABLE = load_parameters(ROOT / "shared" / "params.toml")
NOWHERE = 2.0**100
"""What the robot's own values can be: no stored value is the same, so that each of them is stored."""


def drawn_values(seed: float) -> list[float]:
    """Return a value within its range for each parameter, others for each seed."""
    draw = random.Random(seed)
    drawn = [p.minimum + draw.random() * (p.maximum - p.minimum) for p in TABLE.parameters]
    return [as_float32(v) if p.kind == "real" else float(int(v)) for p, v in zip(TABLE.parameters, drawn, strict=True)]
