# SPDX-License-Identifier: MIT
"""GPIO and pads: who owns a pin, what drives it, what comes in, which edges interrupt."""

from __future__ import annotations

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from emulated_teensy.machine import Wiring
from hil_sim.faults import Fault
from omniwheel._core import lib
from tests.image.assembly import Program
from tests.image.chip import Chip, parked
from tests.image.conftest import WorldMaker

GPIO1, GPIO2, GPIO6, GPIO7 = 0x401B8000, 0x401BC000, 0x42000000, 0x42004000
DR, GDIR, PSR, ICR1, ICR2, IMR, ISR, EDGE_SEL, SET, CLEAR, TOGGLE = 0, 4, 8, 12, 16, 20, 24, 28, 0x84, 0x88, 0x8C
GPR26, GPR27 = 0x400AC068, 0x400AC06C
MUX, PAD = 0x401F8014, 0x401F8204
LAMP = 13
LAMP_BIT, LAMP_PAD = 3, 74 + 3
BUTTON, BUTTON_PAD = 10, 74
GPIO_ALT, SION = 5, 0x10
HYS, ODE, PKE, PUE = 1 << 16, 1 << 11, 1 << 12, 1 << 13
DOWN_100K, UP_47K, UP_100K, UP_22K = (pus << 14 | PKE | PUE for pus in range(4))
IRQ_GPIO2_LOW, IRQ_FAST = 82, 157
CCGR0 = 0x400FC068
LOW_LEVEL, HIGH_LEVEL, RISING, FALLING = range(4)


def fast(chip: Chip) -> None:
    """Give the lamp's pin to GPIO7, as the core does, with the input path forced on."""
    chip.write(GPR27, 0xFFFFFFFF)
    chip.write(MUX + 4 * LAMP_PAD, GPIO_ALT | SION)


def test_set_clear_toggle_drive_the_pin(chip: Chip) -> None:
    fast(chip)
    chip.write(GPIO7 + GDIR, 1 << LAMP_BIT)
    levels = [chip.pin(LAMP)]
    for register in (SET, CLEAR, TOGGLE, TOGGLE):
        chip.write(GPIO7 + register, 1 << LAMP_BIT)
        levels.append(chip.pin(LAMP))
        assert chip.read(GPIO7 + PSR) >> LAMP_BIT & 1 == levels[-1]
        assert chip.read(GPIO7 + DR) >> LAMP_BIT & 1 == levels[-1]
    assert levels == [0, 1, 0, 1, 0]


def test_an_output_is_not_seen_without_sion(chip: Chip) -> None:
    fast(chip)
    chip.write(MUX + 4 * LAMP_PAD, GPIO_ALT)
    chip.write(GPIO7 + GDIR, 1 << LAMP_BIT)
    chip.write(GPIO7 + SET, 1 << LAMP_BIT)
    assert chip.pin(LAMP) == 1
    assert not chip.read(GPIO7 + PSR)
    assert chip.read(GPIO7 + DR) == 1 << LAMP_BIT


def test_only_the_owner_drives_and_sees(chip: Chip) -> None:
    fast(chip)
    chip.write(GPIO2 + GDIR, 1 << LAMP_BIT)
    chip.write(GPIO2 + SET, 1 << LAMP_BIT)
    chip.write(PAD + 4 * LAMP_PAD, 0)
    assert chip.pin(LAMP) == -1
    chip.write(GPR27, ~(1 << LAMP_BIT) & 0xFFFFFFFF)
    assert chip.pin(LAMP) == 1
    assert chip.read(GPIO2 + PSR) == 1 << LAMP_BIT
    assert chip.read(GPIO7 + PSR) == 0


@pytest.mark.parametrize(
    ("control", "level"), [(0, -1), (DOWN_100K, 0), (UP_47K, 1), (UP_100K, 1), (UP_22K, 1), (UP_22K | HYS, 1)]
)
def test_pulls(chip: Chip, control: int, level: int) -> None:
    chip.write(PAD + 4 * LAMP_PAD, control)
    assert chip.pin(LAMP) == level


def test_a_keeper_keeps_the_last_level(chip: Chip) -> None:
    chip.write(PAD + 4 * LAMP_PAD, PKE)
    for level in (1, 0, 1):
        chip.drive(LAMP, level)
        chip.drive(LAMP, -1)
        assert chip.pin(LAMP) == level


def test_open_drain_only_pulls_down(chip: Chip) -> None:
    fast(chip)
    chip.write(PAD + 4 * LAMP_PAD, ODE | UP_22K)
    chip.write(GPIO7 + GDIR, 1 << LAMP_BIT)
    chip.write(GPIO7 + SET, 1 << LAMP_BIT)
    chip.drive(LAMP, 0)
    assert chip.pin(LAMP) == 0
    assert not chip.found(lib.RT1062_FINDING_PINS)
    chip.write(PAD + 4 * LAMP_PAD, UP_22K)
    assert "low and high at once" in chip.found(lib.RT1062_FINDING_PINS)[0]


