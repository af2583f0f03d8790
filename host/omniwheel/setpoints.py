# SPDX-License-Identifier: MIT
"""Setpoints and pose fixes as MAVLink messages; a number that is not finite is refused before it is sent."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from omniwheel.burst import SIGNALS
from omniwheel.connection import Connection
from omniwheel.dialect import Message, mavlink
from omniwheel.errors import SetpointError
from omniwheel.frames import Pose, Twist, flip

_M = mavlink
MAX_WHEELS = 4
PLACES = {"wheel": 1, "voltage": 2, "pose": 3}
"""Where an excitation can be added, and its number in MAV_CMD_OMNI_EXCITE."""
_IGNORE_POSITION = _M.POSITION_TARGET_TYPEMASK_X_IGNORE | _M.POSITION_TARGET_TYPEMASK_Y_IGNORE
_IGNORE_Z = _M.POSITION_TARGET_TYPEMASK_Z_IGNORE | _M.POSITION_TARGET_TYPEMASK_VZ_IGNORE
_IGNORE_VELOCITY = _M.POSITION_TARGET_TYPEMASK_VX_IGNORE | _M.POSITION_TARGET_TYPEMASK_VY_IGNORE
_IGNORE_ACCELERATION = (
    _M.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | _M.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | _M.POSITION_TARGET_TYPEMASK_AZ_IGNORE
)
_IGNORE_YAW = _M.POSITION_TARGET_TYPEMASK_YAW_IGNORE
_IGNORE_YAW_RATE = _M.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
_FRAMES = {"body": _M.MAV_FRAME_BODY_FRD, "world": _M.MAV_FRAME_LOCAL_NED}
_UNKNOWN_COVARIANCE = [math.nan] + [0.0] * 20
_X, _Y, _YAW = 0, 6, 20
"""Places in the row-major upper triangle of a covariance of x, y, z, roll, pitch, yaw."""
_INT16_MAX, _UINT16_MAX = 32767, 65535
_PER_UNIT = 1e4
"""Units of OMNI_POSE_FIX's standard deviations in a metre or a radian."""
_ROUNDED = 1.0 / math.sqrt(12.0)
"""Standard deviation of what rounding takes away, in steps."""
_TIME_MS_WRAP = 2**32
_FLOAT32_MAX = float.fromhex("0x1.fffffep+127")


def finite(name: str, value: float) -> float:
    """Return ``value``; raise SetpointError if it is not a finite number, or too large for MAVLink's float32."""
    number = _finite_double(name, value)
    if abs(number) > _FLOAT32_MAX:
        raise SetpointError(f"{name} is {number:g}; at most {_FLOAT32_MAX:.4g} can be sent")
    return number


def _finite_double(name: str, value: float) -> float:
    try:
        number = float(value)
    except OverflowError:  # a Python int may have any length
        number = math.inf if value > 0 else -math.inf
    except (TypeError, ValueError):
        raise SetpointError(f"{name} is {value!r}; must be a number", hint="lengths in m, angles in rad") from None
    if not math.isfinite(number):
        raise SetpointError(f"{name} is {number}; must be a finite number")
    return number


def _all_finite(values: Any) -> None:
    for name, value in values._asdict().items():
        finite(name, value)


def velocity_target(connection: Connection, twist: Twist, frame: str) -> Message:
    """Return the setpoint of a velocity in the frame "body" or "world"."""
    if frame not in _FRAMES:
        raise SetpointError(f"the frame is {frame!r}; must be one of {', '.join(_FRAMES)}")
    _all_finite(twist)
    mask = _IGNORE_POSITION | _IGNORE_Z | _IGNORE_ACCELERATION | _IGNORE_YAW
    return _target(connection, _FRAMES[frame], mask, Pose(0.0, 0.0, 0.0), twist)


def pose_target(connection: Connection, pose: Pose, feed_forward: Twist | None) -> Message:
    """Return the setpoint of a world pose, with a feed-forward world twist if there is one."""
    _all_finite(pose)
    mask = _IGNORE_Z | _IGNORE_ACCELERATION
    if feed_forward is None:
        mask |= _IGNORE_VELOCITY | _IGNORE_YAW_RATE
    else:
        _all_finite(feed_forward)
    return _target(connection, _M.MAV_FRAME_LOCAL_NED, mask, pose, feed_forward or Twist(0.0, 0.0, 0.0))


def check_duty(duty: Sequence[float]) -> None:
    """Raise SetpointError unless there is a duty -1..1 for each of one to four wheels."""
    if not 0 < len(duty) <= MAX_WHEELS:
        raise SetpointError(f"{len(duty)} duties are given; must be one per wheel, at most {MAX_WHEELS}")
    for wheel, value in enumerate(duty, 1):
        if abs(finite(f"duty {wheel}", value)) > 1.0:
            raise SetpointError(f"duty {wheel} is {value:g}; must be from -1 to 1")


def duty_target(connection: Connection, duty: Sequence[float]) -> Message:
    """Return the setpoint of open-loop duties, -1..1 per wheel (at most four; wheels left out get 0)."""
    check_duty(duty)
    values = [float(value) for value in duty] + [0.0] * (MAX_WHEELS - len(duty))
    message: Message = _M.MAVLink_omni_setpoint_duty_message(
        connection.target_system, connection.target_component, values
    )
    return message


