# SPDX-License-Identifier: MIT
"""The latest of everything a robot says, gathered into one snapshot."""

from __future__ import annotations

from dataclasses import dataclass

from omniwheel.connection import Connection
from omniwheel.dialect import Message
from omniwheel.pose_quality import PoseQuality, QualityWatch
from omniwheel.sensor_quality import FloorWatch, SensorQuality, gyro_quality, is_present
from omniwheel.telemetry import (
    Battery,
    Control,
    FlowState,
    GyroState,
    Heartbeat,
    Odometry,
    Status,
    StatusText,
    Telemetry,
    TelemetryT,
    Tracking,
    Wheels,
    decode,
)

_KINDS: tuple[type[Telemetry], ...] = (
    Heartbeat,
    Tracking,
    Wheels,
    Control,
    Status,
    Battery,
    StatusText,
    GyroState,
    FlowState,
    Odometry,
)
_OF_QUALITY: tuple[type[Telemetry], ...] = (Tracking, Control, Status)


@dataclass(frozen=True)
class RobotStatus:
    """What the robot said last; None where it has not said anything yet.

    ``heartbeat_age_s`` is the time since the last heartbeat on the connection's clock, infinite before the first.
    ``quality`` says how good the pose is, by what the robot's filter knows. Of its ``gyro`` [rad/s] and of its sensor
    of ``floor_motion`` [m, rad] a robot tells only if asked (:mod:`omniwheel.sensor_messages`). ``sensors`` says in
    words what it makes of them now.
    """

    heartbeat_age_s: float
    heartbeat: Heartbeat | None
    tracking: Tracking | None
    wheels: Wheels | None
    control: Control | None
    safety: Status | None
    battery: Battery | None
    text: StatusText | None
    quality: PoseQuality | None = None
    gyro: GyroState | None = None
    floor_motion: FlowState | None = None
    sensors: tuple[SensorQuality, ...] = ()

    @property
    def armed(self) -> bool:
        """Whether the motors are powered."""
        return self.heartbeat is not None and self.heartbeat.armed

    @property
    def simulated(self) -> bool:
        """Whether a simulated world moves the wheels: the robot is in host-in-the-loop."""
        return self.heartbeat is not None and self.heartbeat.hil

    @property
    def mode(self) -> str:
        """What moves the robot: hold, pose, velocity, trajectory, duty; "unknown" before the first heartbeat."""
        return self.heartbeat.mode if self.heartbeat is not None else "unknown"

    @property
    def state(self) -> str:
        """Safety state: init, disarmed, armed, failsafe, estop; "unknown" before the first status message."""
        return self.safety.state if self.safety is not None else "unknown"

    @property
    def faults(self) -> tuple[str, ...]:
        """Names of the present faults and warnings."""
        return self.safety.faults if self.safety is not None else ()


class StatusBoard:
    """Listens to a connection and keeps the last of each kind of telemetry."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._latest: dict[str, Message] = {}
        self._heartbeat_s = float("-inf")
        self._quality = QualityWatch()
        self._floor = FloorWatch()
        self._names = {kind.message for kind in _KINDS}
        connection.add_listener(self._take)

    def _take(self, message: Message) -> None:
        name = message.get_type()
        if name in self._names:
            self._latest[name] = message
        for kind in _OF_QUALITY:
            told = decode(kind, message)
            if told is not None:
                self._quality.take(told)
        flow = decode(FlowState, message)
        if flow is not None:
            self._floor.take(flow)
        if name == Heartbeat.message:
            self._heartbeat_s = self._connection.clock()

    def last(self, kind: type[TelemetryT]) -> TelemetryT | None:
        """Return what came last of a kind; None before the first."""
        message = self._latest.get(kind.message)
        return None if message is None else decode(kind, message)

    def _sensors(self, gyro: GyroState | None, floor: FlowState | None) -> tuple[SensorQuality, ...]:
        tracking = self.last(Tracking)
        now_s = None if tracking is None else tracking.time_s
        told = (
            gyro_quality(gyro) if gyro is not None and is_present(gyro, now_s) else None,
            self._floor.quality() if floor is not None and is_present(floor, now_s) else None,
        )
        return tuple(quality for quality in told if quality is not None)

    def snapshot(self) -> RobotStatus:
        """Return the present state of knowledge."""
        gyro, floor = self.last(GyroState), self.last(FlowState)
        return RobotStatus(
            heartbeat_age_s=self._connection.clock() - self._heartbeat_s,
            heartbeat=self.last(Heartbeat),
            tracking=self.last(Tracking),
            wheels=self.last(Wheels),
            control=self.last(Control),
            safety=self.last(Status),
            battery=self.last(Battery),
            text=self.last(StatusText),
            quality=self._quality.quality(),
            gyro=gyro,
            floor_motion=floor,
            sensors=self._sensors(gyro, floor),
        )
