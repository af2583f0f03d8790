# SPDX-License-Identifier: MIT
"""Sends a Teensy to its bootloader and runs PJRC's loader for the command line, which also works over SSH."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import serial

from omniwheel.errors import FlashError
from omniwheel.flashing.boards import Board, teensy_ports
from omniwheel.flashing.source import STANDARD_ERROR, core_dir
from omniwheel.ports import bootloaders

PROGRAM = "teensy_loader_cli"
HOW_TO_GET_IT = (
    "Debian, Ubuntu: sudo apt install teensy-loader-cli; anywhere: pio pkg install -g -t platformio/tool-teensy"
)
REBOOT_BAUD = 134
"""Opening a Teensy's port at this rate sends it to its bootloader; our firmware switches the motors off first."""
LEAVE_S = 5.0
"""How long a board may take from there until its port is gone."""
LOADER_S = 120.0
"""How long the loader may take, a person on the way to the button included."""
POLL_S = 0.1
CUT_SHORT = (
    "press the button on the board and run the same command with --blank; the bootloader cannot be "
    "overwritten, and until an upload is complete the board runs no program or its old one"
)


def find_loader() -> str | None:
    """Return PJRC's loader: PlatformIO's, which comes with the first build, or one that is installed; or None."""
    folders = (str(core_dir() / "packages" / "tool-teensy"), str(Path(sys.executable).parent), None)
    return next((path for folder in folders if (path := shutil.which(PROGRAM, path=folder))), None)


def require_loader() -> str:
    """Return PJRC's loader. Raises FlashError."""
    path = find_loader()
    if path is None:
        raise FlashError(f"{PROGRAM} is not installed", hint=HOW_TO_GET_IT)
    return path


def loader_command(loader: str, image: Path) -> list[str]:
    """Return what is run. It waits for a bootloader (-w) and reboots no board by itself."""
    return [loader, "--mcu=TEENSY40", "-w", "-v", str(image)]


def enter_bootloader(
    board: Board, *, clock: Callable[[], float] = time.monotonic, sleep: Callable[[float], None] = time.sleep
) -> bool:
    """Send the board to its bootloader. Return whether its port is gone, or never was there.

    Raises FlashError if another board got there meanwhile.
    """
    if board.port is None:
        return not board.others
    try:
        serial.Serial(board.port.device, REBOOT_BAUD).close()
    except (OSError, serial.SerialException) as error:
        hint = "check whether another program uses it; `omni doctor` checks its permissions"
        raise FlashError(f"{board.port.device} cannot be opened: {error}", hint=hint) from error
    deadline = clock() + LEAVE_S
    gone = False
    while not gone and clock() < deadline:
        sleep(POLL_S)
        gone = board.port.device not in [port.device for port in teensy_ports()]
    if (bootloaders() or 0) > 1:
        raise FlashError("another Teensy has entered its bootloader, too; nothing was uploaded", hint=CUT_SHORT)
    return gone


def run_loader(loader: str, image: Path, *, timeout_s: float = LOADER_S) -> None:
    """Upload the file to the board in its bootloader and start it. Raises FlashError, whose hint says how to go on."""
    try:
        done = subprocess.run(loader_command(loader, image), check=False, stdout=STANDARD_ERROR, timeout=timeout_s)
    except OSError as error:
        raise FlashError(f"{loader} cannot be run: {error.strerror}") from error
    except subprocess.TimeoutExpired as error:
        raise FlashError(f"no upload within {timeout_s:g} s: no bootloader was found", hint=CUT_SHORT) from error
    if done.returncode != 0:
        raise FlashError(f"the upload failed: {PROGRAM} ended with exit code {done.returncode}", hint=CUT_SHORT)
