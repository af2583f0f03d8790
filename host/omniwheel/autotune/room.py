# SPDX-License-Identifier: MIT
"""Drives a robot through points in a square around where it stands, there and back, and records what it did."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from omniwheel.dialect import Message
from omniwheel.drive_log import is_slow
from omniwheel.errors import AutotuneError
from omniwheel.frames import Pose
from omniwheel.identification.dataset import Dataset
from omniwheel.identification.sources import from_messages
from omniwheel.robot import Robot
from omniwheel.telemetry import Tracking
from omniwheel.tuning import Experiment, Figures, Trace

MOST_LEGS = 31
"""The robot keeps 32 waypoints."""
LEAST_ROOM_M = 0.05


@dataclass(frozen=True)
class Rates:
    """How often the robot tells what: sums for the identification, its pose, its pose fixes [Hz].

    ``quiet``: what it is not asked for meanwhile.
    """

    sample_hz: float = 50.0
    tracking_hz: float = 50.0
    fixes_hz: float = 5.0
    quiet: tuple[str, ...] = ()


CABLE = Rates()
RADIO = Rates(3.0, 2.0, 0.5, ("ATTITUDE", "LOCAL_POSITION_NED", "POSITION_TARGET_LOCAL_NED", "ODOMETRY"))
"""What 480 bytes a second carry, half of 9600 baud. The samples are sums, so that none is lost between two of them."""
FIX_NUMBERS = 3.0
"""A fix is three numbers: the mean of its normalised innovation squared, if the robot knows what it does not know."""
ROUNDING_SHARE, MOST_MERGED = 0.05, 4
"""Rounding of the encoders by the wheels' speed, and of how many samples a row is made until it is below that."""
PEAK_SPEED, PEAK_ACCELERATION = 1.875, 5.774
"""Peaks of a leg, which is a quintic from rest to rest: times way / time and way / time^2."""
SETTINGS = ("TRJ_TYPE", "TRJ_PERIOD", "TRJ_LAPS", "TRJ_SCALE", "TRJ_RAMP")
_WAYPOINTS = 1.0
ON_PATH = 2
"""``phase`` of OMNI_TRACKING."""


@dataclass(frozen=True)
class Drive:
    """What a drive showed: voltages and wheel speeds, the path as the robot saw it, and its figures.

    ``fixes_refused`` of ``fixes``: pose fixes that the robot did not believe; 0 of 0 if there are none. ``unknown``: by
    the key of a figure, what the robot does not know of its pose while it moves, standard deviation [m, rad].
    """

    data: Dataset
    trace: Trace
    figures: Figures
    fixes: int = 0
    fixes_refused: int = 0
    unknown: dict[str, float] = field(default_factory=dict)


def reach_of(side_m: float, body_m: float) -> float:
    """Return how far from the middle the centre of a robot of radius ``body_m`` may be, along each side of a square.

    Raises AutotuneError if the square is too small.
    """
    reach = 0.5 * side_m - body_m
    if reach < LEAST_ROOM_M:
        least = 2.0 * (body_m + LEAST_ROOM_M)
        raise AutotuneError(f"the robot needs more than {side_m:g} m", hint=f"use --room {least:.2f} or more")
    return reach


def points(here: Pose, reach_m: float, turn_rad: float, legs: int, seed: int) -> list[Pose]:
    """Return the ends of ``legs``, from where the robot stands and back, headings within ``turn_rad`` of the first.

    They lie in a square around it. The first one is where it stands, or the robot would hurry to it.
    """
    draw = np.random.default_rng(seed)
    places = [
        Pose(
            here.x + reach_m * draw.uniform(-1.0, 1.0),
            here.y + reach_m * draw.uniform(-1.0, 1.0),
            here.theta + turn_rad * draw.uniform(-1.0, 1.0),
        )
        for _ in range(legs - 1)
    ]
    return [here, *places, here]


def leg_time(places: Sequence[Pose], speed: tuple[float, float], acceleration: tuple[float, float]) -> float:
    """Return how long each leg takes [s] so that none is beyond ``speed`` [m/s, rad/s] and ``acceleration``."""
    longest = 0.0
    for before, after in pairwise(places):
        ways = (math.hypot(after.x - before.x, after.y - before.y), abs(after.theta - before.theta))
        for way, fast, quick in zip(ways, speed, acceleration, strict=True):
            longest = max(longest, PEAK_SPEED * way / fast, math.sqrt(PEAK_ACCELERATION * way / quick))
    return longest


