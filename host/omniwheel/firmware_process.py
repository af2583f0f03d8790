# SPDX-License-Identifier: MIT
"""The PC firmware as a child process: one process is one robot."""

from __future__ import annotations

import json
import selectors
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO

from omniwheel.errors import FirmwareNotFoundError
from omniwheel.firmware_child import READY_TIMEOUT_S, FirmwareChild
from omniwheel.parameters import ParameterValue
from omniwheel.paths import MissingFileError, firmware_path


class FirmwareProcess(FirmwareChild):
    """Runs ``omni-firmware`` for one robot; a context manager that always ends it.

    ``robot`` is a packaged name or a path, and ``parameters`` are set over it. ``links`` are the firmware's own link
    specifications (``tcp:127.0.0.1:0`` picks a free port, ``pty`` a pseudo-terminal). ``storage`` is the file of its
    non-volatile memory (None: it forgets). With ``lockstep`` it ticks only on OMNI_HIL_SENSORS from the start.
    ``radio`` is the number of the link that is a radio, as slow as LINK2_BAUD, from 1; 0: none (None: the second,
    unlimited).
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
        super().__init__(robot, parameters)
        self._options = _options(links, storage)
        self._options += ["--lockstep"] if lockstep else []
        if radio is not None:
            self._options += ["--radio", str(radio)]
        self._program = Path(program) if program is not None else _program()

    def _launch(self, folder: Path, parameters: Path, log: IO[bytes]) -> tuple[str, ...]:
        command = [str(self._program), "--params", str(parameters), "--end-with-stdin", *self._options]
        # Nothing is written to its standard input: that ends with this process, even one that is killed.
        process = self._spawn(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log)
        links = first_ready_line(process)
        if links is None:
            raise self._not_started()
        return links


def first_ready_line(process: subprocess.Popen[bytes]) -> tuple[str, ...] | None:
    """Wait for a program's first line, ``{"ready": true, "links": [...]}``; return the links, None if it is another."""
    try:
        return tuple(str(link) for link in json.loads(_first_line(process))["links"])
    except (ValueError, KeyError, TypeError):
        return None


def _first_line(process: subprocess.Popen[bytes]) -> bytes:
    assert process.stdout is not None
    end = time.monotonic() + READY_TIMEOUT_S
    line = b""
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        while not line.endswith(b"\n") and selector.select(end - time.monotonic()):
            piece = process.stdout.read1(4096)  # type: ignore[attr-defined]
            if not piece:
                break
            line += piece
    return line


def _program() -> Path:
    try:
        return firmware_path()
    except MissingFileError as error:
        hint = "the PC firmware needs Linux or macOS; on Windows use a real robot or --link to another computer"
        raise FirmwareNotFoundError(str(error), hint=hint) from error


def _options(links: Sequence[str], storage: Path | str | None) -> list[str]:
    options = [word for link in links for word in ("--link", link)]
    return options if storage is None else [*options, "--storage", str(storage)]
