# SPDX-License-Identifier: MIT
"""What an experiment showed: numbers with their units, beside what the model says, and the curves for its picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omniwheel.burst import Burst
from omniwheel.experiments.response import Response
from omniwheel.experiments.session import Claims
from omniwheel.wheel_loop import Margins

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Figure:
    """A number in SI: measured, with half of its 95 % interval (NaN: none), and as the model has it (NaN: unknown)."""

    key: str
    name: str
    unit: str
    measured: float
    half_width: float = math.nan
    model: float = math.nan

    def as_dict(self) -> dict[str, float | str]:
        """Return it as plain data."""
        return {
            "unit": self.unit,
            "measured": self.measured,
            "half_width": self.half_width,
            "model": self.model,
        }


@dataclass(frozen=True)
class Line:
    """A curve of a panel."""

    name: str
    x: Array
    y: Array
    modelled: bool = False


@dataclass(frozen=True)
class Panel:
    """A diagram of the picture; ``logarithmic`` frequencies."""

    title: str
    x_label: str
    y_label: str
    lines: Sequence[Line]
    logarithmic: bool = False


@dataclass(frozen=True)
class Outcome:
    """Figures, curves, what was used, remarks that a reader has to know, and the burst itself."""

    experiment: str
    claims: Claims
    settings: dict[str, Any]
    figures: Sequence[Figure]
    panels: Sequence[Panel]
    burst: Burst
    remarks: Sequence[str] = field(default_factory=tuple)

    def __getitem__(self, key: str) -> Figure:
        return next(figure for figure in self.figures if figure.key == key)

    def document(self) -> dict[str, Any]:
        """Return everything but curves and burst as plain data."""
        return {
            "experiment": self.experiment,
            "settings": self.settings,
            "claims": vars(self.claims),
            "figures": {figure.key: figure.as_dict() for figure in self.figures},
            "remarks": list(self.remarks),
        }


def margin_figures(measured: Margins, model: Margins | None) -> list[Figure]:
    """Return a loop's margins, measured and modelled."""
    known = Margins(math.nan, math.nan, math.nan) if model is None else model
    return [
        Figure("gain_margin", "gain margin", "", measured.gain, model=known.gain),
        Figure("phase_margin_rad", "phase margin", "rad", measured.phase_rad, model=known.phase_rad),
        Figure("distance", "distance from -1", "", measured.distance, model=known.distance),
    ]


def magnitude_dB(value: Complex) -> Array:
    """Return 20 log10 |value|."""
    return np.asarray(20.0 * np.log10(np.maximum(np.abs(value), 1e-9)), dtype=np.float64)


def bode(name: str, measured: Response, model: Complex | None) -> list[Panel]:
    """Return magnitude and phase of a response, with the model's beside it."""
    good, hz = measured.credible, measured.frequency_hz
    sizes = [Line("measured", hz[good], magnitude_dB(measured.value[good]))]
    phases = [Line("measured", hz[good], np.degrees(np.unwrap(np.angle(measured.value[good]))))]
    if model is not None:
        sizes.append(Line("model", hz, magnitude_dB(model), modelled=True))
        phases.append(Line("model", hz, np.degrees(np.unwrap(np.angle(model))), modelled=True))
    return [
        Panel(f"{name}: size", "frequency [Hz]", "[dB]", sizes, logarithmic=True),
        Panel(f"{name}: phase", "frequency [Hz]", "[deg]", phases, logarithmic=True),
    ]
