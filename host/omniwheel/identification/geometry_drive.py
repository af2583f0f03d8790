# SPDX-License-Identifier: MIT
"""Drives a connected robot through the runs that its geometry needs, within a room, with poses measured beside them.

Poses come from a motion-capture stream during each run, or from a tape measure between the runs. The robot drives by
its own dead reckoning; before each run its pose estimate is set to the measured pose, so that errors do not add up. The
last run is not used in the fit: its dead reckoning with the documented and with the found geometry is compared.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from omniwheel.capability.speeds import top_speed, top_turn_rate
from omniwheel.dialect import Message
from omniwheel.errors import DriveError, LimitError, MocapError, MocapLostError
from omniwheel.frames import Pose, relative_pose
from omniwheel.identification.dataset import Dataset
from omniwheel.identification.pose_fit.clock import measure_clock
from omniwheel.identification.pose_fit.scores import Score, score
from omniwheel.identification.pose_fit.study import GeometryStudy, identify_geometry
from omniwheel.identification.pose_fit.wheel_model import WheelModel
from omniwheel.identification.pose_fit.windows import Run, run_of
from omniwheel.identification.sources import from_messages
from omniwheel.logs.log import Array, Truth, WheelLog
from omniwheel.robot import Robot
from omniwheel.telemetry import Tracking

SAMPLE_HZ = 50.0
REST_S = 0.5
"""Rest at both ends of each run, which is recorded."""
MARGIN_M = 0.15
"""Free floor beyond the wheels, in which the robot may be wrong about its pose."""
LEAST_REACH_M = 0.4
"""Distance from the centre of the room to the goals below which runs are too short."""
SPEED_M_S = 0.25
"""Speed of the runs; slower for a robot that cannot go so fast."""
SPEED_SHARE, TURN_SHARE = 0.5, 0.4
"""Shares of the robot's top speed and top turn rate that are used together at most."""
TURN_RAD_S = 0.8
LEAST_SPEED_M_S = 0.01
LARGEST_STEP_M, LARGEST_STEP_RAD = 0.03, 0.1
"""Distance by which the estimate of a robot at rest may differ from the pose that was set."""
SETTLED_S = 1.0
TRUTH_TIMEOUT_S = 3.0
LONGEST_GAP_S = 3.0
"""Time without a measured pose after which a slow run ends; a faster one ends sooner (:func:`longest_gap_s`)."""
GAP_SHARE = 0.5
"""Share of the margin that is driven without a pose; in the rest the robot brakes."""
LEAST_POSES = 20
DIRECTIONS = 24
LOOP_SHARE = 0.7
"""Share of the reach for runs of several legs, on which the errors of the dead reckoning add up."""
BEND_RAD = 0.5
"""Turn during a straight run: each wheel rolls in each run, so that a dead encoder shows."""
TURNS_RAD = 4.0 * math.pi
"""Turn on the spot to each side."""

Tell = Callable[[str], None]


class MeasuredPose(Protocol):
    """A pose of a stream and when it was taken [s], on the stream's clock."""

    @property
    def pose(self) -> Pose:
        """World pose."""
        ...

    @property
    def taken_s(self) -> float:
        """Time of exposure [s]."""
        ...


class PoseStream(Protocol):
    """Motion capture, as of :mod:`omniwheel.mocap.source`."""

    def clock(self) -> float:
        """Return the present time [s]."""
        ...

    def read(self, timeout_s: float) -> MeasuredPose | None:
        """Return the next pose, waiting up to ``timeout_s``; None if there is none. Raises MocapError."""
        ...


@dataclass(frozen=True)
class RunPlan:
    """Goals of one run in the room, or a turn on the spot. The origin is where the robot stood first, x ahead of it."""

    name: str
    goals: tuple[Pose, ...] = ()
    turn_rad: float = 0.0


@dataclass(frozen=True)
class Pace:
    """Largest speed [m/s] and turn rate [rad/s] of the runs: both together are possible in all directions."""

    speed_m_s: float
    turn_rad_s: float

    def leg_speed(self, start: Pose, goal: Pose) -> float:
        """Return the speed [m/s] of a straight leg on which the robot also turns."""
        distance_m = math.hypot(goal.x - start.x, goal.y - start.y)
        turn = abs(math.remainder(goal.theta - start.theta, math.tau))
        return max(distance_m / max(distance_m / self.speed_m_s, turn / self.turn_rad_s, 1e-3), LEAST_SPEED_M_S)


@dataclass(frozen=True)
class DrivenGeometry:
    """The geometry from the runs, and the ``check`` run, which was not used: its errors before and after."""

    study: GeometryStudy
    logs: tuple[WheelLog, ...]
    before: Score
    after: Score

    @property
    def is_better(self) -> bool:
        """Whether the found geometry predicts the check run better than the documented one."""
        return self.after.rms_m < self.before.rms_m


