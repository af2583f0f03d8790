# SPDX-License-Identifier: MIT
"""The Teensy's encoders: which decoder counts which wheel, and that every edge is counted once."""

from __future__ import annotations

import ctypes
import random
import re
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omni_schema import BoardWiring, plan_encoders
from omni_schema.encoder_plan import INTERRUPTS_PER_S, NO_PINS, NO_WAY_IN, SHARED_INPUT
from omni_schema.wiring import DECODERS, LAST_PIN
from tests.boards.teensy40.chip import BOARD, HERE, build, write_wiring_header
from tests.native import ROOT, generated_dir

BY_INTERRUPT = NOT_GIVEN = 0xFF
FINE, PINS_MISSING, UNREACHABLE, INPUT_TWICE = range(4)
XBAR = {0: 17, 1: 16, 2: 6, 3: 7, 4: 8, 5: 17, 7: 15, 8: 14, 30: 23, 31: 22, 32: 10, 33: 9}
AUTO, HARDWARE, INTERRUPT = range(3)
ORIGINAL = ((3, 2), (7, 6), (5, 4))
MOVED = ((3, 2), (7, 8), (5, 4), (30, 31))
PLAIN = ((10, 11), (14, 22), (29, 28), (24, 6))
GRAY = ((0, 0), (1, 0), (1, 1), (0, 1))  # A leads B
IRQ_GPIO6789 = 157


