# SPDX-License-Identifier: MIT
"""LPUART6 of the emulated chip: bytes take the line's time, FIFOs, flags and interrupt; the wires of Serial1."""

from __future__ import annotations

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from emulated_teensy.image_file import Image
from emulated_teensy.machine import Channel, FindingKind, Machine, Wiring
from omniwheel._core import ffi, lib
from tests.image.chip import Chip

BASE = 0x40198000
PINCFG, BAUD, STAT, CTRL, DATA, FIFO, WATER = (BASE + offset for offset in (0x0C, 0x10, 0x14, 0x18, 0x1C, 0x28, 0x2C))
TDRE, TC, RDRF, IDLE, OVERRUN = 1 << 23, 1 << 22, 1 << 21, 1 << 20, 1 << 19
TIE, TCIE, RIE, ILIE, TE, RE = 1 << 23, 1 << 22, 1 << 21, 1 << 20, 1 << 19, 1 << 18
RXEMPT_IN_DATA = 1 << 12
FIFOS_ON = 1 << 7 | 1 << 3
IRQ = 25
MUX_TX, MUX_RX, DAISY_RX = 0x401F80C4, 0x401F80C8, 0x401F8550
BIT_NS = 1e9 / 115200
FRAME_NS = 10 * BIT_NS


@pytest.fixture
def uart(chip: Chip) -> Chip:
    """LPUART6 as the core's begin(115200) leaves it: 26 samples per bit, 8 clocks each."""
    chip.open_gates(3, 3)
    chip.open_gates(4, 1)
    chip.write(0x400FC024, 1 << 6)  # CSCDR1: the crystal, undivided
    chip.write(MUX_RX, 2)
    chip.write(MUX_TX, 2)
    chip.write(DAISY_RX, 1)
    chip.write(BAUD, 25 << 24 | 8)
    chip.write(WATER, 2 << 16 | 2)
    chip.write(FIFO, FIFOS_ON)
    chip.write(CTRL, TE | RE)
    chip.wait(1.5 * FRAME_NS)  # the preamble
    return chip


def send(chip: Chip, data: bytes) -> None:
    assert lib.rt1062_send(chip.c, lib.RT1062_UART, data, len(data)) == len(data)


def sent(chip: Chip) -> bytes:
    room = ffi.new("uint8_t[4096]")
    return bytes(ffi.buffer(room, lib.rt1062_receive(chip.c, lib.RT1062_UART, room, 4096)))


def test_registers_after_reset_are_the_manuals(chip: Chip) -> None:
    chip.open_gates(3, 3)
    found = [chip.read(register) for register in (BAUD, STAT, CTRL, DATA, FIFO, WATER)]
    assert found == [0x0F000004, TDRE | TC, 0, RXEMPT_IN_DATA, 0x00C00011, 0]


def test_a_byte_leaves_after_ten_bits(uart: Chip) -> None:
    uart.write(DATA, 0x55)
    assert uart.read(STAT) & TC == 0
    uart.wait(0.97 * FRAME_NS)
    assert sent(uart) == b""
    assert uart.read(STAT) & TC == 0
    uart.wait(0.06 * FRAME_NS)
    assert sent(uart) == b"U"
    assert uart.read(STAT) & TC == TC


def test_the_send_fifo_holds_four_beside_the_one_that_leaves(uart: Chip) -> None:
    for byte in b"abcde":
        uart.write(DATA, byte)
    assert uart.read(WATER) >> 8 & 7 == 4
    assert uart.read(STAT) & TDRE == 0
    uart.write(DATA, ord("f"))  # no room
    assert uart.read(FIFO) >> 17 & 1 == 1
    uart.wait(2.5 * FRAME_NS)  # two more have begun
    assert uart.read(WATER) >> 8 & 7 == 2
    assert uart.read(STAT) & TDRE == TDRE
    uart.wait(3 * FRAME_NS)
    assert sent(uart) == b"abcde"


def test_bytes_arrive_one_frame_time_after_another(uart: Chip) -> None:
    send(uart, b"xyz")
    uart.wait(0.97 * FRAME_NS)
    assert uart.read(WATER) >> 24 & 7 == 0
    uart.wait(0.06 * FRAME_NS)
    assert uart.read(WATER) >> 24 & 7 == 1
    assert uart.read(STAT) & RDRF == 0  # more than two are wanted
    uart.wait(2 * FRAME_NS)
    assert uart.read(STAT) & RDRF == RDRF
    assert [uart.read(DATA) & 0xFF for _ in range(3)] == list(b"xyz")
    assert uart.read(DATA) & RXEMPT_IN_DATA