def planned_runs(reach_m: float) -> list[RunPlan]:
    """Return the runs within ``reach_m`` of the centre: straight, sideways, diagonal, turns both ways; last the check.

    Each begins where the one before ended; the first at the centre.
    """
    h = reach_m
    near = LOOP_SHARE * h
    corners = ((near, 0.0), (0.0, near), (-near, 0.0), (0.0, -near))
    quarter = 0.5 * math.pi
    loop = tuple(Pose(x, y, math.remainder(quarter * (n + 1), math.tau)) for n, (x, y) in enumerate(corners))
    back = tuple(
        Pose(x, y, math.remainder(-quarter * (n + 1), math.tau))
        for n, (x, y) in enumerate((*corners[2::-1], corners[3]))
    )
    return [
        RunPlan("ahead", (Pose(h, 0.0, BEND_RAD),)),
        RunPlan("astern", (Pose(-h, 0.0, 0.0),)),
        RunPlan("diagonal", (Pose(0.0, h, -BEND_RAD),)),
        RunPlan("sideways", (Pose(0.0, -h, 0.0),)),
        RunPlan("left turns", turn_rad=TURNS_RAD),
        RunPlan("right turns", turn_rad=-TURNS_RAD),
        RunPlan("left loop", loop),
        RunPlan("right loop", back),
        RunPlan(
            "check",
            (
                Pose(near, 0.5 * near, 2.0),
                Pose(-near, near, -2.2),
                Pose(-near, -near, -0.5),
                Pose(near, -near, 1.2),
                Pose(0.0, near, 3.0),
            ),
        ),
    ]


def reach_m(room_m: float, layout: WheelModel) -> float:
    """Return how far the robot's centre may go from the centre of a square room. Raises LimitError for a small one."""
    outside = layout.distance_m + layout.radius_m + MARGIN_M
    reach = 0.5 * room_m - outside
    if not reach >= LEAST_REACH_M:
        needed = 2.0 * (LEAST_REACH_M + outside)
        raise LimitError(
            f"the runs need a free square of {needed:.2f} m around the robot; {room_m:g} m are free",
            hint=f"--room {math.ceil(10.0 * needed) / 10.0:g} if that is free; the larger, the more accurate",
        )
    return reach


def longest_gap_s(speed_m_s: float) -> float:
    """Return how long [s] a robot of this speed may drive without a measured pose: it stops within the margin."""
    return min(LONGEST_GAP_S, GAP_SHARE * MARGIN_M / speed_m_s)


class Tape:
    """Poses from a tape measure: ``ask`` returns the robot's pose in the room, at rest, after the run of that name."""

    def __init__(self, ask: Callable[[str], Pose]) -> None:
        self._ask = ask

    def at_rest(self, where: str) -> Pose:
        """Return the pose after a run; that of the start is the origin of the room."""
        return self._ask(where)

    def begin(self) -> None:
        """Begin a run."""

    def take(self) -> None:
        """Take what has been measured: nothing while the robot drives."""

    def require_recent(self, gap_s: float) -> None:
        """Nothing is known while the robot drives."""

    def check(self, largest_m: float, gap_s: float) -> None:
        """Nothing is known while the robot drives."""

    def truth(self, data: Dataset, start: Pose, end: Pose) -> Truth:
        """Return both ends of the run."""
        ends = np.array([start, end])
        return Truth(data.time_s[[0, -1]], ends[:, :2], ends[:, 2], same_clock=True)


