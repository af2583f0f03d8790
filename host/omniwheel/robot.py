# SPDX-License-Identifier: MIT
"""A connected robot: :class:`Robot`, and :func:`connect` without a thread.

Most programs use :func:`omniwheel.connect`, :mod:`omniwheel.sync` or :mod:`omniwheel.aio`: all of them give this class.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from omni_schema import load_parameters
from omniwheel.callbacks import Callbacks
from omniwheel.connection import Connection, Recorder
from omniwheel.dialect import Message
from omniwheel.errors import LogError, OmniError
from omniwheel.first_contact import await_robot
from omniwheel.hub.shared_link import open_shared
from omniwheel.limits import DEFAULT_TIMEOUT_S
from omniwheel.link import Link, is_slow
from omniwheel.motion import MovingRobot
from omniwheel.paths import params_path
from omniwheel.ports import only_teensy
from omniwheel.robot_base import FORCE, SETPOINT_PERIOD_S
from omniwheel.robot_state import RobotState
from omniwheel.signing import Signer
from omniwheel.status import RobotStatus
from omniwheel.telemetry import Telemetry, TelemetryT, Tracking, Wheels, decode
from omniwheel.telemetry_parts import require_kinds
from omniwheel.tlog import SIMULATED_EPOCH_US, wall_clock_us

if TYPE_CHECKING:
    from omniwheel.recording import Recording
    from omniwheel.run import Run

__all__ = ["FORCE", "SETPOINT_PERIOD_S", "Robot", "connect"]

RECORDED = (Tracking.message, Wheels.message)
"""What a recorded connection asks for more often than the robot sends it by itself."""
RECORDED_HZ = 50.0
GONE_S = 2.5
"""A robot that sent no heartbeat for so long is not asked for more on leaving."""

T = TypeVar("T", bound=Telemetry)
RobotT = TypeVar("RobotT", bound="Robot")


class Robot(RobotState, MovingRobot):
    """A robot on the other end of a link; use it as a context manager.

    Poses are world x [m], y [m], theta [rad] counter-clockwise. Every wait has a deadline, then LinkTimeoutError. On
    leaving the context the robot is disarmed if this object armed it.

    From :func:`omniwheel.connect` a thread serves the link: heartbeats, telemetry, setpoints. The program may sleep and
    compute, and several threads may use one robot. From :func:`omniwheel.sync.connect` there is no thread: every method
    that waits serves the link meanwhile, and a program that computes calls :meth:`sleep` at least once a second.
    """

    _callbacks: Callbacks | None = None
    _recording: Recording | None = None
    _watched: tuple[str, ...] = ()
    robot_file: bytes = b""
    """The text of the robot file; empty for a robot on a link, which does not send it."""

    def close(self) -> None:
        """Disarm if this object armed the robot, then close the link."""
        try:
            self._forget_motion("robot.close()")
            super().close()
        finally:
            if self._callbacks is not None:
                self._callbacks.close()

    def sleep(self, duration_s: float) -> None:
        """Let time pass on the robot's side: as time.sleep for a real robot, and simulated time for a simulated one.

        Ctrl-C ends what :meth:`velocity` began, as it ends every motion.
        """
        try:
            self.pump(duration_s)
        except KeyboardInterrupt:
            with suppress(OmniError):
                if self.connection.end_repeating(self._stream):
                    self.stop()
            raise

    # ---- state

    def _latest(self, kind: type[TelemetryT]) -> TelemetryT:
        self.pump(0.0)
        return self._board.last(kind) or self.wait_for(kind)

    def _newest_status(self) -> RobotStatus:
        self.pump(0.0)
        return self.status

    # ---- callbacks

    def on(self, kind: type[T], callback: Callable[[T], object]) -> Callable[[], None]:
        """Call ``callback`` with each telemetry of a ``kind`` (a class of :mod:`omniwheel.telemetry`) that comes.

        The returned function ends that. Callbacks are called one after the other in a thread of their own, and may use
        the robot; without a thread (:mod:`omniwheel.sync`) they are called while something waits. What one raises is
        raised by the motion under way, which ends at rest, or the next one, :meth:`sleep` or property; never by what
        stops or disarms.
        """
        require_kinds(kind)

        def take(message: Message) -> None:
            value = decode(kind, message)
            if value is not None:
                call(lambda: callback(value))

        if self.connection.is_served:
            self._callbacks = self._callbacks or Callbacks(self.connection)
            call: Callable[[Callable[[], object]], object] = self._callbacks.call
        else:
            call = _call
        return self.connection.add_listener(take)

    # ---- recording

    def record(self) -> None:
        """Keep everything from now on for :attr:`run`, and ask for poses and wheels at 50 Hz unless on a slow radio."""
        from omniwheel.recording import Recording

        connection = self.connection
        self._recording = recording = Recording(partial(stamp_us, connection.clock))
        before = connection.recorder

        def write(frame: bytes) -> None:
            recording.write(frame)
            if before is not None:
                before(frame)

        connection.recorder = write
        if connection.sends_heartbeats and not is_slow(self.url):
            self._watched = RECORDED
            for name in RECORDED:
                self.set_message_interval(name, RECORDED_HZ)

    @property
    def run(self) -> Run:
        """Everything since the connection, so far. Raises LogError if it is not recorded."""
        if self._recording is None:
            raise LogError(
                "this connection is not recorded", hint="robot.record() begins; connect(record=True) does so"
            )
        return self._recording.run(self.parameters.known, self.robot_file)

    def _leave(self) -> None:
        """Give the link its own rates back, unless the robot is gone."""
        if self.status.heartbeat_age_s < GONE_S:
            for name in self._watched:
                self.set_message_interval(name, None)


def stamp_us(clock: Callable[[], float]) -> int:
    """Return the time for a telemetry log: since 1970, or of a simulation's clock since its own beginning."""
    return wall_clock_us() if clock is time.monotonic else SIMULATED_EPOCH_US + round(clock() * 1e6)


