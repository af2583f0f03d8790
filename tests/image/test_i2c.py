# SPDX-License-Identifier: MIT
"""The I2C master LPI2C1 and the bus: times by the manual's formulas and UM10204, acknowledges, lines that are held."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from emulated_teensy.i2c_wave import LIMITS, START, STOP, Wave, edges_of, read_wave, violations
from hil_sim.world import World
from omniwheel._core import ffi, lib
from tests.image.assembly import Program
from tests.image.chip import Chip, parked
from tests.image.conftest import WorldMaker

MASTER = 0x403F0000
MCR, MSR, MIER, MCFGR0, MCFGR1, MCFGR2, MCFGR3, MCCR0, MFCR, MFSR, MTDR, MRDR = (
    0x10, 0x14, 0x18, 0x20, 0x24, 0x28, 0x2C, 0x48, 0x58, 0x5C, 0x60, 0x70,
)  # fmt: skip
MEN, RST, RTF, RRF = 1, 2, 1 << 8, 1 << 9
TDF, RDF, EPF, SDF, NDF, ALF, FEF, PLTF, MBF, BBF = (1 << bit for bit in (0, 1, 8, 9, 10, 11, 12, 13, 24, 25))
TRANSMIT, RECEIVE, STOP_COMMAND, START_COMMAND = 0, 1 << 8, 2 << 8, 4 << 8
CSCDR2 = 0x400FC038
SCL_MUX, SDA_MUX = 0x401F80FC, 0x401F8100
SCL_PAD, SDA_PAD = 0x401F82EC, 0x401F82F0
SCL_DAISY, SDA_DAISY = 0x401F84CC, 0x401F84D0
GPIO6, GPR26 = 0x42000000, 0x400AC068
GDIR, PSR = 4, 8
SCL_BIT, SDA_BIT = 1 << 16, 1 << 17
ALT3_SION, GPIO_SION = 3 | 0x10, 5 | 0x10
OPEN_DRAIN_UP = 1 << 16 | 3 << 14 | 1 << 13 | 1 << 12 | 1 << 11 | 2 << 3
IRQ_LPI2C1 = 28
SDA, SCL = 18, 19
CHIP = 0x40
CLOCK_NS = 1e9 / 60e6


@dataclass(frozen=True)
class Timing:
    """Fields of the timing registers."""

    prescale: int
    low: int
    high: int
    hold: int
    valid: int
    filter: int
    idle: int = 0

    @property
    def scale_ns(self) -> float:
        """A prescaled clock."""
        return CLOCK_NS * float(1 << self.prescale)

    @property
    def latency(self) -> int:
        """Prescaled clocks until a rise has been seen."""
        rise = 1  # of the 20 ns
        return (2 + self.filter + rise) >> self.prescale


STANDARD = Timing(3, 38, 33, 43, 6, 15, 170)
FAST = Timing(1, 44, 20, 21, 7, 15, 134)
FAST_PLUS = Timing(0, 35, 17, 18, 6, 4, 112)
SPEED_Hz = {STANDARD: 100_000, FAST: 400_000, FAST_PLUS: 1_000_000}


def set_up(chip: Chip, timing: Timing = FAST) -> None:
    """Clock, pins and master as the firmware sets them up."""
    chip.write(CSCDR2, chip.read(CSCDR2) & ~(0x3F << 19 | 1 << 18))
    chip.open_gates(2, 3)
    for pad, mux, daisy in ((SCL_PAD, SCL_MUX, SCL_DAISY), (SDA_PAD, SDA_MUX, SDA_DAISY)):
        chip.write(pad, OPEN_DRAIN_UP)
        chip.write(mux, ALT3_SION)
        chip.write(daisy, 1)
    chip.write(MASTER + MCR, RST)
    chip.write(MASTER + MCR, 0)
    chip.write(MASTER + MCFGR1, timing.prescale)
    chip.write(MASTER + MCFGR2, timing.filter << 24 | timing.filter << 16 | timing.idle)
    chip.write(MASTER + MCCR0, timing.valid << 24 | timing.hold << 16 | timing.high << 8 | timing.low)
    chip.write(MASTER + MCR, MEN)
    edges_of(chip.c)


@dataclass
class Bus:
    """A chip with its bus at a world's PWM chip."""

    chip: Chip
    world: World

    def command(self, *words: int) -> None:
        """Give the master commands, waiting for room."""
        for word in words:
            for _ in range(1000):
                if self.chip.read(MASTER + MFSR) & 7 < 4:
                    break
                self.chip.wait(1000)
            self.chip.write(MASTER + MTDR, word)

    def write(self, *data: int, address: int = CHIP) -> None:
        """Write bytes with START and STOP, and wait."""
        self.command(START_COMMAND | address << 1, *data, STOP_COMMAND)
        self.chip.wait(600_000)

    def flags(self) -> int:
        """Return the status."""
        return self.chip.read(MASTER + MSR)

    def clear(self, flags: int) -> None:
        """Clear flags."""
        self.chip.write(MASTER + MSR, flags)

    def wave(self) -> Wave:
        """Return what happened on the bus since the last call."""
        return read_wave(edges_of(self.chip.c))

    @property
    def registers(self) -> list[int]:
        """The PWM chip's registers."""
        return list(self.world.c.chip.registers)


