# SPDX-License-Identifier: MIT
"""Whether a robot can follow a setpoint: asked before it arms, so that nothing is shortened in silence.

The robot scales a velocity that its wheels cannot follow, and refuses one beyond LIM_V or LIM_W. These functions say so
beforehand, with the limit's name, its value and what to do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from omniwheel.capability.drive_model import Array, DriveModel
from omniwheel.capability.speeds import MOTORS, Bound, limit_speed, motor_speed
from omniwheel.errors import LimitError
from omniwheel.frames import Pose, Twist

_ROUNDING = 1.0 + 1e-4
_DIRECTIONS = 36
_TURNED_STEP = math.radians(2.0)
"""Headings between two that were tried: what the robot reaches differs by less than 0.1 % over half of this."""


def check_velocity(model: DriveModel, twist: Twist, heading_rad: float | None = 0.0, turned_rad: float = 0.0) -> None:
    """Raise LimitError if the robot cannot follow a velocity.

    ``heading_rad``: the robot's heading in the frame of the twist; 0 for the body's frame, None if it is not known. A
    velocity is then refused only if no heading could follow it.
    ``turned_rad``: how far the robot turns in that frame while it follows. All headings on the way have to be possible.
    """
    heading = _best_heading(model, twist) if heading_rad is None else heading_rad
    turned = max(-math.tau, min(math.tau, turned_rad))
    steps = math.ceil(abs(turned) / _TURNED_STEP)
    bodies = [_turned(twist, -(heading + turned * k / max(1, steps))) for k in range(steps + 1)]
    body = min(bodies, key=lambda asked: _least(model, asked).value)
    bound = _least(model, body)
    if bound.value * _ROUNDING < 1.0:
        raise _refusal(model, twist, bound, body)


def _best_heading(model: DriveModel, twist: Twist) -> float:
    """Return the heading in which the robot can follow most of a world twist: coarsely all around, then finely."""
    best, width = 0.0, 2.0 * math.pi
    while width > 1e-4:
        tried = [best + width * (k / _DIRECTIONS - 0.5) for k in range(_DIRECTIONS + 1)]
        best = max(tried, key=lambda heading: _least(model, _turned(twist, -heading)).value)
        width *= 3.0 / _DIRECTIONS
    return best


def _turned(twist: Twist, angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * twist.vx - s * twist.vy, s * twist.vx + c * twist.vy, twist.wz])


def _least(model: DriveModel, body: Array) -> Bound:
    """Return what share of a body twist the robot can follow, and what limits it."""
    bounds = [Bound(motor_speed(model, body), MOTORS), Bound(limit_speed(model, body), "LIM_WHEEL")]
    speed, turn = math.hypot(body[0], body[1]), abs(float(body[2]))
    if speed > 0.0:
        bounds.append(Bound(model.speed_limit_m_s / speed, "LIM_V"))
    if turn > 0.0:
        bounds.append(Bound(model.turn_limit_rad_s / turn, "LIM_W"))
    return min(bounds, key=lambda bound: bound.value)


def _refusal(model: DriveModel, twist: Twist, bound: Bound, body: Array) -> LimitError:
    speed = math.hypot(twist.vx, twist.vy)
    unit = ("m/s", speed) if speed > 0.0 else ("rad/s", abs(twist.wz))
    motors = motor_speed(model, body) * unit[1]
    also = f" with {twist.wz:g} rad/s" if speed > 0.0 and twist.wz else ""
    limit, reached = _limit_text(model, bound.cause), bound.value * unit[1]
    message = f"requested {unit[1]:.3g} {unit[0]}{also}; its limit is {reached:.3g} {unit[0]}: {limit}"
    refusal = partial(LimitError, limit=bound.cause, asked=unit[1], possible=reached)
    if bound.cause == MOTORS:
        return refusal(message, hint="reduce the setpoint; `omni robots check` shows the robot's limits")
    needed = _needed(model, bound.cause, twist, body)
    if motors * _ROUNDING < unit[1]:
        return refusal(
            f"{message}; its motors could {motors:.3g}", hint="reduce the speed: the motors cannot go faster"
        )
    hint = f"reduce the setpoint, or raise the limit, if that is safe: omni params set {bound.cause}={needed:.3g}"
    return refusal(f"{message}; its motors could {motors:.3g}", hint=hint)


def _limit_text(model: DriveModel, cause: str) -> str:
    return {
        "LIM_WHEEL": f"LIM_WHEEL is {model.wheel_limit_rad_s:g} rad/s",
        "LIM_V": f"LIM_V is {model.speed_limit_m_s:g} m/s",
        "LIM_W": f"LIM_W is {model.turn_limit_rad_s:g} rad/s",
        MOTORS: f"the motors at {model.supply_V:g} V",
    }[cause]


def _needed(model: DriveModel, cause: str, twist: Twist, body: Array) -> float:
    """Return the value that the limit would need for this twist, a little more than just enough."""
    wheel = float(np.max(np.abs(model.rows @ body / model.radius_m)))
    return {"LIM_WHEEL": wheel, "LIM_V": math.hypot(twist.vx, twist.vy), "LIM_W": abs(twist.wz)}[cause] * 1.01


def check_pose(pose: Pose, position_limit_m: float) -> None:
    """Raise LimitError for a pose that the robot would refuse, or a heading that looks like degrees."""
    for axis, value in (("x", pose.x), ("y", pose.y)):
        if abs(value) > position_limit_m:
            raise LimitError(
                f"{axis} = {value:g} m is beyond LIM_POS, {position_limit_m:g} m",
                hint="poses are in the world's frame, in metres; a larger room: omni params set LIM_POS=...",
                limit="LIM_POS",
                asked=abs(value),
                possible=position_limit_m,
            )
    if abs(pose.theta) > 2.0 * math.pi:
        raise LimitError(
            f"theta = {pose.theta:g} rad is more than one turn",
            hint=f"angles are in radians; {pose.theta:g} degrees: math.radians({pose.theta:g}), on a command line "
            f"{pose.theta:g}deg",
            limit="one turn",
            asked=abs(pose.theta),
            possible=math.tau,
        )


def check_wheel_count(duty: Sequence[float], wheels: int) -> None:
    """Raise LimitError unless there is one duty for each wheel."""
    if len(duty) != wheels:
        raise LimitError(
            f"{len(duty)} duties for {wheels} wheels", hint="give one number per wheel; 0 switches a wheel off"
        )
