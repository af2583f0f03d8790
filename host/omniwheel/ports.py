# SPDX-License-Identifier: MIT
"""Serial ports of this computer, and which of them look like a robot."""

from __future__ import annotations

from dataclasses import dataclass

from serial.tools import list_ports

TEENSY_VID = 0x16C0
FTDI_VID = 0x0403


@dataclass(frozen=True)
class Port:
    """A serial port; ``guess`` is "teensy", "xbee" or ""."""

    device: str
    description: str
    guess: str


def guess_device(vid: int | None) -> str:
    """Say what a USB vendor id suggests: PJRC's is a Teensy, FTDI's the adapter that carries an XBee."""
    if vid == TEENSY_VID:
        return "teensy"
    return "xbee" if vid == FTDI_VID else ""


def serial_ports() -> list[Port]:
    """Return the serial ports, likely robots first."""
    ports = [Port(p.device, p.description or "", guess_device(p.vid)) for p in list_ports.comports()]
    return sorted(ports, key=lambda port: ({"teensy": 0, "xbee": 1}.get(port.guess, 2), port.device))
