# SPDX-License-Identifier: MIT
"""How much older poses are than they say, from a robot that is turned to and fro.

The robot knows by wheels and gyro how it is turned, in its own time. The same turning is in the poses, later by what
their time is wrong. The delay is the one at which both agree best. Heading errors of wheels that slip grow slowly, so
short pieces are compared, each with an offset and a drift of its own. How far the pieces disagree is the result's
standard deviation. Lag of the robot's own heading is not seen: a gyro's filter, and play of wheels and gears.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import asdict, dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from omniwheel.dialect import Message
from omniwheel.errors import MocapLatencyError, OmniError
from omniwheel.mocap.source import MocapSource
from omniwheel.robot import Robot
from omniwheel.timesync import TimeSync

Array = NDArray[np.float64]
SAMPLE_HZ = 100.0
LEAST_POSES, LEAST_RATE_HZ = 60, 5.0
LEAST_TURN_RAD = 0.05
"""RMS of the turning to and fro without which nothing can be said."""
WORST_LIMIT_S = 0.01
WORST_MISFIT = 0.1
"""RMS of what headings of poses and of the robot disagree, by the RMS of the headings."""
ALIAS_RATIO, ALIAS_S = 3.0, 0.05
"""Another delay, further away than this, has to fit so much worse: even swings fit half a swing later, too."""
_LEAST_S, _MOST_S, _STEP_S = -0.2, 0.6, 0.0025
_PIECE_S = 2.0
_LEAST_IN_PIECE = 8
_LEAST_PIECES = 4.0
_ROUGH_ORDER = 3
_LONGEST_GAP_S = 0.06
_POLL_S = 0.002
_SETTLE_S = 1.0
"""The first answers of the clock come quickly one after another: the best of them is good."""


@dataclass(frozen=True)
class PoseLatency:
    """What poses and robot show of each other.

    ``latency_s``: how much older the poses are than they say, within ``limit_s`` in 95 of 100 cases. ``scale``: how far
    the robot turns by the poses, over what it believes. ``turned_rad``: to and fro together. ``clock_error_s``: what
    the robot's clock may be off by at most; it comes on top.
    """

    latency_s: float
    limit_s: float
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


def observe(source: MocapSource, robot: Robot, duration_s: float, timeout_s: float) -> Headings:
    """Watch poses and robot for ``duration_s``. Nothing moves, and the robot gets no fixes from here.

    ``source`` and the robot's connection must tell the same time. Raises LinkTimeoutError, and MocapLatencyError if the
    robot was restarted meanwhile, or gets fixes from elsewhere: it would follow the poses then.
    """
    clock, sync = robot.connection.clock, TimeSync(robot.connection)
    samples: list[Message] = []
    counted: list[Message] = []
    taken = {"OMNI_SAMPLE": samples, "OMNI_CONTROL": counted}
    remove = robot.connection.add_listener(lambda m: taken[m.get_type()].append(m) if m.get_type() in taken else None)
    seen: list[tuple[float, float]] = []
    worst_s = 0.0
    try:
        sync.wait(timeout_s)
        settled_s = clock() + _SETTLE_S
        while clock() < settled_s:
            sync.serve()
            robot.connection.poll(_POLL_S)
        for message, rate_hz in (("OMNI_SAMPLE", SAMPLE_HZ), ("OMNI_CONTROL", 5.0)):
            robot.set_message_interval(message, rate_hz)
        samples.clear()
        restarts = sync.restarts
        end_s = clock() + duration_s
        while clock() < end_s and not source.ended:
            # The link is waited for, not the poses: these have their time, but the clock's answer is timed when read.
            pose = source.read(0.0)
            robot.connection.poll(_POLL_S)
            sync.serve()
            best = sync.best
            if pose is not None and best is not None:
                worst_s = max(worst_s, best.error_s(clock()))
                seen.append((pose.taken_s + best.offset_s, pose.pose.theta))
    finally:
        remove()
        sync.close()
        with suppress(OmniError):  # whatever happened is more important
            for message in taken:
                robot.set_message_interval(message, None)
    if sync.restarts != restarts or any(b.time_us <= a.time_us for a, b in pairwise(samples)):
        raise MocapLatencyError("the robot restarted during the measurement", hint="measure again")
    if len(counted) < 2:
        raise MocapLatencyError("no report of pose fixes from the robot", hint="use a better link: USB")
    if counted[-1].fixes_accepted != counted[0].fixes_accepted:
        raise MocapLatencyError(
            "the robot receives pose fixes from another program", hint="end the mocap bridge, and measure again"
        )
    poses = np.array(seen, dtype=np.float64).reshape(-1, 2)
    motion = np.array([(m.time_us * 1e-6, m.pose[2]) for m in samples], dtype=np.float64).reshape(-1, 2)
    return Headings(poses[:, 0], poses[:, 1], motion[:, 0], motion[:, 1], worst_s)


def pose_latency(headings: Headings) -> PoseLatency:
    """Return the delay between both. Raises MocapLatencyError, with what to do, if they do not tell."""
    pair = _Pair(headings)
    turned_rad = float(np.std(pair.quick(pair.believed(0.0))))
    if turned_rad < LEAST_TURN_RAD:
        raise MocapLatencyError(
            f"the robot was turned to and fro by {turned_rad:.2f} rad RMS: too little",
            hint="turn it to the left and back by a quarter turn, about once a second, repeatedly",
        )
    delay_s, scale = _rough(pair)
    for _ in range(3):
        step_s, limit_s = _refined(pair, delay_s, scale)
        delay_s += step_s
    if not limit_s <= WORST_LIMIT_S:
        raise MocapLatencyError(
            f"the delay is about {1e3 * delay_s:.0f} ms, with a 95 % limit above {1e3 * WORST_LIMIT_S:.0f} ms",
            hint="turn the robot faster, all the time, without lifting it, and measure for longer",
        )
    turned_rad = float(np.sum(np.abs(np.diff(pair.believed(delay_s)))))
    return PoseLatency(delay_s, limit_s, len(pair.time_s), turned_rad, scale, headings.clock_error_s)


class _Pair:
    """The poses' headings, and the robot's at the same times or earlier. Raises MocapLatencyError if there are none."""

    def __init__(self, headings: Headings) -> None:
        robot_s, pose_s = headings.robot_s, headings.pose_s
        if len(robot_s) < 2:
            raise MocapLatencyError("the robot sent no OMNI_SAMPLE", hint="check that the firmware has this version")
        if float(np.median(np.diff(robot_s))) > _LONGEST_GAP_S:
            raise MocapLatencyError("the link is too slow to measure times of milliseconds", hint="connect by USB")
        if len(pose_s) < LEAST_POSES or float(np.median(np.diff(pose_s))) > 1.0 / LEAST_RATE_HZ:
            raise MocapLatencyError(
                f"{len(pose_s)} poses were received; {LEAST_POSES} are needed, and {LEAST_RATE_HZ:g} per second",
                hint="check that the cameras see the robot all the time",
            )
        # Only poses for which the robot's heading is known at every delay that is tried.
        known = (pose_s - _MOST_S > robot_s[0]) & (pose_s - _LEAST_S < robot_s[-1])
        gaps = np.flatnonzero(np.diff(robot_s) > _LONGEST_GAP_S)
        for begin_s, end_s in zip(robot_s[gaps], robot_s[gaps + 1], strict=True):
            known &= (pose_s - _LEAST_S < begin_s) | (pose_s - _MOST_S > end_s)
        if np.count_nonzero(known) < LEAST_POSES:
            raise MocapLatencyError(
                "the robot's samples and the poses hardly overlap in time", hint="measure longer, or use a better link"
            )
        self.time_s = pose_s[known]
        self._pose_rad = headings.pose_rad[known]
        self._robot_s, self._robot_rad = robot_s, np.unwrap(headings.robot_rad)
        place = 2.0 * (self.time_s - self.time_s[0]) / (self.time_s[-1] - self.time_s[0]) - 1.0
        self._slow: Array = np.linalg.qr(np.polynomial.legendre.legvander(place, _ROUGH_ORDER))[0]

    def believed(self, delay_s: float) -> Array:
        """Return the robot's heading so much before each pose."""
        heading: Array = np.interp(self.time_s - delay_s, self._robot_s, self._robot_rad)
        return heading

    def seen(self, believed: Array) -> Array:
        """Return the poses' headings without jumps of whole turns, also where poses are missing for a while."""
        apart: Array = np.unwrap(self._pose_rad - believed)
        return apart + believed

    def quick(self, values: Array) -> Array:
        """Return values without what changes slowly."""
        rest: Array = values - self._slow @ (self._slow.T @ values)
        return rest


