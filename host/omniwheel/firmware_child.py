# SPDX-License-Identifier: MIT
"""What a firmware that runs as a child process has in common, be it the PC's own or an emulated one."""

from __future__ import annotations

import errno
import os
import subprocess
import tempfile
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Any, TypeVar

from omniwheel.errors import FirmwareEndedError, FirmwareStartError, LinkLostError
from omniwheel.link import FileLink, open_link
from omniwheel.parameters import ParameterValue, checked_value
from omniwheel.robots import parameter_table, read_robot
from omniwheel.tcp_server import listen_hint

READY_TIMEOUT_S = 20.0
_STOP_TIMEOUT_S = 3.0
_ENDING_S = 1.0
_POLL_S = 0.01
_MESSAGES_KEPT = 4000

Self = TypeVar("Self", bound="FirmwareChild")


class FirmwareChild(ABC):
    """A child process that is one robot; a context manager that always ends it."""

    def __init__(self, robot: str | Path, parameters: Mapping[str, ParameterValue] | None) -> None:
        self.robot = read_robot(robot)
        table = parameter_table()
        self.values = self.robot.parameter_values()
        self.values.update({name: checked_value(table, name, value) for name, value in (parameters or {}).items()})
        self.links: tuple[str, ...] = ()
        self._process: subprocess.Popen[bytes] | None = None
        self._log: IO[bytes] | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def __enter__(self: Self) -> Self:
        try:
            self.start()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        ended = self._ending() if isinstance(error, LinkLostError) else None
        said = self.messages
        self.stop()
        if ended is not None:
            raise FirmwareEndedError(ended, said) from error

    def _ending(self) -> int | None:
        """Return the exit code of a process that is ending by itself: its links are closed a moment before."""
        if self._process is None:
            return None
        try:
            return self._process.wait(_ENDING_S)
        except subprocess.TimeoutExpired:
            return None

    @property
    def urls(self) -> tuple[str, ...]:
        """Link URLs to connect to, in the order of ``links``."""
        return tuple(_as_url(link) for link in self.links)

    def open_link(self, number: int = 0) -> FileLink:
        """Connect to one of the links. Raises LinkOpenError."""
        return open_link(self.urls[number])

    @property
    def pid(self) -> int | None:
        """Process id while it runs."""
        return self._process.pid if self._process is not None and self.running else None

    @property
    def running(self) -> bool:
        """Whether the process is there."""
        return self._process is not None and self._process.poll() is None

    @property
    def exit_code(self) -> int | None:
        """Exit code of a process that has ended by itself, None while it runs."""
        return None if self._process is None else self._process.poll()

    @property
    def messages(self) -> str:
        """The end of what the firmware wrote to standard error, or to its console."""
        if self._log is None:
            return ""
        size = self._log.seek(0, 2)
        self._log.seek(max(0, size - _MESSAGES_KEPT))
        return self._log.read().decode(errors="replace").strip()

    def start(self) -> None:
        """Start the program and wait until its links listen."""
        values = "".join(f"{name}={value!r}\n" for name, value in self.values.items())
        try:
            self._folder = tempfile.TemporaryDirectory(prefix="omni-firmware-")
            folder = Path(self._folder.name)
            parameters = folder / "parameters"
            parameters.write_text(values, encoding="ascii")
            self._log = (folder / "log").open("a+b")
        except OSError as error:
            hint = "free some space there, or set TMPDIR to another folder"
            raise FirmwareStartError(f"cannot work in {tempfile.gettempdir()}: {error.strerror}", hint=hint) from error
        self.links = self._launch(folder, parameters, self._log)

    @abstractmethod
    def _launch(self, folder: Path, parameters: Path, log: IO[bytes]) -> tuple[str, ...]:
        """Start the process with :meth:`_spawn`, wait until it is ready, return its links."""

    def _spawn(self, command: Sequence[str], **options: Any) -> subprocess.Popen[bytes]:
        # Python ignores SIGXFSZ, and so is a child to: a file at its size limit is an error there, and not the end.
        options = {"stdin": subprocess.DEVNULL, "restore_signals": False, **options}
        try:
            self._process = subprocess.Popen(command, **options)
        except OSError as error:
            raise FirmwareStartError(f"cannot start {command[0]}: {error.strerror}") from error
        return self._process

    def _wait_until(self, ready: Callable[[], bool]) -> bool:
        """Wait until ``ready()`` or the end of the process or of all patience; return what ``ready()`` says then."""
        end = time.monotonic() + READY_TIMEOUT_S
        while not ready():
            if not self.running or time.monotonic() > end:
                return ready()
            time.sleep(_POLL_S)
        return True

    def _not_started(self) -> FirmwareStartError:
        *before, last = (self.messages or "no output on standard error").splitlines()
        if last.endswith(os.strerror(errno.EADDRINUSE)):
            before.append(listen_hint(errno.EADDRINUSE))
        return FirmwareStartError(f"the firmware did not start: {last}", hint="\n".join(before))

    def stop(self) -> int | None:
        """End the process, at first politely; return its exit code. Harmless when it has ended."""
        process, self._process = self._process, None
        if process is not None:
            process.terminate()
            try:
                process.wait(_STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    pipe.close()
        if self._log is not None:
            self._log.close()
            self._log = None
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None
        return process.returncode if process is not None else None


def _as_url(link: str) -> str:
    """Turn the firmware's name of a link into the URL that reaches it."""
    kind, _, rest = link.partition(":")
    if kind == "pty":
        return rest
    return f"udpout:{rest}" if kind == "udp" else link
