# SPDX-License-Identifier: MIT
"""Firmware for a Teensy from the page: ``omni flash`` as a child process, first with ``--dry-run``, then in earnest.

Only what passed its check is uploaded: the very file, byte for byte.
"""

from __future__ import annotations

import hashlib
import json
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omni.studio.actions import BadRequestError
from omniwheel.flashing.loader import HOW_TO_GET_IT, PROGRAM
from omniwheel.robots import robot_names

OMNI_FLASH = (sys.executable, "-m", "omni", "flash")
LINES_KEPT = 12
_END_S = 5.0


@dataclass(frozen=True)
class Firmware:
    """What a page chose: build for ``robot``, or the .hex ``file``; onto the board at ``port`` ("": the one Teensy).

    ``blank``: a board without a serial port, whose button is pressed. ``new_wiring``: upload it though the board's
    firmware knows another wiring.
    """

    robot: str
    file: str
    port: str
    blank: bool
    new_wiring: bool = False

    def words(self) -> list[str]:
        """Return the arguments that look at it and upload nothing."""
        what = [self.file] if self.file else ["--robot", self.robot]
        return [*what, *self.board(), "--dry-run", "--json"]

    def board(self) -> list[str]:
        """Return the arguments that say where it goes."""
        flags = [("--blank", self.blank), ("--new-wiring", self.new_wiring)]
        return [*(["--port", self.port] if self.port else []), *(name for name, chosen in flags if chosen)]


def firmware_of(request: Mapping[str, Any]) -> Firmware:
    """Return what a page asks for. Raises BadRequestError."""
    robot, file, port, blank = (request.get(key) for key in ("robot", "file", "port", "blank"))
    if not all(isinstance(text, str) for text in (robot, file, port)) or not isinstance(blank, bool):
        raise BadRequestError("robot, file and port must be strings, blank true or false")
    if bool(robot) == bool(file):
        raise BadRequestError("choose a robot to build for, or the path of a .hex file")
    if robot and robot not in robot_names():
        raise BadRequestError(f"unknown robot {robot!r}")
    if str(file).startswith("-") or str(port).startswith("-"):
        raise BadRequestError("a file or port must not begin with -")
    return Firmware(str(robot), str(file), str(port), blank, request.get("new_wiring") is True)


@dataclass(frozen=True)
class Checked:
    """Firmware that passed its check, what ``omni flash`` answered, and the digest of the file as it was then."""

    firmware: Firmware
    said: dict[str, Any]
    digest: str


