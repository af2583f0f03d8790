# SPDX-License-Identifier: MIT
"""What a robot makes of its gyro and its floor-motion sensor, in words, and what to do if something is wrong."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from omniwheel.telemetry import FlowState, GyroState, Telemetry

BIAS_LIMIT_RAD_S = 0.05
"""Six times the offset that the data sheet of a gyro calls usual, 0.5 degrees per second."""
DIRECTION_LIMIT_RAD = math.radians(5.0)
"""The robot itself refuses a sensor beyond 9 degrees; half of that already bends its path."""
MOST_REFUSED, MOST_LOST = 0.1, 0.1
"""Shares. A right sensor on a good floor is below 1 %, but wheels that spin make readings look wrong."""
WINDOW_S, STEP_S, LEAST_READINGS = 30.0, 1.0, 50
"""Readings so far back count; with fewer, nothing is said of their shares."""
SILENT_S = 10.0
"""What is so much older than the newest pose is not the present state. It is five messages on a radio."""
_BACK_S = 1.0


@dataclass(frozen=True)
class Sensor:
    """One that a robot may have: the message that tells of it, and the parameter that is 0 if there is none."""

    name: str
    kind: type[Telemetry]
    parameter: str


GYRO = Sensor("gyro", GyroState, "GYRO_AXIS")
FLOOR = Sensor("floor odometry", FlowState, "FLOW_MODE")
SENSORS = (GYRO, FLOOR)


@dataclass(frozen=True)
class SensorQuality:
    """What the robot makes of one sensor. ``good`` says that nothing has to be done; else ``advice`` says what."""

    name: str
    good: bool
    text: str
    advice: str = ""


def sensors_of(parameters: Mapping[str, float]) -> tuple[Sensor, ...]:
    """Return the sensors that a robot with these parameters has."""
    return tuple(sensor for sensor in SENSORS if parameters.get(sensor.parameter))


def shown(sensors: Iterable[Sensor], told: Iterable[SensorQuality]) -> list[SensorQuality]:
    """Return what to show of a robot's ``sensors``: what it has ``told``, or that it has told nothing."""
    by_name = {quality.name: quality for quality in told}
    nothing = "no report from the robot"
    return [by_name.get(sensor.name, SensorQuality(sensor.name, True, nothing)) for sensor in sensors]


def gyro_quality(state: GyroState) -> SensorQuality:
    """Return what the robot makes of its gyro."""
    if not state.used:
        advice = "the robot's messages give the reason; `omni bringup gyro` diagnoses it"
        return SensorQuality(GYRO.name, False, "not used: estimate from the wheels only", advice)
    text = f"used, bias {state.bias_rad_s:+.5f} rad/s, sd {state.bias_sd_rad_s:.5f}"
    if abs(state.bias_rad_s) > BIAS_LIMIT_RAD_S:
        advice = "such a bias is unusual: keep the robot at rest, then run `omni bringup gyro`"
        return SensorQuality(GYRO.name, False, text, advice)
    return SensorQuality(GYRO.name, True, text)


class FloorWatch:
    """Listens to what a robot tells of its floor-motion sensor, and says how good that sensor is."""

    def __init__(self) -> None:
        self._last: FlowState | None = None
        self._before: deque[FlowState] = deque()

    def take(self, state: FlowState) -> None:
        """Take a message. Another thread may ask for the quality meanwhile: what it needs is there all the time."""
        last = self._last
        if last is None or state.time_s < last.time_s or state.readings_came < last.readings_came:
            self._before = deque([state])  # the first message since the robot's start
        elif state.time_s - self._before[-1].time_s >= STEP_S:
            self._before.append(state)
        while len(self._before) > 1 and state.time_s - self._before[1].time_s >= WINDOW_S:
            self._before.popleft()
        self._last = state

    def quality(self) -> SensorQuality | None:
        """Return what the robot makes of the sensor, None before it has told of it."""
        state = self._last
        if state is None:
            return None
        if state.readings_came == 0:
            advice = "check its wires and the robot's messages; `omni bringup flow` diagnoses it"
            return SensorQuality(FLOOR.name, False, "no readings; not usable", advice)
        counts = f"used {state.readings_used}, rejected {state.readings_refused}, lost {state.readings_lost}"
        advice = self._advice(state)
        if not state.usable:
            text = f"{counts}; not usable: estimate from the wheels only"
        elif not state.readings_used and not advice:
            text = f"{counts}; not yet verified by a drive"
        elif state.leads:
            text = f"{counts}; it overrides the wheels, which spin or slide"
        else:
            text = counts
        return SensorQuality(FLOOR.name, state.usable and not advice, text, advice)

    def _advice(self, state: FlowState) -> str:
        """Return the most likely cause first: a sensor that points elsewhere is refused, too."""
        if abs(state.direction_off_rad) > DIRECTION_LIMIT_RAD:
            # Its readings seem turned the other way than the sensor itself is.
            degrees = -math.degrees(state.direction_off_rad)
            return (
                f"it is misaligned by {degrees:+.0f}°: add {degrees:.1f} to FLOW_ANGLE; with a Pinpoint check the "
                "cables"
            )
        refused, lost = self._shares(state)
        if lost > MOST_LOST:
            return f"{100 * lost:.0f} % of its readings were lost: check its window, its height and the floor"
        if not state.usable:
            return "the robot's messages give the reason; check its window, its height and the floor"
        if refused > MOST_REFUSED:
            return f"{100 * refused:.0f} % of its readings were rejected: check for spinning wheels, and FLOW_SCALE"
        return ""

    def _shares(self, state: FlowState) -> tuple[float, float]:
        """Return how much was refused and lost: of the window, or since the robot's start while that is shorter."""
        first = self._before[0]
        whole = state.time_s - first.time_s >= WINDOW_S
        pairs = zip(_counts(state), _counts(first), strict=True)
        used, refused, came, lost = (now - before if whole else now for now, before in pairs)
        judged = used + refused
        return (
            refused / judged if judged >= LEAST_READINGS else 0.0,
            lost / came if came >= LEAST_READINGS else 0.0,
        )


def is_present(state: GyroState | FlowState, now_s: float | None) -> bool:
    """Whether a message is of now: ``now_s`` is the time of the newest pose on the robot's clock [s], if one came."""
    return now_s is None or -_BACK_S <= now_s - state.time_s <= SILENT_S


def _counts(state: FlowState) -> tuple[int, int, int, int]:
    return state.readings_used, state.readings_refused, state.readings_came, state.readings_lost
