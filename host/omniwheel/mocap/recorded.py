# SPDX-License-Identifier: MIT
"""Recorded streams: a CSV file with one pose per line, written by ``omni mocap record`` and replayed as it was.

The header names the columns, in this order: ``taken_s``, ``arrived_s``, ``frame``, ``x_m``, ``y_m``, ``theta_rad``.
Both times are seconds on one clock of the recording, of any origin. The frame is the stream's number of it, and theta
counts counter-clockwise. Lines are in the order of arrival. Two more columns, ``sd_xy_m`` and ``sd_theta_rad``, say how
good a pose is; 0: not known. Files of before do not have them.
"""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType

from omniwheel.errors import MocapSourceError
from omniwheel.frames import Pose
from omniwheel.growing_file import GrowingFile
from omniwheel.mocap.source import MocapPose

COLUMNS = ("taken_s", "arrived_s", "frame", "x_m", "y_m", "theta_rad")
SD_COLUMNS = ("sd_xy_m", "sd_theta_rad")
_HINT = (
    f"the first line must be {','.join(COLUMNS)}, and may end with ,{','.join(SD_COLUMNS)}; "
    "`omni mocap record` writes such files"
)


class RecordingWriter:
    """Writes a recording; a context manager. An existing file is replaced. Everything here raises OutputFileError.

    The file can be read while it grows; see :mod:`omniwheel.growing_file` for what a kill or a full disk leaves.
    """

    def __init__(self, path: Path) -> None:
        self.poses = 0
        self._file = GrowingFile(path, lambda data: data.rfind(b"\n") + 1)
        self._write_row((*COLUMNS, *SD_COLUMNS))

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def write(self, measured: MocapPose) -> None:
        """Append one pose, micrometres and microseconds exact."""
        times = (f"{measured.taken_s:.6f}", f"{measured.arrived_s:.6f}", measured.frame)
        sds = (measured.sd_xy_m, measured.sd_theta_rad)
        self._write_row((*times, *(f"{value:.6f}" for value in (*measured.pose, *sds))))
        self.poses += 1

    def flush_if_due(self) -> None:
        """Hand out what waits for longer than a second: to be called now and then while a stream is silent."""
        self._file.flush_if_due()

    def close(self) -> None:
        """Finish the file."""
        self._file.close()

    def _write_row(self, row: Sequence[object]) -> None:
        self._file.write((",".join(str(value) for value in row) + "\n").encode("ascii"))


def read_recording(path: Path) -> list[MocapPose]:
    """Return the poses of a recording. MocapSourceError names file, line, column and what is wrong."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = csv.reader(file)
            header = tuple(word.strip() for word in next(rows, []))
            if header not in (COLUMNS, (*COLUMNS, *SD_COLUMNS)):
                raise MocapSourceError(f"{path}:1: these are not the columns of a recording", hint=_HINT)
            poses = list(_poses(path, rows, header))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise MocapSourceError(f"cannot read {path}: {reason}", hint=_HINT) from error
    if not poses:
        raise MocapSourceError(f"{path}: there is no pose in this recording", hint=_HINT)
    return poses


def _poses(path: Path, rows: Iterator[list[str]], columns: Sequence[str]) -> Iterator[MocapPose]:
    last_s = -math.inf
    for number, row in enumerate(rows, start=2):
        where = f"{path}:{number}"
        if len(row) != len(columns):
            raise MocapSourceError(f"{where}: {len(row)} columns instead of {len(columns)}", hint=_HINT)
        numbers = [_number(where, *pair) for pair in zip(columns, row, strict=True)]
        taken_s, arrived_s, frame, x, y, theta, sd_xy, sd_theta = (*numbers, 0.0, 0.0)[: len(COLUMNS) + len(SD_COLUMNS)]
        if min(sd_xy, sd_theta) < 0.0:
            raise MocapSourceError(f"{where}: a standard deviation is negative", hint=_HINT)
        if arrived_s < last_s or taken_s > arrived_s:
            what = "comes before the line above it" if arrived_s < last_s else "is before taken_s"
            raise MocapSourceError(f"{where}: arrived_s = {arrived_s} {what}", hint="sort the file by arrived_s")
        last_s = arrived_s
        pose = Pose(x, y, math.remainder(theta, math.tau))
        yield MocapPose(pose, taken_s, arrived_s, int(frame), sd_xy, sd_theta)


def _number(where: str, column: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise MocapSourceError(f"{where}: {column} is {text!r}; a finite number is needed", hint=_HINT)
    return value


class RecordedSource:
    """Replays a recording in its own rhythm: the first pose arrives at once, latencies stay what they were.

    ``clock`` and ``sleep`` may be those of a simulation.
    """

    def __init__(
        self,
        path: Path,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.name = f"recorded:{path}"
        self._poses = read_recording(path)
        self._clock = clock
        self._sleep = sleep
        self._next = 0
        self._shift_s = clock() - self._poses[0].arrived_s

    def clock(self) -> float:
        """Return the present time [s]."""
        return self._clock()

    @property
    def ended(self) -> bool:
        """Whether the last pose has been handed out."""
        return self._next == len(self._poses)

    def read(self, timeout_s: float) -> MocapPose | None:
        """Return the next pose when its time has come."""
        left_s = math.inf if self.ended else self._poses[self._next].arrived_s + self._shift_s - self._clock()
        if left_s > 0.0 and timeout_s > 0.0:
            self._sleep(min(left_s, timeout_s))
        if left_s > timeout_s:
            return None
        recorded = self._poses[self._next]
        self._next += 1
        arrived_s = recorded.arrived_s + self._shift_s
        return replace(recorded, taken_s=recorded.taken_s + self._shift_s, arrived_s=arrived_s)

    def close(self) -> None:
        """Nothing to close."""
