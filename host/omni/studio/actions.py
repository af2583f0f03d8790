# SPDX-License-Identifier: MIT
"""What a page may ask of the robot, by name. Each is checked here; the robot checks it again."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from omni.studio.edits import Edits
from omni.studio.parameter_view import values_as_json
from omni.studio.session import set_automatic_rate, set_rate
from omniwheel.drawn_path import DrawnPath, drawn_path, preview
from omniwheel.errors import OmniError
from omniwheel.frames import Pose
from omniwheel.number_text import finite
from omniwheel.robot import Robot

Request = Mapping[str, Any]
LARGEST_RATE_HZ = 200.0
MOST_SIGNALS = 64
_EXACT_DIGITS = 15


class BadRequestError(OmniError):
    """A page asked for something that cannot be understood."""


def parse_request(text: str | bytes | bytearray) -> Any:
    """Return what a page has sent as JSON. Raises BadRequestError.

    An integer that no double holds exactly is a float, which may be infinite: nothing converts it later and fails.
    """
    try:
        return json.loads(text, parse_int=lambda digits: int(digits) if len(digits) <= _EXACT_DIGITS else float(digits))
    except (ValueError, RecursionError) as error:
        raise BadRequestError("malformed request") from error


def number_of(request: Request, name: str, default: float | None = None) -> float:
    """Return a number of the request. Raises BadRequestError."""
    value = request.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise BadRequestError(f"{name} must be a number, not {value!r}")
    return float(value)


def keys_of(request: Request) -> list[str]:
    """Return the names of signals, each once. Raises BadRequestError."""
    keys = request.get("signals")
    if not isinstance(keys, list) or len(keys) > MOST_SIGNALS or not all(isinstance(key, str) for key in keys):
        raise BadRequestError(f"signals must be a list of at most {MOST_SIGNALS} names", hint="show fewer signals")
    return list(dict.fromkeys(keys))


def _values(request: Request) -> dict[str, float | str]:
    values = request.get("values")
    if not isinstance(values, dict) or not all(isinstance(value, int | float | str) for value in values.values()):
        raise BadRequestError("values must be an object of parameters and numbers")
    return {str(name): value for name, value in values.items()}


def _three(request: Request, *names: str) -> tuple[float, float, float]:
    x, y, z = (number_of(request, name) for name in names)
    return x, y, z


def _velocity(robot: Robot, _edits: Edits, request: Request) -> None:
    twist = _three(request, "vx", "vy", "wz")
    frame = "world" if request.get("frame") == "world" else "body"
    robot.guard.check()
    robot.require_velocity(*twist, frame=frame)
    robot.set_velocity(*twist, frame=frame)


def _pose(robot: Robot, _edits: Edits, request: Request) -> None:
    pose = _three(request, "x", "y", "theta")
    robot.guard.check()
    robot.require_pose(*pose)
    robot.set_pose(*pose)


def _start_trajectory(robot: Robot, _edits: Edits, request: Request) -> None:
    kind = request.get("type")
    laps = None if request.get("laps") is None else number_of(request, "laps")
    robot.start_trajectory(str(kind) if kind else None, laps)


def _drawn_path(request: Request) -> DrawnPath:
    line = request.get("line")
    if not isinstance(line, list) or not all(isinstance(point, list) and len(point) == 2 for point in line):
        raise BadRequestError("line must be a list of points, each [x, y] in metres")
    heading_rad = None if request.get("heading") is None else number_of(request, "heading")
    return drawn_path(line, number_of(request, "speed"), heading_rad=heading_rad, laps=number_of(request, "laps", 1.0))


def _preview_path(robot: Robot, _edits: Edits, request: Request) -> dict[str, Any]:
    path = _drawn_path(request)
    tracking = robot.status.tracking
    at = path.points[0] if tracking is None else tracking.pose
    seen = preview(path, robot.parameters.known, robot.table, Pose(*at))
    return {
        "line": np.round(seen.line, 4).tolist(),
        "length_m": round(path.length_m, 3),
        "way_s": round(seen.way_s, 1),
        "duration_s": finite(round(seen.duration_s, 1)),
        "slowed": round(seen.slowed, 3),
    }


def _follow_line(robot: Robot, _edits: Edits, request: Request) -> None:
    _drawn_path(request).start(robot)


def _set_pose_estimate(robot: Robot, _edits: Edits, request: Request) -> None:
    robot.set_pose_estimate(*_three(request, "x", "y", "theta"))


def _rate(robot: Robot, _edits: Edits, request: Request) -> None:
    rate_hz = request.get("hz")
    if rate_hz is not None and not 0 < number_of(request, "hz") <= LARGEST_RATE_HZ:
        raise BadRequestError(f"hz must be more than 0 and at most {LARGEST_RATE_HZ:g}")
    if rate_hz is None:
        set_automatic_rate(robot)
    else:
        set_rate(robot, float(rate_hz))


def _set(_robot: Robot, edits: Edits, request: Request) -> dict[str, float]:
    return values_as_json(edits.set(_values(request), request.get("step")))


def _undo(_robot: Robot, edits: Edits, _request: Request) -> dict[str, float]:
    return values_as_json(edits.undo())


def _redo(_robot: Robot, edits: Edits, _request: Request) -> dict[str, float]:
    return values_as_json(edits.redo())


ACTIONS: dict[str, Callable[[Robot, Edits, Request], Any]] = {
    "arm": lambda robot, _edits, _request: robot.arm(),
    "release": lambda robot, _edits, _request: robot.estop_clear(),
    "velocity": _velocity,
    "pose": _pose,
    "start_trajectory": _start_trajectory,
    "stop_trajectory": lambda robot, _edits, _request: robot.stop_trajectory(),
    "preview_path": _preview_path,
    "follow_line": _follow_line,
    "set_pose_estimate": _set_pose_estimate,
    "set": _set,
    "undo": _undo,
    "redo": _redo,
    "store": lambda robot, _edits, _request: robot.store(),
    "rate": _rate,
}
"""By the name that the page uses. Stop and disarm are not here: they wait for nothing (:class:`Session`)."""
SETPOINTS = frozenset({"velocity", "pose"})
"""What the page repeats: only the newest counts."""
MOVES = frozenset({"arm", "start_trajectory", "follow_line"})
"""What leads to motion by several commands: a stop or the loss of the page ends it between two of them."""
ENDS_STREAM = frozenset({"start_trajectory", "follow_line", "stop_trajectory"})
"""What takes the place of setpoints that were repeated."""
FOR_EVERY_PAGE = frozenset({"stop_trajectory"})
"""What a page may ask that only watches."""
