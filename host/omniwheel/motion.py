# SPDX-License-Identifier: MIT
"""Motions of a connected robot that end by themselves, or raise why not: :class:`MovingRobot`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from omniwheel.capability.reach import check_velocity
from omniwheel.capability.speeds import top_turn_rate
from omniwheel.capability.travel import profile_time_s, travel_time_s, turn_acceleration
from omniwheel.driven import Driven, DrivenPath, Progress
from omniwheel.errors import (
    DriveError,
    LimitError,
    LinkError,
    OmniError,
    SetpointError,
    StoppedError,
)
from omniwheel.frames import Pose, Twist
from omniwheel.motion_profile import Profile, profile
from omniwheel.motion_watch import Motion, ended_by, latest_tracking
from omniwheel.robot_base import SETPOINT_PERIOD_S, RobotBase
from omniwheel.setpoints import finite, pose_target, velocity_target

if TYPE_CHECKING:
    from omniwheel.drawn_path import DrawnPath

PATIENCE, PATIENCE_S = 1.5, 3.0
"""Time that a drive may take unless told otherwise: factor of the one that it should take, and what is added."""
FASTEST = 0.8
"""A timeout below this fraction of the time that a drive should take is refused."""
FRAMES = ("world", "body")
_ANOTHER_MOTION = "another motion"
_RAMP_SHARE = 0.5
"""Share of LIM_A with which a drive of a given speed gains it."""


class MovingRobot(RobotBase):
    """The part of :class:`omniwheel.Robot` that drives somewhere.

    Every motion begins where the last one ended, and after it the robot holds its pose until the next one. A motion
    ends early with StoppedError if the robot stops itself, if another station or program stops it, or if another thread
    of this program begins another motion. Then, and after Ctrl-C, the robot is at rest.
    """

    _motion = 0
    """Number of the latest motion. One that finds another number here has been replaced."""
    _latest_call = ""
    """What began with the latest number: another motion, or a method that stops."""
    _latest_stop = ""
    """The last of the methods that stop: one that comes before a motion begins ends it, too."""
    _stream: Callable[[], None] | None = None
    """The setpoint that is repeated for the latest motion."""

    def arm(self) -> None:
        """Power the motors, within 5 s if wheels still turn. Raises ArmingRefusedError with the robot's reasons.

        What an earlier motion repeated is over: the robot holds until the next motion.
        """
        drove = self.connection.end_repeating(self._stream)
        if drove:
            self._begin()
        super().arm()
        if drove:
            self.stop_trajectory()

    # ---- to a pose

    def drive_to(
        self,
        x: float,
        y: float,
        heading: float | None = None,
        *,
        speed: float | None = None,
        frame: str = "world",
        timeout_s: float | None = None,
        progress: Progress | None = None,
    ) -> DrivenPath:
        """Drive to a pose and return on arrival: within 5 mm and 0.02 rad for 0.2 s. Then the robot holds the goal.

        ``x``, ``y`` [m] and ``heading`` [rad, counter-clockwise; None: as now] are in the ``frame`` "world", or "body":
        ahead, to the left, and turned from where the robot is now. With ``speed`` [m/s] it drives a straight line, with
        ramps of half of LIM_A. Without, it is as fast as TRJ_MARGIN, LIM_V, LIM_A and LIM_WHEEL let it. ``timeout_s``:
        1.5 × :meth:`travel_time_s` + 3 s unless given. ``progress`` is called with each :class:`Tracking`.
        A motion that is asked for meanwhile ends this one: StoppedError.

        Raises LimitError before anything moves if the robot cannot go there, so fast, or in this time; NotArrivedError
        if it is not there in time; StoppedError; LinkError.
        """
        stops = self._require_armed()
        goal = self.goal(x, y, heading, frame)
        allowed_s = self.allowed_time_s(goal, timeout_s, speed=speed)
        line = None if speed is None else self._profile(goal, speed)
        start_s = self.connection.clock()

        def ask() -> None:
            pose, twist = (goal, None) if line is None else line.at(self.connection.clock() - start_s)
            self.send(pose_target(self.connection, pose, twist))

        with self._moving(ask, goal, progress, stops) as motion:
            while not motion.is_at_goal() or (line is not None and motion.time_s < line.duration_s):
                if motion.time_s > allowed_s or motion.is_stuck():
                    raise motion.not_arrived()
                motion.wait()
            line, motion.holds_goal = None, True  # the last setpoint is the goal itself
        return motion.driven_path

    def turn_to(
        self,
        heading: float,
        *,
        frame: str = "world",
        timeout_s: float | None = None,
        progress: Progress | None = None,
    ) -> DrivenPath:
        """Turn on the spot to a heading [rad], the shorter way; as :meth:`drive_to`."""
        if frame not in FRAMES:
            raise _unknown_frame(frame)
        here = latest_tracking(self).reference
        there = finite("heading", heading) + (here.theta if frame == "body" else 0.0)
        wrapped = math.remainder(there, math.tau) if frame == "body" else there
        return self.drive_to(here.x, here.y, wrapped, timeout_s=timeout_s, progress=progress)

    def goal(self, x: float, y: float, heading: float | None = None, frame: str = "world") -> Pose:
        """Return the world pose that :meth:`drive_to` would drive to. Raises SetpointError, LimitError."""
        if frame not in FRAMES:
            raise _unknown_frame(frame)
        here = latest_tracking(self).reference
        x, y = finite("x", x), finite("y", y)
        turn = None if heading is None else finite("heading", heading)
        if frame == "world":
            return Pose(x, y, math.remainder(here.theta, math.tau) if turn is None else turn)
        c, s = math.cos(here.theta), math.sin(here.theta)
        theta = math.remainder(here.theta + (turn or 0.0), math.tau)
        return Pose(here.x + c * x - s * y, here.y + s * x + c * y, theta)

    def travel_time_s(self, goal: Pose, speed: float | None = None) -> float:
        """Return how long :meth:`drive_to` takes to a world pose on a free floor [s], to about a tenth.

        Raises LimitError for a pose out of reach.
        """
        self.require_pose(*goal)
        if speed is not None:
            return profile_time_s(self._profile(goal, speed))
        margin = self.parameters["TRJ_MARGIN"]
        return travel_time_s(self.drive_model(), latest_tracking(self).reference, goal, margin)

    def allowed_time_s(self, goal: Pose, timeout_s: float | None = None, *, speed: float | None = None) -> float:
        """Return how long a drive to a world pose may take [s]: ``timeout_s``, or 1.5 × :meth:`travel_time_s` + 3 s.

        Raises LimitError for a pose out of reach, or a time in which the robot cannot be there.
        """
        needed_s = self.travel_time_s(goal, speed)
        if timeout_s is None:
            return PATIENCE * needed_s + PATIENCE_S
        if timeout_s < FASTEST * needed_s:
            here = latest_tracking(self).pose
            distance_m = math.hypot(here.x - goal.x, here.y - goal.y)
            raise LimitError(
                f"{distance_m:.2f} m take this robot about {needed_s:.1f} s; the time given is {timeout_s:g} s",
                hint="give it more time or none, or see what limits the robot: omni robots check",
                limit="time",
                asked=timeout_s,
                possible=needed_s,
            )
        return timeout_s

    def _profile(self, goal: Pose, speed: float) -> Profile:
        """Return the straight line to a pose; LimitError if the robot cannot be so fast on it."""
        if not finite("speed", speed) > 0.0:
            raise SetpointError(f"speed is {speed:g} m/s; more than 0 is needed")
        model = self.drive_model()
        acceleration = _RAMP_SHARE * model.acceleration_limit_m_s2
        here = latest_tracking(self).reference
        turn_rad_s, turn_rad_s2 = _RAMP_SHARE * top_turn_rate(model).value, _RAMP_SHARE * turn_acceleration(model)
        line = profile(here, goal, speed, turn_rad_s, acceleration, turn_rad_s2)
        distance = math.hypot(goal.x - here.x, goal.y - here.y)
        if distance > 0.0:  # at the speed itself, too, even if the line is too short to reach it
            along = Twist(speed * (goal.x - here.x) / distance, speed * (goal.y - here.y) / distance, 0.0)
            check_velocity(model, along, here.theta)
        check_velocity(model, line.cruise, here.theta, line.turn_rad)
        return line

    # ---- along a path

    def follow(
        self,
        path: Any,
        *,
        speed: float = 0.2,
        heading: float | None = None,
        laps: float = 1.0,
        timeout_s: float = math.inf,
        progress: Progress | None = None,
    ) -> DrivenPath:
        """Follow a line on the floor on a smooth path without stops, and return at its end. Then the robot holds.

        It drives to the first point before, straight from where it is. What limits it are LIM_WHEEL, TRJ_MARGIN and
        LIM_A.

        ``path``: world positions x, y [m] as a sequence, a NumPy array (n, 2), an object with ``coords`` (shapely), or
        a CSV file of them; or a :class:`~omniwheel.drawn_path.DrawnPath`. The robot plans it itself, and slows down
        to what its limits need. ``speed`` [m/s], ``heading`` [rad] to keep (None: along the path), ``laps`` as of
        :func:`~omniwheel.drawn_path.drawn_path`. Raises DrawnPathError, LimitError, NotArrivedError, StoppedError.
        """
        stops = self._require_armed()
        line = as_path(path, speed, heading, laps)
        line.require(self)
        goal = line.points[-1] if 0.0 < line.laps <= 1.0 else None
        with self._moving(None, goal, progress, stops) as motion:
            line.start(self)
            motion.until_path_done(timeout_s)
        return motion.driven_path

    def follow_trajectory(
        self,
        type: str | int | None = None,  # noqa: A002
        laps: float | None = None,
        period_s: float | None = None,
        *,
        timeout_s: float = math.inf,
        progress: Progress | None = None,
    ) -> DrivenPath:
        """Follow the on-board trajectory to its end, as :meth:`start_trajectory` takes it. Then the robot holds.

        Raises NotArrivedError after ``timeout_s``, StoppedError, CommandRefusedError.
        """
        stops = self._require_armed()
        with self._moving(None, None, progress, stops) as motion:
            self.start_trajectory(type, laps, period_s)
            motion.until_path_done(timeout_s)
        return motion.driven_path

    # ---- with a velocity

    def drive(
        self,
        vx: float,
        vy: float,
        wz: float,
        duration: float,
        *,
        frame: str = "body",
        progress: Progress | None = None,
    ) -> Driven:
        """Drive with a velocity [m/s, m/s, rad/s] for ``duration`` [s], come to rest, and hold.

        ``frame``: "body" or "world". Raises LimitError before anything moves if the robot cannot follow it,
        StoppedError.
        """
        stops = self._require_armed()
        if finite("duration", duration) <= 0.0:
            raise SetpointError(f"duration is {duration:g} s; must be above 0")
        self.require_velocity(vx, vy, wz, frame=frame, duration_s=duration)
        with self._moving(self._velocity(vx, vy, wz, frame), None, progress, stops) as motion:
            while motion.time_s < duration:
                motion.wait(duration - motion.time_s)
            self._come_to_rest(motion)
        return motion.driven

    def velocity(self, vx: float, vy: float, wz: float, *, frame: str = "body") -> None:
        """Drive with a velocity [m/s, m/s, rad/s] until the next motion, :meth:`stop` or :meth:`hold`; returns at once.

        The velocity is sent again and again while the link is served: always with :func:`omniwheel.connect`, while
        something waits with :mod:`omniwheel.sync`. It ends when the robot stops; the next motion raises why. Raises
        LimitError if the robot cannot follow it, StoppedError.
        """
        stops = self._require_armed()
        self.require_velocity(vx, vy, wz, frame=frame)
        with self.connection.monitor:
            self._begin(stops=stops)
            self._repeat(self._velocity(vx, vy, wz, frame))

    # ---- to rest

    def stop(self) -> None:
        """End every motion: brake with LIM_A, then hold the pose, armed. Nothing happens to a robot that is not armed.

        One that another station or program drives now holds at once, as with :meth:`hold`. A motion that another thread
        waits for raises StoppedError. No callback's error ends this.
        """
        number = self._begin("robot.stop()")
        if self._may_drive():
            with suppress(StoppedError), self._moving(None, None, None, call="robot.stop()") as motion:
                number, motion.quiet = motion.number, True
                self._come_to_rest(motion)
                return
        if self.status.armed and self._motion == number:
            self.connection.repeat(None)
            self.stop_trajectory()

    def hold(self) -> None:
        """End every motion and hold the present pose, armed; of one that is fast, :meth:`stop` brakes more gently."""
        self._begin("robot.hold()")
        self.connection.repeat(None)
        self.stop_trajectory()

    def disarm(self) -> None:
        """Power the motors off; always possible."""
        with self._ending_motions("robot.disarm()"):
            super().disarm()

    def estop(self) -> None:
        """Power the motors off at once, latched until :meth:`estop_clear`. The robot rolls on; :meth:`stop` brakes."""
        with self._ending_motions("robot.estop()"):
            super().estop()

    @contextmanager
    def _ending_motions(self, by: str) -> Iterator[None]:
        """End what moves the robot, and what another thread begins meanwhile; also if the robot does not answer."""
        self._forget_motion(by)
        try:
            yield
        finally:
            self._forget_motion(by)

    def _forget_motion(self, by: str) -> None:
        self._begin(by)
        self.connection.repeat(None)

    # ---- what motions have in common

    def _may_drive(self) -> bool:
        return (self.armed_here or self.status.armed) and not self.guard.is_over

    def _require_armed(self) -> int:
        """Return how many stops there have been; raise DriveError if the robot is not armed."""
        stops = self._stops
        self.guard.check()
        if not (self.armed_here or self.status.armed):
            if self.status.state == "estop":
                raise DriveError(
                    "the emergency stop is on, so the robot cannot drive",
                    hint="release it, then arm: robot.estop_clear(), robot.arm()",
                )
            raise DriveError("the robot is not armed, so it cannot drive", hint="arm it first: robot.arm()")
        self.guard.join()
        return stops

    def _velocity(self, vx: float, vy: float, wz: float, frame: str = "body") -> Callable[[], None]:
        """Return what sends a velocity as the motion's own setpoint."""
        return lambda: self.send(velocity_target(self.connection, Twist(vx, vy, wz), frame))

    def _end_stream(self) -> None:
        if self.connection.end_repeating(self._stream):
            self._begin()

    def _repeat(self, ask: Callable[[], None]) -> None:
        """Send a setpoint now, and again and again while the link is served and the robot drives."""

        def ask_while_driving() -> None:
            if self.guard.is_over:
                self.connection.repeat(None)
            else:
                ask()

        with self.connection.monitor:
            ask()
            self._stream = ask_while_driving
            self.connection.repeat(ask_while_driving, SETPOINT_PERIOD_S)

    @contextmanager
    def _moving(
        self,
        ask: Callable[[], None] | None,
        goal: Pose | None,
        progress: Progress | None,
        stops: int | None = None,
        call: str = _ANOTHER_MOTION,
    ) -> Iterator[Motion]:
        """Watch a motion while the context lasts; then hold. ``ask`` is the setpoint that is repeated, if there is one.

        ``stops`` is how many there had been when the motion was asked for: StoppedError if one has come since.
        ``call`` is what a motion that this one replaces says.
        If the motion ends by an error, the robot is brought to rest, as far as it can be reached.
        """
        motion = Motion(self, self._begin(call, stops), self._replaced_by, goal, progress)
        try:
            if ask is None:
                self.connection.repeat(None)
            else:
                self._repeat(ask)
            yield motion
            self._end(motion)
        except (StoppedError, LinkError):
            if self._motion == motion.number:
                self.connection.repeat(None)
            raise
        except BaseException:  # Ctrl-C, too
            if self._motion == motion.number:
                with suppress(OmniError):
                    self.stop()
            raise
        finally:
            motion.close()

    def _end(self, motion: Motion) -> None:
        """Hold the goal at the end of a motion, or where the robot is if there is none."""
        with self.connection.monitor:
            motion.check()
            if motion.holds_goal and self._stream is not None:
                self._stream()  # the last of a stream that ends at its pose
            self.connection.repeat(None)
        if not motion.holds_goal:
            self.stop_trajectory()
        motion.finish()

    def _come_to_rest(self, motion: Motion) -> None:
        """Ask for velocity zero until the robot's reference is at rest. Raises StoppedError."""
        self._repeat(self._velocity(0.0, 0.0, 0.0))
        motion.until_at_rest()

    def _replaced_by(self, number: int) -> str:
        """Return what has taken the place of the motion of a number; "" if nothing has."""
        return self._latest_call if self._motion != number else ""

    def _require_no_stop_since(self, stops: int) -> None:
        if stops != self._stops:
            raise ended_by(self._latest_stop)

    def _begin(self, call: str = _ANOTHER_MOTION, stops: int | None = None) -> int:
        """Return the number of a new motion; ``call`` is what ended the one before."""
        with self.connection.monitor:
            if stops is not None:
                self._require_no_stop_since(stops)
            self._motion += 1
            self._latest_call = call
            if call != _ANOTHER_MOTION:
                self._stops, self._latest_stop = self._stops + 1, call
            return self._motion


def as_path(path: Any, speed: float, heading: float | None, laps: float) -> DrawnPath:
    """Return what the robot is given for a line in any form that :meth:`MovingRobot.follow` takes."""
    from omniwheel.drawn_path import DrawnPath, drawn_path, read_line

    if isinstance(path, DrawnPath):
        return path
    if isinstance(path, str | Path):
        path = read_line(Path(path))
    points = [list(point)[:2] for point in getattr(path, "coords", path)]
    return drawn_path(points, speed, heading_rad=heading, laps=laps)


def _unknown_frame(frame: str) -> SetpointError:
    return SetpointError(f"the frame is {frame!r}; allowed are {', '.join(FRAMES)}")
