# SPDX-License-Identifier: MIT
"""What a page shows of the robot besides plots, as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from omni.studio.session import Session
from omniwheel._core import lib
from omniwheel.capability.speeds import top_speed, top_turn_rate
from omniwheel.number_text import finite
from omniwheel.robot import Robot
from omniwheel.sensor_quality import Sensor, shown
from omniwheel.status import RobotStatus
from omniwheel.telemetry import Fix

_DIGITS = 5
_DIRECTIONS = 72


def link_state(session: Session | None) -> dict[str, Any]:
    """Return what is known of the connection."""
    if session is None:
        return {"phase": "none", "url": "", "trouble": "", "bytes_per_s": 0, "quality": None}
    quality = session.quality
    return {
        "phase": session.phase,
        "url": session.url,
        "trouble": session.trouble,
        "bytes_per_s": round(session.rx_bytes_s),
        "quality": None if quality is None else quality.state(),
    }


def robot_state(robot: Robot, sensors: Iterable[Sensor]) -> dict[str, Any]:
    """Return state, pose and health of a connected robot that has these ``sensors``."""
    status = robot.status
    return {
        "state": status.state,
        "armed": status.armed,
        "mode": status.mode,
        "faults": list(status.faults),
        "hil": status.heartbeat is not None and status.heartbeat.hil,
        "supply_V": None if status.battery is None else finite(status.battery.voltage_V),
        "silent_s": round(status.heartbeat_age_s, 1),
        **_pose_state(status),
        "slip_m_s": [] if status.wheels is None else [finite(round(slip, 3)) for slip in status.wheels.slip_m_s],
        "fixes": _fix_counts(status),
        "sensors": [asdict(one) for one in shown(sensors, status.sensors)],
        **_loop_state(status),
    }


def fix_as_json(fix: Fix) -> dict[str, Any]:
    """Return a pose fix and what became of it, for the map: place [m, m, rad], age [s] when it was looked at."""
    return {
        "pose": [finite(round(value, _DIGITS)) for value in fix.pose],
        "age_s": finite(round(fix.age_s, 4)),
        "result": fix.result,
    }


def shape_as_json(robot: Robot) -> dict[str, Any]:
    """Return what a map draws and what driving by keys may ask: wheels, size, top speeds, paths.

    ``path`` is the one that its parameters choose.

    ``speed`` is what the robot reaches in every direction [m/s] and by turning [rad/s].
    """
    values = robot.parameters.known
    model = robot.drive_model()
    path = round(values["TRJ_TYPE"])
    directions = (2 * math.pi * number / _DIRECTIONS for number in range(_DIRECTIONS))
    return {
        "wheels": [math.radians(values[f"W{number}_ANGLE"]) for number in range(1, int(values["WHEELS"]) + 1)],
        "radius_m": values["WHEEL_DIST"],
        "speed": {
            "v": min(top_speed(model, angle).value for angle in directions),
            "w": top_turn_rate(model).value,
        },
        "paths": [
            name  # the others are drawn on the map, or uploaded by a program
            for name, number in robot.table["TRJ_TYPE"].values.items()
            if not lib.omni_trajectory_needs_waypoints(number)
        ],
        "path": next((name for name, number in robot.table["TRJ_TYPE"].values.items() if number == path), None),
    }


def _pose_state(status: RobotStatus) -> dict[str, Any]:
    tracking = status.tracking
    if tracking is None:
        return {"pose": None}
    return {
        "pose": [round(value, _DIGITS) for value in tracking.pose],
        "reference": [round(value, _DIGITS) for value in tracking.reference],
        "pose_sd": [finite(round(value, _DIGITS)) for value in tracking.pose_sd],
        "pose_correlation": finite(round(tracking.pose_correlation, _DIGITS)),
        "quality": None if status.quality is None else finite(status.quality.as_dict()),
        "phase": tracking.phase,
        "path_time_s": round(tracking.path_time_s, 2),
    }


def _fix_counts(status: RobotStatus) -> dict[str, int] | None:
    """Return how many fixes the robot has used and refused since its start; None before it has said so."""
    control = status.control
    return None if control is None else {"used": control.fixes_accepted, "refused": control.fixes_refused}


def _loop_state(status: RobotStatus) -> dict[str, Any]:
    loop = status.safety
    if loop is None:
        return {}
    return {
        "overruns": loop.overruns,
        "rx_errors": loop.rx_errors,
        "tx_dropped": loop.tx_dropped,
        "tick_us_max": finite(loop.tick_us_max),
    }
