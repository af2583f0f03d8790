# SPDX-License-Identifier: MIT
"""The PC firmware as a child process: one process is one robot."""

from __future__ import annotations

import json
import selectors
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import IO

from omniwheel.errors import FirmwareNotFoundError, FirmwareStartError
from omniwheel.parameters import ParameterValue, checked_value
from omniwheel.paths import MissingFileError, firmware_path
from omniwheel.robots import parameter_table, read_robot

READY_TIMEOUT_S = 10.0
_STOP_TIMEOUT_S = 3.0
_STDERR_KEPT = 4000


class FirmwareProcess:
    """Runs ``omni-firmware`` for one robot; a context manager that always ends it.

    ``robot`` is a packaged name or a path, ``parameters`` are set over it, ``links`` are the firmware's own link
    specifications (``tcp:127.0.0.1:0`` picks a free port, ``pty`` a pseudo-terminal), ``storage`` is the file of its
    non-volatile memory (None: it forgets). With ``lockstep`` it ticks only on OMNI_HIL_SENSORS from the start.
    ``radio`` is the number of the link that is a radio, as slow as LINK2_BAUD, from 1; 0: none (None: the second, unlimited).
    Raises RobotFileError, FirmwareNotFoundError, FirmwareStartError.
    """

    def __init__(
        self,
        robot: str | Path = "three_wheel",
        *,
        links: Sequence[str] = ("tcp:127.0.0.1:0",),
        lockstep: bool = False,
        storage: Path | str | None = None,
        parameters: Mapping[str, ParameterValue] | None = None,
        program: Path | str | None = None,
        radio: int | None = None,
    ) -> None:
        self.robot = read_robot(robot)
        table = parameter_table()
        self.values = self.robot.parameter_values()
        self.values.update({name: checked_value(table, name, value) for name, value in (parameters or {}).items()})
        self.links: tuple[str, ...] = ()
        self._options = _options(links, lockstep, storage)
        if radio is not None:
            self._options += ["--radio", str(radio)]
        self._program = Path(program) if program is not None else _program()
        self._process: subprocess.Popen[bytes] | None = None
        self._stderr: IO[bytes] | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def __enter__(self) -> FirmwareProcess:
        try:
            self.start()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.stop()

    @property
    def urls(self) -> tuple[str, ...]:
        """Link URLs to connect to, in the order of ``links``."""
        return tuple(_as_url(link) for link in self.links)

    @property
    def pid(self) -> int | None:
        """Process id while it runs."""
        return self._process.pid if self._process is not None and self.running else None

    @property
    def running(self) -> bool:
        """Whether the process is there."""
        return self._process is not None and self._process.poll() is None

    @property
    def messages(self) -> str:
        """The end of what the firmware wrote to standard error."""
        if self._stderr is None:
            return ""
        size = self._stderr.seek(0, 2)
        self._stderr.seek(max(0, size - _STDERR_KEPT))
        return self._stderr.read().decode(errors="replace").strip()

    def start(self) -> None:
        """Start the program and wait until its links listen."""
        self._folder = tempfile.TemporaryDirectory(prefix="omni-firmware-")
        folder = Path(self._folder.name)
        parameters = folder / "parameters"
        parameters.write_text("".join(f"{name}={value!r}\n" for name, value in self.values.items()), encoding="ascii")
        self._stderr = (folder / "stderr").open("w+b")
        command = [str(self._program), "--params", str(parameters), *self._options]
        try:
            self._process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=self._stderr
            )
        except OSError as error:
            raise FirmwareStartError(f"cannot start {self._program}: {error.strerror}") from error
        self.links = self._ready_links()

    def _ready_links(self) -> tuple[str, ...]:
        line = self._first_line()
        try:
            ready = json.loads(line)
            return tuple(str(link) for link in ready["links"])
        except (ValueError, KeyError, TypeError):
            said = self.messages or "nothing on standard error"
            raise FirmwareStartError(f"the firmware did not start: {said.splitlines()[-1]}", hint=said) from None

    def _first_line(self) -> bytes:
        assert self._process is not None
        assert self._process.stdout is not None
        end = time.monotonic() + READY_TIMEOUT_S
        line = b""
        with selectors.DefaultSelector() as selector:
            selector.register(self._process.stdout, selectors.EVENT_READ)
            while not line.endswith(b"\n") and selector.select(end - time.monotonic()):
                piece = self._process.stdout.read1(4096)  # type: ignore[attr-defined]
                if not piece:
                    break
                line += piece
        return line

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
            if process.stdout is not None:
                process.stdout.close()
        if self._stderr is not None:
            self._stderr.close()
            self._stderr = None
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None
        return process.returncode if process is not None else None


def _program() -> Path:
    try:
        return firmware_path()
    except MissingFileError as error:
        hint = "the PC firmware needs Linux or macOS; on Windows use a real robot or --link to another computer"
        raise FirmwareNotFoundError(str(error), hint=hint) from error


def _options(links: Sequence[str], lockstep: bool, storage: Path | str | None) -> list[str]:
    options = [word for link in links for word in ("--link", link)]
    if storage is not None:
        options += ["--storage", str(storage)]
    return [*options, "--lockstep"] if lockstep else options


def _as_url(link: str) -> str:
    """Turn the firmware's name of a link into the URL that reaches it."""
    kind, _, rest = link.partition(":")
    if kind == "pty":
        return rest
    return f"udpout:{rest}" if kind == "udp" else link