def burst_request(duration_s: float, signals: Sequence[str], every: int, wheels: Sequence[int]) -> list[float]:
    """Return the first four parameters of MAV_CMD_OMNI_BURST."""
    unknown = [name for name in signals if name not in SIGNALS]
    if unknown:
        raise SetpointError(f"unknown signal {unknown[0]}; must be one of {', '.join(SIGNALS)}")
    if not set(wheels) <= set(range(MAX_WHEELS)):
        raise SetpointError(f"wheels must be between 0 and {MAX_WHEELS - 1}")
    mask = sum(SIGNALS[name] for name in dict.fromkeys(signals))
    chosen = sum(1 << wheel for wheel in set(wheels))
    return [finite("duration_s", duration_s), finite("every", every), float(mask), float(chosen)]


def excitation_request(place: str, which: int, amplitude: float, duration_s: float) -> list[float]:
    """Return the first four parameters of MAV_CMD_OMNI_EXCITE."""
    if place not in PLACES:
        raise SetpointError(f"unknown excitation point {place!r}; must be one of {', '.join(PLACES)}")
    numbers = [finite("which", which), finite("amplitude", amplitude), finite("duration_s", duration_s)]
    return [float(PLACES[place]), *numbers]


def _target(connection: Connection, frame: int, mask: int, pose: Pose, twist: Twist) -> Message:
    x, y, yaw = flip(*pose)
    vx, vy, yaw_rate = flip(*twist)
    who = (connection.target_system, connection.target_component)
    message: Message = _M.MAVLink_set_position_target_local_ned_message(
        0, *who, frame, mask, x, y, 0.0, vx, vy, 0.0, 0.0, 0.0, 0.0, yaw, yaw_rate
    )
    return message


def pose_fix_message(pose: Pose, time_us: int, sd_xy_m: float = 0.0, sd_theta_rad: float = 0.0) -> Message:
    """Return a pose fix as VICON_POSITION_ESTIMATE.

    ``sd_xy_m`` and ``sd_theta_rad`` are standard deviations: of x and of y, and of theta; 0: not known, and the robot
    takes ``EKF_R_XY`` and ``EKF_R_TH``. Raises SetpointError for what is not finite, or negative.
    """
    _all_finite(pose)
    x, y, yaw = flip(*pose)
    covariance = list(_UNKNOWN_COVARIANCE)
    if _known("sd_xy_m", sd_xy_m):
        covariance[_X] = covariance[_Y] = _limited(sd_xy_m) ** 2
    if _known("sd_theta_rad", sd_theta_rad):
        covariance[_YAW] = _limited(sd_theta_rad) ** 2
    message: Message = _M.MAVLink_vicon_position_estimate_message(time_us, x, y, 0.0, 0.0, 0.0, yaw, covariance)
    return message


def compact_fix_message(pose: Pose, time_us: int, sd_xy_m: float = 0.0, sd_theta_rad: float = 0.0) -> Message:
    """Return a pose fix as OMNI_POSE_FIX: millimetres, 0.1 mrad, milliseconds, standard deviations in 0.1 mm or mrad.

    As :func:`pose_fix_message`. Raises SetpointError beyond 32.767 m, too.
    """
    _all_finite(pose)
    x_mm, y_mm = round(pose.x * 1e3), round(pose.y * 1e3)
    if max(abs(x_mm), abs(y_mm)) > _INT16_MAX:
        raise SetpointError(f"x = {pose.x:g} m, y = {pose.y:g} m: a compact pose fix must be within ±32.767 m")
    theta = round(math.remainder(pose.theta, math.tau) * 1e4)
    sds = _tenths("sd_xy_m", sd_xy_m, 1e-3 * _ROUNDED), _tenths("sd_theta_rad", sd_theta_rad, 1e-4 * _ROUNDED)
    time_ms = round(time_us / 1e3) % _TIME_MS_WRAP or int(time_us > 0)  # 0 would be: no time is known
    message: Message = _M.MAVLink_omni_pose_fix_message(time_ms, x_mm, y_mm, theta, *sds)
    return message


def _known(name: str, sd: float) -> bool:
    """Whether a standard deviation is known: above 0. Raises SetpointError for what is none."""
    if _finite_double(name, sd) < 0.0:
        raise SetpointError(f"{name} is {sd:g}; a standard deviation must be 0 (unknown) or more")
    return sd > 0.0


def _limited(sd: float) -> float:
    """Return a standard deviation within what OMNI_POSE_FIX can say. So its square is no 0 and no infinity."""
    return min(max(sd, 1.0 / _PER_UNIT), _UINT16_MAX / _PER_UNIT)


def _tenths(name: str, sd: float, rounding: float) -> int:
    """Return a standard deviation with that of rounding, in 0.1 mm or 0.1 mrad, rounded up; 0: not known."""
    return math.ceil(_PER_UNIT * _limited(math.hypot(sd, rounding))) if _known(name, sd) else 0