@pytest.fixture
def wired(program: Program, make_world: WorldMaker) -> Iterator[Bus]:
    """A bus that nobody has set up."""
    world = make_world()
    with parked(program, world=world) as chip:
        yield Bus(chip, world)


@pytest.fixture
def bus(wired: Bus) -> Bus:
    """A bus at 400 kHz."""
    set_up(wired.chip)
    return wired


# ---------------------------------------------------------------- times


@pytest.mark.parametrize("timing", [STANDARD, FAST, FAST_PLUS])
def test_times_are_the_manuals(wired: Bus, timing: Timing) -> None:
    set_up(wired.chip, timing)
    wired.command(START_COMMAND | CHIP << 1, 0x00, START_COMMAND | CHIP << 1, 0xA5, 0x5A, STOP_COMMAND)
    wired.chip.wait(900_000)
    wave = wired.wave()
    scale, latency = timing.scale_ns, timing.latency
    assert set(wave.bytes) == {CHIP << 1, 0x00, 0xA5, 0x5A}
    assert wave.low_ns == pytest.approx([(timing.low + 1) * scale] * len(wave.low_ns), abs=0.1)
    assert min(wave.high_ns) == pytest.approx((timing.high + 1 + latency) * scale, abs=0.1)
    assert min(wave.period_ns) == pytest.approx((timing.low + timing.high + 2 + latency) * scale, abs=0.1)
    assert wave.start_hold_ns == pytest.approx([(timing.hold + 1) * scale] * 2, abs=0.1)
    assert wave.start_setup_ns[1] == pytest.approx((timing.hold + 1 + latency) * scale, abs=0.1)
    assert wave.stop_setup_ns == pytest.approx([(timing.hold + 1 + latency) * scale], abs=0.1)
    assert max(wave.data_hold_ns) == pytest.approx((timing.valid + 1) * scale, abs=0.1)


@pytest.mark.parametrize("timing", [STANDARD, FAST, FAST_PLUS])
def test_times_keep_the_specifications_limits(wired: Bus, timing: Timing) -> None:
    set_up(wired.chip, timing)
    for _ in range(2):
        wired.command(START_COMMAND | CHIP << 1, 0x01, START_COMMAND | CHIP << 1, 0x01, 0x04, STOP_COMMAND)
    wired.chip.wait(2_000_000)
    wave = wired.wave()
    assert wave.free_ns
    assert violations(wave, LIMITS[SPEED_Hz[timing]]) == []


def test_the_functional_clock_is_ccms(wired: Bus) -> None:
    set_up(wired.chip)
    wired.chip.write(CSCDR2, wired.chip.read(CSCDR2) | 1 << 18)  # 24 MHz crystal
    wired.write(0x00)
    assert min(wired.wave().low_ns) == pytest.approx((FAST.low + 1) * 2 / 24e6 * 1e9, abs=0.1)


def test_an_empty_fifo_stretches_the_clock(bus: Bus) -> None:
    bus.command(START_COMMAND | CHIP << 1, 0x01)
    bus.chip.wait(500_000)
    assert (bus.chip.pin(SCL), bus.flags() & (TDF | MBF | BBF)) == (0, TDF | MBF | BBF)
    bus.command(0x0C, STOP_COMMAND)
    bus.chip.wait(200_000)
    assert max(bus.wave().low_ns) > 400_000
    assert bus.registers[1] == 0x0C


# ---------------------------------------------------------------- transfers


def test_bytes_reach_the_chip(bus: Bus) -> None:
    bus.write(0x00, 0x20)
    assert bus.wave().events == [START, (CHIP << 1, True), (0, True), (0x20, True), STOP]
    assert bus.registers[0] == 0x20
    assert bus.flags() & (SDF | EPF | NDF | MBF | BBF) == SDF | EPF