class Stream:
    """Poses from motion capture; ``tracked`` is the tracked body in the robot's frame (FIX_X, FIX_Y, FIX_TH)."""

    def __init__(self, source: PoseStream, tracked: Pose, pump: Callable[[float], None]) -> None:
        self._source, self._tracked, self._pump = source, tracked, pump
        self._home: Pose | None = None
        self._rows: list[tuple[float, Pose]] = []
        self._error: MocapError | None = None
        self._begun_s = source.clock()

    def at_rest(self, where: str) -> Pose:
        """Return where the robot is now, by a fresh pose; the first one is the origin. Raises MocapLostError."""
        asked_s, left_s = self._source.clock(), TRUTH_TIMEOUT_S
        while not self._rows or self._rows[-1][0] < asked_s:
            if left_s <= 0.0:
                raise MocapLostError(
                    f"no pose of the robot for {TRUTH_TIMEOUT_S:g} s ({where})", hint="check that the cameras see it"
                )
            self._pump(1.0 / SAMPLE_HZ)
            left_s -= 1.0 / SAMPLE_HZ
            self.take()
            self._raise()
        body = self._centre(self._rows[-1][1])
        if self._home is None:
            self._home = body
        return relative_pose(self._home, body)

    def begin(self) -> None:
        """Begin a run: forget what was measured before."""
        self.take()
        self._rows.clear()
        self._begun_s = self._source.clock()

    def take(self) -> None:
        """Take the poses that have arrived."""
        try:
            while (measured := self._source.read(0.0)) is not None:
                self._rows.append((measured.taken_s, measured.pose))
        except MocapError as error:
            self._error = error

    def require_recent(self, gap_s: float) -> None:
        """Raise MocapError unless a pose has come since the run began, taken within ``gap_s`` [s]."""
        self.take()
        self._raise()
        if not self._rows or self._source.clock() - self._rows[-1][0] > gap_s:
            raise MocapLostError(
                f"no pose of the robot within {gap_s:.2g} s before the run", hint="check that the cameras see it"
            )

    def check(self, largest_m: float, gap_s: float) -> None:
        """Raise DriveError where the robot is outside of the room, MocapError after ``gap_s`` without a pose.

        Until the first pose of a run comes, the time since its begin counts.
        """
        self.take()
        self._raise()
        last_s = self._rows[-1][0] if self._rows else self._begun_s
        if self._source.clock() - last_s > gap_s:
            raise MocapLostError(f"no pose of the robot for {gap_s:.2g} s", hint="check that the cameras see it")
        if not self._rows or self._home is None:
            return
        here = relative_pose(self._home, self._centre(self._rows[-1][1]))
        if max(abs(here.x), abs(here.y)) > largest_m:
            raise DriveError(
                f"the robot left its room: it is at {here.x:.2f}, {here.y:.2f} m from the centre",
                hint="check the wheels, the encoders and wheel_radius_m, then give it more room",
            )

    def truth(self, data: Dataset, start: Pose, end: Pose) -> Truth:
        """Return the poses of the run, on the stream's clock from its first pose on. Raises MocapLostError."""
        self._raise()
        rows = sorted(dict(self._rows).items())
        if len(rows) < LEAST_POSES:
            raise MocapLostError(f"{len(rows)} poses in a run; at least {LEAST_POSES} are needed")
        time = np.array([taken for taken, _ in rows])
        pose = np.array([pose for _, pose in rows])
        return Truth(time - time[0] + data.time_s[0], pose[:, :2], np.unwrap(pose[:, 2]))

    def _centre(self, measured: Pose) -> Pose:
        """Return the wheels' centre of a pose of the tracked body."""
        theta = measured.theta - self._tracked.theta
        c, s = math.cos(theta), math.sin(theta)
        x, y, _ = self._tracked
        return Pose(measured.x - c * x + s * y, measured.y - s * x - c * y, theta)

    def _raise(self) -> None:
        if self._error is not None:
            raise self._error


@dataclass
class _Recorder:
    """Keeps the OMNI_SAMPLE of a run and takes the poses beside it."""

    truth: Tape | Stream
    samples: list[Message] = field(default_factory=list)

    def __call__(self, message: Message) -> None:
        if message.get_type() == "OMNI_SAMPLE":
            self.samples.append(message)
            self.truth.take()


def drive_geometry(
    robot: Robot,
    layout: WheelModel,
    room_m: float,
    truth: Tape | Stream,
    tell: Tell = lambda _: None,
    *,
    speed_m_s: float | None = None,
    save: Callable[[WheelLog], None] = lambda _: None,
) -> list[WheelLog]:
    """Drive the runs and return their logs, the check run last. The robot is at rest and disarmed at the end.

    Nothing moves if the room is too small, the robot is another one, cannot drive so fast, or no pose comes. ``save``
    gets each log when its run has ended, so that a later failure does not lose it. Raises LimitError, DriveError,
    StoppedError, MocapError, LinkError, DatasetError, and what ``save`` raises.
    """
    reach = reach_m(room_m, layout)
    inside_m = 0.5 * room_m - layout.distance_m - layout.radius_m
    wheels = int(robot.parameters["WHEELS"])
    if wheels != layout.wheels:
        raise DriveError(f"the robot has {wheels} wheels; the robot file has {layout.wheels}", hint="correct --robot")
    pace = _pace(robot, speed_m_s)
    names = ("ENC_CPR", *(f"W{wheel + 1}_ENC_DIR" for wheel in range(wheels)))
    parameters = {name: robot.parameters[name] for name in names} | {"WHEELS": float(wheels)}
    if robot.status.armed:
        raise DriveError("the robot is armed: another program may drive it", hint="disarm it first: omni stop")
    logs = []
    start = truth.at_rest("start")
    robot.set_message_interval("OMNI_SAMPLE", SAMPLE_HZ)
    try:
        for plan in planned_runs(reach):
            tell(plan.name)
            data, end = _drive(robot, plan, truth, start, inside_m, pace, parameters)
            measured = truth.truth(data, start, end)
            logs.append(_log(plan.name, data, parameters["ENC_CPR"], measured))
            save(logs[-1])
            start = end
    finally:
        robot.set_message_interval("OMNI_SAMPLE", None)
    return logs