def _call(action: Callable[[], object]) -> object:
    return action()


def connect(
    url: str | Link | None = None,
    *,
    timeout_s: float = DEFAULT_TIMEOUT_S,
    system_id: int | None = None,
    heartbeat: bool = True,
    clock: Callable[[], float] = time.monotonic,
    recorder: Recorder | None = None,
    signing_key: bytes | None = None,
    stop_at_once: bool = False,
    record: bool = False,
    background: bool = False,
) -> Robot:
    """Connect to a robot and wait for its heartbeat.

    ``url`` is a link URL (:mod:`omniwheel.link`) or a link of one's own; without one, the only Teensy that is plugged
    in. With ``record``, ``robot.run`` is what came since. ``background``: a thread serves the link.

    A serial port that another program of ours
    uses is shared with it (docs/guides/hub.md). ``system_id`` chooses a robot where several share a link: without it,
    they are refused. ``recorder`` gets every frame of both directions (:meth:`omniwheel.tlog.TlogWriter.write`).
    Without ``heartbeat`` the robot does not count this program as a ground station. ``signing_key`` (32 bytes,
    :mod:`omniwheel.signing`) signs what is sent, as a robot's radio wants it once a key is set. With ``stop_at_once``
    an emergency stop for every robot that hears it goes out before any heartbeat has come, and again until one has.
    Raises LinkUrlError, LinkOpenError, LinkLostError, LinkTimeoutError, SeveralRobotsError, SigningKeyError.
    """
    connection = Connection(
        _opened(url, timeout_s),
        clock=clock,
        heartbeat=heartbeat,
        recorder=recorder,
        signer=Signer(signing_key) if signing_key is not None else None,
    )
    robot = Robot(connection, table=load_parameters(params_path()), timeout_s=timeout_s)
    return await_and_serve(robot, system_id=system_id, stop_at_once=stop_at_once, record=record, background=background)


def _opened(url: str | Link | None, timeout_s: float) -> Link:
    where = only_teensy() if url is None else url
    return open_shared(where, timeout_s=timeout_s) if isinstance(where, str) else where


def await_and_serve(
    robot: RobotT,
    *,
    system_id: int | None = None,
    stop_at_once: bool = False,
    record: bool = False,
    background: bool = False,
) -> RobotT:
    """Wait for a robot's heartbeat, then serve and record its link as wanted; return the robot.

    If it does not come, the link is closed. Raises what :func:`connect` raises.
    """
    connection = robot.connection
    try:
        await_robot(connection, system_id, robot.timeout_s, stop_at_once)
        if background:
            connection.serve_in_background()
        if record:
            robot.record()
    except BaseException:
        connection.close()
        raise
    return robot
