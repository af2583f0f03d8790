# SPDX-License-Identifier: MIT
"""Compares what a program takes to be wired with what the board's firmware takes to be wired, before an upload."""

from __future__ import annotations

from omni_schema import wiring_id
from omniwheel.errors import FlashError, OmniError
from omniwheel.flashing.boards import Board
from omniwheel.flashing.hex_file import HexImage
from omniwheel.robot import connect
from omniwheel.robots import read_robot, robot_names

OVERRIDE = "--new-wiring"
_ANSWER_S = 3.0


def require_same_wiring(image: HexImage, board: Board) -> None:
    """Raise FlashError if the board's firmware was built for another wiring than the image.

    A board that shows no port, does not answer or runs other firmware says nothing; an image without a label neither.
    """
    running = _running_id(board) if image.wiring_id else 0
    if running in (0, image.wiring_id):
        return
    robots = {wiring_id(read_robot(name)): name for name in reversed(robot_names())}
    raise FlashError(
        f"{image.path} is for {_wiring(robots, image.wiring_id)}, {board} runs firmware for "
        f"{_wiring(robots, running)}: motors and encoders could be on other pins",
        hint=f"choose the firmware of this robot; if its wiring has changed: {OVERRIDE}",
    )


def _wiring(robots: dict[int, str], number: int) -> str:
    name = robots.get(number)
    return f"the wiring of {name}" if name else f"a custom wiring (id {number:08x})"


def _running_id(board: Board) -> int:
    if board.port is None:
        return 0
    try:
        with connect(board.port.device, timeout_s=_ANSWER_S, heartbeat=False) as robot:
            return robot.version.wiring_id
    except OmniError:
        return 0
