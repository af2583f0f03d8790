# SPDX-License-Identifier: MIT
"""How much older poses are than they say, from a robot that is turned to and fro.

The robot knows by wheels and gyro how it is turned, in its own time. The same turning is in the poses, later by what
their time is wrong. The delay is the one at which both agree best. Heading errors of wheels that slip grow slowly, so
short pieces are compared, each with an offset and a drift of its own. How far the pieces disagree is the result's
standard deviation.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from omniwheel.dialect import Message
from omniwheel.errors import LinkTimeoutError, MocapLatencyError
from omniwheel.mocap.source import MocapSource
from omniwheel.robot import Robot
from omniwheel.timesync import TimeSync

Array = NDArray[np.float64]
SAMPLE_HZ = 100.0
LEAST_POSES, LEAST_TURN_RAD = 60, 2.0
"""Poses and turning, to and fro together, without which nothing can be said."""
WORST_SD_S = 0.005
WORST_MISFIT = 0.1
"""RMS of what headings of poses and of the robot disagree, by the RMS of the headings."""
_LEAST_S, _MOST_S, _STEP_S = -0.2, 0.6, 0.005
_PIECE_S = 2.0
_LEAST_IN_PIECE = 8
_ROUGH_ORDER = 3
_LONGEST_GAP_S = 0.06
_POLL_S = 0.01
_CLOCK_S = 0.01


@dataclass(frozen=True)
class PoseLatency:
    """What poses and robot show of each other.

    ``latency_s``: how much older the poses are than they say, standard deviation ``sd_s``. ``scale``: how far the robot
    turns by the poses, over what it believes. ``turned_rad``: to and fro together. ``clock_error_s``: what the robot's
    clock may be off by at most.
    """

    latency_s: float
    sd_s: float
    poses: int
    turned_rad: float
    scale: float
    clock_error_s: float = 0.0

    def as_dict(self) -> dict[str, float]:
        """Return the numbers by name."""
        return asdict(self)


@dataclass
class Headings:
    """Headings over time [s], in the robot's clock: of the poses, and of the robot by its wheels and gyro [rad]."""

    pose_s: Array
    pose_rad: Array
    robot_s: Array
    robot_rad: Array
    clock_error_s: float = 0.0


def observe(
    source: MocapSource, robot: Robot, duration_s: float, clock: Callable[[], float], timeout_s: float
) -> Headings:
    """Watch poses and robot for ``duration_s``. Nothing moves, and the robot gets no fixes from here.

    ``clock`` tells the time of source and connection. Raises LinkTimeoutError, and MocapLatencyError if the robot was
    restarted meanwhile, or gets fixes from elsewhere: it would follow the poses then.
    """
    sync = TimeSync(robot.connection)
    samples: list[Message] = []
    counted: list[Message] = []
    taken = {"OMNI_SAMPLE": samples, "OMNI_CONTROL": counted}
    remove = robot.connection.add_listener(lambda m: taken[m.get_type()].append(m) if m.get_type() in taken else None)
    seen: list[tuple[float, float]] = []
    try:
        _wait_for_clock(sync, robot, clock, timeout_s)
        for message, rate_hz in (("OMNI_SAMPLE", SAMPLE_HZ), ("OMNI_CONTROL", 5.0)):
            robot.set_message_interval(message, rate_hz)
        samples.clear()
        restarts = sync.restarts
        end_s = clock() + duration_s
        while (left_s := end_s - clock()) > 0.0 and not source.ended:
            pose = source.read(min(_POLL_S, left_s))
            robot.connection.poll(0.0)
            sync.serve()
            if pose is not None:
                seen.append((pose.taken_s, pose.pose.theta))
        for message in taken:
            robot.set_message_interval(message, None)
    finally:
        remove()
        sync.close()
    best = sync.best
    if best is None or sync.restarts != restarts:
        raise MocapLatencyError("the robot was restarted meanwhile", hint="measure again")
    if counted and counted[-1].fixes_accepted != counted[0].fixes_accepted:
        raise MocapLatencyError(
            "the robot gets pose fixes from another program", hint="end the mocap bridge, and measure again"
        )
    poses = np.array(seen, dtype=np.float64).reshape(-1, 2)
    motion = np.array([(m.time_us * 1e-6, m.pose[2]) for m in samples], dtype=np.float64).reshape(-1, 2)
    return Headings(poses[:, 0] + best.offset_s, poses[:, 1], motion[:, 0], motion[:, 1], best.error_s(clock()))


def _wait_for_clock(sync: TimeSync, robot: Robot, clock: Callable[[], float], timeout_s: float) -> None:
    end_s = clock() + timeout_s
    answered_s = None
    # The first answers come quickly one after another: the best of a second of them is good.
    while answered_s is None or clock() < answered_s + 1.0:
        sync.serve()
        robot.connection.poll(_CLOCK_S)
        if sync.synchronised and answered_s is None:
            answered_s = clock()
        if answered_s is None and clock() > end_s:
            raise LinkTimeoutError(f"the robot does not answer TIMESYNC within {timeout_s:g} s")


