# SPDX-License-Identifier: MIT
"""Parameters of the motor model from what a drive on the floor shows, which is volts per speed, acceleration, friction.

Voltages and speeds alone do not identify resistance, motor constant and mass separately. So the resistance and
the inductance stay the robot file's. So do two shares: how much of the volts per speed is back-EMF, and how much of
the inertia is the wheel's own. All that the robot computes from them is then as measured.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from omniwheel.errors import AutotuneError
from omniwheel.identification.estimate import Estimate

UNSURE = 0.3
"""An interval wider than this share of its value is no measurement."""
NEEDED = ("speed_gain_V_s", "inertia_xy_V_s2", "inertia_theta_V_s2")
PARAMETERS = ("MOT_J", "MOT_B", "MOT_K", "MOT_R", "MOT_L", "KF_J", "MASS", "WHEEL_RADIUS", "WHEELS")


@dataclass(frozen=True)
class Measured:
    """Parameters as measured, by name, and the inertia [kg m^2] that a wheel moves lifted, turning and translating."""

    values: dict[str, float]
    lifted: float
    turning: float
    translating: float


def motor_values(found: Estimate, present: Mapping[str, float]) -> Measured:
    """Return what follows from an estimate on the floor. Raises AutotuneError if the drive did not show enough."""
    for name in NEEDED:
        width = found.half_width(name)
        if not width <= UNSURE * found[name]:
            raise AutotuneError(
                f"the drive excites {name} too little: {found[name]:.3g} ± {width:.2g}",
                hint="increase --room or --legs",
            )
    constant, viscous, resistance = present["MOT_K"], present["MOT_B"], present["MOT_R"]
    emf = constant / (constant + resistance * viscous / constant)
    gain = found["speed_gain_V_s"]
    constant = emf * gain
    viscous = (gain - constant) * constant / resistance
    winding = present["MOT_L"] * viscous
    body = 2.0 * present["MASS"] * present["WHEEL_RADIUS"] ** 2 / present["WHEELS"]
    own = present["MOT_J"] / (present["KF_J"] or present["MOT_J"] + body)

    def inertia(name: str) -> float:
        return (found[name] * constant - winding) / resistance

    translating, turning = inertia("inertia_xy_V_s2"), inertia("inertia_theta_V_s2")
    lifted = own * translating
    if not lifted > 0.0 or not turning > 0.0:
        raise AutotuneError("the identified inertia is not positive", hint="check wheel directions: omni bringup")
    friction = max(found["coulomb_V"] - found.half_width("coulomb_V"), 0.0)
    values = {"MOT_K": constant, "MOT_B": viscous, "MOT_J": lifted, "KF_J": translating, "WS_FF_S": friction}
    return Measured(values, min(lifted, turning), turning, translating)
