# SPDX-License-Identifier: MIT
"""Serial ports of this computer, and which of them look like a robot; Teensys on USB, also those without a port."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from serial.tools import list_ports

from omniwheel.errors import LinkUrlError

TEENSY_VID = 0x16C0
"""Of a company that sells single product ids of it to many makers: it alone says nothing."""
HALFKAY_PID = 0x0478
"""A Teensy in its bootloader: it has no serial port, and waits for an upload."""
TEENSY_PIDS = {
    HALFKAY_PID: "bootloader",
    0x0482: "keyboard, mouse, joystick",
    0x0483: "serial",
    0x0485: "MIDI",
    0x0486: "raw HID",
    0x0487: "serial, keyboard, mouse, joystick",
    0x0488: "flight simulator",
    0x0489: "MIDI and serial",
    0x048A: "MIDI, audio and serial",
    0x048B: "two serial ports",
    0x048C: "three serial ports",
    0x04D0: "keyboard",
    0x04D1: "disk",
    0x04D2: "audio",
    0x04D3: "keyboard, touch screen",
    0x04D4: "keyboard, mouse, touch screen",
    0x04D5: "disk and serial",
}
"""PJRC's product ids: the USB types of Teensyduino's usb_desc.h, and the bootloader."""
FTDI_VID = 0x0403
WHICH_ROBOT = (
    "name its port or address, as /dev/ttyACM0 or tcp:127.0.0.1:5760. No robot at hand? Simulate one: "
    "omniwheel.simulate() in Python, `omni sitl` in a terminal"
)
USB_FOLDER = Path("/sys/bus/usb/devices")
"""Where Linux lists USB devices."""


@dataclass(frozen=True)
class Port:
    """A serial port; ``guess`` is "teensy", "xbee" or "". ``serial_number`` is the USB device's, "" if it has none."""

    device: str
    description: str
    guess: str
    serial_number: str = ""


def is_teensy(vid: int | None, pid: int | None, maker: str = "", product: str = "") -> bool:
    """Return whether a USB device is a Teensy: by its ids, or by its words where its product id is a new one."""
    if vid != TEENSY_VID:
        return False
    return pid in TEENSY_PIDS or maker == "Teensyduino" or product.startswith("Teensy")


def guess_device(vid: int | None, pid: int | None = None, maker: str = "", product: str = "") -> str:
    """Say what a USB device suggests: a Teensy, or FTDI's adapter that carries an XBee."""
    if is_teensy(vid, pid, maker, product):
        return "teensy"
    return "xbee" if vid == FTDI_VID else ""


def serial_ports() -> list[Port]:
    """Return the serial ports, likely robots first."""
    ports = [
        Port(
            p.device,
            p.description or "",
            guess_device(p.vid, p.pid, p.manufacturer or "", p.product or ""),
            p.serial_number or "",
        )
        for p in list_ports.comports()
    ]
    return sorted(ports, key=lambda port: ({"teensy": 0, "xbee": 1}.get(port.guess, 2), port.device))


def only_teensy() -> str:
    """Return the port of the only Teensy that is plugged in. Raises LinkUrlError, which lists what was found."""
    ports = serial_ports()
    found = [port.device for port in ports if port.guess == "teensy"]
    if len(found) == 1:
        return found[0]
    if found:
        what = f"{len(found)} Teensys are connected: {', '.join(found)}"
    else:
        others = ", ".join(port.device for port in ports)
        what = f"no Teensy is connected; other serial ports: {others}" if others else "no Teensy is connected"
    raise LinkUrlError(f"which robot? {what}", hint=WHICH_ROBOT)


def bootloaders(folder: Path = USB_FOLDER) -> int | None:
    """Return how many Teensys wait in their bootloader; None where this computer does not tell (not Linux)."""
    if not folder.is_dir():
        return None
    return sum(_usb_ids(device) == (TEENSY_VID, HALFKAY_PID) for device in folder.iterdir())


def _usb_ids(device: Path) -> tuple[int, int] | None:
    try:
        vid, pid = ((device / name).read_text(encoding="ascii") for name in ("idVendor", "idProduct"))
        return int(vid, 16), int(pid, 16)
    except (OSError, ValueError):  # an interface, or unplugged meanwhile
        return None