def _pace(robot: Robot, wanted_m_s: float | None) -> Pace:
    """Return the pace of the runs. Raises LimitError for a speed that the robot cannot drive in all directions."""
    model = robot.drive_model()
    slowest = min((top_speed(model, math.tau * k / DIRECTIONS) for k in range(DIRECTIONS)), key=lambda b: b.value)
    most = SPEED_SHARE * slowest.value
    turn_rad_s = min(TURN_RAD_S, TURN_SHARE * top_turn_rate(model).value)
    if wanted_m_s is None:
        return Pace(min(SPEED_M_S, most), turn_rad_s)
    if not LEAST_SPEED_M_S <= wanted_m_s <= most:
        raise LimitError(
            f"a speed of {wanted_m_s:g} m/s is not possible; the runs go from {LEAST_SPEED_M_S:g} m/s to half of this "
            f"robot's top speed, {most:.3g} m/s ({slowest.cause})",
            hint=f"use {math.floor(1000.0 * most) / 1000.0:g} m/s or less",
        )
    return Pace(wanted_m_s, turn_rad_s)


def _drive(
    robot: Robot,
    plan: RunPlan,
    truth: Tape | Stream,
    start: Pose,
    inside_m: float,
    pace: Pace,
    parameters: dict[str, float],
) -> tuple[Dataset, Pose]:
    """Drive one run from rest to rest, disarmed at the end; return what was recorded and where the robot is then."""
    _set_estimate(robot, start)
    gap_s = longest_gap_s(pace.speed_m_s)

    def check(_: Tracking) -> None:
        truth.check(inside_m, gap_s)

    recorder = _Recorder(truth)
    remove = robot.connection.add_listener(recorder)
    try:
        truth.begin()
        robot.pump(REST_S)
        truth.require_recent(gap_s)
        robot.arm()
        here = start
        for goal in plan.goals:
            robot.drive_to(*goal, speed=pace.leg_speed(here, goal), progress=check)
            here = goal
        if plan.turn_rad:
            rate = math.copysign(pace.turn_rad_s, plan.turn_rad)
            robot.drive(0.0, 0.0, rate, plan.turn_rad / rate, progress=check)
        robot.pump(REST_S)
    finally:
        try:
            robot.disarm()
        finally:
            remove()
    robot.pump(REST_S)
    data = from_messages(recorder.samples, plan.name, parameters)
    return data, truth.at_rest(plan.name)


def _set_estimate(robot: Robot, start: Pose) -> None:
    """Set the estimate of the robot, disarmed and at rest. Raises DriveError where something else moves it."""
    robot.set_pose_estimate(*start)
    robot.pump(SETTLED_S)
    here = robot.wait_for(Tracking).pose
    turned = abs(math.remainder(here.theta - start.theta, math.tau))
    if math.hypot(here.x - start.x, here.y - start.y) > LARGEST_STEP_M or turned > LARGEST_STEP_RAD:
        raise DriveError(
            f"the robot's estimate went to {here.x:.2f}, {here.y:.2f} m after it was set to {start.x:.2f}, "
            f"{start.y:.2f} m",
            hint="end the program that sends it pose fixes (omni mocap): this command sets the pose itself",
        )


def _log(name: str, data: Dataset, counts_per_revolution: float, truth: Truth) -> WheelLog:
    assert data.wheel_angle_rad is not None
    counts = np.round(data.wheel_angle_rad * counts_per_revolution / (2.0 * np.pi))
    return WheelLog(
        name=name,
        period_s=data.period_s,
        counts_per_revolution=round(counts_per_revolution),
        time_s=data.time_s,
        counts=np.diff(counts, axis=0, prepend=counts[:1]),
        good=np.ones(counts.shape, dtype=bool),
        duty=np.zeros(counts.shape),
        heading_rad=np.full(len(data.time_s), np.nan),
        truth=truth,
    )


def fit_driven(logs: Sequence[WheelLog], layout: WheelModel) -> DrivenGeometry:
    """Fit the geometry to all runs but the last, and score the last with both geometries. Raises LogError."""
    runs = [run_of(log, log.name, layout) for log in logs]
    study = identify_geometry(runs[:-1], layout)
    nominal, found = layout.matrix(layout.nominal), study.whole.plain_matrix
    return DrivenGeometry(study, tuple(logs), _scored(runs[-1], nominal), _scored(runs[-1], found))


def _scored(run: Run, matrix: Array) -> Score:
    return score(run, matrix, None if run.same_clock else measure_clock(run, matrix))
