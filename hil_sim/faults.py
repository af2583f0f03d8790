# SPDX-License-Identifier: MIT
"""Faults of the simulated world by name, as scenario files give them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hil_sim.schema import WORLD
from omniwheel._core import lib

KINDS: dict[str, int] = {name: fault.number for name, fault in WORLD.faults.items()}
"""Name of a fault to its number in ``hil_fault_kind_t``."""

NAMES: dict[int, str] = {kind: name for name, kind in KINDS.items()}

MAX_FAULTS: int = lib.HIL_MAX_FAULTS


@dataclass(frozen=True)
class Fault:
    """One fault from ``start_s`` up to, not including, ``stop_s`` [s, simulated time].

    ``wheel`` counts from 0 and matters for faults of one wheel. ``world.toml`` says what each fault does, which of them
    have a ``value``, and its unit and range.
    """

    name: str
    start_s: float
    stop_s: float = math.inf
    wheel: int = 0
    value: float = 0.0

    def __post_init__(self) -> None:
        if self.name not in KINDS:
            raise ValueError(f"fault {self.name!r} is unknown; must be one of {', '.join(KINDS)}")

    @property
    def kind(self) -> int:
        """Number of the fault in ``hil_fault_kind_t``."""
        return KINDS[self.name]
