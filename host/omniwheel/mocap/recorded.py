# SPDX-License-Identifier: MIT
"""Recorded streams: a CSV file with one pose per line, written by ``omni mocap record`` and replayed as it was.

The heading line names the columns. Without one they are in this order: ``taken_s``, ``arrived_s``, ``frame``, ``x_m``,
``y_m``, ``theta_rad``. Both times are seconds on one clock of the recording, of any origin. The frame is the stream's
number of it, and theta counts counter-clockwise. Lines are in the order of arrival. Two more columns, ``sd_xy_m`` and
``sd_theta_rad``, say how good a pose is; 0: not known. A file may be without them.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType

import numpy as np

from omniwheel.errors import MocapSourceError
from omniwheel.frames import Pose
from omniwheel.growing_file import GrowingFile
from omniwheel.mocap.source import MocapPose
from omniwheel.table_file import Table, TableFormat, read_table

COLUMNS = ("taken_s", "arrived_s", "frame", "x_m", "y_m", "theta_rad")
SD_COLUMNS = ("sd_xy_m", "sd_theta_rad")
_HINT = (
    f"the columns are {','.join(COLUMNS)}, and may be followed by {','.join(SD_COLUMNS)}; "
    "`omni mocap record` writes such files"
)
_FILE = TableFormat(MocapSourceError, _HINT, COLUMNS, SD_COLUMNS, delimiter=",")


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
    table = read_table(path, _FILE)
    if not table.lines:
        raise MocapSourceError(f"{path}: the recording has no pose", hint=_HINT)
    return list(_poses(path, table))


def _poses(path: Path, table: Table) -> Iterator[MocapPose]:
    last_s = -math.inf
    columns = table.columns
    unknown = np.zeros(len(table.lines))
    rows = zip(*(columns.get(name, unknown).tolist() for name in (*COLUMNS, *SD_COLUMNS)), strict=True)
    for line, row in zip(table.lines, rows, strict=True):
        where = f"{path}:{line}"
        odd = next(
            (name for name, value in zip(COLUMNS + SD_COLUMNS, row, strict=True) if not math.isfinite(value)), ""
        )
        if odd:
            raise MocapSourceError(f"{where}: {odd} is not finite", hint=_HINT)
        taken_s, arrived_s, frame, x, y, theta, sd_xy, sd_theta = row
        if min(sd_xy, sd_theta) < 0.0:
            raise MocapSourceError(f"{where}: a standard deviation is negative", hint=_HINT)
        if arrived_s < last_s or taken_s > arrived_s:
            what = "comes before the line above it" if arrived_s < last_s else "is before taken_s"
            raise MocapSourceError(f"{where}: arrived_s = {arrived_s} {what}", hint="sort the file by arrived_s")
        last_s = arrived_s
        pose = Pose(x, y, math.remainder(theta, math.tau))
        yield MocapPose(pose, taken_s, arrived_s, int(frame), sd_xy, sd_theta)


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