def test_outputs_change_on_stop(bus: Bus) -> None:
    lib.hil_world_output_enable(bus.world.c, True)
    bus.write(0x00, 0x20)
    bus.command(START_COMMAND | CHIP << 1, 0x06 + 4 * 9, 0, 0x10, 0, 0)
    bus.chip.wait(400_000)
    assert bus.registers[0x06 + 4 * 9 + 1] == 0x10
    assert lib.hil_pca9685_duty(pwm_chip(bus.world), 9) == 0.0
    bus.command(STOP_COMMAND)
    bus.chip.wait(50_000)
    assert bus.flags() & SDF
    assert lib.hil_pca9685_duty(pwm_chip(bus.world), 9) == 1.0


def pwm_chip(world: World) -> object:
    return ffi.addressof(world.c, "chip")


def test_reading_with_a_repeated_start(bus: Bus) -> None:
    bus.write(0x00, 0x21)
    bus.wave()
    bus.command(START_COMMAND | CHIP << 1, 0x00, START_COMMAND | CHIP << 1 | 1, RECEIVE | 2, STOP_COMMAND)
    bus.chip.wait(500_000)
    events = bus.wave().events
    assert events == [
        START, (CHIP << 1, True), (0, True),
        START, (CHIP << 1 | 1, True), (0x21, True), (0x04, True), (0xE2, False), STOP,
    ]  # fmt: skip
    assert bus.flags() & RDF
    assert [bus.chip.read(MASTER + MRDR) for _ in range(4)] == [0x21, 0x04, 0xE2, 1 << 14]


def test_a_full_receive_fifo_stretches_the_clock(bus: Bus) -> None:
    bus.command(START_COMMAND | CHIP << 1 | 1, RECEIVE | 5, STOP_COMMAND)
    bus.chip.wait(900_000)
    assert bus.chip.read(MASTER + MFSR) >> 16 == 4
    assert bus.chip.pin(SCL) == 0
    for _ in range(4):
        bus.chip.read(MASTER + MRDR)
    bus.chip.wait(200_000)
    assert bus.chip.read(MASTER + MFSR) >> 16 == 2
    assert bus.flags() & SDF


def test_nobody_answers(bus: Bus) -> None:
    bus.command(START_COMMAND | 0x41 << 1, 0x00)
    bus.chip.wait(100_000)
    assert bus.wave().events == [START, (0x41 << 1, False), STOP]
    assert bus.flags() & (NDF | SDF | MBF) == NDF | SDF
    bus.chip.write(MASTER + MCR, MEN | RTF)
    bus.command(START_COMMAND | CHIP << 1)
    bus.chip.wait(100_000)
    assert not bus.wave().events  # no new START before the flag is cleared
    bus.clear(NDF)
    bus.chip.wait(100_000)
    assert bus.wave().events == [START, (CHIP << 1, True)]


def test_data_without_a_start(bus: Bus) -> None:
    bus.command(0x55)
    assert bus.flags() & FEF
    assert not bus.wave().events


def test_the_interrupt_follows_flags_and_enables(bus: Bus) -> None:
    bus.write(0x01, 0x04)
    assert not bus.chip.pending(IRQ_LPI2C1)
    bus.chip.write(MASTER + MIER, SDF)
    assert bus.chip.pending(IRQ_LPI2C1)


# ---------------------------------------------------------------- lines that are held


def test_a_held_clock_only_delays(bus: Bus) -> None:
    bus.command(START_COMMAND | CHIP << 1, 0x01, 0x0C, STOP_COMMAND)
    bus.chip.wait(20_000)
    bus.chip.drive(SCL, 0)
    bus.chip.wait(300_000)
    assert bus.registers[1] == 0x04
    bus.chip.drive(SCL, -1)
    bus.chip.wait(300_000)
    assert bus.registers[1] == 0x0C
    assert bus.flags() & (SDF | ALF | NDF) == SDF


def test_held_data_loses_the_bus(bus: Bus) -> None:
    bus.command(START_COMMAND | CHIP << 1, 0xFF, 0xFF, STOP_COMMAND)
    bus.chip.wait(30_000)
    bus.chip.drive(SDA, 0)
    bus.chip.wait(100_000)
    assert bus.flags() & (ALF | MBF) == ALF
    assert bus.chip.pin(SCL) == 1


