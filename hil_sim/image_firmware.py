# SPDX-License-Identifier: MIT
"""The image that is flashed, alive on an emulated Teensy 4.0, as a child process."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import IO

from omniwheel.errors import FirmwareStartError
from omniwheel.firmware_child import FirmwareChild
from omniwheel.firmware_process import first_ready_line

MODULE = "hil_sim.image_process"
CONNECTORS = ("usb", "uart")
DEFAULT_LINKS = ("usb=tcp:127.0.0.1:0",)


class ImageFirmware(FirmwareChild):
    """Runs a firmware image (ELF or Intel hex) on an emulated Teensy 4.0; a context manager that always ends it.

    ``links`` are its connectors, ``usb=LINK`` and ``uart=LINK`` (Serial1, the radio's port) with ``tcp:HOST:PORT`` or
    ``pty[:SYMLINK]``; without a name, USB. A client of the USB link is a program that has the port open. ``robot`` says
    what is wired to which pin. The image's own parameters hold; ``storage`` is the file of its parameter memory (None:
    it forgets). With ``scenario`` that world is at the pins. With ``lockstep`` robot time stands still while a host in
    the loop thinks. Otherwise it follows the wall clock, as far as this computer is fast enough. Raises
    FirmwareStartError, also for a file that is no image or a package that is missing.
    """

    def __init__(
        self,
        image: Path | str,
        robot: str | Path = "three_wheel",
        *,
        links: Sequence[str] = DEFAULT_LINKS,
        lockstep: bool = False,
        storage: Path | str | None = None,
        scenario: str | None = None,
        world_robot: str | None = None,
        seed: int | None = None,
    ) -> None:
        super().__init__(robot, None)
        self._words = [sys.executable, "-m", MODULE, str(image), "--robot", str(robot)]
        for connector, link in _by_connector(links).items():
            self._words += [f"--{connector}", link]
        self._words += ["--end-with-stdin", *(["--lockstep"] if lockstep else [])]
        options = {"--storage": storage, "--scenario": scenario, "--world-robot": world_robot, "--seed": seed}
        for option, value in options.items():
            self._words += [] if value is None else [option, str(value)]

    def _launch(self, folder: Path, parameters: Path, log: IO[bytes]) -> tuple[str, ...]:
        process = self._spawn(self._words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log)
        links = first_ready_line(process)
        if links is None:
            raise self._not_started()
        return links


def _by_connector(links: Sequence[str]) -> dict[str, str]:
    named: dict[str, str] = {}
    for link in links:
        connector, equals, rest = link.partition("=")
        if not equals:
            connector, rest = "usb", link
        if connector not in CONNECTORS:
            raise FirmwareStartError(f"link '{link}'; must be usb=LINK or uart=LINK")
        if connector in named:
            raise FirmwareStartError(f"link '{link}': the board has one connector {connector}")
        named[connector] = rest
    return {connector: named[connector] for connector in CONNECTORS if connector in named}