def _rough(pair: _Pair) -> tuple[float, float]:
    """Return the delay at which ``poses = scale * robot`` fits best, and the scale."""
    delays = np.arange(_LEAST_S, _MOST_S, _STEP_S)
    fits = [_fit(pair, float(delay_s)) for delay_s in delays]
    misfits = np.array([misfit for _scale, misfit in fits])
    best = int(np.argmin(misfits))
    if misfits[best] > WORST_MISFIT:
        hint = "check that it is the right body, that the wheels stay on the floor, and that the latency is below 0.5 s"
        raise MocapLatencyError("the poses' rotation does not match the robot's", hint=hint)
    lowest = [n for n in range(1, len(delays) - 1) if misfits[n] <= min(misfits[n - 1], misfits[n + 1])]
    others = [misfits[n] for n in (0, *lowest, len(delays) - 1) if abs(delays[n] - delays[best]) > ALIAS_S]
    if min(others) < ALIAS_RATIO * misfits[best]:
        raise MocapLatencyError(
            "the robot was turned so evenly that several delays fit",
            hint="turn it irregularly, with varying speed and angle",
        )
    scale = fits[best][0]
    if scale < 0.0:
        raise MocapLatencyError(
            "the poses turn opposite to the robot",
            hint="counter-clockwise is positive: check the axes of the cameras, and W1_ENC_DIR … of the robot",
        )
    return float(delays[best]), scale


