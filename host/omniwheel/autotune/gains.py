# SPDX-License-Identifier: MIT
"""Gains from a measured robot: wheel loops as quick as margins and noise allow, and a position loop that fits them.

The margins are data (Requirements). A set of gains must keep them with every inertia that a wheel has on the floor,
turning on the spot and translating. A lifted wheel moves itself alone, and half of the margins must be left then.
Among those sets the one with the largest integral gain wins. After a step of the load the integral of the error is
1 / WS_I, so that one forgets disturbances soonest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from omniwheel.autotune.wheel_loop import Complex, Margins, WheelLoop, margins
from omniwheel.errors import AutotuneError

PROPORTIONAL = np.geomspace(0.002, 200.0, 45)
"""Candidates for WS_P, in units of the motor's volts per rad/s, so that they fit any motor."""
RESET_S = np.geomspace(0.005, 1.0, 16)
"""Candidates for WS_P / WS_I [s]."""
POSITION_1_S = np.geomspace(20.0, 0.2, 50)
"""Candidates for lambda [1/s], the quickest first; beyond that the noise of the pose moves the robot."""
STIFFNESS_SHARE = 0.25
"""k / phi is at most this share of lambda, as in the defaults: then its integral acts slower than lambda does."""


@dataclass(frozen=True)
class Requirements:
    """What gains must keep: margins as in Margins, and the ``noise`` of the voltage (share of the supply)."""

    gain: float = 3.0
    phase_rad: float = math.radians(60.0)
    distance: float = 0.6
    noise: float = 0.012

    def half(self) -> Requirements:
        """Return what must be left of a loop whose wheel is lifted."""
        return replace(self, gain=math.sqrt(self.gain), phase_rad=0.5 * self.phase_rad, distance=0.5 * self.distance)

    def kept_by(self, found: Margins) -> bool:
        """Whether a loop has these margins."""
        return found.gain >= self.gain and found.phase_rad >= self.phase_rad and found.distance >= self.distance


@dataclass(frozen=True)
class WheelGains:
    """WS_P [V s/rad], WS_I [V/rad], the smallest margins over all loads, the largest noise, the least crossover."""

    proportional: float
    integral: float
    margins: Margins
    noise_V: float
    crossover_hz: float


def worst(loops: Sequence[WheelLoop], proportional: float, integral: float) -> WheelGains:
    """Return gains with the worst that any of the loops makes of them."""
    every = [loop.margins(proportional, integral) for loop in loops]
    return WheelGains(
        proportional,
        integral,
        Margins(min(m.gain for m in every), min(m.phase_rad for m in every), min(m.distance for m in every)),
        max(loop.noise_V(proportional, integral) for loop in loops),
        min(loop.bandwidth_hz(proportional, integral) for loop in loops),
    )


def design_wheels(floor: Sequence[WheelLoop], lifted: WheelLoop, supply_V: float, required: Requirements) -> WheelGains:
    """Return the gains with the largest WS_I that keep what is required. Raises AutotuneError if none do."""
    unit = floor[0].motor.speed_gain
    best: WheelGains | None = None
    for proportional in PROPORTIONAL * unit:
        for reset in RESET_S:
            gains = float(proportional), float(proportional / reset)
            if best is not None and gains[1] <= best.integral:
                continue
            found = worst(floor, *gains)
            noisy = found.noise_V > required.noise * supply_V
            if not noisy and required.kept_by(found.margins) and required.half().kept_by(lifted.margins(*gains)):
                best = found
    if best is None:
        raise AutotuneError(
            "no gains of the wheel loops keep the margins without more noise than wanted",
            hint="more encoder counts, or check what was identified: omni identify",
        )
    return best


def design_position(
    floor: Sequence[WheelLoop], wheels: WheelGains, stiffness_1_s: float, required: Requirements
) -> tuple[float, float]:
    """Return the largest lambda [1/s] whose position loop keeps the margins, and k / phi [1/s] to go with it.

    The latter is the present ``stiffness_1_s``, or less where lambda is small. Raises AutotuneError if none does.
    """
    for lam in POSITION_1_S.tolist():
        stiffness = min(stiffness_1_s, STIFFNESS_SHARE * lam)
        found = [position_margins(loop, wheels, lam, stiffness) for loop in floor]
        if all(required.kept_by(entry) for entry in found):
            return float(lam), float(stiffness)
    raise AutotuneError(
        "no gain of the position loop keeps the margins", hint="are the wheels right? omni bringup, omni identify"
    )


def position_margins(loop: WheelLoop, wheels: WheelGains, lam: float, stiffness_1_s: float) -> Margins:
    """Return the margins of the position loop."""
    inner = loop.closed(wheels.proportional, wheels.integral, loop.filter.model.speed_gain)
    return margins(position_open(loop, inner, lam, stiffness_1_s))


def position_open(loop: WheelLoop, inner: Complex, lam: float, stiffness_1_s: float) -> Complex:
    """Return the open position loop: an integrator behind the wheel loop ``inner``, PI by lambda and k / phi."""
    s = loop.difference
    return np.asarray(inner * (lam + stiffness_1_s + lam * stiffness_1_s / s) / s, dtype=np.complex128)
