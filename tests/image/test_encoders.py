# SPDX-License-Identifier: MIT
"""Encoders: the world's counts become edges at the pins, which decoders count through pad, daisy and crossbar."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import pi

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from emulated_teensy.machine import Wiring
from hil_sim.faults import Fault
from hil_sim.world import World
from omniwheel._core import lib
from tests.image.assembly import Program
from tests.image.chip import Chip, parked
from tests.image.conftest import WorldMaker

ENC = 0x403C8000
CTRL, FILT, POSD, UPOS, LPOS, UPOSH, LPOSH, UINIT, LINIT, IMR, CTRL2 = 0, 2, 6, 14, 16, 18, 20, 22, 24, 26, 30
XBAR = 0x403BC000
GPR6 = 0x400AC018
BOTH_CHANGED = 1 << 11
FILTER_1_US = 3 << 8 | 25
COUNTS_PER_TURN = 10_000
WAYS = {
    0: (42 + 3, 1, 17, 0x62C, 1),
    1: (42 + 2, 1, 16, 0x64C, 0),
    2: (4, 3, 6, 0x61C, 0),
    3: (5, 3, 7, 0x620, 0),
    4: (6, 3, 8, 0x624, 0),
    5: (8, 3, 17, 0x62C, 0),
    7: (90 + 1, 1, 15, 0x648, 1),
    8: (90 + 0, 1, 14, 0x644, 1),
    30: (37, 1, 23, 0x63C, 0),
    31: (36, 1, 22, 0x638, 0),
    32: (74 + 12, 1, 10, None, 0),
    33: (7, 3, 9, 0x628, 0),
}
"""Teensy pin: pad, alternative, crossbar input, SELECT_INPUT register and value (NXP's fsl_iomuxc.h)."""


def connect(chip: Chip, unit: int, pins: tuple[int, int], *, filtered: bool = False) -> None:
    """Lead two pins to a decoder and begin at zero."""
    chip.open_gates(2, 11)
    chip.open_gates(4, 12, 13, 14, 15)
    for phase, pin in enumerate(pins):
        pad, alternative, source, daisy, value = WAYS[pin]
        chip.write(0x401F8014 + 4 * pad, alternative)
        if daisy is not None:
            chip.write(0x401F8000 + daisy, value)
        output = 66 + 5 * unit + phase
        address, shift = XBAR + output // 2 * 2, output % 2 * 8
        chip.write(address, chip.read(address, 2) & ~(0xFF << shift) | source << shift, 2)
    base = ENC + 0x4000 * unit
    chip.write(base + FILT, FILTER_1_US if filtered else 0, 2)
    chip.wait(2_000)
    for register in (UPOS, LPOS):
        chip.write(base + register, 0, 2)
    chip.write(base + CTRL2, BOTH_CHANGED, 2)


def count(chip: Chip, unit: int) -> int:
    """Read a decoder as the firmware does."""
    base = ENC + 0x4000 * unit
    value = chip.read(base + UPOS, 2) << 16
    value |= chip.read(base + LPOSH, 2)
    return value - (1 << 32) if value >> 31 else value


def move(chip: Chip, pins: tuple[int, int], steps: int, begin: int = 0) -> None:
    """Turn an encoder by hand from a position, at 0 both levels are low; A leads B forwards."""
    order = [(0, 0), (1, 0), (1, 1), (0, 1)]
    sign = 1 if steps > 0 else -1
    for step in range(1, abs(steps) + 1):
        for pin, level in zip(pins, order[(begin + sign * step) % 4], strict=True):
            chip.drive(pin, level)


@contextmanager
def turning(
    program: Program, make_world: WorldMaker, speeds: list[float], wiring: Wiring
) -> Iterator[tuple[Chip, World]]:
    """A chip whose world's wheels are turned by hand at these speeds [rad/s]."""
    faults = [Fault("wheel_turned", wheel=i, start_s=0.0, stop_s=1e9, value=speed) for i, speed in enumerate(speeds)]
    world = make_world(faults=faults)
    with parked(program, wiring=wiring, world=world) as chip:
        yield chip, world


@pytest.mark.parametrize("pins", [(3, 2), (5, 4), (7, 8), (1, 0), (30, 31), (32, 33)])
@pytest.mark.parametrize("unit", range(4))
def test_every_way_to_every_decoder(chip: Chip, unit: int, pins: tuple[int, int]) -> None:
    for pin in pins:
        chip.drive(pin, 0)
    connect(chip, unit, pins)
    move(chip, pins, 10)
    assert count(chip, unit) == 10
    move(chip, pins, -14, begin=10)
    assert count(chip, unit) == -4
    assert not chip.read(ENC + 0x4000 * unit + CTRL2, 2) & BOTH_CHANGED
    assert not chip.found(lib.RT1062_FINDING_PINS)


def test_counts_wrap_at_32_bits_and_hold_together(chip: Chip) -> None:
    connect(chip, 0, (3, 2))
    chip.write(ENC + UPOS, 0xFFFF, 2)
    chip.write(ENC + LPOS, 0xFFFF, 2)
    for pin in (3, 2):
        chip.drive(pin, 0)
    chip.write(ENC + UPOS, 0xFFFF, 2)
    chip.write(ENC + LPOS, 0xFFFF, 2)
    assert chip.read(ENC + UPOS, 2) == 0xFFFF
    move(chip, (3, 2), 1)
    assert chip.read(ENC + LPOSH, 2) == 0xFFFF
    assert chip.read(ENC + UPOS, 2) == 0
    assert chip.read(ENC + LPOSH, 2) == 0


def test_reverse_and_software_load(chip: Chip) -> None:
    for pin in (3, 2):
        chip.drive(pin, 0)
    connect(chip, 0, (3, 2))
    chip.write(ENC + CTRL, 1 << 10, 2)
    move(chip, (3, 2), 3)
    assert count(chip, 0) == -3
    chip.write(ENC + UINIT, 1, 2)
    chip.write(ENC + LINIT, 2, 2)
    chip.write(ENC + CTRL, 1 << 11, 2)
    assert count(chip, 0) == 1 << 16 | 2


def test_both_phases_at_once_are_an_error(chip: Chip) -> None:
    """Pin 2 feeds both phases: whatever it does is illegal."""
    chip.drive(2, 0)
    connect(chip, 0, (2, 2))
    chip.drive(2, 1)
    assert chip.read(ENC + CTRL2, 2) & BOTH_CHANGED
    assert count(chip, 0) == 0
    chip.write(ENC + CTRL2, BOTH_CHANGED, 2)
    assert not chip.read(ENC + CTRL2, 2) & BOTH_CHANGED


def test_the_filter_delays_and_swallows_short_pulses(chip: Chip) -> None:
    for pin in (3, 2):
        chip.drive(pin, 0)
    connect(chip, 0, (3, 2), filtered=True)
    chip.drive(3, 1)
    chip.wait(500)
    chip.drive(3, 0)
    chip.wait(5_000)
    assert count(chip, 0) == 0
    chip.drive(3, 1)
    assert chip.read(ENC + IMR, 2) == 1 << 3
    chip.wait(500)
    assert count(chip, 0) == 0
    chip.wait(2_000)
    assert count(chip, 0) == 1
    assert chip.read(ENC + IMR, 2) == 1 << 3 | 1 << 7


@pytest.mark.parametrize("wrong", ["mux", "daisy", "crossbar", "direction"])
def test_a_wrong_way_is_deaf_and_found(chip: Chip, wrong: str) -> None:
    for pin in (3, 2):
        chip.drive(pin, 0)
    connect(chip, 0, (3, 2))
    pad, _, source, daisy, value = WAYS[3]
    if wrong == "mux":
        chip.write(0x401F8014 + 4 * pad, 5)
    elif wrong == "daisy":
        assert daisy is not None
        chip.write(0x401F8000 + daisy, 1 - value)
    elif wrong == "crossbar":
        chip.write(XBAR + 66, 9 | 6 << 8, 2)
    else:
        chip.write(GPR6, 1 << (16 + source - 4))
    chip.drive(3, 1)
    assert count(chip, 0) == 0
    assert chip.found(lib.RT1062_FINDING_PINS) == [
        "ENC1 is read, but no pin reaches its phase A: check mux, SELECT_INPUT and XBAR1"
    ]


def test_the_crossbar_takes_halfwords_only(chip: Chip) -> None:
    chip.open_gates(2, 11)
    assert chip.refuses(XBAR + 66, 1, 1)


@pytest.mark.parametrize("speed", [25.132741, -25.132741, 3.0])
def test_decoders_count_what_the_world_counts(program: Program, make_world: WorldMaker, speed: float) -> None:
    """25.13 rad/s of 10000 counts: 40 000 edges per second and wheel."""
    pins = ((3, 2), (7, 8), (5, 4))
    with turning(program, make_world, [speed, -speed, speed / 2], Wiring(encoder_pins=pins)) as (chip, world):
        for unit, pair in enumerate(pins):
            connect(chip, unit, pair, filtered=True)
        begin = list(world.c.counts)[:3]
        first = [count(chip, unit) for unit in range(3)]
        chip.wait(200_000_000)
        moved = [count(chip, unit) - before for unit, before in enumerate(first)]
        counted = [now - before for now, before in zip(list(world.c.counts)[:3], begin, strict=True)]
        assert abs(counted[0]) == pytest.approx(0.2 * abs(speed) / (2 * pi) * COUNTS_PER_TURN, abs=2)
        per_ms = abs(speed) / (2 * pi) * COUNTS_PER_TURN / 1000
        for seen, true in zip(moved, counted, strict=True):
            assert seen == pytest.approx(true, abs=per_ms + 2)  # a millisecond is on its way
        assert not any(chip.read(ENC + 0x4000 * unit + CTRL2, 2) & BOTH_CHANGED for unit in range(3))


@pytest.mark.parametrize("kind", ["encoder_invalid", "clock_stuck"])
def test_a_fault_that_no_wire_shows_is_refused(program: Program, make_world: WorldMaker, kind: str) -> None:
    world = make_world(faults=[Fault(kind, wheel=0, start_s=0.06, stop_s=1.0)])
    with parked(program, world=world) as chip:
        assert chip.wait(20_000_000) == lib.RT1062_STOP_REFUSED
        assert kind in chip.why