def _fit(pair: _Pair, delay_s: float) -> tuple[float, float]:
    believed = pair.believed(delay_s)
    pose, robot = pair.quick(pair.seen(believed)), pair.quick(believed)
    scale = float(pose @ robot / max(float(robot @ robot), 1e-12))
    rest = pose - scale * robot
    return scale, math.sqrt(float(rest @ rest) / max(float(pose @ pose), 1e-12))


def _refined(pair: _Pair, delay_s: float, scale: float) -> tuple[float, float]:
    """Return by how much the delay is too small [s], and the limit of its error (95 %), from pieces of the headings."""
    believed, step_s = pair.believed(delay_s), 1.0 / SAMPLE_HZ
    rest_rad = pair.seen(believed) - scale * believed
    rate_rad_s = scale * (pair.believed(delay_s - step_s) - pair.believed(delay_s + step_s)) / (2.0 * step_s)
    delays: list[float] = []
    weights: list[float] = []
    piece = np.floor((pair.time_s - pair.time_s[0]) / _PIECE_S)
    for number in np.unique(piece):
        here = piece == number
        if np.count_nonzero(here) < _LEAST_IN_PIECE:
            continue
        line = np.linalg.qr(np.column_stack((np.ones(int(here.sum())), pair.time_s[here])))[0]
        rest = rest_rad[here] - line @ (line.T @ rest_rad[here])
        rate = rate_rad_s[here] - line @ (line.T @ rate_rad_s[here])
        weight = float(rate @ rate)
        if weight > 0.0:
            delays.append(-float(rest @ rate) / weight)
            weights.append(weight)
    share = np.array(weights) / np.sum(weights)
    pieces = 1.0 / float(np.sum(share**2)) if len(weights) else 0.0
    if pieces < _LEAST_PIECES:
        return 0.0, math.inf
    mean = float(share @ delays)
    # A piece pulls the mean towards itself: that is what 1 - share takes back.
    variance = float(share**2 @ ((np.array(delays) - mean) ** 2 / (1.0 - share)))
    return mean, student_95(pieces - 1.0) * math.sqrt(variance)


def student_95(freedom: float) -> float:
    """Return the 97.5 % point of Student's t: the first terms of its series (Abramowitz and Stegun, 26.7.5)."""
    z = 1.959964
    first = (z**3 + z) / 4.0
    second = (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / 96.0
    third = (3.0 * z**7 + 19.0 * z**5 + 17.0 * z**3 - 15.0 * z) / 384.0
    return z + first / freedom + second / freedom**2 + third / freedom**3
