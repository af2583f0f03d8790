# SPDX-License-Identifier: MIT
"""Measuring how fast something is: several things in turn, so that a slow moment of the computer hits all alike."""

from __future__ import annotations

import os
import platform
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from hil_sim.processes import usable_processors

Measurement = Callable[[], float]
"""Does its work once and returns its figure, a time or a time per something: the smaller the better."""


@dataclass(frozen=True)
class Spread:
    """The figures of one thing over the rounds: the least is the one to compare, the median says how noisy it was."""

    values: tuple[float, ...]

    @property
    def least(self) -> float:
        """The smallest figure."""
        return min(self.values)

    @property
    def median(self) -> float:
        """The middle figure."""
        return statistics.median(self.values)


def alternate(
    measurements: Mapping[str, Measurement], rounds: int, progress: Callable[[str, int], None] | None = None
) -> dict[str, Spread]:
    """Do all measurements one after the other, ``rounds`` times over; ``progress`` gets name and round of each."""
    values: dict[str, list[float]] = {name: [] for name in measurements}
    for number in range(rounds):
        for name, measure in measurements.items():
            if progress is not None:
                progress(name, number)
            values[name].append(measure())
    return {name: Spread(tuple(figures)) for name, figures in values.items()}


def machine() -> str:
    """Return the processor's name, the number of processors to be used, and how busy they were in the last minute."""
    usable = usable_processors()
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"{_processor()}, {usable} processor{'s' if usable > 1 else ''}{load}"


def _processor() -> str:
    try:
        lines: Sequence[str] = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return f"{names[0]} ({platform.machine()})" if names else platform.machine()
