# SPDX-License-Identifier: MIT
"""Waits until the board that was uploaded to answers, and says what it runs: the new firmware, not the old."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from omniwheel.errors import FlashError, OmniError
from omniwheel.firmware_version import RobotVersion
from omniwheel.flashing.boards import Board, teensy_ports
from omniwheel.flashing.loader import CUT_SHORT
from omniwheel.ports import Port
from omniwheel.robot import connect
from omniwheel.telemetry import Status

BOOT_S = 30.0
_POLL_S = 0.1
_ANSWER_S = 3.0


@dataclass(frozen=True)
class Flashed:
    """What runs after an upload: on which port, and which version."""

    port: str
    version: RobotVersion


@dataclass(frozen=True)
class Answer:
    """What a board says of itself: its version, and for how long it has been running [s]."""

    version: RobotVersion
    uptime_s: float


def wait_for_firmware(
    board: Board,
    git_hash: str,
    *,
    began_s: float,
    left: bool,
    timeout_s: float = BOOT_S,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> Flashed:
    """Wait until the board is back on USB and say what it runs.

    ``began_s`` is when the upload began, by ``clock``. ``left``: since then its port was seen to go; else it is waited
    for that, or for firmware that started since then.
    ``git_hash`` is what was built in, "" if that is not known. Raises FlashError if nothing, the old or other firmware
    answers.
    """
    begin = clock()
    last = "its port did not reappear; unplug it, plug it in and check its LED"
    while clock() < begin + timeout_s:
        port = _port_of(board)
        left = left or port is None
        try:
            answer = _ask(port.device) if port else None
        except OmniError as error:  # not there yet, or gone again: it is starting
            last = f"last problem: {error}"
            answer = None
        if port and answer and (left or answer.uptime_s < clock() - began_s):
            return Flashed(port.device, _checked(port, answer.version, git_hash))
        if answer:
            last = f"the old firmware still responds; {CUT_SHORT}"
        sleep(_POLL_S)
    raise FlashError(f"the board did not respond within {timeout_s:.0f} s of the upload", hint=last)


def _port_of(board: Board) -> Port | None:
    """Return the board's port as it is now: a board keeps its serial number, but perhaps not the port's name."""
    found = teensy_ports()
    if board.port is None:
        new = [port for port in found if port.device not in board.others] if len(found) > 1 else found
        return new[0] if len(new) == 1 else None
    number = board.port.serial_number
    same = [port for port in found if (port.serial_number == number if number else port.device == board.port.device)]
    return same[0] if same else None


def _ask(device: str) -> Answer:
    with connect(device, timeout_s=_ANSWER_S, heartbeat=False) as robot:
        return Answer(robot.version, robot.wait_for(Status).time_s)


def _checked(port: Port, version: RobotVersion, git_hash: str) -> RobotVersion:
    if git_hash.strip("0") and version.git_hash and version.git_hash != git_hash:
        raise FlashError(
            f"{port.device} runs {version}, not the {git_hash[:8]} just built",
            hint="the upload went to another board or failed: press the button on the board and try again with --blank",
        )
    return version
