# SPDX-License-Identifier: MIT
"""The capability card: what a robot can do, what limits it there, and what in its file cannot be right."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from omni_schema import Robot
from omniwheel.capability.drive_model import DriveModel
from omniwheel.capability.observability import FIXES, FLOW, FLOW_TURN, GYRO, slip_words
from omniwheel.capability.speeds import (
    TURNING,
    Bound,
    acceleration_bounds,
    direction,
    directions,
    limit_speed,
    motor_speed,
    top_speed,
    top_turn_rate,
)

DIRECTIONS = 72
"""Directions of the speed polygon, 5 degrees apart."""
WORST_CONDITION = 50.0
"""Beyond this a small error of one wheel's speed is a large one of the body's: the file is refused."""
UNWISE_CONDITION = 5.0
SLOWEST_M_S = 0.02
FASTEST_M_S = 20.0
"""No-load rim speeds between which a robot with omni wheels is believable."""
MOST_CURRENT_A = 200.0
SLOW_TO_NOTICE = 2.0
"""A blocked wheel that is noticed later than so many times SAFE_STALL_T is worth a warning."""
HELD_BACK = 0.6
"""A limit below this share of what the motors could is worth a warning."""


@dataclass(frozen=True)
class Row:
    """One line of the card; ``limited_by`` is empty where nothing limits."""

    key: str
    label: str
    value: float
    unit: str
    limited_by: str = ""


@dataclass(frozen=True)
class Card:
    """The lines, and the top speed [m/s] in DIRECTIONS directions, counter-clockwise from forward."""

    rows: tuple[Row, ...]
    speeds: tuple[Bound, ...]
    sensors: tuple[str, ...]

    def value(self, key: str) -> float:
        """Return a line's value by its key."""
        return next(row.value for row in self.rows if row.key == key)


def card(model: DriveModel) -> Card:
    """Return the card of a robot."""
    speeds = tuple(top_speed(model, 2.0 * math.pi * k / DIRECTIONS) for k in range(DIRECTIONS))
    return Card(
        rows=(*_speed_rows(model, speeds), *_force_rows(model), *_motor_rows(model)),
        speeds=speeds,
        sensors=_sensors(model),
    )


def _speed_rows(model: DriveModel, speeds: tuple[Bound, ...]) -> list[Row]:
    forward, sideways = top_speed(model, 0.0), top_speed(model, math.pi / 2.0)
    slowest = min(speeds, key=lambda bound: bound.value)
    turn = top_turn_rate(model)
    could = min(motor_speed(model, along) for along in directions(DIRECTIONS))
    return [
        Row("speed_forward", "top speed forward", forward.value, "m/s", forward.cause),
        Row("speed_sideways", "top speed sideways", sideways.value, "m/s", sideways.cause),
        Row("speed_any", "top speed in every direction", slowest.value, "m/s", slowest.cause),
        Row("speed_motors", "the motors alone, in every direction", could, "m/s"),
        Row("turn_rate", "turn rate on the spot", turn.value, "rad/s", turn.cause),
    ]


def _force_rows(model: DriveModel) -> list[Row]:
    rows = []
    for key, label, along, unit in (
        ("acceleration", "acceleration forward from rest", direction(0.0), "m/s^2"),
        ("turn_acceleration", "turning from rest", TURNING, "rad/s^2"),
    ):
        for bound in acceleration_bounds(model, along):
            rows.append(Row(f"{key}_{bound.cause}", f"{label}, by {bound.cause}", bound.value, unit))
    return rows


def _motor_rows(model: DriveModel) -> list[Row]:
    per_mm = model.counts_per_revolution / (2.0 * math.pi * float(np.mean(model.radius_m)) * 1e3)
    return [
        Row(
            "rim_speed",
            "a lifted wheel's rim at full duty",
            model.no_load_rad_s * float(np.mean(model.radius_m)),
            "m/s",
        ),
        Row("stall_torque", "torque of a wheel, at standstill", model.stall_torque_N_m, "N m"),
        Row("stall_current", "current of a motor, at standstill (model)", model.stall_current_A, "A"),
        Row("supply_current", "current of all, at standstill (model)", model.wheels * model.stall_current_A, "A"),
        *_current_rows(model),
        Row("counts_per_mm", "encoder counts per millimetre", per_mm, "1/mm"),
        Row("blocked", f"detection of a blocked wheel, at {model.stall_V:g} V, after", model.blocked_s, "s"),
        Row("condition", "condition of the kinematics", model.condition, ""),
    ]


def _current_rows(model: DriveModel) -> list[Row]:
    """Return what LIM_I and SAFE_I leave; nothing where they are off."""
    rows = []
    if model.current_limit_A > 0.0:
        rows += [
            Row("current_limit", "maximum current of a driving motor", model.current_limit_A, "A", "LIM_I"),
            Row("limited_torque", "torque of a wheel at that current, at standstill", model.limited_torque_N_m, "N m"),
        ]
    if model.continuous_A > 0.0:
        rows.append(Row("hot", "a blocked motor is too hot, by SAFE_I, after", model.hot_s, "s"))
    return rows