def drive(robot: Robot, places: Sequence[Pose], leg_s: float) -> Drive:
    """Drive through the points and return what was seen. The robot is disarmed at the end, whatever happens.

    Its waypoints are replaced, and SETTINGS are left changed. Raises ExperimentError if the robot stopped itself.
    """
    seen: list[Message] = []
    names = (
        "WHEELS",
        "ENC_CPR",
        "EKF_R_XY",
        "EKF_R_TH",
        *(f"W{wheel + 1}_ENC_DIR" for wheel in range(int(robot.parameters["WHEELS"]))),
    )
    parameters = {name: robot.parameters[name] for name in names}
    settings = dict(zip(SETTINGS, (_WAYPOINTS, leg_s, 1.0, 1.0, 0.1), strict=True))
    robot.parameters.set_many(settings)
    robot.set_waypoints(places)
    counted: list[Message] = []
    tracked: list[Message] = []
    rates = RADIO if is_slow(robot.url) else CABLE
    taken = {"OMNI_SAMPLE": seen, "OMNI_CONTROL": counted, Tracking.message: tracked}
    asked = {"OMNI_SAMPLE": rates.sample_hz, "OMNI_CONTROL": rates.fixes_hz, **dict.fromkeys(rates.quiet, 0.0)}
    remove = robot.connection.add_listener(lambda m: taken[m.get_type()].append(m) if m.get_type() in taken else None)
    try:
        for message, rate_hz in asked.items():
            robot.set_message_interval(message, rate_hz)
        trace, figures = Experiment(robot, rates.tracking_hz).trajectory(10.0 + 4.0 * leg_s * len(places))
    finally:
        remove()
        for message in (*asked, Tracking.message):
            robot.set_message_interval(message, None)
    refused, accepted = (_grown(counted, name) for name in ("fixes_refused", "fixes_accepted"))
    fixes = refused + accepted
    noise = (parameters["EKF_R_XY"], parameters["EKF_R_TH"])
    unknown = unknown_of(tracked, [message.nis for message in counted], noise) if fixes else {}
    return Drive(merged(seen, robot.url, parameters), trace, figures, fixes, refused, unknown)


def unknown_of(tracked: Sequence[Message], nis: Sequence[float], fix_sd: tuple[float, float]) -> dict[str, float]:
    """Return what the robot does not know of its pose on its path, RMS, by figure.

    That is the standard deviation that it tells, and what its pose fixes contradict of it. With wrong wheels in the
    robot file the fixes are further away than they should be: ``nis``, their normalised innovations squared, show that.
    What is too much of these is taken for error of the pose. ``fix_sd``: of a fix [m, rad].
    """
    told = np.array([message.pose_sd for message in tracked if message.phase == ON_PATH], dtype=np.float64)
    told = told[np.isfinite(told).all(axis=1)] if len(told) else told
    if not len(told):
        return {}
    own = np.mean(told**2, axis=0)
    seen = [value for value in nis if value > 0.0]
    excess = max(float(np.mean(seen)) / FIX_NUMBERS - 1.0, 0.0) if seen else 0.0
    x, y, theta = own + excess * (own + np.array([fix_sd[0], fix_sd[0], fix_sd[1]]) ** 2)
    return {"position_m": math.sqrt(x + y), "theta_rad": math.sqrt(theta)}


def _grown(seen: Sequence[Message], name: str) -> int:
    return int(getattr(seen[-1], name) - getattr(seen[0], name)) if seen else 0


def merged(samples: Sequence[Message], name: str, parameters: Mapping[str, float]) -> Dataset:
    """Return samples as a dataset. Where encoders have few counts, several samples make a row: their sums add up."""
    data = from_messages(samples, name, parameters)
    assert data.wheel_angle_rad is not None
    steps = np.diff(data.wheel_angle_rad, axis=0)
    rounding = 2.0 * math.pi / parameters["ENC_CPR"] / math.sqrt(6.0)
    wanted = rounding / (ROUNDING_SHARE * max(float(np.sqrt(np.mean(steps**2))), 1e-9))
    every = int(np.clip(math.ceil(wanted), 1, MOST_MERGED))
    return data if every == 1 else from_messages(samples[::every], name, parameters)