def test_another_alternative_takes_the_pin_away(chip: Chip) -> None:
    fast(chip)
    chip.write(GPIO7 + GDIR, 1 << LAMP_BIT)
    chip.write(PAD + 4 * LAMP_PAD, 0)
    chip.write(MUX + 4 * LAMP_PAD, 1)
    assert chip.pin(LAMP) == -1
    chip.drive(LAMP, 1)
    assert chip.read(GPIO7 + PSR) == 0


@pytest.mark.parametrize(
    ("condition", "levels", "flags"),
    [(RISING, [0, 1, 0], [0, 1, 0]), (FALLING, [1, 0, 1], [0, 1, 0]), (None, [0, 1, 0, 1], [0, 1, 1, 1])],
)
def test_edges(chip: Chip, condition: int | None, levels: list[int], flags: list[int]) -> None:
    fast(chip)
    bit = 1 << LAMP_BIT
    chip.drive(LAMP, levels[0])
    if condition is None:
        chip.write(GPIO7 + EDGE_SEL, bit)
    else:
        chip.write(GPIO7 + ICR1, condition << 2 * LAMP_BIT)
    chip.write(GPIO7 + ISR, 0xFFFFFFFF)
    seen = []
    for level in levels:
        chip.drive(LAMP, level)
        seen.append(chip.read(GPIO7 + ISR) >> LAMP_BIT & 1)
        chip.write(GPIO7 + ISR, bit)
    assert seen == flags


@pytest.mark.parametrize("condition", [LOW_LEVEL, HIGH_LEVEL])
def test_a_level_sets_its_flag_again_until_it_goes(chip: Chip, condition: int) -> None:
    fast(chip)
    chip.write(GPIO7 + ICR1, condition << 2 * LAMP_BIT)
    chip.drive(LAMP, condition)
    chip.write(GPIO7 + ISR, 0xFFFFFFFF)
    assert chip.read(GPIO7 + ISR) >> LAMP_BIT & 1
    chip.drive(LAMP, 1 - condition)
    chip.write(GPIO7 + ISR, 0xFFFFFFFF)
    assert not chip.read(GPIO7 + ISR) >> LAMP_BIT & 1


def test_interrupt_lines(chip: Chip) -> None:
    fast(chip)
    bit = 1 << LAMP_BIT
    chip.write(GPIO7 + EDGE_SEL, bit)
    chip.write(GPIO7 + ISR, 0xFFFFFFFF)
    chip.drive(LAMP, 1)
    assert not chip.pending(IRQ_FAST)
    chip.write(GPIO7 + IMR, bit)
    assert chip.pending(IRQ_FAST)
    assert not chip.pending(IRQ_GPIO2_LOW)


@pytest.mark.parametrize(("control", "open_level"), [(UP_22K, 1), (0, -1), (PKE, 0)])
def test_a_stop_button_grounds_its_pin_until_it_is_pressed(
    program: Program, make_world: WorldMaker, control: int, open_level: int
) -> None:
    """Open, only the pad's pull-up tells: a keeper would hold what was there, and nothing would read nothing."""
    world = make_world(faults=[Fault("stop_button", start_s=1e3)])
    with parked(program, wiring=Wiring(stop_button_pin=BUTTON), world=world) as chip:
        chip.write(PAD + 4 * BUTTON_PAD, control)
        fault, now_s = world.c.config.fault[0], 1e-6 * world.c.time_us
        fault.start_s, fault.stop_s = now_s + 0.005, now_s + 0.01
        seen = []
        for wait_ns in (3_000_000, 5_000_000, 5_000_000):
            chip.wait(wait_ns)
            seen.append(chip.pin(BUTTON))
    assert seen == [0, open_level, 0]


def test_a_gated_clock_is_found(chip: Chip) -> None:
    chip.write(CCGR0, chip.read(CCGR0) & ~(3 << 30))
    assert chip.read(GPIO2 + PSR) == 0
    assert chip.found(lib.RT1062_FINDING_CLOCK) == ["GPIO2 is used while its clock is off"]


@pytest.mark.parametrize("size", [1, 2])
def test_registers_are_words(chip: Chip, size: int) -> None:
    assert "no such register" in chip.refuses(GPIO7 + SET, 1, size)


def test_bits_that_a_pad_does_not_have_are_refused(chip: Chip) -> None:
    assert "has no bits" in chip.refuses(MUX, 0x20)
    assert "has no bits" in chip.refuses(PAD, 1 << 20)
    assert "has no bits" in chip.refuses(0x401F84CC, 2)
