# SPDX-License-Identifier: MIT
"""Which Teensy an upload goes to. The loader takes whatever board waits in its bootloader; it cannot be told which."""

from __future__ import annotations

from dataclasses import dataclass

from omniwheel.errors import FlashError
from omniwheel.ports import Port, bootloaders, serial_ports

_UNPLUG = "unplug all Teensys but the one to upload to"


@dataclass(frozen=True)
class Board:
    """The board that an upload goes to. ``port`` is None for one that shows none: it waits, or waits for its button.

    ``others`` are the ports of Teensys that were there before.
    """

    port: Port | None
    others: tuple[str, ...] = ()

    def __str__(self) -> str:
        if self.port is None:
            return "the board that waits in its bootloader, or whose button is pressed"
        number = self.port.serial_number
        return f"{self.port.device}{f' (serial number {number})' if number else ''}"


def teensy_ports() -> list[Port]:
    """Return the serial ports that look like a Teensy."""
    return [port for port in serial_ports() if port.guess == "teensy"]


def choose_board(port: str | None, *, blank: bool) -> Board:
    """Return the one board to upload to; ``blank``: one without a serial port. Raises FlashError if there is not one.

    With several boards the one on ``port`` is sent to its bootloader by us. And where the computer tells that no other
    waits there, the loader can only take that one.
    """
    found = teensy_ports()
    names = tuple(port.device for port in found)
    waiting = bootloaders()
    if waiting is not None and waiting > 1:
        raise FlashError(
            f"{waiting} Teensys wait in their bootloaders: the upload could go to any of them", hint=_UNPLUG
        )
    if blank:
        return Board(None, names)
    if waiting:
        if found:
            what = "another Teensy waits in its bootloader and would be flashed instead"
            raise FlashError(what, hint="--blank uploads to that one; unplug it to upload to the other")
        return Board(None)
    return Board(_one_port(port, found, only_ours_waits=waiting == 0))


def _one_port(wanted: str | None, found: list[Port], *, only_ours_waits: bool) -> Port:
    names = ", ".join(port.device for port in found) or "none"
    if wanted is not None and wanted not in [port.device for port in found]:
        known = wanted in [port.device for port in serial_ports()]
        problem = f"{wanted} is not a Teensy" if known else f"no such port {wanted}"
        raise FlashError(problem, hint=f"Teensys: {names}")
    if not found:
        hint = "plug it in by a USB cable that carries data; a board that never had a serial port needs --blank"
        raise FlashError("no Teensy is connected", hint=hint)
    if len(found) > 1 and not only_ours_waits:
        raise FlashError(f"{len(found)} Teensys are connected, and the loader cannot tell them apart", hint=_UNPLUG)
    if len(found) > 1 and wanted is None:
        raise FlashError(f"{len(found)} Teensys are connected", hint=f"--port, one of {names}")
    return next(port for port in found if wanted in (None, port.device))