@pytest.mark.parametrize(("last", "bits"), [(0x00, 19), (0xFF, 11), (0x7F, 19), (0xF0, 15)])
def test_the_line_is_idle_after_ten_ones_and_says_so_once(uart: Chip, last: int, bits: int) -> None:
    """Ones at the end of a frame count from after the start bit on (ILT is 0)."""
    send(uart, bytes([last]))
    uart.wait((bits - 0.3) * BIT_NS)
    assert uart.read(STAT) & IDLE == 0
    uart.wait(0.6 * BIT_NS)
    assert uart.read(STAT) & IDLE == IDLE
    uart.write(STAT, IDLE)
    uart.wait(5 * FRAME_NS)
    assert uart.read(STAT) & IDLE == 0


def test_a_slow_program_loses_bytes_and_hears_nothing_until_it_clears_the_flag(uart: Chip) -> None:
    send(uart, b"123456")
    uart.wait(6.5 * FRAME_NS)
    assert uart.read(STAT) & OVERRUN == OVERRUN
    assert [uart.read(DATA) & 0xFF for _ in range(4)] == list(b"1234")
    send(uart, b"7")
    uart.wait(2 * FRAME_NS)
    assert uart.read(WATER) >> 24 & 7 == 0
    uart.write(STAT, OVERRUN)
    send(uart, b"8")
    uart.wait(2 * FRAME_NS)
    assert uart.read(DATA) & 0xFF == ord("8")


def test_the_interrupt_follows_flags_and_enables(uart: Chip) -> None:
    assert not uart.pending(IRQ)
    uart.write(CTRL, TE | RE | TIE)
    assert uart.pending(IRQ)
    uart.write(CTRL, TE | RE | RIE)
    uart.write(0xE000E280, 1 << IRQ)  # forget it
    assert not uart.pending(IRQ)
    send(uart, b"abc")
    uart.wait(2.5 * FRAME_NS)
    assert not uart.pending(IRQ)
    uart.wait(FRAME_NS)
    assert uart.pending(IRQ)


@pytest.mark.parametrize(("register", "wrong"), [(MUX_RX, 5), (DAISY_RX, 0)])
def test_a_wrong_pad_or_daisy_makes_it_deaf(uart: Chip, register: int, wrong: int) -> None:
    uart.write(register, wrong)
    send(uart, b"abc")
    uart.wait(4 * FRAME_NS)
    assert uart.read(WATER) >> 24 & 7 == 0


def test_a_wrong_pad_makes_it_dumb_and_is_found(uart: Chip) -> None:
    uart.write(MUX_TX, 5)
    uart.write(DATA, 0x55)
    uart.wait(2 * FRAME_NS)
    assert sent(uart) == b""
    assert any("LPUART6 sends" in text for text in uart.findings())


def test_without_its_clock_it_is_found(chip: Chip) -> None:
    gates = chip.read(0x400FC074)
    chip.write(0x400FC074, gates & ~(3 << 6))
    chip.read(STAT)
    assert any("LPUART6" in text and "clock" in text for text in chip.findings())


@pytest.mark.parametrize(
    ("register", "value"),
    [
        (CTRL, 1 << 1),
        (CTRL, 1 << 4),
        (BAUD, 1 << 29),
        (BAUD, 4 << 24 | 8),
        (STAT, 1 << 28),
        (FIFO, 1 << 10),
        (PINCFG, 1),
    ],
)
def test_what_is_not_modelled_is_refused(uart: Chip, register: int, value: int) -> None:
    """Parity, nine or ten bits, oversampling by 5 on one edge, inversion, idle triggers, another trigger input."""
    assert uart.refuses(register, value)


def test_serial1_of_the_image_speaks_at_its_parameters_baud_rate(flashed_image: Image) -> None:
    """The image's radio port starts with 9600 baud: at most 960 bytes per second, and a heartbeat every second."""
    with Machine(flashed_image, wiring=Wiring()) as machine:
        machine.power_on()
        machine.run(3.0)
        said = machine.receive(Channel.UART)
        assert 200 < len(said) < 3 * 960
        assert said[0] == 0xFD
        assert FindingKind.PINS not in {finding.kind for finding in machine.findings()}
