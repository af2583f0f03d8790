# SPDX-License-Identifier: MIT
"""Runs one excitation on a connected robot: arms, keeps setpoints coming, watches, records, disarms.

Everything that an experiment needs of a robot stands here once. What is excited, and what is made of the burst, is the
matter of each experiment.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from omniwheel.burst import Burst
from omniwheel.errors import LimitError, StoppedError
from omniwheel.frames import Pose
from omniwheel.robot import Robot
from omniwheel.tuning import ExperimentError

REPEAT_S = 0.15
"""How often a setpoint is sent: beside telemetry, a radio of 9600 baud carries no more.

One that is lost must not make the last older than SAFE_CMD_TO, 0.5 s by default: so it cannot be much longer.
"""
MODE_TIMEOUT_S = 5.0
SILENT_S = 3.0
TAIL_S = 0.3
"""How long the burst goes on after the excitation, so that the answer has died away."""
SLACK_M = 0.05
SLIP_SHARE, SLIP_M_S = 0.5, 0.03
"""Slipping is a slip speed beyond this share of the rims' speed, and beyond this."""

Tell = Callable[[str], None]


@dataclass(frozen=True)
class Claims:
    """What an experiment will use.

    ``room_m``: side of the square that the robot needs around where it stands; 0 on a stand. ``travel_m``: how far
    its centre goes. ``wheel_rad_s``, ``rim_m_s``: fastest wheel. ``turn_rad_s``: turn rate. ``duty``: largest duty.
    """

    room_m: float
    travel_m: float
    wheel_rad_s: float
    rim_m_s: float
    turn_rad_s: float
    duty: float

    def sentence(self) -> str:
        """Return it for a person."""
        room = f"a square of {self.room_m:.2f} m" if self.room_m > 0.0 else "no free floor (wheels lifted)"
        return (
            f"needs {room}; wheels up to {self.wheel_rad_s:.3g} rad/s ({self.rim_m_s:.3g} m/s), "
            f"turning at {self.turn_rad_s:.3g} rad/s, duty up to {self.duty:.2f}"
        )


@dataclass(frozen=True)
class Excitation:
    """As :meth:`omniwheel.robot.Robot.excite` takes it."""

    place: str
    which: int
    amplitude: float
    duration_s: float
    from_hz: float = 0.0
    to_hz: float = 0.0


@dataclass(frozen=True)
class Procedure:
    """An excitation, the setpoint around it, and what is recorded.

    ``keep`` sends the setpoint once, ``mode`` is what the robot then says that it follows, ``settle_s`` how long it
    takes to get there. ``stop`` sends what brings it to rest again.
    """

    excitation: Excitation
    keep: Callable[[], None]
    stop: Callable[[], None]
    mode: str
    settle_s: float
    signals: Sequence[str]
    wheels: Sequence[int]
    claims: Claims
    every: int = 1


def require_room(claims: Claims, room_m: float) -> None:
    """Raise LimitError if the experiment needs more room than there is."""
    if claims.room_m > room_m:
        hint = f"--room {math.ceil(100.0 * claims.room_m) / 100.0:g} if that is free, or a smaller --amplitude"
        raise LimitError(
            f"the experiment needs a free square of {claims.room_m:.2f} m; {room_m:g} m are free", hint=hint
        )


def require_duty(claims: Claims, limit: float) -> None:
    """Raise LimitError if the voltages would be cut: the answer would be that of the supply."""
    if claims.duty > limit:
        hint = "use a smaller --amplitude or --speed"
        raise LimitError(f"the experiment needs a duty of {claims.duty:.2f}; LIM_DUTY leaves {limit:.2f}", hint=hint)


def run_excitation(robot: Robot, procedure: Procedure) -> Burst:
    """Run it and return what was recorded. The robot is disarmed at the end, whatever happens.

    Raises ExperimentError if the robot stopped itself, left its room, slipped or went silent.
    """
    excitation = procedure.excitation
    watch = _Watch(robot, procedure)
    recorded_s = excitation.duration_s + TAIL_S
    robot.start_burst(recorded_s, procedure.signals, every=procedure.every, wheels=procedure.wheels, wait=True)
    try:
        robot.arm()
        with robot.connection.repeating(watch.keep, REPEAT_S):
            robot.wait_until(lambda status: status.mode == procedure.mode, MODE_TIMEOUT_S, f"in mode {procedure.mode}")
            robot.pump(procedure.settle_s)
            robot.excite(
                excitation.place,
                excitation.which,
                excitation.amplitude,
                excitation.duration_s,
                from_hz=excitation.from_hz,
                to_hz=excitation.to_hz,
            )
            robot.pump(recorded_s)
        with robot.connection.repeating(procedure.stop, REPEAT_S):
            robot.pump(procedure.settle_s)
    finally:
        robot.disarm()
    burst = robot.fetch_burst()
    if burst.config_sequence[0] != burst.config_sequence[1]:
        raise ExperimentError("a parameter was changed during the experiment", hint="repeat it")
    return burst


class _Watch:
    """Sends the setpoint again and again, and looks whether anything is odd."""

    def __init__(self, robot: Robot, procedure: Procedure) -> None:
        self._robot, self._procedure = robot, procedure
        self._start: Pose | None = None

    def keep(self) -> None:
        """Send the setpoint, unless something is odd: then ExperimentError."""
        self._check_state()
        self._check_place()
        self._check_slip()
        self._procedure.keep()

    def _check_state(self) -> None:
        try:
            self._robot.guard.check()
        except StoppedError as error:
            raise ExperimentError(str(error), hint=error.hint) from error
        if self._robot.status.heartbeat_age_s > SILENT_S:
            raise ExperimentError(f"no message from the robot for {SILENT_S:g} s", hint="check the link")

    def _check_place(self) -> None:
        tracking, claims = self._robot.status.tracking, self._procedure.claims
        if tracking is None or claims.room_m == 0.0:
            return
        if self._start is None:
            self._start = tracking.pose
        gone_m = math.hypot(tracking.pose.x - self._start.x, tracking.pose.y - self._start.y)
        if gone_m > claims.travel_m + SLACK_M:
            raise ExperimentError(
                f"the robot left its free square: {gone_m:.2f} m from its start, {claims.travel_m:.2f} m were expected",
                hint="check for a free-turning wheel and a sloped floor",
            )

    def _check_slip(self) -> None:
        wheels, claims = self._robot.status.wheels, self._procedure.claims
        if wheels is None or claims.room_m == 0.0:
            return
        slip_m_s = max(abs(value) for value in wheels.slip_m_s)
        if slip_m_s > max(SLIP_SHARE * claims.rim_m_s, SLIP_M_S):
            raise ExperimentError(
                f"the wheels slip at {slip_m_s:.2f} m/s", hint="use a smaller --amplitude or another floor"
            )
