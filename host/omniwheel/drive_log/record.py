# SPDX-License-Identifier: MIT
"""A telemetry log as arrays, and the numbers that say how the drive was."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omniwheel.dialect import Message
from omniwheel.errors import DatasetError, LogError
from omniwheel.identification.sources import read_messages
from omniwheel.telemetry import Control, Heartbeat, Status, StatusText, Tracking, Wheels, decode

Array = NDArray[np.float64]
FULL_DUTY = 0.99
ROBOT_COMPONENT = 1
"""MAV_COMP_ID_AUTOPILOT1, as which the firmware sends."""


@dataclass(frozen=True)
class TelemetryRecord:
    """What a robot said, in the order of its clock; times [s] on that clock.

    ``pose`` and ``reference``: rows of x [m], y [m], theta [rad, not wrapped], at ``time_s``. ``speed``, ``wanted``
    [rad/s] and ``duty`` -1..1: rows per wheel at ``wheel_time_s``. ``fixes``: rows of time, x, y, theta as they were
    sent with the robot's time. ``events``: what happened, in words. ``stops``: names of the faults that stopped it.
    """

    time_s: Array
    pose: Array
    reference: Array
    wheel_time_s: Array
    speed: Array
    wanted: Array
    duty: Array
    events: tuple[tuple[float, str], ...]
    stops: tuple[str, ...]

    @property
    def wheels(self) -> int:
        """Number of wheels that ever turned or were driven; 4 entries are sent for every robot."""
        used = np.any((self.speed != 0.0) | (self.duty != 0.0), axis=0) if len(self.speed) else np.zeros(4, dtype=bool)
        return int(np.max(np.flatnonzero(used))) + 1 if used.any() else 3

    def numbers(self) -> dict[str, float | None]:
        """Return how the drive was; None where nothing was recorded that says so."""
        error = self.pose - self.reference
        steps = np.hypot(*np.diff(self.pose[:, :2], axis=0).T) if len(self.pose) > 1 else np.zeros(0)
        times = np.diff(self.time_s)
        speeds = steps[times > 0.0] / times[times > 0.0]
        return {
            "duration_s": float(self.time_s[-1] - self.time_s[0]) if len(self.time_s) > 1 else None,
            "way_m": float(np.sum(steps)) if len(steps) else None,
            "position_rmse_m": _rms(np.hypot(error[:, 0], error[:, 1])),
            "heading_rmse_rad": _rms(error[:, 2]),
            "largest_error_m": float(np.max(np.hypot(error[:, 0], error[:, 1]))) if len(error) else None,
            "top_speed_m_s": float(np.max(speeds)) if len(speeds) else None,
            "top_wheel_rad_s": float(np.max(np.abs(self.speed))) if len(self.speed) else None,
            "full_duty_share": float(np.mean(np.abs(self.duty) >= FULL_DUTY)) if len(self.duty) else None,
        }


def _rms(values: Array) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None


def read_record(path: Path) -> TelemetryRecord:
    """Read a telemetry log (.tlog). Raises LogError if it is none, or holds neither poses nor wheels."""
    try:
        record = record_of(read_messages(path))
    except DatasetError as error:
        raise LogError(str(error), hint="give a .tlog file, as `omni record` and `omni drive` write it") from error
    if not len(record.time_s) and not len(record.wheel_time_s):
        raise LogError(f"{path} holds neither OMNI_TRACKING nor OMNI_WHEELS", hint="is it a log of another robot?")
    return record


def record_of(messages: Iterable[Message]) -> TelemetryRecord:
    """Return the record of messages in the order in which they came."""
    tracking: dict[float, Tracking] = {}
    wheels: dict[float, Wheels] = {}
    watcher = EventWatcher()
    for message in messages:
        placed, turned = decode(Tracking, message), decode(Wheels, message)
        if placed is not None:
            tracking[placed.time_s] = placed
            watcher.now_s = placed.time_s
        elif turned is not None:
            wheels[turned.time_s] = turned
            watcher.now_s = turned.time_s
        else:
            watcher.take(message)
    poses = [tracking[time] for time in sorted(tracking)]
    rows = [wheels[time] for time in sorted(wheels)]
    pose = _unwrapped(poses, "pose")
    reference = _unwrapped(poses, "reference")
    if len(poses):
        reference[:, 2] += 2.0 * math.pi * np.round((pose[0, 2] - reference[0, 2]) / (2.0 * math.pi))
    return TelemetryRecord(
        time_s=np.array(sorted(tracking)),
        pose=pose,
        reference=reference,
        wheel_time_s=np.array(sorted(wheels)),
        speed=_rows(rows, "speed_rad_s"),
        wanted=_rows(rows, "reference_rad_s"),
        duty=_rows(rows, "duty"),
        events=tuple(watcher.events),
        stops=tuple(watcher.stops),
    )


def _rows(items: list[Any], name: str, width: int = 4) -> Array:
    return np.array([getattr(item, name) for item in items], dtype=float).reshape(len(items), width)


def _unwrapped(poses: list[Tracking], name: str) -> Array:
    rows = _rows(poses, name, 3)
    rows[:, 2] = np.unwrap(rows[:, 2])
    return rows


class EventWatcher:
    """Notes what happened: changes of state, mode and parameters, and what the robot said.

    ``now_s`` is the time of what is taken next; ``events`` are times and words, ``stops`` names of stop faults.
    """

    def __init__(self) -> None:
        self.now_s = 0.0
        self.events: list[tuple[float, str]] = []
        self.stops: list[str] = []
        self._last: dict[str, Any] = {}

    def take(self, message: Message) -> None:
        """Take one message of any kind; those of ground stations, which a log of a link holds too, say nothing here."""
        if message.get_srcComponent() != ROBOT_COMPONENT:
            return
        status, text = decode(Status, message), decode(StatusText, message)
        beat, control = decode(Heartbeat, message), decode(Control, message)
        if status is not None:
            self._changed("state", status.state)
            self.stops += [fault for fault in status.fault_history if fault not in self.stops]
        elif text is not None:
            self.events.append((self.now_s, text.text))
        elif beat is not None:
            self._changed("mode", beat.mode)
        elif control is not None:
            self._changed("parameters", control.config_sequence)

    def _changed(self, what: str, value: Any) -> None:
        if what in self._last and self._last[what] != value:
            self.events.append((self.now_s, "parameters changed" if what == "parameters" else f"{what} {value}"))
        self._last[what] = value
