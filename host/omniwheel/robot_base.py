# SPDX-License-Identifier: MIT
"""What a connected robot can be told, one message or command at a time: :class:`RobotBase`."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import TypeVar

from omni_schema import ParameterTable
from omniwheel.burst import Burst, parse_burst
from omniwheel.burst_request import BurstRequest
from omniwheel.callbacks import warn_of_drops
from omniwheel.capability.drive_model import DriveModel, model_from_parameters
from omniwheel.capability.reach import check_pose, check_velocity, check_wheel_count
from omniwheel.commands import CANCELLED, Commander, message_id
from omniwheel.connection import Connection
from omniwheel.dialect import Message, mavlink
from omniwheel.drive_guard import DriveGuard
from omniwheel.errors import ArmingRefusedError, CommandRefusedError, LinkTimeoutError, OmniError, VersionMismatchError
from omniwheel.firmware_version import RobotVersion, version_from_message
from omniwheel.frames import Pose, Twist
from omniwheel.limits import DEFAULT_TIMEOUT_S
from omniwheel.log_download import LogDownload, Progress
from omniwheel.monitored import monitored
from omniwheel.parameters import Parameters, checked_value
from omniwheel.setpoints import (
    burst_request,
    duty_target,
    excitation_request,
    finite,
    pose_fix_message,
    pose_target,
    velocity_target,
)
from omniwheel.signing import install_key
from omniwheel.status import RobotStatus, StatusBoard
from omniwheel.telemetry import SigningStatus, TelemetryT, decode
from omniwheel.telemetry_parts import require_kinds
from omniwheel.texts import TextLog

FORCE = 21196.0
"""Param 2 of the arm/disarm command that MAVLink defines as "do it anyway"."""
SETPOINT_PERIOD_S = 0.05
SEEN_S = 0.5
"""The telemetry of a state that the robot has accepted comes within this time, except on the slowest radios."""
_BUFFERED = 10000
_AS_PARAMETER = -1.0
_STORE, _RESTORE, _RESET = 1, 0, 2

Self = TypeVar("Self", bound="RobotBase")


@monitored("connection", "close")
class RobotBase:
    """The part of :class:`omniwheel.Robot` that is one message, one command or one repeated setpoint per call."""

    _stops = 0
    """How many methods that stop have been called."""

    def __init__(self, connection: Connection, *, table: ParameterTable, timeout_s: float = DEFAULT_TIMEOUT_S) -> None:
        self.connection = connection
        self.timeout_s = timeout_s
        self.table = table
        self.texts = TextLog(connection)
        self.parameters = Parameters(connection, table, self.texts)
        self.commands = Commander(connection, self.texts)
        self._board = StatusBoard(connection)
        self._burst = BurstRequest(connection, self.commands.is_of_another)
        self.guard = DriveGuard(connection, self.texts, lambda: self.status)
        self._version: RobotVersion | None = None
        self.on_store: Callable[[], None] | None = None
        """Called when the robot has stored its parameters."""

    # ---- connection

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Disarm if this object armed the robot, then close the link."""
        try:
            if self.armed_here:
                with suppress(OmniError):
                    self.disarm()
            with suppress(OmniError):
                self._leave()
        finally:
            self.connection.close()

    def _leave(self) -> None:
        """Do what is to be done before the link is closed."""

    def _end_stream(self) -> None:
        """End what a motion repeats, before the program asks for something else."""

    def _require_no_stop_since(self, stops: int) -> None:
        """Raise StoppedError if this program has stopped the robot since there were so many stops."""

    def pump(self, duration_s: float = 0.0) -> None:
        """Serve the link for ``duration_s`` of the link's clock; 0 takes what is there."""
        self.connection.pump(duration_s)

    def send(self, message: Message) -> None:
        """Send any MAVLink message of the dialect (:data:`omniwheel.dialect.mavlink`)."""
        self.connection.send(message)

    @property
    def url(self) -> str:
        """The link."""
        return self.connection.link.url

    # ---- what the robot says

    @property
    def status(self) -> RobotStatus:
        """The latest of everything, as a snapshot; see :meth:`pump`."""
        return self._board.snapshot()

    @property
    def version(self) -> RobotVersion:
        """Firmware version, asked for once."""
        if self._version is None:
            message = self.commands.request_message("AUTOPILOT_VERSION", self.timeout_s)
            self._version = version_from_message(message)
        return self._version

    def require_same_parameters(self) -> None:
        """Raise VersionMismatchError if the robot's parameter table is not the one this package knows."""
        if self.version.schema_crc != self.table.crc:
            raise VersionMismatchError(
                f"the robot's firmware {self.version} has other parameters than this omniwheel",
                hint="install the same version on both; names, ranges or meanings may differ",
            )

    def telemetry(self, *kinds: type[TelemetryT], timeout_s: float | None = None) -> Iterator[TelemetryT]:
        """Yield telemetry of these kinds (classes of :mod:`omniwheel.telemetry`) as it comes, without end.

        What arrives while the loop's body calls other methods is kept, up to 10 000 messages; then the oldest are
        dropped, with one warning. Raises LinkTimeoutError if nothing comes for ``timeout_s`` (default: the
        connection's).
        """
        require_kinds(*kinds)
        for message in self.messages(*(kind.message for kind in kinds), timeout_s=timeout_s):
            for kind in kinds:
                decoded = decode(kind, message)
                if decoded is not None:
                    yield decoded

    def messages(self, *names: str, timeout_s: float | None = None) -> Iterator[Message]:
        """Yield MAVLink messages by name as they come; the raw side of :meth:`telemetry`."""
        limit = self.timeout_s if timeout_s is None else timeout_s
        waiting: deque[Message] = deque(maxlen=_BUFFERED)
        has_warned = False

        def take(message: Message) -> None:
            nonlocal has_warned
            if message.get_type() in names:
                if len(waiting) == _BUFFERED and not has_warned:
                    has_warned = True
                    warn_of_drops(f"the loop over {' or '.join(names)} is slower than the telemetry", _BUFFERED)
                waiting.append(message)

        remove = self.connection.add_listener(take)
        try:
            while True:
                with self.connection.monitor:
                    if not waiting and self.connection.wait(lambda _: bool(waiting), limit) is None:
                        raise LinkTimeoutError(
                            f"no {' or '.join(names)} from the robot for {limit:g} s",
                            hint="is this message switched off? set_message_interval(name, hz) switches it on",
                        )
                yield waiting.popleft()
        finally:
            remove()

    def wait_for(self, kind: type[TelemetryT], timeout_s: float | None = None) -> TelemetryT:
        """Return the next telemetry of one kind."""
        return next(self.telemetry(kind, timeout_s=timeout_s))

    def wait_until(self, condition: Callable[[RobotStatus], bool], timeout_s: float, what: str) -> RobotStatus:
        """Serve the link until ``condition(status)`` holds; LinkTimeoutError names ``what`` was waited for."""
        if not condition(self.status) and self.connection.wait(lambda _: condition(self.status), timeout_s) is None:
            raise LinkTimeoutError(f"the robot was not {what} within {timeout_s:g} s")
        return self.status

    def set_message_interval(self, name: str, rate_hz: float | None) -> None:
        """Set the rate of a message on this link: 0 switches it off, None restores the rate at boot."""
        interval_us = 0.0 if rate_hz is None else -1.0 if rate_hz == 0 else 1e6 / finite("rate_hz", rate_hz)
        number = float(message_id(name))
        self.commands.send(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, interval_us, what=f"to set the rate of {name}")

    # ---- arming and stopping

    @property
    def armed_here(self) -> bool:
        """Whether the robot was armed, or asked to, by this object, and not disarmed and armed by another one since."""
        return self.guard.armed_here

    def arm(self) -> None:
        """Power the motors, within 5 s if wheels still turn. Raises ArmingRefusedError with the robot's reasons."""
        self.guard.begin()  # already now: Ctrl-C while the answer is on its way must disarm, too
        try:
            self.commands.send(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, what="to arm")
        except ArmingRefusedError as error:
            if error.result != CANCELLED:
                self.guard.end()
                if self.status.state == "estop":
                    error.hint = "release it, then arm again: robot.estop_clear(), or `omni stop --release`"
            else:
                with suppress(OmniError):
                    self.disarm()  # a copy may still be on its way to the robot: this comes behind it
            raise
        self._see(lambda status: status.armed)

    def disarm(self) -> None:
        """Power the motors off; always possible."""
        self.commands.send(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, FORCE, what="to disarm")
        self.guard.end()
        self._see(lambda status: not status.armed)

    def estop(self) -> None:
        """Emergency stop, latched until :meth:`estop_clear`."""
        self.commands.send(mavlink.MAV_CMD_OMNI_ESTOP, 1.0, what="to stop at once")
        self.guard.end()
        self._see(lambda status: status.state in ("estop", "unknown"))

    def estop_clear(self, *, after_own_stop: bool = False) -> None:
        """Release the emergency stop: disarmed then. ``after_own_stop``: not if another sender's stop came in 15 s."""
        command, what = mavlink.MAV_CMD_OMNI_ESTOP, "to release the emergency stop"
        self.commands.send(command, 0.0, what=what, after_own_stop=after_own_stop)
        self._see(lambda status: status.state != "estop")

    def _see(self, condition: Callable[[RobotStatus], bool]) -> None:
        """Wait a little for the telemetry of what the robot has just accepted, so that :attr:`status` agrees."""
        with suppress(OmniError):
            if not condition(self.status):
                self.connection.wait(lambda _: condition(self.status), SEEN_S)

    # ---- what it can follow

    def drive_model(self) -> DriveModel:
        """Return what decides how fast this robot can go, from its parameters; they are read once."""
        return model_from_parameters(self.parameters, {})

    def require_velocity(
        self, vx: float, vy: float, wz: float, *, frame: str = "body", duration_s: float | None = None
    ) -> None:
        """Raise LimitError if the robot cannot follow this velocity; it names the limit and what to do.

        In the world's frame the robot's present heading counts; as long as none has come, any heading will do. A robot
        that turns meanwhile has to be able to follow in every heading on its way: for ``duration_s``, or all around.
        """
        velocity_target(self.connection, Twist(vx, vy, wz), frame)
        if vx == vy == wz == 0.0:
            return  # always possible, and nothing to ask the robot for
        if frame == "body":
            check_velocity(self.drive_model(), Twist(vx, vy, wz))
            return
        tracking = self.status.tracking
        heading = None if tracking is None else tracking.pose.theta
        turned = math.copysign(math.tau, wz) if duration_s is None else wz * duration_s
        check_velocity(self.drive_model(), Twist(vx, vy, wz), heading, turned if wz else 0.0)

    def require_pose(self, x: float, y: float, theta: float) -> None:
        """Raise LimitError for a pose beyond LIM_POS, or a heading that looks like degrees."""
        check_pose(Pose(x, y, theta), self.parameters["LIM_POS"])

    def require_duty(self, duty: Sequence[float]) -> None:
        """Raise LimitError unless there is one duty for each of the robot's wheels."""
        check_wheel_count(duty, int(self.parameters["WHEELS"]))

    # ---- set-points

    def set_velocity(self, vx: float, vy: float, wz: float, *, frame: str = "body") -> None:
        """Ask for a velocity [m/s, m/s, rad/s] in the ``body`` or ``world`` frame.

        To be repeated faster than SAFE_CMD_TO (0.5 s by default), or the robot stops; :meth:`velocity` does that.
        """
        self._end_stream()
        self.send(velocity_target(self.connection, Twist(vx, vy, wz), frame))

    def set_pose(self, x: float, y: float, theta: float, *, feed_forward: Twist | None = None) -> None:
        """Ask for a world pose, with the world twist along it if it moves. To be repeated like :meth:`set_velocity`."""
        self._end_stream()
        self.send(pose_target(self.connection, Pose(x, y, theta), feed_forward))

    def set_duty(self, duty: Sequence[float]) -> None:
        """Put duties -1..1 on the motors, open loop; positive drives the body counter-clockwise. Only while armed.

        For bring-up and identification: nothing holds the wheels' speed. To be repeated like :meth:`set_velocity`.
        """
        self._end_stream()
        self.send(duty_target(self.connection, duty))

    def drive_duty(self, duty: Sequence[float], duration_s: float, *, stop: bool = True) -> None:
        """Keep open-loop duties for ``duration_s``, then ask for zero duty unless ``stop`` is False.

        Raises StoppedError, and LimitError unless there is one duty per wheel; nothing was sent then.
        """
        self.require_duty(duty)
        self.repeat(lambda: self.set_duty(duty), duration_s)
        if stop:
            self.set_duty([0.0] * len(duty))

    def repeat(self, action: Callable[[], None], duration_s: float) -> None:
        """Call one of the ``set_`` methods again and again for ``duration_s``. No limit is checked here.

        Raises StoppedError once the robot has stopped by itself, or anybody has stopped it.
        """
        end, stops = self.connection.clock() + finite("duration_s", duration_s), self._stops
        if self.status.armed:
            self.guard.join()
        while self.connection.clock() < end:
            self.guard.check()
            with self.connection.monitor:
                self._require_no_stop_since(stops)
                action()
            self.pump(min(SETPOINT_PERIOD_S, max(0.0, end - self.connection.clock())))

    def send_pose_fix(
        self, x: float, y: float, theta: float, time_us: int = 0, *, sd_xy_m: float = 0.0, sd_theta_rad: float = 0.0
    ) -> None:
        """Send a measured world pose, as from motion capture; ``time_us`` in the robot's clock, 0: unknown.

        ``sd_xy_m`` and ``sd_theta_rad`` are its standard deviations, of x and of y, and of theta. 0: not known, and
        the robot takes ``EKF_R_XY`` and ``EKF_R_TH``. Raises SeveralRobotsError while another robot is on the line.
        """
        self.send(pose_fix_message(Pose(x, y, theta), time_us, sd_xy_m, sd_theta_rad))

    def set_pose_estimate(self, x: float, y: float, theta: float) -> None:
        """Restart the pose estimate here; only while disarmed."""
        values = [finite(name, value) for name, value in (("x", x), ("y", y), ("theta", theta))]
        self.commands.send(mavlink.MAV_CMD_OMNI_SET_POSE, *values, what="to set the pose estimate")

    # ---- on-board trajectory

    def start_trajectory(
        self,
        type: str | int | None = None,  # noqa: A002
        laps: float | None = None,
        period_s: float | None = None,
    ) -> None:
        """Plan the path that the TRJ_* parameters describe and follow it; while disarmed, from arming on.

        ``type`` (a name of TRJ_TYPE, like "rose"), ``laps`` and ``period_s`` take the place of the parameters for this
        once.
        """
        number = _AS_PARAMETER if type is None else checked_value(self.table, "TRJ_TYPE", type)
        count = _AS_PARAMETER if laps is None else checked_value(self.table, "TRJ_LAPS", laps)
        period = 0.0 if period_s is None else checked_value(self.table, "TRJ_PERIOD", period_s)
        what = "to start the trajectory"
        self._end_stream()
        self.commands.send(mavlink.MAV_CMD_OMNI_TRAJECTORY_START, number, count, period, what=what)
        self.guard.go_on()

    def stop_trajectory(self) -> None:
        """Leave the trajectory and hold the pose."""
        self._end_stream()
        self.commands.send(mavlink.MAV_CMD_OMNI_TRAJECTORY_STOP, what="to hold the pose", hurry=True)

    def set_waypoints(self, poses: Sequence[tuple[float, float, float]]) -> None:
        """Replace the waypoints of the trajectory types "waypoints" and "spline": world poses, at most 32."""
        points = [[finite(f"waypoint {n}", value) for value in pose] for n, pose in enumerate(poses)]
        for number, point in enumerate(points):
            self.commands.send(mavlink.MAV_CMD_OMNI_WAYPOINT, float(number), *point, what=f"to set waypoint {number}")

    # ---- what the control tick saw

    def start_burst(
        self,
        duration_s: float,
        signals: Sequence[str] = (),
        *,
        every: int = 1,
        wheels: Sequence[int] = (),
        wait: bool = False,
    ) -> None:
        """Have the robot record signals of its control tick, one sample per ``every`` ticks of 1 ms.

        ``signals`` are names of :data:`omniwheel.burst.SIGNALS`, ``wheels`` count from 0; none: all of them. With
        ``wait`` the recording begins with the next experiment. A duration of 0 ends a recording early. Raises
        CommandRefusedError with the robot's reason, such as how much its memory holds.
        """
        numbers, last = burst_request(duration_s, signals, every, wheels), (float(wait), 0.0)
        with self._burst.asking(duration_s, signals, every, wheels, wait):
            self.commands.send(mavlink.MAV_CMD_OMNI_BURST, *numbers, what="to record a burst", last=last)

    def fetch_burst(self, timeout_s: float = DEFAULT_TIMEOUT_S, progress: Progress | None = None) -> Burst:
        """Wait until the recording is over, for ``timeout_s`` at most, and fetch it; what is lost comes again.

        Raises LogError if there is none by then, or what came is no burst, or not that of :meth:`start_burst`.
        """
        download = LogDownload(self.connection)
        burst = parse_burst(download.fetch(download.await_log(timeout_s), progress))
        self._burst.check(burst)
        return burst

    def record_burst(
        self, duration_s: float, signals: Sequence[str] = (), *, every: int = 1, wheels: Sequence[int] = ()
    ) -> Burst:
        """Record a burst now, wait for its end and return it; :meth:`start_burst` says what the arguments are."""
        self.start_burst(duration_s, signals, every=every, wheels=wheels)
        self.pump(duration_s)
        return self.fetch_burst()

    def excite(
        self,
        place: str,
        which: int,
        amplitude: float,
        duration_s: float,
        *,
        from_hz: float = 0.0,
        to_hz: float = 0.0,
    ) -> None:
        """Have the robot add a signal to its own loop, tick by tick; a burst that waits begins with it.

        ``place`` and its unit: "wheel" a wanted wheel speed [rad/s], "voltage" a wheel's voltage [V], "pose" the wanted
        pose in the world [m, rad]. ``which``: the wheel from 1, 0 all of them alike; of a pose 0 x, 1 y, 2 theta. It is
        a step, or a sine from ``from_hz`` to ``to_hz``. Only while armed. Raises CommandRefusedError with the robot's
        reason.
        """
        numbers = excitation_request(place, which, amplitude, duration_s)
        sweep = (finite("from_hz", from_hz), finite("to_hz", to_hz))
        with self._burst.beginning():
            self.commands.send(mavlink.MAV_CMD_OMNI_EXCITE, *numbers, what="to excite a loop", last=sweep)

    def end_excitation(self) -> None:
        """End an excitation that goes on; nothing happens without one."""
        self.commands.send(mavlink.MAV_CMD_OMNI_EXCITE, 0.0, what="to end the excitation")

    # ---- parameters' storage, reboot, host-in-the-loop

    def store(self) -> None:
        """Write the parameters to non-volatile memory; only while disarmed."""
        self._storage(_STORE, "to store the parameters")
        if self.on_store is not None:
            self.on_store()

    def restore(self) -> None:
        """Read the parameters back from non-volatile memory, except SYS_ID."""
        self._storage(_RESTORE, "to restore the stored parameters")

    def reset_parameters(self) -> None:
        """Set all parameters but SYS_ID to the robot file's values (not stored until :meth:`store`)."""
        self._storage(_RESET, "to reset the parameters")

    # ---- message signing on the radio

    def signing_status(self) -> SigningStatus:
        """Ask for the state of the radio's signing: key's fingerprint and what was refused."""
        message = self.commands.request_message(SigningStatus.message, self.timeout_s)
        status = decode(SigningStatus, message)
        assert status is not None
        return status

    def setup_signing(self, key: bytes | None) -> None:
        """Give the robot a signing key, or take its key away; over USB only, while disarmed.

        Raises CommandRefusedError with the robot's reasons.
        """
        mark = self.texts.mark()
        target = (self.connection.target_system, self.connection.target_component)
        if not install_key(target, key, self.send, self.signing_status):
            raise CommandRefusedError("the signing key", "DENIED", self.texts.reasons_since(mark))

    def _storage(self, action: int, what: str) -> None:
        self.commands.send(mavlink.MAV_CMD_PREFLIGHT_STORAGE, float(action), what=what)
        if action != _STORE:  # storing changes no value
            self.parameters.forget()

    def reboot(self) -> None:
        """Restart the firmware; refused while armed."""
        self.commands.send(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1.0, what="to reboot")

    def enter_hil(self) -> None:
        """Enter host-in-the-loop; only while disarmed and not in an emergency stop.

        From now on the robot ticks once per OMNI_HIL_SENSORS.
        """
        self.commands.send(mavlink.MAV_CMD_OMNI_HIL, 1.0, what="to enter host-in-the-loop")

    def leave_hil(self) -> None:
        """Leave host-in-the-loop."""
        self.commands.send(mavlink.MAV_CMD_OMNI_HIL, 0.0, what="to leave host-in-the-loop")
