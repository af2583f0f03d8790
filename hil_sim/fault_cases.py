# SPDX-License-Identifier: MIT
"""What can go wrong, one case per line: the fault, what the robot must do about it and how soon, what it must say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

FAULT_S = 0.7
"""When the fault comes [s]: the robot drives steadily by then."""

EMERGENCY_STOP = "emergency stop"
"""What stops the robot is no fault but an emergency stop: it needs a release."""

TURN = "turn"
CIRCLE = "circle"

_POSE = {"fix_rate_Hz": 50.0, "fix_sd_xy_m": 0.002, "fix_sd_theta_rad": 0.002, "fix_delay_s": 0.02}
_GYRO = {**_POSE, "gyro_rate_Hz": 1000.0}
_USED = {"GYRO_AXIS": 3.0}
_FLOW = {**_POSE, "flow_rate_Hz": 50.0}
_FLOW_USED = {"FLOW_MODE": 2.0}
_WITHOUT_PIN = {"output_enable_wired": 0.0}


@dataclass(frozen=True)
class Kind:
    """A fault of the world by name, with its wheel (from 1) or value; it lasts ``for_s`` (None: the case)."""

    name: str
    wheel: int | None = None
    value: float | None = None
    for_s: float | None = None


@dataclass(frozen=True)
class FaultCase:
    """One fault and what is expected.

    ``stops`` is the name of the stop fault, or EMERGENCY_STOP (None: the robot drives on). ``warns`` is a warning
    that must show, ``says`` a part of a status text. ``bound`` is the longest time to zero volts: a number of seconds,
    or names of parameters in seconds joined by " + ". ``coasts`` False: the motors keep their last voltage until the
    fault has gone. ``error_m`` is how far from its path the robot may get on a circle.
    """

    name: str
    what: str
    faults: tuple[Kind, ...]
    stops: str | None = None
    bound: str = ""
    warns: str | None = None
    says: str | None = None
    drive: str = TURN
    lasts_s: float = 0.3
    coasts: bool = True
    error_m: float = 0.05
    parameters: Mapping[str, float] = field(default_factory=dict)
    world: Mapping[str, float] = field(default_factory=dict)

    @property
    def failsafe(self) -> str | None:
        """The stop fault that the robot names, if one stops it."""
        return None if self.stops == EMERGENCY_STOP else self.stops

    def bound_s(self, values: Mapping[str, float]) -> float:
        """Return the bound [s] with a robot's parameters."""
        return sum(values[word] if word.isidentifier() else float(word) for word in self.bound.split(" + "))


