# SPDX-License-Identifier: MIT
"""Gains from a measured robot: wheel loops as quick as margins and noise allow, and a position loop that fits them.

The margins are data (Requirements). A set of gains must keep them with every inertia that a wheel has on the floor,
turning on the spot and translating. A lifted wheel moves itself alone. Half of the margins must be left then, or what
the old gains leave if that is less.
Among those sets the stiffest one wins: with it a disturbing voltage moves the wheel least. What counts are the
frequencies at which a robot tracks a path.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from omniwheel.errors import AutotuneError
from omniwheel.wheel_loop import Margins, WheelLoop, margins, position_open, turns_around

PROPORTIONAL = np.geomspace(0.02, 50.0, 28)
"""Candidates for WS_P, in units of the motor's volts per rad/s, so that they fit any motor."""
RESET_S = np.geomspace(0.01, 1.0, 12)
"""Candidates for WS_P / WS_I [s]."""
POSITION_1_S = np.geomspace(12.0, 0.2, 45)
"""Candidates for lambda [1/s], the quickest first; beyond that the noise of the pose moves the robot."""
TRACKED_HZ = (0.2, 4.0)
"""Frequencies at which a robot tracks a path and meets friction, slip and a sagging supply."""
PROPORTIONAL_MOST, INTEGRAL_MOST = 200.0, 5000.0
"""What WS_P and WS_I take."""
LAYER_MOST = {"XY": 1.0, "TH": 3.0}
"""What ISMC_PHI_XY [m] and ISMC_PHI_TH [rad] take."""
FILTER_NOISE_MOST = 1000.0
"""What KF_Q_W takes."""
STIFFNESS_SHARE = 0.25
"""k / phi is at most this share of lambda, as in the defaults: then its integral acts slower than lambda does.

Only a phi that the robot does not take makes it larger.
"""


@dataclass(frozen=True)
class Requirements:
    """What gains must keep: margins as in Margins, and the ``noise`` of the voltage (share of the supply).

    ``quickest_1_s`` is the largest lambda of the position loop.
    """

    gain: float = 2.0
    phase_rad: float = math.radians(45.0)
    distance: float = 0.5
    noise: float = 0.03
    quickest_1_s: float = 12.0

    def part(self, share: float) -> Requirements:
        """Return this share of the margins: of the gain margin in decibels."""
        return replace(self, gain=self.gain**share, phase_rad=share * self.phase_rad, distance=share * self.distance)

    def half(self) -> Requirements:
        """Return half of the margins."""
        return self.part(0.5)

    def at_most(self, found: Margins) -> Requirements:
        """Return the same, but nowhere more than a loop has already."""
        return replace(
            self,
            gain=min(self.gain, found.gain),
            phase_rad=min(self.phase_rad, found.phase_rad),
            distance=min(self.distance, found.distance),
        )

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


def least(every: Sequence[Margins]) -> Margins:
    """Return the least of each margin."""
    return Margins(min(m.gain for m in every), min(m.phase_rad for m in every), min(m.distance for m in every))


def worst(loops: Sequence[WheelLoop], proportional: float, integral: float) -> WheelGains:
    """Return gains with the worst that any of the loops makes of them."""
    return WheelGains(
        proportional,
        integral,
        least([loop.margins(proportional, integral) for loop in loops]),
        max(loop.noise_V(proportional, integral) for loop in loops),
        min(loop.bandwidth_hz(proportional, integral) for loop in loops),
    )


def compliance(loops: Sequence[WheelLoop], proportional: float, integral: float) -> float:
    """Return the wheel's speed per disturbing volt [rad/s/V], RMS over TRACKED_HZ, of the loop where it is largest."""
    return max(loop.compliance(proportional, integral, *TRACKED_HZ) for loop in loops)


def design_wheels(
    floor: Sequence[WheelLoop],
    lifted: WheelLoop,
    supply_V: float,
    required: Requirements,
    present: Sequence[tuple[float, float]] = (),
    lifted_least: Requirements | None = None,
) -> WheelGains:
    """Return the stiffest gains that keep what is required. Raises AutotuneError if none do.

    ``present``: further candidates, such as the gains that the robot has. ``lifted_least``: what a lifted wheel must
    keep, half of what is required by default.
    """
    in_the_air = lifted_least or required.half()
    unit = floor[0].motor.speed_gain
    grid = [(float(p), float(p / reset)) for p in PROPORTIONAL * unit for reset in RESET_S]
    possible = [entry for entry in (*present, *grid) if entry[0] <= PROPORTIONAL_MOST and entry[1] <= INTEGRAL_MOST]
    for gains in sorted(possible, key=lambda entry: compliance(floor, *entry)):
        if max(loop.noise_V(*gains) for loop in floor) > required.noise * supply_V:
            continue
        found = worst(floor, *gains)
        if required.kept_by(found.margins) and in_the_air.kept_by(lifted.margins(*gains)):
            return found
    raise AutotuneError(
        "no wheel-loop gains meet the required margins and the noise limit",
        hint="use an encoder with more counts, or check the identified parameters: omni identify",
    )


def design_position(
    floor: Sequence[WheelLoop],
    wheels: WheelGains,
    stiffness_1_s: float,
    required: Requirements,
    least_1_s: float = 0.0,
) -> tuple[float, float]:
    """Return the largest lambda [1/s] whose position loop keeps the margins, and k / phi [1/s] to go with it.

    The latter is the present ``stiffness_1_s``, or less where lambda is small, but never below ``least_1_s``: the
    robot takes no larger phi. Raises AutotuneError if no lambda keeps the margins.
    """
    for lam in POSITION_1_S[required.quickest_1_s * (1.0 + 1e-9) >= POSITION_1_S].tolist():
        stiffness = max(min(stiffness_1_s, STIFFNESS_SHARE * lam), least_1_s)
        found = [position_margins(loop, wheels, lam, stiffness) for loop in floor]
        if all(required.kept_by(entry) for entry in found):
            return float(lam), float(stiffness)
    raise AutotuneError(
        "no position-loop gain meets the required margins", hint="check the wheels: omni bringup, omni identify"
    )


def position_margins(loop: WheelLoop, wheels: WheelGains, lam: float, stiffness_1_s: float) -> Margins:
    """Return the margins of the position loop around a stable wheel loop; all 0 if it is unstable."""
    inner = loop.closed(wheels.proportional, wheels.integral, loop.filter.model.speed_gain)
    found = position_open(loop, inner, lam, stiffness_1_s)
    return Margins(0.0, 0.0, 0.0) if turns_around(found) else margins(found)
