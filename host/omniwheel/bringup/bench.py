# SPDX-License-Identifier: MIT
"""What the checks share: the robot's layout, its samples, arming that always ends, lines of the robot file."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from omniwheel.bringup.other_stops import OtherStops
from omniwheel.bringup.result import Findings
from omniwheel.dialect import Message
from omniwheel.errors import OmniError
from omniwheel.robot import SETPOINT_PERIOD_S, Robot
from omniwheel.telemetry import Health, Sample, decode

SAMPLE_HZ = 50.0
SPIN_S = 1.0
_COUNTS_WRAP = 2**32
_VOLT_SECONDS_WRAP = 4294.967296


@dataclass(frozen=True)
class Layout:
    """What the robot believes about its wheels; tuples have one entry per wheel."""

    wheels: int
    counts_per_revolution: int
    encoder_direction: tuple[int, ...]
    motor_direction: tuple[int, ...]
    in1_channel: tuple[int, ...]
    in2_channel: tuple[int, ...]
    speed_V_s: float
    """Voltage per rad/s of a free wheel: K + R b / K."""
    supply_V: float

    @property
    def rad_per_count(self) -> float:
        """Angle of a count."""
        return math.tau / self.counts_per_revolution


def layout_of(robot: Robot) -> Layout:
    """Ask the robot for its layout."""
    values = robot.parameters
    wheels = int(values["WHEELS"])

    def per_wheel(suffix: str) -> tuple[int, ...]:
        return tuple(int(values[f"W{wheel}_{suffix}"]) for wheel in range(1, wheels + 1))

    constant = values["MOT_K"]
    return Layout(
        wheels=wheels,
        counts_per_revolution=int(values["ENC_CPR"]),
        encoder_direction=per_wheel("ENC_DIR"),
        motor_direction=per_wheel("MOT_DIR"),
        in1_channel=per_wheel("IN1_CH"),
        in2_channel=per_wheel("IN2_CH"),
        speed_V_s=constant + values["MOT_R"] * values["MOT_B"] / constant,
        supply_V=values["BAT_V_NOM"],
    )


def file_line(section: str, key: str, values: object) -> str:
    """Return the line of the robot file that should be there."""
    text = f"[{', '.join(str(value) for value in values)}]" if isinstance(values, Sequence) else str(values)
    return f"in the robot file, section [{section}]: {key} = {text}"


def flipped(directions: Sequence[int], wheel: int) -> list[int]:
    """Return the directions with one of them turned round."""
    return [-value if i == wheel else value for i, value in enumerate(directions)]


def swapped(values: Sequence[int], one: int, other: int) -> list[int]:
    """Return the values with two of them exchanged."""
    result = list(values)
    result[one], result[other] = values[other], values[one]
    return result


def wheel_names(wheels: Sequence[int]) -> str:
    """Return "wheel 1 and wheel 3" for [0, 2]."""
    return " and ".join(f"wheel {wheel + 1}" for wheel in wheels)


def health_of(robot: Robot) -> Health:
    """Ask for OMNI_HEALTH."""
    health = decode(Health, robot.commands.request_message(Health.message, robot.timeout_s))
    assert health is not None
    return health


def counted(before: Sample, after: Sample, wheels: int) -> tuple[int, ...]:
    """Return the counts of each wheel's encoder between two samples, in the encoder's own direction."""
    half = _COUNTS_WRAP // 2
    return tuple((after.counts[i] - before.counts[i] + half) % _COUNTS_WRAP - half for i in range(wheels))


def mean_voltage_V(before: Sample, after: Sample, wheel: int) -> float:
    """Return the mean voltage put on a motor between two samples, in the wheel's direction."""
    volt_seconds = math.remainder(after.volt_seconds[wheel] - before.volt_seconds[wheel], _VOLT_SECONDS_WRAP)
    return volt_seconds / (after.time_s - before.time_s)


class Samples:
    """OMNI_SAMPLE while the context lasts: ``all`` since :meth:`forget`, oldest first."""

    def __init__(self, robot: Robot, rate_hz: float = SAMPLE_HZ) -> None:
        self._robot = robot
        self._rate_hz = rate_hz
        self._remove: Callable[[], None] = lambda: None
        self.all: list[Sample] = []

    def __enter__(self) -> Samples:
        def take(message: Message) -> None:
            sample = decode(Sample, message)
            if sample is not None:
                self.all.append(sample)

        self._remove = self._robot.connection.add_listener(take)
        self._robot.set_message_interval(Sample.message, self._rate_hz)
        return self

    def __exit__(self, *_: object) -> None:
        self._remove()
        with suppress(OmniError):
            self._robot.set_message_interval(Sample.message, 0.0)

    def forget(self) -> None:
        """Drop what came so far."""
        self.all.clear()

    def fresh(self) -> Sample:
        """Wait for the next sample and return it."""
        return self._robot.wait_for(Sample)


@contextmanager
def armed(robot: Robot) -> Iterator[None]:
    """Arm, and disarm at the end, also on errors. Raises OtherStopError if another station stopped it meanwhile."""
    with OtherStops(robot) as others:
        try:
            robot.arm()
            yield
        finally:
            robot.disarm()
        others.require_no_estop()


@contextmanager
def left_disarmed(robot: Robot) -> Iterator[OtherStops]:
    """Disarm at the end, however it comes; what the robot refuses then is left.

    Raises OtherStopError if an emergency stop is on at the beginning.
    """
    with OtherStops(robot) as others:
        others.require_no_estop()
        try:
            yield others
        finally:
            with suppress(OmniError):
                robot.disarm()


def stream_duty(robot: Robot, duty: Sequence[float], duration_s: float) -> None:
    """Send duties for ``duration_s``, also to a robot that has stopped: what it does then is what is looked at."""
    end_s = robot.connection.clock() + duration_s
    while (left_s := end_s - robot.connection.clock()) > 0.0:
        robot.set_duty(duty)
        robot.pump(min(SETPOINT_PERIOD_S, left_s))


def spin(
    robot: Robot, others: OtherStops, findings: Findings, samples: Samples, layout: Layout, duty: float, name: str
) -> bool:
    """Arm and turn all wheels; record if they do not turn. Raises OtherStopError if another station stopped them."""
    robot.arm()
    stream_duty(robot, [duty] * layout.wheels, SPIN_S)
    others.require_no_estop()
    turning = any(counted(samples.all[-5], samples.all[-1], layout.wheels)) if len(samples.all) >= 5 else False
    if not turning:
        robot.disarm()
        findings.bad(name, "the wheels do not turn: a stop cannot be tested", "run `omni bringup motors` first")
    return turning


def rest_time_s(samples: Samples, layout: Layout, since_s: float) -> float | None:
    """Return how long after ``since_s`` (robot's clock) the last count came; None: still turning at the end."""
    last = since_s
    for before, after in zip(samples.all, samples.all[1:], strict=False):
        if after.time_s > since_s and any(counted(before, after, layout.wheels)):
            last = after.time_s
    return None if last >= samples.all[-1].time_s else last - since_s