CASES: tuple[FaultCase, ...] = (
    FaultCase(
        "setpoints_stop",
        "setpoints stop coming",
        (Kind("link_silence"),),
        "command loss",
        "SAFE_CMD_TO",
        lasts_s=0.55,
    ),
    FaultCase(
        "ground_station_lost",
        "no heartbeat of the ground station",
        (Kind("link_silence"),),
        "link loss",
        "SAFE_LINK_TO",
        drive=CIRCLE,
        lasts_s=0.8,
        parameters={"SAFE_LINK_TO": 1.1},
        says="link 1 lost: it had the command",
    ),
    FaultCase(
        "stop_button",
        "stop button pressed, or its wire cut",
        (Kind("stop_button"),),
        EMERGENCY_STOP,
        "0.001",
        says="stop button open: pressed, or its wire is cut",
    ),
    FaultCase("encoder_dead", "encoder dead (reported)", (Kind("encoder_invalid", wheel=1),), "encoder", "0.003"),
    FaultCase(
        "encoder_stuck", "encoder stands still", (Kind("encoder_stuck", wheel=1),), "stall", "SAFE_STALL_T + 0.05"
    ),
    FaultCase(
        "encoder_reversed", "encoder counts backwards", (Kind("encoder_reversed", wheel=2),), "stall", "SAFE_STALL_T"
    ),
    FaultCase(
        "encoder_wild",
        "encoder off by up to 300 counts at random",
        (Kind("encoder_noisy", 3, 300.0),),
        "encoder",
        "0.02",
    ),
    FaultCase("encoder_noise", "encoder off by up to 3 counts at random", (Kind("encoder_noisy", 3, 3.0),)),
    FaultCase("encoder_bit", "bit 6 of a counter stuck", (Kind("encoder_bit", 1, 6),), warns="encoder glitch"),
    FaultCase("motor_dead", "one motor disconnected", (Kind("motor_dead", wheel=1),), "stall", "SAFE_STALL_T + 0.05"),
    FaultCase("motor_stalled", "one wheel blocked", (Kind("motor_stalled", wheel=3),), "stall", "SAFE_STALL_T + 0.05"),
    FaultCase("i2c_nack", "PWM chip does not acknowledge", (Kind("i2c_nack"),), "driver", "0.012"),
    FaultCase("i2c_stuck", "bus stuck low", (Kind("i2c_stuck"),), "driver", "0.012"),
    FaultCase(
        "i2c_stuck_no_pin",
        "bus stuck low, no output-enable pin",
        (Kind("i2c_stuck"),),
        "driver",
        "0.012",
        coasts=False,
        world=_WITHOUT_PIN,
    ),
    FaultCase("i2c_glitch", "PWM chip misses 5 updates", (Kind("i2c_nack", for_s=0.005),)),
    FaultCase("chip_dip", "PWM chip loses its power for 3 ms", (Kind("chip_power", for_s=0.003),)),
    FaultCase(
        "brown_out",
        "brown-out: 5 V, PWM chip without power",
        (Kind("battery_sag", value=5.0), Kind("chip_power")),
        "driver",
        "0.012",
    ),
    FaultCase("battery_low", "supply at 8 V", (Kind("battery_sag", value=8.0),), "battery", "0.05"),
    FaultCase("battery_dip", "supply at 8 V for 30 ms", (Kind("battery_sag", value=8.0, for_s=0.03),)),
    FaultCase(
        "pose_jump",
        "pose fixes off by 0.5 m for 0.3 s",
        (Kind("pose_jump", value=0.5, for_s=0.3),),
        drive=CIRCLE,
        warns="fix refused",
        world=_POSE,
    ),
    FaultCase(
        "pose_lost", "no pose fixes", (Kind("pose_loss"),), drive=CIRCLE, lasts_s=0.8, warns="pose stale", world=_POSE
    ),
    FaultCase(
        "pose_frozen",
        "pose fixes repeat themselves",
        (Kind("pose_freeze"),),
        drive=CIRCLE,
        lasts_s=1.0,
        warns="pose stale",
        says="pose fix refused: it repeats itself",
        world=_POSE,
    ),
    FaultCase(
        "pose_late",
        "pose fixes 0.1 s late, stamped as fresh",
        (Kind("pose_delay", value=0.1),),
        drive=CIRCLE,
        world=_POSE,
    ),
    FaultCase(
        "gyro_silent",
        "gyro sends nothing",
        (Kind("gyro_silent"),),
        drive=CIRCLE,
        warns="gyro",
        world=_GYRO,
        parameters=_USED,
    ),
    FaultCase(
        "gyro_stuck",
        "gyro repeats its last reading",
        (Kind("gyro_stuck"),),
        drive=CIRCLE,
        warns="gyro",
        world=_GYRO,
        parameters=_USED,
    ),
    FaultCase(
        "gyro_saturated",
        "gyro at the end of its range",
        (Kind("gyro_offset", value=90.0),),
        drive=CIRCLE,
        warns="gyro",
        world=_GYRO,
        parameters=_USED,
    ),
    FaultCase(
        "flow_silent",
        "floor-motion sensor sends nothing",
        (Kind("flow_silent"),),
        drive=CIRCLE,
        lasts_s=1.0,
        warns="floor motion",
        world=_FLOW,
        parameters=_FLOW_USED,
    ),
    FaultCase(
        "flow_stuck",
        "floor-motion sensor says that nothing moves",
        (Kind("flow_stuck"),),
        drive=CIRCLE,
        lasts_s=1.0,
        warns="floor motion",
        world=_FLOW,
        parameters=_FLOW_USED,
    ),
    FaultCase(
        "flow_jump",
        "floor-motion sensor off by 20 mm in each reading",
        (Kind("flow_jump", value=0.02),),
        drive=CIRCLE,
        lasts_s=1.0,
        warns="floor motion",
        world=_FLOW,
        parameters=_FLOW_USED,
    ),
    FaultCase("clock_forward", "clock jumps ahead by 0.1 s", (Kind("clock_jump", value=0.1),), "time", "0"),
    FaultCase("clock_back", "clock jumps back by 0.1 s", (Kind("clock_jump", value=-0.1),), "time", "0"),
    FaultCase("clock_stuck", "clock stands still", (Kind("clock_stuck"),), "time", "0.001"),
    FaultCase("ticks_late", "ticks 2 ms apart", (Kind("tick_late", value=0.002),), "overrun", "0.022"),
)
"""Every case, in the order of the table in docs/reference/safety.md."""
