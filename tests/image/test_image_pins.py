# SPDX-License-Identifier: MIT
"""The image that is flashed at its pins: what it does to the bus, and what it counts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from emulated_teensy.i2c_wave import LIMITS, START, STOP, Edge, read_wave, violations
from emulated_teensy.image_file import Image
from emulated_teensy.machine import Stop
from hil_sim.faults import Fault
from hil_sim.teensy import Teensy, wiring_of
from hil_sim.world import World
from omniwheel._core import ffi
from omniwheel.robots import read_robot
from tests.image.conftest import WorldMaker

BOOTED_S = 0.45
SCL, SDA, OUTPUT_ENABLE = 19, 18, 9
CHIP_WRITE = 0x40 << 1
READ_ENCODERS = "_ZN4omni16Teensy40Encoders4readEPl"
ALL_LED_OFF = [CHIP_WRITE, 0xFD, 0x10]
AWAKE = 0x20
EDGES_PER_S = 40_000
SPEED = 25.132741
"""[rad/s], 40 000 edges per second of an encoder with 10 000 counts."""


@dataclass
class Robot:
    """The image running, with a world at its pins."""

    machine: Teensy
    world: World

    def run(self, duration_s: float) -> None:
        """Let time pass."""
        stop = self.machine.run(duration_s)
        assert stop == Stop.TIME, self.machine.why

    def boot(self) -> None:
        """Let it boot; the world's time begins with the power."""
        self.run(BOOTED_S - self.machine.time_s)

    def edges(self) -> list[Edge]:
        """Take the bus's edges since the last call."""
        return self.machine.i2c_edges()

    def forget_edges(self) -> None:
        """Drop the bus's edges so far, at a moment when no transfer is under way.

        Of half a transfer nobody could tell whether its first edge is a START or a clock.
        """
        self.edges()
        for _ in range(100):
            self.run(0.0001)
            if not self.edges():
                return
        raise AssertionError("the bus is never idle for 0.1 ms")

    def counts(self) -> list[int]:
        """Stop at the next reading of the encoders and return what the image makes of them."""
        self.machine.clear_breaks()
        self.machine.break_at(READ_ENCODERS)
        assert self.machine.run(0.01) == Stop.BREAK, self.machine.why
        place, back = self.machine.register(1), self.machine.register(14)
        self.machine.clear_breaks()
        self.machine.break_at(back & ~1)
        assert self.machine.run(0.001) == Stop.BREAK, self.machine.why
        self.machine.clear_breaks()
        return list(ffi.unpack(ffi.from_buffer("int32_t[]", self.machine.read(place, 12)), 3))

    @property
    def chip(self) -> list[int]:
        """The PWM chip's registers."""
        return list(self.world.c.chip.registers)


def start(flashed_image: Image, world: World) -> Robot:
    machine = Teensy(flashed_image, wiring=wiring_of(read_robot("three_wheel")), world=world)
    machine.power_on()
    return Robot(machine, world)


@pytest.fixture
def robot(flashed_image: Image, make_world: WorldMaker) -> Iterator[Robot]:
    """A robot that has booted."""
    robot = start(flashed_image, make_world())
    with robot.machine:
        robot.boot()
        robot.forget_edges()
        yield robot


def test_the_motors_are_switched_off_first(flashed_image: Image, make_world: WorldMaker) -> None:
    robot = start(flashed_image, make_world())
    with robot.machine:
        edges = robot.edges()
        while START not in read_wave(edges).events:
            robot.run(0.005)
            edges += robot.edges()
            assert robot.machine.pin(OUTPUT_ENABLE) == 1
        robot.run(0.002)
        assert read_wave(edges + robot.edges()).bytes[:3] == ALL_LED_OFF
        assert robot.world.c.chip.output_enable_high
        assert not robot.machine.findings()


def test_the_chip_is_set_up_and_driven_within_the_specification(robot: Robot) -> None:
    robot.run(0.02)
    wave = read_wave(robot.edges())
    assert robot.chip[0] == AWAKE
    assert robot.chip[0xFE] == 3
    assert wave.events.count(STOP) >= 9  # a processor that takes 10 ns per instruction misses every other tick's update
    assert all(acknowledged for event in wave.events if isinstance(event, tuple) for acknowledged in event[1:])
    assert violations(wave, LIMITS[400_000]) == []
    assert not robot.machine.findings()


def test_a_line_that_was_held_is_freed(robot: Robot) -> None:
    robot.machine.drive_pin(SDA, 0)
    robot.run(0.02)
    held = [edge for edge in robot.edges() if not edge.sda]
    rises = sum(1 for before, now in pairwise(held) if now.scl and not before.scl)
    assert rises >= 9  # the bus clear's clocks
    robot.machine.drive_pin(SDA, None)
    robot.run(0.05)
    robot.forget_edges()
    robot.run(0.01)
    wave = read_wave(robot.edges())
    assert wave.events.count(START) >= 8
    assert all(event[1] for event in wave.events if isinstance(event, tuple))
    assert robot.chip[0] == AWAKE


def test_a_chip_that_lost_its_power_is_set_up_again(flashed_image: Image, make_world: WorldMaker) -> None:
    robot = start(flashed_image, make_world(faults=[Fault("chip_power", start_s=BOOTED_S, stop_s=BOOTED_S + 0.05)]))
    with robot.machine:
        robot.boot()
        robot.run(0.04)
        assert robot.chip[0] == 0x11
        robot.run(0.1)
        assert robot.chip[0] == AWAKE


@pytest.mark.parametrize("speed", [SPEED, -SPEED])
def test_the_image_counts_every_edge(flashed_image: Image, make_world: WorldMaker, speed: float) -> None:
    """Wheels 1 and 3 by decoders, wheel 2 by interrupts (pin 6 has no way into the crossbar), all at once."""
    faults = [Fault("wheel_turned", wheel=i, start_s=BOOTED_S, stop_s=1e9, value=speed) for i in range(3)]
    robot = start(flashed_image, make_world(faults=faults))
    with robot.machine:
        robot.boot()
        begin = robot.counts()
        robot.run(0.1)
        seen = [now - before for now, before in zip(robot.counts(), begin, strict=True)]
        true = list(robot.world.c.counts)[:3]
        per_ms = EDGES_PER_S / 1000
        assert [abs(count) for count in true] == pytest.approx([0.1 * EDGES_PER_S] * 3, abs=3 * per_ms)
        for counted, count in zip(seen, true, strict=True):
            assert counted == pytest.approx(count, abs=per_ms + 2)  # a millisecond is on its way
        assert max(seen, key=abs) - min(seen, key=abs) == pytest.approx(0, abs=2)
        assert not robot.machine.findings()