def _sensors(model: DriveModel) -> tuple[str, ...]:
    lines = [f"encoders: motion since the start, and {slip_words(model, ())}; the pose drifts without fixes"]
    flow = () if not model.flow_axes else (FLOW_TURN,) if model.flow_axes > 2 else (FLOW,)
    if model.gyro:
        lines.append(
            f"gyro: the heading without fixes; with encoders, {slip_words(model, (GYRO,))} at a time. Slip that "
            "carries the robot sideways or along does not show"
        )
    if flow:
        turn = " and the turn" if model.flow_axes > 2 else ""
        lines.append(
            f"floor odometry: the distance{turn} since the start, with any wheel slip; with encoders, "
            f"{slip_words(model, flow)} at a time"
        )
    if flow and model.gyro:
        lines.append(f"gyro and floor odometry: with encoders, {slip_words(model, (GYRO, *flow))} at a time")
    lines.append(
        "pose fixes (Vicon, or any program that sends them): the pose; with encoders, "
        f"{slip_words(model, (FIXES,))} over time"
    )
    return tuple(lines)


def sensor_warnings(robot: Robot) -> list[str]:
    """Return what the robot file says of its sensors and probably does not mean, each with its remedy."""
    flow, values = robot.board.flow, robot.parameter_values()
    if flow is None or not flow.chip.wheels:
        return []
    found = []
    name = flow.chip.name
    if values["FLOW_X"] or values["FLOW_Y"]:
        found.append(f"A {name} measures the motion of the robot's centre: leave FLOW_X and FLOW_Y at 0.")
    if values["FLOW_ANGLE"]:
        found.append(f"The directions of a {name} are corrected by its cables and `reversed`: leave FLOW_ANGLE at 0.")
    places = {"x_wheel_mm": flow.x_wheel_mm, "y_wheel_mm": flow.y_wheel_mm}
    for key, value in places.items():
        if value == 0.0:
            found.append(
                f"flow.{key} is 0: this means that the wheel is in line with the robot's centre. If not, set its "
                "distance."
            )
        elif abs(value) < 1.0:
            found.append(f"flow.{key} = {value:g} is in millimetres: less than 1 mm is implausible.")
    return found


def problems(model: DriveModel) -> list[str]:
    """Return what makes this file unusable, each with what to correct; empty if nothing does."""
    found = []
    if not model.condition < WORST_CONDITION:
        found.append(
            f"geometry.wheel_angle_deg: these wheels cannot produce every motion (condition {model.condition:.3g}, "
            f"{WORST_CONDITION:g} at most); spread their bearings around the robot"
        )
    rim = model.no_load_rad_s * float(np.mean(model.radius_m))
    if not SLOWEST_M_S <= rim <= FASTEST_M_S:
        rpm, constant = model.no_load_rad_s * 30.0 / math.pi, model.constant_N_m_A
        found.append(
            f"motor: a lifted wheel would turn at {rpm:.3g} rpm, its rim at {rim:.3g} m/s; plausible is "
            f"{SLOWEST_M_S:g} to {FASTEST_M_S:g} m/s. Check constant_N_m_A ({constant:g}, seen at the wheel: "
            "about supply_V divided by the no-load speed in rad/s), viscous_friction_N_m_s and supply_V"
        )
    if model.stall_current_A > MOST_CURRENT_A:
        found.append(
            f"motor.resistance_ohm: {model.resistance_ohm:g} ohm would let {model.stall_current_A:.0f} A flow in a "
            f"stalled motor; plausible is up to {MOST_CURRENT_A:g} A. It is supply_V divided by the stall current"
        )
    return found


def warnings(model: DriveModel) -> list[str]:
    """Return what is possible but probably not meant, each with its remedy."""
    found = []
    if UNWISE_CONDITION < model.condition < WORST_CONDITION:
        found.append(
            f"The wheels' bearings make a poor base: condition {model.condition:.3g}, where 1.5 is usual. One wheel's "
            "error moves the whole robot."
        )
    could = motor_speed(model, direction(0.0))
    for name, limit, value in (
        ("LIM_WHEEL", limit_speed(model, direction(0.0)), model.wheel_limit_rad_s),
        ("LIM_V", model.speed_limit_m_s, model.speed_limit_m_s),
    ):
        if limit < HELD_BACK * could:
            found.append(
                f"{name} = {value:g} holds the robot at {limit:.3g} m/s forward, its motors could {could:.3g} m/s. "
                f"If not intended, set {name} in [parameters]."
            )
    if limit_speed(model, direction(0.0)) > 1.05 * could and model.speed_limit_m_s > 1.05 * could:
        found.append(
            f"LIM_WHEEL = {model.wheel_limit_rad_s:g} rad/s is more than the motors reach ({could:.3g} m/s forward): "
            "a path planned for it cannot be followed."
        )
    if model.blocked_s > SLOW_TO_NOTICE * model.stall_s:
        found.append(
            f"A blocked wheel is noticed after {model.blocked_s:.2g} s, not SAFE_STALL_T = {model.stall_s:g} s: "
            f"{model.counts_per_revolution:g} counts per turn are too few. Use an encoder with more counts."
        )
    if model.current_limit_A >= model.stall_current_A:
        found.append(
            f"LIM_I = {model.current_limit_A:g} A never acts: a stalled motor takes "
            f"{model.stall_current_A:.3g} A. Lower it, or set it to 0."
        )
    elif model.current_limit_A > 0.0 and model.limited_torque_N_m == 0.0:
        found.append(
            f"LIM_I = {model.current_limit_A:g} A leaves a wheel no torque beyond its dry friction: it will not turn."
        )
    grip, motors = (bound.value for bound in reversed(acceleration_bounds(model, direction(0.0))))
    possible = min(grip, motors)
    if model.acceleration_limit_m_s2 > possible:
        cause = "the grip of the floor" if grip < motors else "the force of the motors"
        found.append(
            f"LIM_A = {model.acceleration_limit_m_s2:g} m/s^2 is more than {cause} forward ({possible:.3g} m/s^2)."
        )
    return found
