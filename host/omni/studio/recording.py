# SPDX-License-Identifier: MIT
"""Recordings that are started from the page. They become runs as those of ``omni drive``.

The robot's thread only puts frames into a queue. A thread of the recording's own writes them, so a slow or full disk
delays neither control nor a stop.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from datetime import datetime, timezone
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from omni.studio.error_text import in_words
from omni.studio.session import Session
from omni.studio.worker import Worker
from omniwheel import parameter_file
from omniwheel.drive_log.folder import BEFORE_FILE, TLOG_FILE, Drive, write_drive, write_with_figures
from omniwheel.errors import OmniError, OutputFileError
from omniwheel.logs.run_folder import new_run_folder
from omniwheel.robots import parameter_table
from omniwheel.tlog import TlogWriter, wall_clock_us

NAME, ASKED = "studio", "recorded in the studio"
POSE_MODES = ("pose", "trajectory")
"""Modes in which the robot follows poses; what it was asked for names them."""
NOT_ENDED = "still recording, or the studio was killed"
LARGEST_FOR_FIGURES = 64 << 20
"""Figures and picture need the whole log in memory."""
MOST_WAITING = 200_000
"""Frames that wait for a disk: minutes of them."""
_LOOK_S = 0.1
_PATIENCE_S = 30.0


class Recording:
    """One recording, from its making to its end. Raises OutputFileError if it cannot be begun, LinkLostError."""

    def __init__(self, root: Path, session: Session, ended: Callable[[Recording, Drive], None]) -> None:
        self.folder = new_run_folder(root, NAME)
        self.trouble = ""
        self._session = session
        self._ended = ended
        self._frames: SimpleQueue[bytes] = SimpleQueue()
        self._stopped = threading.Event()
        self._overflown = False
        self._began = datetime.now(timezone.utc)
        self._followed: set[str] = set()
        try:
            self._robot = session.record(self._take)
            self._before = dict(self._robot.parameters.known)
            parameter_file.write(self.folder / BEFORE_FILE, self._before, self._robot.table)
            write_drive(self.folder, self._drive(NOT_ENDED, 0), self._robot.table)  # listed whatever happens
            self._writer = TlogWriter(self.folder / TLOG_FILE)
        except OmniError:
            self._stopped.set()
            self._remove()
            raise
        self._thread = threading.Thread(target=self._run, name="recording", daemon=True)
        self._thread.start()

    @property
    def on(self) -> bool:
        """Whether it still writes: its folder is complete but for figures and picture afterwards."""
        return self._thread.is_alive()

    @property
    def ends(self) -> bool:
        """Whether it takes no more frames."""
        return self._stopped.is_set()

    def end(self) -> None:
        """Take no more frames; those that came are written meanwhile."""
        self._stopped.set()

    def wait(self) -> None:
        """Wait until everything is on the disk, but not without end for one that hangs."""
        self._thread.join(_PATIENCE_S)

    def _take(self, frame: bytes) -> None:
        """Take a frame; the robot's thread does no more than this. It may come long after the end."""
        if self._stopped.is_set() or self._overflown:
            return
        self._frames.put(wall_clock_us().to_bytes(8, "big") + frame)
        self._overflown = self._frames.qsize() > MOST_WAITING

    def _run(self) -> None:
        end = "done"
        try:
            while not self._stopped.is_set():
                self._write()
                self._note_what_it_follows()
                if self._session.robot is not self._robot and not self._stopped.is_set():
                    end = "the link was lost"
                    break
                if self._overflown:
                    raise OutputFileError("the disk is too slow for this recording", hint="choose another folder")
            self._stopped.set()
            self._write()
            self._writer.close()
        except OutputFileError as error:
            self._fail(error)
            end = str(error)
            with suppress(OutputFileError):
                self._writer.close()
        self._stopped.set()
        drive = self._drive(end, self._writer.frames)
        try:
            write_drive(self.folder, drive, self._robot.table)
        except OutputFileError as error:
            self._fail(error)
        self._ended(self, drive)

    def _drive(self, end: str, frames: int) -> Drive:
        known = self._robot.parameters.known
        after = {name: known.get(name, value) for name, value in self._before.items()}
        asked = ASKED + "".join(f", {name}" for name in sorted(self._followed))
        return Drive(asked, self._began, end, self._robot.url, self._before, after, frames)

    def _note_what_it_follows(self) -> None:
        """Position errors mean something where the robot follows poses; driven by keys, it follows none."""
        status = self._robot.status
        if status.armed and status.mode in POSE_MODES:
            self._followed.add(status.mode)

    def _write(self) -> None:
        """Write what has come by now, or wait a moment for something to come."""
        records: list[bytes] = []
        with suppress(Empty):
            records.append(self._frames.get(timeout=_LOOK_S))
            time.sleep(0.0 if self._stopped.is_set() else _LOOK_S)
            while True:
                records.append(self._frames.get_nowait())
        if records:
            self._writer.write_records(b"".join(records), len(records))
        self._writer.flush_if_due()

    def _fail(self, error: OmniError) -> None:
        self.trouble = self.trouble or in_words(error)

    def _remove(self) -> None:
        with suppress(OSError):
            for file in self.folder.iterdir():
                file.unlink()
            self.folder.rmdir()


