# SPDX-License-Identifier: MIT
"""What frequencies a stretch of a signal holds."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omni.studio.samples import CAPACITY, Trace
from omniwheel.errors import OmniError

LEAST_SAMPLES = 16
MOST_SAMPLES = 2 * CAPACITY
"""With those that stand for missing ones."""
LONGEST_GAP_S, LONGEST_GAP = 0.9, 20.0
"""A gap of more than both, the second in samples, is not filled. A restart leaves one of a second."""
MOST_LINES = 1000
"""Of a spectrum. Where there are more, the largest of neighbours is kept."""


class TooFewSamplesError(OmniError):
    """A stretch that is too short for a spectrum."""


@dataclass(frozen=True)
class Spectrum:
    """Amplitudes, in the signal's unit, at frequencies [Hz]; a sine of amplitude a gives a line of height a."""

    key: str
    frequency_Hz: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    resolution_Hz: float
    """Two sines that are closer look like one."""

    def as_json(self) -> dict[str, Any]:
        """Return it as the page takes it, with its largest line."""
        top = int(np.argmax(self.amplitude))
        return {
            "key": self.key,
            "Hz": np.round(self.frequency_Hz, 4).tolist(),
            "amplitude": [float(f"{value:.4g}") for value in self.amplitude],
            "resolution_Hz": round(self.resolution_Hz, 4),
            "peak": {"Hz": round(float(self.frequency_Hz[top]), 3), "amplitude": float(f"{self.amplitude[top]:.4g}")},
        }


def spectrum(trace: Trace) -> Spectrum:
    """Return the amplitude spectrum of a trace: mean and straight trend removed, Hann window.

    Samples are brought to even distances first, the median of theirs; where some are missing, straight lines take
    their place. Raises TooFewSamplesError.
    """
    time_s, keep = np.unique(trace.time_s, return_index=True)
    if len(time_s) < LEAST_SAMPLES:
        hint = "wait, select a longer interval, or choose a higher rate under Samples"
        raise TooFewSamplesError(
            f"{trace.key} has {len(time_s)} samples in this interval; {LEAST_SAMPLES} are needed", hint=hint
        )
    step_s = float(np.median(np.diff(time_s)))
    count = 1 + round((time_s[-1] - time_s[0]) / step_s)
    if count > MOST_SAMPLES:
        hint = "select an interval without gaps"
        raise TooFewSamplesError(f"{trace.key} has too few samples for {time_s[-1] - time_s[0]:.0f} s", hint=hint)
    gap_s = float(np.max(np.diff(time_s)))
    if gap_s > max(LONGEST_GAP_S, LONGEST_GAP * step_s):
        text = f"{trace.key} has a gap of {gap_s:.1f} s here: the robot restarted, or the link was interrupted"
        raise TooFewSamplesError(text, hint="select an interval without gaps")
    even_s = time_s[0] + step_s * np.arange(count)
    value = np.interp(even_s, time_s, trace.value[keep].astype(np.float64))
    value = value - np.polyval(np.polyfit(even_s - even_s[0], value, 1), even_s - even_s[0])
    window = np.hanning(count)
    amplitude = 2.0 * np.abs(np.fft.rfft(window * value)) / window.sum()
    frequency_Hz = np.arange(len(amplitude)) / (count * step_s)
    # A Hann window widens a line to two bins of 1 / duration on either side.
    return Spectrum(trace.key, *_fewer(frequency_Hz[1:], amplitude[1:]), 2.0 / (count * step_s))


def _fewer(
    frequency_Hz: NDArray[np.float64], amplitude: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if len(frequency_Hz) <= MOST_LINES:
        return frequency_Hz, amplitude
    edges = np.linspace(0, len(frequency_Hz), MOST_LINES + 1).astype(int)
    tops = [first + int(np.argmax(amplitude[first:last])) for first, last in pairwise(edges)]
    return frequency_Hz[tops], amplitude[tops]
