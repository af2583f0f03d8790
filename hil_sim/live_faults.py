# SPDX-License-Identifier: MIT
"""Faults of a world that runs in real time, with texts for users who are new to the robot.

What the robot does about it is derived from :mod:`hil_sim.fault_cases`, which tests hold to the real firmware.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from hil_sim.fault_cases import CASES, EMERGENCY_STOP, FaultCase

ICE = "ice"
"""No fault of ``world.toml``: the floor's friction coefficient becomes the value."""
ICE_FRICTION = 0.004
"""So little that a slow robot slides, too."""
_CASES = {case.name: case for case in CASES}


@dataclass(frozen=True)
class LiveFault:
    """Something to break. ``name`` is a fault of ``world.toml`` or :data:`ICE`.

    ``words`` say what is broken, ``group`` where. ``reaction`` says what the robot does about it. ``value`` is the
    fault's number in its unit of ``world.toml``; None: it has none. ``needs_fixes``: it shows only with a pose sensor,
    ``needs_gyro``: only with a gyro, ``needs_flow``: only with a sensor of motion over the floor.
    """

    name: str
    group: str
    words: str
    reaction: str
    value: float | None = None
    needs_fixes: bool = False
    needs_gyro: bool = False
    needs_flow: bool = False


def reaction_words(case: FaultCase) -> str:
    """Return what a robot that drives does in this case."""
    if case.stops == EMERGENCY_STOP:
        return f"The robot stops until it is released: {case.says}."
    if case.stops is not None:
        return f"A robot that drives stops: failsafe: {case.stops}."
    return "The robot drives on." if case.warns is None else f"The robot drives on and warns: {case.warns}."


def _of_case(group: str, words: str, case_name: str, kind: str | None = None, later: str = "") -> LiveFault:
    """Return a case's fault, of several the one called ``kind``, with its value and the robot's reaction.

    ``later`` says what the robot does if the fault lasts longer than the case.
    """
    case = _CASES[case_name]
    found = next(fault for fault in case.faults if kind in (None, fault.name))
    gyro = case.world.get("gyro_rate_Hz", 0.0) > 0.0
    flow = case.world.get("flow_rate_Hz", 0.0) > 0.0
    fixes = case.world.get("fix_rate_Hz", 0.0) > 0.0 and not gyro and not flow
    reaction = f"{reaction_words(case)} {later}".strip()
    return LiveFault(found.name, group, words, reaction, found.value, fixes, gyro, flow)


_ENCODERS, _MOTORS, _POWER = "Encoders", "Motors and wheels", "Supply and motor driver"
_POSES, _GYRO, _FLOW, _OTHERS = "Pose fixes", "Gyro", "Floor odometry sensor", "Floor, button, clock"

LIVE_FAULTS: tuple[LiveFault, ...] = (
    _of_case(_ENCODERS, "Encoder unplugged: it stops counting", "encoder_stuck"),
    _of_case(_ENCODERS, "Encoder reversed: it counts backwards", "encoder_reversed"),
    _of_case(_ENCODERS, "Encoder error: it reports its failure", "encoder_dead"),
    _of_case(_ENCODERS, "Noise on the encoder's wires: random counts", "encoder_wild"),
    _of_case(_ENCODERS, "One bit of the encoder's counter is stuck", "encoder_bit"),
    _of_case(_MOTORS, "Motor disconnected", "motor_dead"),
    _of_case(_MOTORS, "Blocked wheel", "motor_stalled"),
    LiveFault(
        "wheel_turned",
        _MOTORS,
        "Wheel turned from outside, 0.5 turns per second",
        "The encoder counts. A robot that drives may stop.",
        math.pi,
    ),
    _of_case(_POWER, "Empty battery: the supply voltage drops", "battery_low"),
    _of_case(_POWER, "I2C bus stuck: the motor driver is unreachable", "i2c_stuck"),
    _of_case(_POWER, "The motor driver's chip does not acknowledge", "i2c_nack"),
    _of_case(_POWER, "The motor driver's chip has no power", "brown_out", "chip_power"),
    _of_case(_POSES, "Pose fixes stop: the camera is covered", "pose_lost"),
    _of_case(
        _POSES,
        "Pose fixes jump by 0.5 m",
        "pose_jump",
        later="If the offset lasts, the estimator accepts them and the robot stops: failsafe: tracking.",
    ),
    _of_case(_POSES, "Pose fixes freeze: the last one is repeated", "pose_frozen"),
    _of_case(_POSES, "Pose fixes come 0.1 s late", "pose_late"),
    _of_case(_GYRO, "The gyro stops sending", "gyro_silent"),
    _of_case(_GYRO, "The gyro repeats its last reading", "gyro_stuck"),
    _of_case(_GYRO, "The gyro's readings are off by 90 rad/s, beyond its range", "gyro_saturated"),
    _of_case(_FLOW, "The floor odometry sensor stops sending", "flow_silent"),
    _of_case(_FLOW, "The floor odometry sensor reports no motion", "flow_stuck"),
    _of_case(_FLOW, "The floor odometry sensor's readings are off by 20 mm", "flow_jump"),
    LiveFault(
        ICE,
        _OTHERS,
        "Ice: the wheels slip",
        "The wheels spin, and the robot slides off its path. If the error grows, it stops: failsafe: tracking.",
        ICE_FRICTION,
    ),
    _of_case(_OTHERS, "Stop button pressed, or its wire cut", "stop_button"),
    _of_case(_OTHERS, "The clock jumps ahead by 0.1 s", "clock_forward"),
    _of_case(_OTHERS, "The control ticks come late", "ticks_late"),
)
"""In the order of a page. Not here: ``link_silence``, since other programs' links do not pass through the world, and
``clock_stuck``, with which the robot falls silent, too."""