@pytest.fixture(scope="module")
def c(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return build(tmp_path_factory.mktemp("io"))


def plan(c: ctypes.CDLL, pins: Sequence[Sequence[int]], wanted: Sequence[int]) -> tuple[int, list[int]]:
    units = (ctypes.c_uint8 * 4)()
    flat = bytes(pin for pair in pins for pin in pair)
    problem = c.encoder_plan(len(pins), flat, bytes(wanted), units)
    return problem, list(units[: len(pins)])


class Wheels:
    """Encoders whose channels the test turns edge by edge."""

    def __init__(self, c: ctypes.CDLL, pins: Sequence[tuple[int, int]], wanted: int = AUTO) -> None:
        self.c = c
        self.pins = pins
        c.chip_reset()
        self.problem, self.units = plan(c, pins, [wanted] * len(pins))
        assert self.problem == FINE
        c.encoders_begin()
        self.phase = [2] * len(pins)  # the lines are pulled up
        self.turned = [0] * len(pins)

    def turn(self, wheel: int, step: int) -> None:
        self.phase[wheel] += step
        self.turned[wheel] += step
        for pin, level in zip(self.pins[wheel], GRAY[self.phase[wheel] % 4], strict=True):
            self.c.pin_level(pin, bool(level))

    def read(self) -> tuple[list[int], list[bool]]:
        """Return the counts, and for each whether it can be trusted."""
        out = (ctypes.c_int32 * 4)()
        trusted = self.c.encoders_read(out)
        wheels = range(len(self.pins))
        return [out[i] for i in wheels], [bool(trusted >> i & 1) for i in wheels]

    def counts(self) -> list[int]:
        counts, trusted = self.read()
        assert all(trusted)
        return counts

    def errors(self) -> list[int]:
        out = (ctypes.c_uint32 * 4)()
        self.c.encoders_errors(out)
        return list(out[: len(self.pins)])


# ---------------------------------------------------------------- which decoder


@pytest.mark.full
def test_the_original_robot_has_two_hardware_decoders_and_one_by_interrupt(c: ctypes.CDLL) -> None:
    assert plan(c, ORIGINAL, [AUTO] * 3) == (FINE, [0, BY_INTERRUPT, 1])
    units = (ctypes.c_uint8 * 3)()
    c.robot_plan(units)
    assert list(units) == [0, BY_INTERRUPT, 1]  # three_wheel.toml, at compile time


@pytest.mark.full
@given(st.data())
def test_a_hardware_decoder_is_given_exactly_where_one_can_be(c: ctypes.CDLL, data: st.DataObject) -> None:
    wheels = data.draw(st.sampled_from((3, 4)))
    likely = st.sampled_from(sorted(XBAR)) | st.integers(0, LAST_PIN)
    pins = data.draw(st.lists(likely, min_size=2 * wheels, max_size=2 * wheels, unique=True))
    wanted = data.draw(st.lists(st.sampled_from((AUTO, HARDWARE, INTERRUPT)), min_size=wheels, max_size=wheels))
    pairs = [pins[i : i + 2] for i in range(0, 2 * wheels, 2)]
    problem, units = plan(c, pairs, wanted)
    given_out = [unit for unit in units if unit != BY_INTERRUPT]
    assert sorted(given_out) == list(range(len(given_out)))
    inputs = [XBAR[pin] for pair, unit in zip(pairs, units, strict=True) if unit != BY_INTERRUPT for pin in pair]
    assert len(set(inputs)) == len(inputs)
    for pair, unit, wish in zip(pairs, units, wanted, strict=True):
        if wish == INTERRUPT:
            assert unit == BY_INTERRUPT
        elif unit == BY_INTERRUPT:
            assert any(pin not in XBAR for pin in pair) or {0, 5} & set(pair)
            assert wish == AUTO or problem != FINE
    if problem == UNREACHABLE:
        assert any(w == HARDWARE and set(p) - set(XBAR) for p, w in zip(pairs, wanted, strict=True))
    elif problem == INPUT_TWICE:
        assert {0, 5} <= set(pins)


@pytest.mark.full
def test_pins_that_share_an_input_get_one_decoder(c: ctypes.CDLL) -> None:
    assert plan(c, ((0, 2), (5, 4), (3, 1)), [AUTO] * 3) == (FINE, [0, BY_INTERRUPT, 1])
    assert plan(c, ((0, 2), (5, 4), (3, 1)), [AUTO, HARDWARE, AUTO]) == (FINE, [BY_INTERRUPT, 0, 1])
    assert plan(c, ((0, 2), (5, 4), (3, 1)), [HARDWARE, HARDWARE, AUTO])[0] == INPUT_TWICE
    assert plan(c, ((0, 5), (2, 4), (3, 1)), [HARDWARE, AUTO, AUTO])[0] == INPUT_TWICE


@pytest.mark.full
@given(st.data())
def test_a_robot_file_is_judged_as_the_compiler_judges_it(c: ctypes.CDLL, data: st.DataObject) -> None:
    """``omni robots check`` tells before the build what the build would refuse."""
    wheels = data.draw(st.sampled_from((3, 4)))
    likely = st.sampled_from(sorted(XBAR)) | st.integers(0, LAST_PIN)
    pins = data.draw(st.lists(likely, min_size=2 * wheels, max_size=2 * wheels, unique=True))
    wanted = data.draw(st.lists(st.sampled_from((AUTO, HARDWARE, INTERRUPT)), min_size=wheels, max_size=wheels))
    pairs = tuple((pins[i], pins[i + 1]) for i in range(0, 2 * wheels, 2))
    given_pins = data.draw(st.sampled_from((pairs, pairs, ())))
    decoders = tuple(DECODERS[w] for w in wanted)
    ours = plan_encoders(BoardWiring(given_pins, decoders, None, None, None, 1.0, 13, 400_000))
    problem, units = plan(c, given_pins or ((NOT_GIVEN, NOT_GIVEN),) * wheels, wanted)
    words = {PINS_MISSING: NO_PINS, UNREACHABLE: NO_WAY_IN, INPUT_TWICE: SHARED_INPUT}
    assert [None if unit == BY_INTERRUPT else unit for unit in units] == list(ours.units)
    assert (problem == FINE) == (not ours.problems)
    assert problem == FINE or words[problem] in ours.problems


def test_the_limit_of_interrupts_is_the_same_in_both(c: ctypes.CDLL) -> None:
    assert c.encoder_edge_limit() * 1000 == INTERRUPTS_PER_S


def compile_plan(tmp_path: Path, **wiring: str) -> subprocess.CompletedProcess[str]:
    text = (ROOT / "shared" / "robots" / "three_wheel.toml").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith(tuple(wiring))]
    at = lines.index("[wiring]") + 1
    lines[at:at] = [f"{key} = {value}" for key, value in wiring.items() if value]
    robot = tmp_path / "robot.toml"
    robot.write_text("\n".join(lines), encoding="utf-8")
    ours = [ROOT / "firmware", ROOT / "shared" / "core" / "include", generated_dir() / "include"]
    includes = [HERE / "fakes_io", write_wiring_header(tmp_path, robot), *ours]
    command = ["c++", "-std=c++17", "-fsyntax-only", *(f"-I{i}" for i in includes), str(BOARD / "encoders_robot.cpp")]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_compiler_refuses_with_the_same_words() -> None:
    source = (BOARD / "encoders_robot.cpp").read_text(encoding="utf-8")
    text = re.sub(r'"\n\s*"', "", source).replace('\\"', '"')
    for words in (NO_PINS, NO_WAY_IN, SHARED_INPUT):
        assert f"robot file: {words}" in text