class Recorder:
    """Starts and ends recordings into one folder; ``worker`` computes their figures."""

    def __init__(self, root: Path, worker: Worker) -> None:
        self.root = root
        self._worker = worker
        self._lock = threading.Lock()
        self._recording: Recording | None = None
        self._figures: Future[None] | None = None
        self._completed_count = 0
        self._trouble = ""

    def start(self, session: Session) -> str:
        """Begin a recording; return its folder. Raises OutputFileError, LinkLostError."""
        with self._lock:
            if self._recording is not None and not self._recording.ends:
                return str(self._recording.folder)
            if self._recording is not None:
                self._recording.wait()  # it may be at its last lines
                if self._recording.on:
                    raise OutputFileError(
                        "the previous recording is still being written to disk",
                        hint="try again, or choose another folder",
                    )
            self._recording, self._trouble = None, ""
            self._recording = Recording(self.root, session, self._ended)
            return str(self._recording.folder)

    def end(self) -> None:
        """End the recording, if there is one, without waiting for the disk."""
        recording = self._recording
        if recording is not None:
            recording.end()

    def stop(self) -> None:
        """End the recording, if there is one; its folder is there then."""
        self.end()
        recording = self._recording
        if recording is not None:
            recording.wait()

    def close(self) -> None:
        """End the recording and wait for its figures."""
        self.stop()
        if self._figures is not None:
            with suppress(OmniError, TimeoutError):
                self._figures.result(timeout=_PATIENCE_S)

    def state(self) -> dict[str, Any]:
        """Return what a page shows."""
        recording = self._recording
        if recording is None:
            return {"on": False, "folder": str(self.root), "trouble": self._trouble, "completed": 0}
        return {
            "on": recording.on,
            "folder": str(recording.folder if recording.on else self.root),
            "trouble": recording.trouble or self._trouble,
            "completed": self._completed_count,
        }

    def _ended(self, recording: Recording, drive: Drive) -> None:
        try:
            self._figures = self._worker.ask(complete, recording.folder, drive)
            self._figures.add_done_callback(self._completed)
        except (OmniError, RuntimeError) as error:  # the worker has ended with the server
            self._trouble = f"no metrics for the recording: {error}"

    def _completed(self, figures: Future[None]) -> None:
        self._completed_count += 1
        error = None if figures.cancelled() else figures.exception()
        if error is not None:
            self._trouble = f"no metrics for the recording: {error}"


def complete(folder: Path, drive: Drive) -> None:
    """Add figures and picture to a recording, unless it is too long. Raises OutputFileError."""
    if (folder / TLOG_FILE).stat().st_size <= LARGEST_FOR_FIGURES:
        write_with_figures(folder, drive, parameter_table())