def test_no_start_while_a_line_is_low(bus: Bus) -> None:
    bus.chip.drive(SDA, 0)
    bus.command(START_COMMAND | CHIP << 1)
    bus.chip.wait(100_000)
    assert bus.flags() & (MBF | BBF) == BBF
    bus.chip.drive(SDA, -1)
    bus.chip.wait(100_000)
    assert bus.wave().events[-2:] == [START, (CHIP << 1, True)]


def test_a_bus_that_stays_high_is_idle_again(bus: Bus) -> None:
    """Somebody's START without a STOP: BUSIDLE clocks later the bus counts as free."""
    for pin, level in ((SDA, 0), (SCL, 0), (SDA, -1), (SCL, -1)):
        bus.chip.drive(pin, level)
    assert bus.flags() & BBF
    bus.chip.wait(FAST.idle * FAST.scale_ns + 500)
    assert not bus.flags() & BBF


def test_pin_low_timeout(wired: Bus) -> None:
    set_up(wired.chip)
    wired.chip.write(MASTER + MCR, 0)
    wired.chip.write(MASTER + MCFGR3, 4 << 8)  # 4 * 256 clocks
    wired.chip.write(MASTER + MCR, MEN)
    wired.chip.drive(SCL, 0)
    wired.chip.wait(4 * 256 * FAST.scale_ns - 1000)
    assert not wired.flags() & PLTF
    wired.chip.wait(2000)
    assert wired.flags() & PLTF


def test_clocks_by_gpio_free_a_chip_that_holds_data(bus: Bus) -> None:
    """The master is reset while the chip sends a 0: the chip holds SDA until it has been clocked to its end."""
    chip = bus.chip
    bus.write(0x00, 0x20)
    bus.command(START_COMMAND | CHIP << 1, 0x06, START_COMMAND | CHIP << 1 | 1, RECEIVE | 0)
    chip.wait(4 * 9 * 2_500 - 9_000)
    chip.write(MASTER + MCR, RST)
    assert (chip.pin(SCL), chip.pin(SDA)) == (1, 0)
    chip.write(GPR26, 0xFFFFFFFF)
    for mux in (SCL_MUX, SDA_MUX):
        chip.write(mux, GPIO_SION)
    clocks = 0
    while not chip.read(GPIO6 + PSR) & SDA_BIT:
        clocks += 1
        assert clocks <= 9
        for direction in (SCL_BIT, 0):
            chip.write(GPIO6 + GDIR, direction)
            chip.wait(5_000)
    assert 1 <= clocks <= 9
    chip.write(GPIO6 + GDIR, 0)
    set_up(chip)
    bus.write(0x01, 0x0C)
    assert bus.registers[1] == 0x0C


# ---------------------------------------------------------------- wrong set-ups


@pytest.mark.parametrize(
    ("address", "value", "line"),
    [(SCL_MUX, 5, "SCL"), (SDA_MUX, 3, "SDA"), (SCL_DAISY, 0, "SCL"), (SDA_DAISY, 0, "SDA"), (SDA_MUX, 0x12, "SDA")],
)
def test_a_master_without_its_pins_is_deaf_and_found(bus: Bus, address: int, value: int, line: str) -> None:
    bus.chip.write(address, value)
    bus.write(0x00, 0x20)
    assert bus.registers[0] == 0x11
    assert bus.chip.found(lib.RT1062_FINDING_PINS) == [
        f"LPI2C1 is to begin, but its {line} reaches no pin: check mux, SION and SELECT_INPUT"
    ]


def test_without_a_clock_nothing_is_written(wired: Bus) -> None:
    wired.chip.write(MASTER + MCFGR2, 5)
    assert wired.chip.found(lib.RT1062_FINDING_CLOCK) == ["LPI2C1 is used while its clock is off"]


@pytest.mark.parametrize(
    ("register", "value"), [(MCFGR0, 1), (MCFGR1, 1 << 8), (MTDR, 5 << 8), (MTDR, 3 << 8), (0x110, 1), (MCCR0, 0)]
)
def test_what_is_not_modelled_or_not_allowed_is_refused(bus: Bus, register: int, value: int) -> None:
    assert bus.chip.refuses(MASTER + register, value)


def test_a_fifth_command_is_refused(bus: Bus) -> None:
    for _ in range(5):
        bus.chip.write(MASTER + MTDR, START_COMMAND | CHIP << 1)
    assert "fifth" in bus.chip.refuses(MASTER + MTDR, STOP_COMMAND)