@pytest.mark.full
def test_an_impossible_wiring_does_not_compile_and_says_why(tmp_path: Path) -> None:
    assert compile_plan(tmp_path).returncode == 0
    hardware = str([DECODERS[HARDWARE]] * 3)
    assert "only pins 0 1 2 3 4 5 7 8 30 31 32 33 reach" in compile_plan(tmp_path, encoder_decoder=hardware).stderr

    assert compile_plan(tmp_path, encoder_decoder=hardware, encoder_pins="[[3, 2], [7, 8], [5, 4]]").returncode == 0
    assert "give wiring.encoder_pins" in compile_plan(tmp_path, encoder_pins="").stderr


# ---------------------------------------------------------------- counting


@pytest.mark.parametrize("wanted", [AUTO, INTERRUPT], ids=("auto", "interrupt"))
@pytest.mark.parametrize("pins", [ORIGINAL, MOVED, PLAIN], ids=("original", "moved", "plain"))
def test_random_walks_are_counted_edge_by_edge(c: ctypes.CDLL, pins: tuple[tuple[int, int], ...], wanted: int) -> None:
    wheels = Wheels(c, pins, wanted)
    assert wheels.counts() == [0] * len(pins)
    rng = random.Random(1)
    lean = [1, -1, 0, 1]
    for step in range(20_000):
        wheel = rng.randrange(len(pins))
        wheels.turn(wheel, rng.choice((-1, 1, lean[wheel] or 1)))
        if step % 97 == 0:
            assert wheels.counts() == wheels.turned
    assert wheels.counts() == wheels.turned
    assert wheels.errors() == [0] * len(pins)


def test_both_decoders_count_the_same_way_round(c: ctypes.CDLL) -> None:
    for wanted in (AUTO, INTERRUPT):
        wheels = Wheels(c, MOVED, wanted)
        for wheel in range(4):
            for _ in range(10 * (wheel + 1)):
                wheels.turn(wheel, 1)
        assert wheels.counts() == [10, 20, 30, 40]


@pytest.mark.parametrize("wanted", [AUTO, INTERRUPT], ids=("auto", "interrupt"))
def test_swapped_channels_count_backwards(c: ctypes.CDLL, wanted: int) -> None:
    wheels = Wheels(c, MOVED[:3], wanted)
    wheels.pins = [(b, a) for a, b in MOVED[:3]]
    wheels.turn(0, 1)
    assert wheels.counts() == [-1, 0, 0]
    for _ in range(100):
        wheels.turn(1, -1)
    assert wheels.counts() == [-1, 100, 0]


def test_a_hardware_count_wraps_and_is_read_in_one_piece(c: ctypes.CDLL) -> None:
    wheels = Wheels(c, MOVED)
    for wheel, position in enumerate((0x0000FFFF, 0xFFFFFFFF, 0x7FFFFFFF, 0x80000000)):
        c.decoder_position(wheels.units[wheel], position)
        wheels.turn(wheel, 1)
    assert wheels.counts() == [0x10000, 0, -0x80000000, -0x7FFFFFFF]


def test_a_missed_edge_is_an_error_and_not_a_count(c: ctypes.CDLL) -> None:
    wheels = Wheels(c, PLAIN)
    for n in range(1, 5):
        c.interrupts_held(True)
        wheels.turn(1, 1)
        wheels.turn(1, 1)
        c.interrupts_held(False)
        assert wheels.counts()[1] == 0
        assert wheels.errors() == [0, n, 0, 0]
    wheels.turn(1, 1)
    assert wheels.counts()[1] == 1  # and it goes on counting


def test_a_pulse_that_is_over_before_the_interrupt_counts_nothing(c: ctypes.CDLL) -> None:
    wheels = Wheels(c, PLAIN)
    c.interrupts_held(True)
    wheels.turn(2, 1)
    wheels.turn(2, -1)
    c.interrupts_held(False)
    assert wheels.counts() == [0] * 4
    assert wheels.errors() == [0] * 4


