# SPDX-License-Identifier: MIT
"""Saving parameters in the very image: lengths, and the power failing meanwhile."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from emulated_teensy.image_file import read_image
from emulated_teensy.machine import FindingKind, Machine, Snapshot
from omniwheel.errors import FirmwareImageError
from tests.image.flash_log import ImageLog

RAM = 0x20250000
FREE_SECTOR = 0x601FE000
"""The last of those that the image keeps its parameters in: erased unless thousands of saves were made."""
BOOT_s = 0.9


@pytest.fixture(scope="module")
def booted(image: Path) -> Iterator[tuple[Machine, Snapshot]]:
    """Return a machine whose program runs, and how it is then."""
    with Machine(read_image(image)) as machine:
        machine.power_on()
        machine.run(BOOT_s)
        assert machine.findings() == []
        yield machine, machine.snapshot()


@pytest.fixture
def machine(booted: tuple[Machine, Snapshot]) -> Machine:
    """Return the machine as it was after its start."""
    booted[0].restore(booted[1])
    return booted[0]


def pattern(count: int) -> bytes:
    """Return bytes that differ from their neighbours and from erased memory."""
    return bytes((73 * i + 5 * count) % 255 for i in range(count))


@pytest.mark.parametrize("aligned", [0, 1, 2, 3, 4, 5, 6, 7])
def test_the_core_faults_on_some_lengths(booted: tuple[Machine, Snapshot], aligned: int) -> None:
    """Its copy into the flash controller: 3 bytes more than a multiple of 8, or 7 from an aligned address."""
    machine, start = booted
    for count in range(1, 33):
        machine.restore(start)
        machine.write(RAM + aligned, pattern(count))
        faults = count % 8 == 3 or (count % 8 == 7 and aligned % 4 == 0)
        if faults:
            with pytest.raises(FirmwareImageError):
                machine.call("eepromemu_flash_write", (FREE_SECTOR, RAM + aligned, count), limit_s=0.002)
            assert [finding.kind for finding in machine.findings()] == [FindingKind.DEVICE_WIDTH]
        else:
            machine.call("eepromemu_flash_write", (FREE_SECTOR, RAM + aligned, count))
            assert bytes(machine.flash[0x1FE000 : 0x1FE000 + count]) == pattern(count)
            assert machine.findings() == []


def test_saves_of_every_length(machine: Machine) -> None:
    log = ImageLog(machine)
    for number, count in enumerate([*range(1, 70), 255, 256, 257, 1000, 2000]):
        offset = 13 * number % 40
        assert log.save(offset, pattern(count)), count
        assert log.load(offset, count) == pattern(count)
        log.find_again()
        assert log.load(offset, count) == pattern(count), f"{count} bytes at {offset} are lost over a start"
    assert machine.findings() == []


@pytest.mark.parametrize("share", [0.0, 0.5, 0.98])
@pytest.mark.parametrize("command", [1, 2, 3, 4])
def test_a_power_cut_leaves_the_old_or_the_new(machine: Machine, command: int, share: float) -> None:
    log = ImageLog(machine)
    old, new = pattern(61), bytes(255 - byte for byte in pattern(61))
    assert log.save(3, old)
    machine.cut_power_at(command, share)
    with pytest.raises(FirmwareImageError, match="POWER"):
        log.save(3, new)
    machine.power_on()
    machine.run(BOOT_s)
    log = ImageLog(machine)
    assert log.load(3, 61) in (old, new)
    assert log.save(3, new)
    assert log.load(3, 61) == new
    assert machine.findings() == []
