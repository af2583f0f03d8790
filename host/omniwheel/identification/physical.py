# SPDX-License-Identifier: MIT
"""From volts and seconds to kilograms and newtons, with a scale, an ohm-meter, and a stand or the motor's constant.

Voltage and speed alone never show K and R apart. R comes from an ohm-meter, L from the
data sheet and the mass m from a scale. Then the inertia that the floor adds to translation gives
g = K / R = 2 m r^2 / (n (a_xy - a_stand)). A known K gives g without
a stand. Then::

    K = g R    b = g (e - K)    T_c = g u_c    J = g (a_stand - L (e - K) / R)    I = g n l^2 / r^2 (a_theta - a_stand)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omniwheel.errors import IdentificationError
from omniwheel.identification.estimate import Estimate
from omniwheel.identification.model import Layout

Array = NDArray[np.float64]

NAMES = (
    "motor_constant_N_m_A",
    "motor_viscous_N_m_s",
    "motor_coulomb_N_m",
    "motor_inertia_kg_m2",
    "inertia_kg_m2",
)
STAND_PREFIX = "stand_"


@dataclass(frozen=True)
class Known:
    """What was measured otherwise and is taken as exact; ``motor_constant_N_m_A`` stands in for a run on a stand."""

    mass_kg: float
    resistance_ohm: float
    inductance_H: float
    motor_constant_N_m_A: float | None = None

    def __post_init__(self) -> None:
        """Refuse what is no positive number."""
        for name, value in vars(self).items():
            if value is not None and not 0.0 < value < np.inf:
                raise IdentificationError(f"{name} is {value}; must be a positive number")


def physical(floor: Estimate, layout: Layout, known: Known, stand: Estimate | None = None) -> Estimate:
    """Return motor and body in SI with their intervals. Raises IdentificationError if the numbers contradict."""
    if stand is None and known.motor_constant_N_m_A is None:
        raise IdentificationError(
            "the motor constant cannot be identified from voltage and speed alone",
            hint="record steps with the wheels off the floor (--stand), or give the data sheet's --motor-constant",
        )
    both = floor if stand is None else floor.joined(stand, STAND_PREFIX)
    result = both.transformed(NAMES, lambda values: _convert(dict(zip(both.names, values, strict=True)), layout, known))
    if result["motor_viscous_N_m_s"] <= 0.0 or result["motor_inertia_kg_m2"] <= 0.0 or result["inertia_kg_m2"] <= 0.0:
        raise IdentificationError(
            f"a motor constant of {result['motor_constant_N_m_A']:.3g} N.m/A implies negative friction or inertia",
            hint="check mass, resistance and motor constant, and that the wheels were lifted in the stand run",
        )
    return result


def _convert(v: dict[str, float], layout: Layout, known: Known) -> Array:
    n, r = len(layout.angle_rad), layout.radius_m
    body = 2.0 * known.mass_kg * r**2 / n
    e = v["speed_gain_V_s"]
    if known.motor_constant_N_m_A is None:
        free = v[STAND_PREFIX + "inertia_V_s2"]
        g = body / (v["inertia_xy_V_s2"] - free)
    else:
        g = known.motor_constant_N_m_A / known.resistance_ohm
        free = v.get(STAND_PREFIX + "inertia_V_s2", v["inertia_xy_V_s2"] - body / g)
    constant = g * known.resistance_ohm
    winding = known.inductance_H * (e - constant) / known.resistance_ohm
    turning = n * (layout.distance_m / r) ** 2 * (v["inertia_theta_V_s2"] - free)
    return np.array([constant, g * (e - constant), g * v["coulomb_V"], g * (free - winding), g * turning])
