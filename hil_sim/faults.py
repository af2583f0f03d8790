# SPDX-License-Identifier: MIT
"""Faults of the simulated world by name, as scenario files give them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from omniwheel._core import lib

KINDS: dict[str, int] = {
    "encoder_stuck": lib.HIL_FAULT_ENCODER_STUCK,
    "encoder_reversed": lib.HIL_FAULT_ENCODER_REVERSED,
    "encoder_invalid": lib.HIL_FAULT_ENCODER_INVALID,
    "i2c_nack": lib.HIL_FAULT_I2C_NACK,
    "i2c_stuck": lib.HIL_FAULT_I2C_STUCK,
    "link_silence": lib.HIL_FAULT_LINK_SILENCE,
    "pose_loss": lib.HIL_FAULT_POSE_LOSS,
    "pose_jump": lib.HIL_FAULT_POSE_JUMP,
    "battery_sag": lib.HIL_FAULT_BATTERY_SAG,
    "motor_dead": lib.HIL_FAULT_MOTOR_DEAD,
    "motor_stalled": lib.HIL_FAULT_MOTOR_STALLED,
    "encoder_noisy": lib.HIL_FAULT_ENCODER_NOISY,
    "encoder_bit": lib.HIL_FAULT_ENCODER_BIT,
    "chip_power": lib.HIL_FAULT_CHIP_POWER,
    "pose_freeze": lib.HIL_FAULT_POSE_FREEZE,
    "pose_delay": lib.HIL_FAULT_POSE_DELAY,
    "clock_jump": lib.HIL_FAULT_CLOCK_JUMP,
    "clock_stuck": lib.HIL_FAULT_CLOCK_STUCK,
    "tick_late": lib.HIL_FAULT_TICK_LATE,
    "wheel_turned": lib.HIL_FAULT_WHEEL_TURNED,
    "stop_button": lib.HIL_FAULT_STOP_BUTTON,
}
"""Name of a fault to its number in ``hil_fault_kind_t``."""

NAMES: dict[int, str] = {kind: name for name, kind in KINDS.items()}

MAX_FAULTS: int = lib.HIL_MAX_FAULTS


@dataclass(frozen=True)
class Fault:
    """One fault from ``start_s`` up to, not including, ``stop_s`` [s, simulated time].

    ``wheel`` counts from 0 and matters for encoder and motor faults. ``value`` is the offset in x [m] of a pose jump,
    the open-circuit voltage [V] of a battery sag, the largest error [counts] of a noisy encoder, the number of a
    counter's bit that always reads 1, the delay [s] of pose fixes, the jump [s] of the clock, the time [s] between late
    ticks or the speed [rad/s] of a wheel that a hand turns; ``hil_fault_kind_t`` in world.h says what each fault does.
    """

    name: str
    start_s: float
    stop_s: float = math.inf
    wheel: int = 0
    value: float = 0.0

    def __post_init__(self) -> None:
        if self.name not in KINDS:
            raise ValueError(f"fault {self.name!r} is unknown; allowed are {', '.join(KINDS)}")

    @property
    def kind(self) -> int:
        """Number of the fault in ``hil_fault_kind_t``."""
        return KINDS[self.name]