def pose_latency(headings: Headings) -> PoseLatency:
    """Return the delay between both. Raises MocapLatencyError, with what to do, if they do not tell."""
    _check(headings)
    robot_s, keep = np.unique(headings.robot_s, return_index=True)
    robot_rad = np.unwrap(headings.robot_rad[keep])
    # Only poses for which the robot's heading is known at every delay that is tried.
    inside = (headings.pose_s - _MOST_S > robot_s[0]) & (headings.pose_s - _LEAST_S < robot_s[-1])
    time_s, pose_rad = headings.pose_s[inside], np.unwrap(headings.pose_rad)[inside]
    if len(time_s) < LEAST_POSES:
        raise MocapLatencyError(
            f"only {len(time_s)} poses came, and {LEAST_POSES} are needed",
            hint="can the cameras see the robot all the time? Measure for longer",
        )

    def believed(delay_s: float) -> Array:
        heading: Array = np.interp(time_s - delay_s, robot_s, robot_rad)
        return heading

    delays = np.arange(_LEAST_S, _MOST_S, _STEP_S)
    fits = [_rough_fit(time_s, pose_rad, believed(delay_s)) for delay_s in delays]
    best = int(np.argmin([misfit for _scale, misfit in fits]))
    scale, misfit = fits[best]
    turned_rad = float(np.sum(np.abs(np.diff(believed(float(delays[best]))))))
    if turned_rad < LEAST_TURN_RAD:
        raise MocapLatencyError(
            f"the robot turned by {turned_rad:.1f} rad in all, which is too little",
            hint="turn it to the left and to the right by a quarter turn, about once a second",
        )
    if misfit > WORST_MISFIT or best in (0, len(delays) - 1):
        raise MocapLatencyError(
            "the poses do not turn as the robot does", hint="is it the right body, and do its wheels stay on the floor?"
        )
    if scale < 0.0:
        raise MocapLatencyError(
            "the poses turn to the other side than the robot",
            hint="counter-clockwise is positive: see the axes of the cameras, and W1_ENC_DIR … of the robot",
        )
    delay_s = float(delays[best])
    for _ in range(3):
        step_s, sd_s = _refined(time_s, pose_rad - scale * believed(delay_s), scale * _rate(believed, delay_s))
        delay_s += step_s
    if not sd_s <= WORST_SD_S:
        raise MocapLatencyError(
            f"the delay is {1e3 * delay_s:.0f} ms, but uncertain by {1e3 * sd_s:.0f} ms",
            hint="turn the robot faster, without lifting it, and measure for longer",
        )
    return PoseLatency(delay_s, sd_s, len(time_s), turned_rad, scale, headings.clock_error_s)


def _check(headings: Headings) -> None:
    if not len(headings.robot_s):
        raise MocapLatencyError("the robot sent no OMNI_SAMPLE", hint="does its firmware fit to this program?")
    if float(np.median(np.diff(headings.robot_s)) if len(headings.robot_s) > 1 else math.inf) > _LONGEST_GAP_S:
        raise MocapLatencyError("the link is too slow to measure times of milliseconds", hint="connect by USB")


def _rough_fit(time_s: Array, pose_rad: Array, robot_rad: Array) -> tuple[float, float]:
    """Fit ``pose = scale * robot + slow drift``; return the scale, and the misfit by what the poses turned."""
    place = 2.0 * (time_s - time_s[0]) / (time_s[-1] - time_s[0]) - 1.0
    slow = np.polynomial.legendre.legvander(place, _ROUGH_ORDER)
    basis = np.linalg.qr(slow)[0]
    pose = pose_rad - basis @ (basis.T @ pose_rad)
    robot = robot_rad - basis @ (basis.T @ robot_rad)
    scale = float(pose @ robot / max(float(robot @ robot), 1e-12))
    rest = pose - scale * robot
    return scale, math.sqrt(float(rest @ rest) / max(float(pose @ pose), 1e-12))


def _rate(believed: Callable[[float], Array], delay_s: float) -> Array:
    step_s = 1.0 / SAMPLE_HZ
    return (believed(delay_s - step_s) - believed(delay_s + step_s)) / (2.0 * step_s)


def _refined(time_s: Array, rest_rad: Array, rate_rad_s: Array) -> tuple[float, float]:
    """Return by how much the delay is too small [s], and its standard deviation, from pieces of the headings."""
    delays: list[float] = []
    weights: list[float] = []
    piece = np.floor((time_s - time_s[0]) / _PIECE_S)
    for number in np.unique(piece):
        here = piece == number
        if np.count_nonzero(here) < _LEAST_IN_PIECE:
            continue
        line = np.linalg.qr(np.column_stack((np.ones(int(here.sum())), time_s[here])))[0]
        rest = rest_rad[here] - line @ (line.T @ rest_rad[here])
        rate = rate_rad_s[here] - line @ (line.T @ rate_rad_s[here])
        weight = float(rate @ rate)
        if weight > 0.0:
            delays.append(-float(rest @ rate) / weight)
            weights.append(weight)
    if len(delays) < 3:
        return 0.0, math.inf
    share = np.array(weights) / np.sum(weights)
    mean = float(share @ delays)
    spread = float(share**2 @ (np.array(delays) - mean) ** 2)
    return mean, math.sqrt(spread * len(delays) / (len(delays) - 1))
