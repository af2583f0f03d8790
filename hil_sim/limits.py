# SPDX-License-Identifier: MIT
"""Bounds and defaults that the simulation and the help pages of ``omni`` share; importing this costs nothing."""

from __future__ import annotations

MAX_DURATION_S = 3600.0
"""Longest simulated time of a scenario."""
MAX_SEED = 2**63 - 1
DEFAULT_BATCH = 32
"""Runs of a study that are done, kept and repeated together."""
SAMPLERS = ("tpe", "cmaes", "random")
"""How an optimisation chooses what to try next."""
