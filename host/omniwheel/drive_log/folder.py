# SPDX-License-Identifier: MIT
"""The folder that a drive of a robot leaves."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from datetime import datetime, timezone
from pathlib import Path
from types import TracebackType
from typing import Any

from omni_schema import ParameterTable
from omniwheel import __version__, files, parameter_file
from omniwheel.errors import LogError, OmniError, OutputFileError
from omniwheel.link import is_slow
from omniwheel.logs.run_folder import DRIVE_PARAMETERS, DRIVE_TLOG, new_run_folder
from omniwheel.robot import Robot
from omniwheel.telemetry_picture import draw_telemetry
from omniwheel.telemetry_record import TelemetryRecord, read_record
from omniwheel.tlog import TlogWriter

DRIVE_FILE, TLOG_FILE, PICTURE_FILE = "drive.json", DRIVE_TLOG, "run.png"
BEFORE_FILE, AFTER_FILE = DRIVE_PARAMETERS, "parameters_after.toml"
CONTROLLER = "CTL_MODE"
WATCHED, WATCHED_HZ = ("OMNI_TRACKING", "OMNI_WHEELS"), 50.0
"""What a faster link is asked for while the drive lasts."""


@dataclass(frozen=True)
class Drive:
    """What is known of a drive besides its log.

    ``end`` is "done" or what went wrong, ``before`` and ``after`` its parameters, ``frames`` how many the log holds.
    """

    asked: str
    began: datetime
    end: str
    link: str
    before: Mapping[str, float]
    after: Mapping[str, float]
    frames: int


class DriveLog:
    """Keeps one drive: made before the robot is connected, told of it, finished on leaving the context.

    The folder holds telemetry.tlog, parameters.toml (and parameters_after.toml if they changed), run.png, and
    drive.json with what was asked, how it ended, events and numbers. An error of the disk never keeps a robot from
    being disarmed: it is raised at the end.
    """

    def __init__(self, root: Path, name: str, asked: str) -> None:
        self.folder = new_run_folder(root, name)
        self._asked = asked
        self._writer = TlogWriter(self.folder / TLOG_FILE)
        self._began = datetime.now(timezone.utc)
        self._robot: Robot | None = None
        self._before: dict[str, float] = {}
        self._trouble: OutputFileError | None = None

    def write(self, frame: bytes) -> None:
        """Take a frame of either direction; the recorder of the connection."""
        try:
            self._writer.write(frame)
        except OutputFileError as error:
            self._trouble = self._trouble or error

    def connected(self, robot: Robot, *, set_rates: bool = True) -> None:
        """Keep the robot's parameters as they are before it moves; without ``set_rates`` its telemetry stays as it is.

        Rates that are set here need :meth:`leaving`.
        """
        self._robot = robot
        slow = is_slow(robot.url)
        self._before = dict(robot.parameters.known) if slow else robot.parameters.download()
        self._before[CONTROLLER] = robot.parameters[CONTROLLER]
        for name in () if slow or not set_rates else WATCHED:
            robot.set_message_interval(name, WATCHED_HZ)
        parameter_file.write(self.folder / BEFORE_FILE, self._before, robot.table)

    def leaving(self) -> None:
        """Give the link its own rates back, before it is closed."""
        robot = self._robot
        if robot is not None and not is_slow(robot.url):
            with suppress(OmniError):
                for name in WATCHED:
                    robot.set_message_interval(name, None)

    def _finish(self, robot: Robot, end: str) -> None:
        """Write what became of the drive; ``end`` is "done" or what went wrong."""
        self._writer.close()
        after = {name: robot.parameters[name] for name in self._before}
        frames = self._writer.frames
        drive = Drive(self._asked, self._began, end, robot.url, self._before, after, frames)
        write_with_figures(self.folder, drive, robot.table)
        if self._trouble is not None:
            raise self._trouble

    def __enter__(self) -> DriveLog:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        end = "done" if error is None else (str(error) or type(error).__name__)
        try:
            if self._robot is None:
                self._writer.close()
                _remove_if_empty(self.folder)
            else:
                self._finish(self._robot, "interrupted" if isinstance(error, KeyboardInterrupt) else end)
        except OmniError:
            if error is None:  # else that is what has to be heard of
                raise


def write_with_figures(folder: Path, drive: Drive, table: ParameterTable) -> None:
    """Write what became of a drive whose log is closed, with figures and picture. Raises OutputFileError."""
    record = _recorded(folder / TLOG_FILE)
    write_drive(folder, drive, table, record)
    if record is not None:
        draw_telemetry(record, drive.asked, folder / PICTURE_FILE)


def write_drive(folder: Path, drive: Drive, table: ParameterTable, record: TelemetryRecord | None = None) -> None:
    """Write drive.json, and the parameters after the drive if they changed. Raises OutputFileError."""
    if drive.after != drive.before:
        parameter_file.write(folder / AFTER_FILE, drive.after, table)
    files.write_json(folder / DRIVE_FILE, _document(drive, table, record))


def _document(drive: Drive, table: ParameterTable, record: TelemetryRecord | None) -> dict[str, Any]:
    number = drive.before.get(CONTROLLER)
    return {
        "kind": "drive",
        "asked": drive.asked,
        "controller": "" if number is None else parameter_file.format_value(table.get(CONTROLLER), number),
        "began": drive.began.isoformat(timespec="seconds"),
        "end": drive.end,
        "link": drive.link,
        "numbers": {} if record is None else record.numbers(),
        "pose_jumps": [] if record is None else [asdict(jump) for jump in record.jumps],
        "stops": [] if record is None else list(record.stops),
        "events": [] if record is None else [{"time_s": time, "what": what} for time, what in record.events],
        "parameters_changed": {
            name: [value, drive.after[name]] for name, value in drive.before.items() if drive.after[name] != value
        },
        "frames": drive.frames,
        "omniwheel": __version__,
    }


def _recorded(path: Path) -> TelemetryRecord | None:
    try:
        return read_record(path)
    except LogError:
        return None


def _remove_if_empty(folder: Path) -> None:
    (folder / TLOG_FILE).unlink(missing_ok=True)
    folder.rmdir()