class Flasher:
    """Checks and uploads one firmware at a time. ``command`` is what does it. For any thread."""

    def __init__(self, command: Sequence[str] = OMNI_FLASH) -> None:
        self._command = list(command)
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._lines: deque[str] = deque(maxlen=LINES_KEPT)
        self._uploads = False
        self._trouble = self._done = ""
        self._checked: Checked | None = None

    @property
    def running(self) -> bool:
        """Whether something is being checked or uploaded."""
        return self._process is not None

    def require_idle(self) -> None:
        """Raise BadRequestError while something is being uploaded."""
        if self.running and self._uploads:
            raise BadRequestError("firmware is being uploaded", hint="wait for its end")

    def check(self, firmware: Firmware) -> None:
        """Begin to build and check; returns at once. Raises BadRequestError while another one is under way."""
        self._checked = None

        def checked(said: dict[str, Any]) -> str:
            self._checked = Checked(firmware, said, _digest(said["file"]))
            if said["problem"]:
                return f"The image is valid. An upload would be refused: {said['problem']}"
            return f"The image is valid: {said['size']} bytes for {said['board']}. Not uploaded yet"

        self._begin(firmware.words(), checked, uploads=False)

    def require_checked(self, firmware: Firmware) -> dict[str, Any]:
        """Return the answer of the check of this firmware.

        Raises BadRequestError if it cannot be uploaded now: it was not checked, the check found that an upload would
        be refused or has no loader, its file has changed since, or another firmware is being checked or uploaded.
        """
        if self._checked is None or self._checked.firmware != firmware:
            raise BadRequestError("this firmware was not checked", hint="press Check first")
        self._require_free()
        said = self._checked.said
        if said["problem"]:
            raise BadRequestError(f"the check found: {said['problem']}", hint="correct it, then press Check again")
        if said.get("loader", PROGRAM) is None:
            raise BadRequestError(f"{PROGRAM} is not installed here", hint=f"{HOW_TO_GET_IT}, then press Check again")
        if _digest(said["file"]) != self._checked.digest:
            raise BadRequestError(f"{said['file']} has changed since it was checked", hint="press Check again")
        return said

    def upload(self, firmware: Firmware) -> None:
        """Begin to upload what was checked; returns at once. Raises BadRequestError as :meth:`require_checked`."""
        said = self.require_checked(firmware)
        words = [said["file"], "--sha256", said["sha256"], *firmware.board(), "--json"]
        self._begin(words, lambda now: _runs(said, now), uploads=True)

    def end(self) -> None:
        """End it as Ctrl-C does. An upload that is cut short leaves a board that has to be uploaded to again."""
        process = self._process
        if process is not None:
            process.send_signal(signal.SIGINT)

    def close(self) -> None:
        """End it, and wait a moment for its last words."""
        process = self._process
        if process is not None:
            self.end()
            with suppress(subprocess.TimeoutExpired):
                process.wait(_END_S)

    def state(self) -> dict[str, Any]:
        """Return what a page shows: the latest lines, then what came of it."""
        return {
            "running": self.running,
            "uploads": self._uploads,
            "lines": list(self._lines),
            "done": self._done,
            "trouble": self._trouble,
            "checked": self._checked is not None and self._checked.said["problem"] is None and not self.running,
        }

    def _require_free(self) -> None:
        if self._process is not None:
            raise BadRequestError("another firmware is being checked or uploaded", hint="wait for its end")

    def _begin(self, words: list[str], done: Callable[[dict[str, Any]], str], *, uploads: bool) -> None:
        with self._lock:
            self._require_free()
            self._lines.clear()
            self._trouble = self._done = ""
            self._uploads = uploads
            self._process = process = subprocess.Popen(
                [*self._command, *words],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
            )
        threading.Thread(target=self._follow, args=(process, done), daemon=True).start()

    def _follow(self, process: subprocess.Popen[str], done: Callable[[dict[str, Any]], str]) -> None:
        assert process.stdout is not None
        listener = threading.Thread(target=self._listen, args=(process,), daemon=True)
        listener.start()
        answer = process.stdout.read()
        listener.join()
        code = process.wait()
        try:
            said = json.loads(answer) if answer.strip() else {}
            if "error" in said:
                self._trouble = " ".join(filter(None, (f"{said['error']['message']}.", said["error"]["hint"])))
            elif code != 0:
                self._trouble = "it was ended" if code in (130, -signal.SIGINT) else f"it ended with exit code {code}"
            else:
                self._done = done(said)
        except (ValueError, KeyError, TypeError) as error:
            self._trouble = f"omni flash printed an unexpected line: {error!r}"
        finally:
            self._process = None

    def _listen(self, process: subprocess.Popen[str]) -> None:
        assert process.stderr is not None
        for line in process.stderr:
            if line.strip():
                self._lines.append(line.rstrip())


def _digest(file: str) -> str:
    """Return the SHA-256 of a file; "" of one that is not there."""
    try:
        return hashlib.sha256(Path(file).read_bytes()).hexdigest()
    except OSError:
        return ""


def _runs(checked: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    version = now["version"]
    if checked["built"].strip("0") and version["git_hash"] and version["git_hash"] != checked["built"]:
        raise ValueError(f"{now['port']} runs {version['git_hash'][:8]}, not {checked['built'][:8]}: press its button")
    return f"{now['port']} runs firmware {version['firmware']}. Connect to it above"
