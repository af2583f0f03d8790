# SPDX-License-Identifier: MIT
"""What resets the very image, and whether it knows afterwards."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from emulated_teensy.image_file import read_image
from emulated_teensy.machine import Channel, FindingKind, Machine, Snapshot, Stop
from omniwheel.errors import FirmwareImageError

BOOT_s = 0.9
PROGRAM, WATCHDOG, HOT = 2, 0x80, 0x100
ENDLESS_LOOP = b"\xfe\xe7"


@pytest.fixture(scope="module")
def booted(image: Path) -> Iterator[tuple[Machine, Snapshot]]:
    """Return a machine whose program runs, and how it is then."""
    with Machine(read_image(image)) as machine:
        machine.power_on()
        machine.run(BOOT_s)
        machine.stop_on(Stop.RESET)
        yield machine, machine.snapshot()


@pytest.fixture
def machine(booted: tuple[Machine, Snapshot]) -> Machine:
    """Return the machine as it was after its start."""
    booted[0].restore(booted[1])
    return booted[0]


def said_after_restart(machine: Machine) -> bytes:
    """Return what the radio brings after the reset that is to come or has just been."""
    machine.receive(Channel.UART)
    machine.run(BOOT_s)
    machine.run(BOOT_s)
    return machine.receive(Channel.UART)


def endless_loop(machine: Machine) -> int:
    """Return where the image has an instruction that branches to itself."""
    code = machine.read(0, machine.address_of("_etext"))
    at = next(at for at in range(0, len(code), 2) if code[at : at + 2] == ENDLESS_LOOP)
    return at | 1


def test_a_program_that_lives_is_left_alone(machine: Machine) -> None:
    assert machine.run(3.0) == Stop.TIME
    assert machine.findings() == []


def test_the_watchdog_ends_a_hang(machine: Machine) -> None:
    begin_s = machine.time_s
    with pytest.raises(FirmwareImageError, match="RESET"):
        machine.call(endless_loop(machine), limit_s=1.0)
    assert machine.time_s - begin_s < 0.22
    assert [finding.kind for finding in machine.findings()] == [FindingKind.WATCHDOG]
    assert b"restarted by the watchdog" in said_after_restart(machine)


def test_a_fault_is_reported_after_the_restart(machine: Machine) -> None:
    machine.write(0x20250000, b"abc")
    with pytest.raises(FirmwareImageError, match="RESET"):
        machine.call("eepromemu_flash_write", (0x601FE000, 0x20250000, 3), limit_s=1.0)
    said = said_after_restart(machine)
    assert b"restarted after a crash" in said
    assert b"crash at 0x" in said


@pytest.mark.parametrize(
    ("flags", "text"),
    [(WATCHDOG, b"restarted by the watchdog"), (HOT, b"the processor was too hot"), (PROGRAM, None)],
)
def test_the_reason_is_known_and_forgotten(machine: Machine, flags: int, text: bytes | None) -> None:
    machine.reset(flags)
    assert machine.run(0.1) == Stop.RESET
    said = said_after_restart(machine)
    assert b"disarmed" in said
    assert (b"restarted" in said) == (text is not None)
    assert text is None or text in said
    machine.reset(PROGRAM)
    assert machine.run(0.1) == Stop.RESET
    assert b"restarted" not in said_after_restart(machine)


def test_too_hot_is_a_fault_and_said(machine: Machine) -> None:
    machine.set_temperature(95)
    assert machine.run(0.5) == Stop.RESET
    machine.set_temperature(40)
    assert b"too hot" in said_after_restart(machine)
