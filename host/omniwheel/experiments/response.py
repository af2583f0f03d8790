# SPDX-License-Identifier: MIT
"""Frequency responses from a sweep that the robot made itself, and what they say of a loop.

The sweep r, known exactly, is the instrument: whatever it did not cause averages out, feedback or not. Over the whole
record, which begins and ends at rest::

    A / B (f) = sum conj(R) A / sum conj(R) B        the sums over neighbouring frequencies
    coherence = |sum conj(R) A|^2 / (sum |R|^2 sum |A|^2)

The relative standard deviation of a response from n frequencies is sqrt((1 - coherence) / (2 n coherence)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omniwheel.identification.estimate import require_scipy
from omniwheel.wheel_loop import Margins, margins

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

SMOOTHED_HZ = 2.0
"""Width over which neighbouring frequencies are averaged."""
CREDIBLE = 0.5
"""Coherence below which a response says nothing."""
HALF_POWER = math.sqrt(0.5)
INTERVAL = 1.96
"""Half of a 95 % interval, in standard deviations."""


@dataclass(frozen=True)
class Response:
    """A frequency response: complex ``value``, ``coherence`` 0 to 1, ``spread``: its relative standard deviation."""

    frequency_hz: Array
    value: Complex
    coherence: Array
    spread: Array

    @property
    def credible(self) -> NDArray[np.bool_]:
        """Where it says something."""
        return np.asarray(self.coherence >= CREDIBLE)


@dataclass(frozen=True)
class Value:
    """A measured number with half of its 95 % interval."""

    value: float
    half_width: float

    def as_dict(self) -> dict[str, float]:
        """Return both as plain data."""
        return {"value": self.value, "half_width": self.half_width}


class Sweep:
    """A recorded sweep: ``reference`` as the loop got it, every ``period_s``, from ``from_hz`` to ``to_hz``."""

    def __init__(
        self, reference: Array, period_s: float, from_hz: float, to_hz: float, smoothed_hz: float = SMOOTHED_HZ
    ) -> None:
        self._reference, self._rate = reference, 1.0 / period_s
        frequency = np.fft.rfftfreq(len(reference), period_s)
        self._width = max(3, round(smoothed_hz / frequency[1]) | 1)
        edge = 0.5 * smoothed_hz
        low, high = min(from_hz, to_hz) + edge, max(from_hz, to_hz) - edge
        self._chosen = (frequency >= low) & (frequency <= high)
        self.frequency_hz = np.asarray(frequency[self._chosen], dtype=np.float64)
        self._own = self._cross(reference)

    def _cross(self, signal: Array) -> Complex:
        return self._smoothed(self._reference, signal)

    def _smoothed(self, first: Array, second: Array) -> Complex:
        spectra = require_scipy("signal")
        size = len(first)
        _, raw = spectra.csd(first, second, self._rate, window="boxcar", nperseg=size, detrend="constant")
        mean = np.convolve(raw, np.full(self._width, 1.0 / self._width), mode="same")
        return np.asarray(mean[self._chosen], dtype=np.complex128)

    def response(self, answer: Array, cause: Array | None = None) -> Response:
        """Return the response of a recorded signal to the reference, or to another recorded signal."""
        cross = self._cross(answer)
        power = np.real(self._smoothed(answer, answer))
        coherence = np.clip(np.abs(cross) ** 2 / (np.real(self._own) * power), 1e-6, 1.0)
        spread = np.sqrt((1.0 - coherence) / (2.0 * self._width * coherence))
        under = self._own
        if cause is not None:
            under = self._cross(cause)
            cause_coherence = np.abs(under) ** 2 / (np.real(self._own) * np.real(self._smoothed(cause, cause)))
            coherence = np.minimum(coherence, cause_coherence)
        return Response(self.frequency_hz, np.asarray(cross / under), coherence, spread)


def bandwidth(response: Response) -> Value | None:
    """Return up to which frequency the answer keeps 71 % (-3 dB) of the reference; None if it is not in the sweep."""
    frequency, size = response.frequency_hz, np.abs(response.value)
    usable = response.credible
    below = np.flatnonzero(usable & (size < HALF_POWER))
    if not len(below) or below[0] == 0:
        return None
    at = int(below[0])
    around = slice(max(0, at - 12), at + 12)
    slope, offset = np.polyfit(frequency[around], size[around], 1)
    if slope >= 0.0:
        return None
    width = INTERVAL * float(response.spread[at]) * HALF_POWER / abs(float(slope))
    return Value(float((HALF_POWER - offset) / slope), max(width, 0.5 * float(frequency[1] - frequency[0])))


def modelled_bandwidth(frequency_hz: Array, closed: Complex) -> Value | None:
    """Return the same of a response that is known exactly."""
    sure = np.ones(len(closed))
    return bandwidth(Response(frequency_hz, closed, sure, 0.0 * sure))


def crossover_hz(loop: Response) -> float | None:
    """Return where the open loop falls below 1; None if it does not in the sweep."""
    size = np.abs(loop.value)
    above = np.flatnonzero(loop.credible & (size >= 1.0))
    return float(loop.frequency_hz[above[-1]]) if len(above) else None


def measured_margins(loop: Response) -> Margins:
    """Return the margins of the open loop where it was measured: infinite, or 180 degrees, if they lie beyond that."""
    return margins(loop.value[loop.credible])


def delay_s(measured: Response, model: Complex) -> Value:
    """Return by how much what was measured comes later than the model, from the phase between them."""
    usable = measured.credible
    omega = 2.0 * math.pi * measured.frequency_hz[usable]
    phase = np.unwrap(np.angle(measured.value[usable] / model[usable]))
    weight = 1.0 / np.maximum(measured.spread[usable], 1e-3) ** 2
    total = float(np.sum(weight * omega**2))
    return Value(-float(np.sum(weight * omega * phase)) / total, INTERVAL / math.sqrt(total))
