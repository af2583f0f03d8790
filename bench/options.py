# SPDX-License-Identifier: MIT
"""What every benchmark is told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hil_sim.speed import Measurement, Spread, alternate


@dataclass(frozen=True)
class Options:
    """``quick``: short runs, to see that all works. ``say`` gets a line about what is being done."""

    quick: bool
    seed: int
    say: Callable[[str], None]

    @property
    def rounds(self) -> int:
        """How often each measurement is done, in turn with the others."""
        return 2 if self.quick else 5

    def pick(self, quick: int, full: int) -> int:
        """Return the size of something."""
        return quick if self.quick else full

    def measure(self, measurements: dict[str, Measurement]) -> dict[str, Spread]:
        """Do the measurements in turn, ``rounds`` times over."""
        return alternate(
            measurements, self.rounds, lambda name, number: self.say(f"{name} ({number + 1}/{self.rounds})")
        )

    @property
    def how(self) -> str:
        """How the figures came about, for a table's note."""
        return f"least and median of {self.rounds}, measured in turn"