def test_a_hardware_decoder_that_saw_both_change_is_counted_once(c: ctypes.CDLL) -> None:
    wheels = Wheels(c, ORIGINAL)
    c.decoder_both_changed(wheels.units[2])
    wheels.counts()
    wheels.counts()
    assert wheels.errors() == [0, 0, 1]
    c.decoder_both_changed(wheels.units[2])
    wheels.counts()
    assert wheels.errors() == [0, 0, 2]


def test_edges_interrupt_everything_else(c: ctypes.CDLL) -> None:
    Wheels(c, PLAIN)
    assert 0 <= c.irq_priority(IRQ_GPIO6789) < 32  # SysTick, the highest of Teensyduino


# ---------------------------------------------------------------- noise


def chatter(c: ctypes.CDLL, pin: int, edges: int, pulses: bool = False) -> None:
    """Noise on a line; ``pulses``: each is over before the interrupt looks."""
    for n in range(edges):
        if pulses:
            c.interrupts_held(True)
            c.pin_level(pin, n % 2 == 1)
            c.pin_level(pin, n % 2 == 0)
            c.interrupts_held(False)
        else:
            c.pin_level(pin, n % 2 == 1)


def test_as_many_edges_as_the_limit_allows_are_all_counted(c: ctypes.CDLL) -> None:
    wheels = Wheels(c, PLAIN)
    limit = c.encoder_edge_limit()
    assert limit > 5 * 40  # 25 rad/s at 10000 counts per revolution bring 40 in a tick
    for _ in range(20):
        for wheel in range(4):
            for _ in range(limit):
                wheels.turn(wheel, 1)
        assert wheels.counts() == wheels.turned
    assert wheels.errors() == [0] * 4


@pytest.mark.parametrize("pulses", [False, True], ids=["levels", "pulses"])
@pytest.mark.parametrize("channel", [0, 1], ids="AB")
def test_a_storm_of_edges_does_not_starve_the_tick(c: ctypes.CDLL, channel: int, pulses: bool) -> None:
    wheels = Wheels(c, PLAIN)
    limit = c.encoder_edge_limit()
    for tick in range(5):
        c.pin_interrupts()
        chatter(c, PLAIN[2][channel], 20 * limit, pulses)
        wheels.turn(0, 1)  # the others go on
        wheels.turn(3, -1)
        assert c.pin_interrupts() <= limit + 10
        counts, trusted = wheels.read()
        assert trusted == [True, True, False, True]
        assert (counts[0], counts[3]) == (wheels.turned[0], wheels.turned[3])
        assert wheels.errors() == [0, 0, tick + 1, 0]
    for pin in PLAIN[2]:
        c.pin_level(pin, True)
    wheels.phase[2] = 2
    before, _ = wheels.read()
    for _ in range(100):  # quiet again: every edge counts
        wheels.turn(2, 1)
    assert wheels.counts()[2] == before[2] + 100
    assert wheels.errors()[2] == 5


def test_storms_on_all_encoders_at_once_leave_time_for_the_tick(c: ctypes.CDLL) -> None:
    wheels = Wheels(c, PLAIN)
    limit = c.encoder_edge_limit()
    for _ in range(3):
        c.pin_interrupts()
        for n in range(10 * limit):
            for pins in PLAIN:
                for pin in pins:
                    c.pin_level(pin, n % 2 == 1)
        assert c.pin_interrupts() <= 4 * (limit + 1)
        assert wheels.read()[1] == [False] * 4


def test_an_edge_of_another_encoder_beside_a_storm_is_not_lost(c: ctypes.CDLL) -> None:
    """Two encoders share a port and its registers."""
    rng = random.Random(6)
    wheels = Wheels(c, ((14, 15), (16, 17), (22, 23)))
    for _ in range(200):
        chatter(c, 14, rng.randrange(3 * c.encoder_edge_limit()))
        c.interrupts_held(True)  # its interrupt waits while the tick reads
        wheels.turn(1, rng.choice((-1, 1)))
        wheels.read()
        c.interrupts_held(False)
        counts, trusted = wheels.read()
        assert counts[1:] == wheels.turned[1:]
        assert trusted[1:] == [True, True]
    assert wheels.errors()[1:] == [0, 0]


def test_a_hardware_decoder_has_no_limit(c: ctypes.CDLL) -> None:
    wheels = Wheels(c, ORIGINAL)
    for _ in range(5 * c.encoder_edge_limit()):
        wheels.turn(0, 1)
    assert wheels.counts()[0] == wheels.turned[0]
