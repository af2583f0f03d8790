# SPDX-License-Identifier: MIT
"""A line on the floor, drawn by mouse or read from a file, as a smooth path of the robot (TRJ_TYPE spline)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omni_schema import ParameterTable
from omniwheel._core import ffi, lib
from omniwheel.core_config import plan_trajectory, robot_config
from omniwheel.errors import OmniError
from omniwheel.frames import Pose
from omniwheel.robot_base import RobotBase
from omniwheel.table_file import TableFormat, read_table

MOST_POINTS: int = lib.OMNI_MAX_WAYPOINTS
MOST_GIVEN = 20_000
"""Points that a line may have."""
SHORTEST_M = 0.05
_POINT_M = 0.03
"""A line is resampled to points no closer than this."""
_AVERAGED = 8
"""Places of the line that make up a point: a hand that shakes shakes less."""
_PREVIEW_POINTS = 300
_FARTHEST_M = 1e4
_LEAST_PERIOD_S = 0.5
"""The smallest TRJ_PERIOD."""


class DrawnPathError(OmniError):
    """A line that is no path: too short, too many points, not finite."""


_FILE = TableFormat(
    DrawnPathError, "a line per point: x, y in metres, with decimal points, like 0.5, 0.25", ("x", "y"), comments=True
)


@dataclass(frozen=True)
class DrawnPath:
    """What the robot is given: waypoints for TRJ_TYPE spline, and the path time of a lap."""

    points: tuple[Pose, ...]
    period_s: float
    laps: float
    length_m: float

    def require(self, robot: RobotBase) -> None:
        """Raise LimitError if a point of it is beyond the robot's LIM_POS."""
        for point in self.points:
            robot.require_pose(*point)

    def start(self, robot: RobotBase) -> None:
        """Give it to a robot and start it; a disarmed one begins when it is armed. Raises LimitError, OmniError."""
        self.require(robot)
        robot.set_waypoints(self.points)
        robot.start_trajectory("spline", self.laps, self.period_s)


@dataclass(frozen=True)
class Preview:
    """How a robot would drive a path: world positions (n x 2) [m], its time, by how much it is slowed down."""

    line: NDArray[np.float64]
    duration_s: float
    """From the path's beginning to its end; infinite for endless laps."""
    way_s: float
    """The way to its beginning takes so long."""
    slowed: float
    """Times slower than asked for, at least 1."""


def drawn_path(
    line: Sequence[Sequence[float]], speed_m_s: float, *, heading_rad: float | None = None, laps: float = 1.0
) -> DrawnPath:
    """Return the path along a line of world positions [m] at a speed.

    ``heading_rad`` is kept all the way; None: the robot faces where it goes. With other ``laps`` than one the path is
    closed, and its last point leads to the first. Raises DrawnPathError.
    """
    given = _checked(line)
    if not (math.isfinite(speed_m_s) and speed_m_s > 0.0):
        raise DrawnPathError(f"the speed must be above 0 m/s, not {speed_m_s!r}")
    closed = not 0.0 < laps <= 1.0
    if closed and math.dist(given[0], given[-1]) > 1e-9:
        given = np.vstack([given, given[:1]])
    length_m = float(np.hypot(*np.diff(given, axis=0).T).sum())
    if length_m < SHORTEST_M:
        raise DrawnPathError(f"the path is {length_m:.3f} m long; must be {SHORTEST_M:g} m or more")
    count = min(MOST_POINTS + closed, max(3 + closed, 1 + round(length_m / _POINT_M)))
    places = _evenly(given, count)
    if closed:
        places = places[:-1]
    headings = np.full(len(places), heading_rad) if heading_rad is not None else _along(places, closed=closed)
    points = tuple(Pose(float(x), float(y), float(h)) for (x, y), h in zip(places, headings, strict=True))
    return DrawnPath(points, max(_LEAST_PERIOD_S, length_m / speed_m_s), laps, length_m)


def preview(path: DrawnPath, values: Mapping[str, float], table: ParameterTable, at: Pose) -> Preview:
    """Return how a robot with these parameters, now ``at`` a pose, would drive a path.

    The control core itself plans it, as it does on the robot. Raises CoreError.
    """
    config = robot_config(values, table, 0)
    trajectory = config.trajectory
    trajectory.type, trajectory.laps, trajectory.period_s = lib.OMNI_TRJ_TYPE_SPLINE, path.laps, path.period_s
    points = ffi.new("omni_waypoints_t *")
    points.count = len(path.points)
    for number, point in enumerate(path.points):
        points.pose[number] = point
    plan = plan_trajectory(config, ffi.new("omni_pose_t *", tuple(at)), points)
    pose, rate, change = ffi.new("omni_pose_t *"), ffi.new("omni_twist_t *"), ffi.new("omni_twist_t *")
    line = []
    for time_s in np.linspace(0.0, path.period_s * (1.0 if path.laps == 0.0 else min(1.0, path.laps)), _PREVIEW_POINTS):
        lib.omni_path_evaluate(plan, float(time_s), pose, rate, change)
        line.append((pose.x, pose.y))
    timing = plan.timing
    endless = path.laps == 0.0
    duration_s = math.inf if endless else (2 * timing.ramp_ns + timing.cruise_ns) * 1e-9
    return Preview(np.array(line), duration_s, float(plan.lead_in_s), max(1.0, float(plan.scale)))


def read_line(path: Path) -> list[list[float]]:
    """Return the positions of a CSV file: its columns x and y [m], in this order if there is no heading line.

    Columns are parted by commas, or by semicolons or tabs. Raises DrawnPathError.
    """
    columns = read_table(path, _FILE).columns
    found = np.column_stack((columns["x"], columns["y"])).tolist()
    if not found:
        raise DrawnPathError(f"{path}: has no points", hint=_FILE.hint)
    return list(found)


def _checked(line: Sequence[Sequence[float]]) -> NDArray[np.float64]:
    if not 2 <= len(line) <= MOST_GIVEN:
        raise DrawnPathError(f"a path must have 2 to {MOST_GIVEN} points, not {len(line)}")
    try:
        given = np.array([[float(x), float(y)] for x, y in line])
    except (TypeError, ValueError):
        raise DrawnPathError("each point of a path must be x and y in metres") from None
    if not (np.abs(given) <= _FARTHEST_M).all():
        raise DrawnPathError(f"the points of a path must be numbers within ±{_FARTHEST_M:g} m")
    return given


def _evenly(given: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return so many points at equal distances along a line, its ends among them, each a mean of its surroundings."""
    steps = np.hypot(*np.diff(given, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    fine = np.linspace(0.0, along[-1], _AVERAGED * (count - 1) + 1)
    line = np.column_stack([np.interp(fine, along, given[:, axis]) for axis in (0, 1)])
    half = _AVERAGED // 2
    centres = range(_AVERAGED, len(line) - 1, _AVERAGED)
    inner = [line[at - half : at + half + 1].mean(axis=0) for at in centres]
    return np.vstack([line[0], *inner, line[-1]])


def _along(places: NDArray[np.float64], *, closed: bool) -> NDArray[np.float64]:
    """Return the direction of travel at each point [rad]."""
    ahead = np.roll(places, -1, axis=0) - np.roll(places, 1, axis=0) if closed else np.gradient(places, axis=0)
    return np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
