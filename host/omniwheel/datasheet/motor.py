# SPDX-License-Identifier: MIT
"""A gear motor's data sheet turned into the motor model of a robot file.

A data sheet gives points of two lines: speed and current without load, torque and current at stall. The model is

    K (V - K w) / R = T + b w + T_c,        K: motor constant, R: resistance, b and T_c: viscous and dry friction

with everything seen at the output shaft. Three facts fix K, R and the friction:

- back EMF:      K = (U - R_w I_0) / w_0, with the winding's resistance R_w = U / I_stall;
- without load:  K (U - K w_0) / R = b w_0 + T_c, which is the friction; half of it is taken as dry;
- at stall:      K U / R - T_c = T_stall.

R then is larger than R_w by what the gear loses. The model has one constant for torque and for back EMF. And torque and
speed matter to the control, so they are what it reproduces. The current at stall stays the data sheet's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from omniwheel.errors import DataSheetError

NO_LOAD_SHARE = 0.04
"""No-load current by stall current where the sheet does not give it: 0.03 to 0.06 for common 12 V gear motors."""
_UNUSUAL_LINES = (24.0, 100.0)
"""Magnetic encoders on motor shafts have fewer, optical ones more."""
DRY_SHARE = 0.5
"""Of the friction at no-load speed; the sheet does not tell dry from viscous."""
MECHANICAL_S = 0.03
"""Assumed time constant of rotor and gear alone, where no inertia is given."""
ELECTRICAL_S = 5e-4
"""Assumed L / R where no inductance is given."""


@dataclass(frozen=True)
class GearMotor:
    """What a data sheet says, at the output shaft. Torque in N m, speed in rad/s, current in A; None: not given."""

    voltage_V: float
    no_load_rad_s: float
    stall_torque_N_m: float
    stall_current_A: float | None = None
    no_load_current_A: float | None = None
    gear: float = 1.0
    encoder_lines: float | None = None
    name: str = ""
    source: str = ""

    @property
    def counts_per_revolution(self) -> int | None:
        """Counts per revolution of the output shaft, four per line of an encoder on the motor's shaft."""
        return None if self.encoder_lines is None else round(4.0 * self.encoder_lines * self.gear)


def encoder_doubt(motor: GearMotor) -> str:
    """Return why an encoder's resolution is unlikely, and what it may be instead; "" if it is usual."""
    lines, low, high = motor.encoder_lines, *_UNUSUAL_LINES
    if lines is None or motor.gear <= 1.0 or not low < lines < high:
        return ""
    return (
        f"{lines:g} encoder lines (PPR), which are {4.0 * lines:g} CPR, are unusual for a gear motor: most have 7 to "
        f"16 lines, 28 to 64 CPR. If the data sheet says {lines:g} CPR: --encoder {lines:g}CPR"
    )


@dataclass(frozen=True)
class MotorModel:
    """The constants of the motor model, seen at the output shaft; ``idle_assumed``: by NO_LOAD_SHARE."""

    constant_N_m_A: float
    resistance_ohm: float
    viscous_N_m_s: float
    coulomb_N_m: float
    inertia_kg_m2: float
    inductance_H: float
    idle_assumed: bool


def motor_model(motor: GearMotor) -> MotorModel:
    """Return the model of a data sheet's motor. Raises DataSheetError if its numbers are missing or contradict."""
    _check(motor)
    share = NO_LOAD_SHARE
    if motor.stall_current_A is not None and motor.no_load_current_A is not None:
        share = motor.no_load_current_A / motor.stall_current_A
    loss_V = motor.voltage_V * share
    constant = (motor.voltage_V - loss_V) / motor.no_load_rad_s
    resistance = constant * (motor.voltage_V - DRY_SHARE * loss_V) / motor.stall_torque_N_m
    friction = constant * loss_V / resistance
    _check_torque(motor, constant)
    return MotorModel(
        constant_N_m_A=constant,
        resistance_ohm=resistance,
        viscous_N_m_s=(1.0 - DRY_SHARE) * friction / motor.no_load_rad_s,
        coulomb_N_m=DRY_SHARE * friction,
        inertia_kg_m2=MECHANICAL_S * constant**2 / resistance,
        inductance_H=ELECTRICAL_S * resistance,
        idle_assumed=motor.stall_current_A is None or motor.no_load_current_A is None,
    )


def _check(motor: GearMotor) -> None:
    for label, value in (
        ("the voltage", motor.voltage_V),
        ("the no-load speed", motor.no_load_rad_s),
        ("the stall torque", motor.stall_torque_N_m),
        ("the gear ratio", motor.gear),
        ("the stall current", motor.stall_current_A),
        ("the encoder's lines", motor.encoder_lines),
    ):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise DataSheetError(f"{label} is {value:g}; must be a number above 0")
    idle, stall = motor.no_load_current_A, motor.stall_current_A
    if idle is not None and not (math.isfinite(idle) and idle >= 0.0):
        raise DataSheetError(f"the no-load current is {idle:g} A; must be 0 or more")
    if idle is not None and stall is not None and idle > 0.5 * stall:
        raise DataSheetError(
            f"the no-load current is {idle:g} A, the stall current {stall:g} A: must be below half of it",
            hint="both are needed in ampere, at the same voltage",
        )


def _check_torque(motor: GearMotor, constant: float) -> None:
    """Raise if the motor would give more torque than its current can make: a wrong unit, or a wrong line."""
    if motor.stall_current_A is None:
        return
    most = constant * motor.stall_current_A
    if motor.stall_torque_N_m > 1.05 * most:
        raise DataSheetError(
            f"{motor.stall_torque_N_m:.3g} N m at stall is impossible: {motor.stall_current_A:g} A at "
            f"{constant:.3g} V s/rad make {most:.3g} N m at most",
            hint="check the torque's unit (1 kg.cm is 0.0981 N.m); all numbers must be of one voltage and one shaft",
        )
