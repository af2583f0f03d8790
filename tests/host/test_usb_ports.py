# SPDX-License-Identifier: MIT
"""Which USB devices are taken for a Teensy. The vendor id is shared by many makers."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from omniwheel.ports import FTDI_VID, HALFKAY_PID, TEENSY_VID, bootloaders, guess_device, serial_ports


@pytest.mark.parametrize(
    ("vid", "pid", "maker", "product", "guess"),
    [
        (TEENSY_VID, 0x0483, "Teensyduino", "USB Serial", "teensy"),
        (TEENSY_VID, 0x0483, "", "", "teensy"),  # Windows and some hubs tell no words
        (TEENSY_VID, 0x0483, "Acme", "Robot", "teensy"),  # the words can be chosen in the firmware
        (TEENSY_VID, 0x0489, "Teensyduino", "Teensy MIDI", "teensy"),
        (TEENSY_VID, 0x048C, "Teensyduino", "Triple Serial", "teensy"),
        (TEENSY_VID, 0x04DF, "Teensyduino", "Something new", "teensy"),
        (TEENSY_VID, 0x04DF, "", "Teensy 5", "teensy"),
        (TEENSY_VID, 0x05DC, "obdev.at", "USBasp", ""),  # a programmer
        (TEENSY_VID, 0x27DD, "", "V-USB CDC", ""),  # anybody's serial adapter
        (TEENSY_VID, 0x05DF, "", "USBRelay2", ""),
        (TEENSY_VID, None, "", "", ""),
        (0x2341, 0x0483, "Arduino", "Teensy look-alike", ""),
        (FTDI_VID, 0x6015, "FTDI", "FT231X", "xbee"),
        (None, None, "", "", ""),
    ],
)
def test_a_teensy_is_known_by_more_than_a_shared_vendor_id(
    vid: int | None, pid: int | None, maker: str, product: str, guess: str
) -> None:
    assert guess_device(vid, pid, maker, product) == guess


def test_ports_are_listed_with_likely_robots_first(monkeypatch: pytest.MonkeyPatch) -> None:
    def port(device: str, vid: int | None, pid: int | None) -> SimpleNamespace:
        return SimpleNamespace(
            device=device, description=None, vid=vid, pid=pid, manufacturer=None, product=None, serial_number=None
        )

    listed = [port("/dev/a", None, None), port("/dev/b", FTDI_VID, 1), port("/dev/c", TEENSY_VID, 0x0483)]
    monkeypatch.setattr("omniwheel.ports.list_ports.comports", lambda: listed)
    assert [(p.device, p.guess) for p in serial_ports()] == [("/dev/c", "teensy"), ("/dev/b", "xbee"), ("/dev/a", "")]


def test_boards_that_wait_in_their_bootloader_are_counted(tmp_path: Path) -> None:
    def plug(name: str, vid: int, pid: int) -> None:
        (tmp_path / name).mkdir()
        (tmp_path / name / "idVendor").write_text(f"{vid:04x}\n")
        (tmp_path / name / "idProduct").write_text(f"{pid:04x}\n")

    assert bootloaders(tmp_path / "not_linux") is None
    assert bootloaders(tmp_path) == 0
    plug("1-1", TEENSY_VID, HALFKAY_PID)
    plug("1-2", TEENSY_VID, 0x0483)
    plug("1-3", 0x1D6B, 0x0002)
    (tmp_path / "1-1:1.0").mkdir()  # an interface has no ids
    assert bootloaders(tmp_path) == 1
    plug("1-4", TEENSY_VID, HALFKAY_PID)
    assert bootloaders(tmp_path) == 2
