# SPDX-License-Identifier: MIT
"""Which way of waiting the world's end of a lockstep link chooses, on simulated machines with simulated clocks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from types import ModuleType
from typing import Any

import pytest

from bench.figures.waiting_speed import table
from omniwheel._core import ffi, lib
from tests.hil_sim.echo_robot import Bench

FIRST_US, LONGEST_US, AGAIN_US = lib.HIL_WAITING_FIRST_us, lib.HIL_WAITING_LONGEST_us, lib.HIL_WAITING_AGAIN_us
LOOK_US, EXTRA_US = lib.HIL_WAITING_LOOK_us, lib.HIL_WAITING_EXTRA_us
INTERRUPTED_US = lib.HIL_WAITING_INTERRUPTED_us
START_US = 1_000_000_007
ROOT = Path(__file__).parents[2]


def waiting(*, looks: bool = True) -> Any:
    """Return a new end on a computer with two processors, whatever this one has."""
    made = ffi.new("hil_waiting_t *")
    lib.hil_waiting_init(made, True)
    made.may_change = True
    made.prefers_looking = made.poll_backoff.enabled = looks
    return made


@dataclass(frozen=True)
class Machine:
    """How long a turn takes [us] looking and asleep, and how many turns pass until another program takes a slice."""

    looking_us: float
    asleep_us: float
    turns_to_slice: tuple[float, float] = (float("inf"), float("inf"))
    slice_us: float = 4000.0
    together_us: float = 0.0
    """So long after both ends slept, looking ends are still on one processor: a turn takes 230 us."""


# Quiet, and beside a program that never sleeps. Turns are three times as long as measured on two virtual processors:
# so there are fewer to simulate.
QUIET = Machine(40.0, 200.0)
PARTED_LATE = Machine(40.0, 200.0, together_us=7000.0)
BUSY = Machine(40.0, 80.0, turns_to_slice=(50.0, 3000.0))
SLOW_WAKING = Machine(40.0, 44.0)


@dataclass
class Run:
    """A link on a machine."""

    end: Any = field(default_factory=waiting)
    now_us: float = START_US
    random: Random = field(default_factory=lambda: Random(1))
    slept_us: float = -1e9
    looking_us: float = 0.0

    def turn(self, machine: Machine) -> bool:
        """Let a turn pass; return whether it was looked."""
        lib.hil_waiting_turn(self.end, int(self.now_us))
        looks = bool(lib.hil_waiting_looks(self.end))
        assert bool(self.end.poll_backoff.enabled) == looks
        turn_us = machine.looking_us if looks else machine.asleep_us
        if looks and self.now_us - self.slept_us < machine.together_us:
            turn_us = 230.0
        if self.random.random() < 1.0 / machine.turns_to_slice[0 if looks else 1]:
            turn_us += machine.slice_us
        self.now_us += turn_us
        if looks:
            self.looking_us += turn_us
        else:
            self.slept_us = self.now_us
        return looks

    def for_us(self, machine: Machine, time_us: float) -> tuple[float, int]:
        """Run for a while; return the share of the time in which the ends looked, and the turns."""
        begin_us, looking_us, turns = self.now_us, self.looking_us, 0
        while self.now_us < begin_us + time_us:
            self.turn(machine)
            turns += 1
        return (self.looking_us - looking_us) / (self.now_us - begin_us), turns

    def until(self, machine: Machine, looks: bool) -> float:
        """Run until this way is preferred; return how long that took [us]."""
        begin_us = self.now_us
        while bool(self.end.prefers_looking) != looks:
            self.turn(machine)
            assert self.now_us - begin_us < 10 * LONGEST_US, "it follows some time"
        return self.now_us - begin_us


MACHINES = [(QUIET, True), (PARTED_LATE, True), (BUSY, False), (SLOW_WAKING, True)]


@pytest.mark.full
@pytest.mark.parametrize(("machine", "looks"), MACHINES)
@pytest.mark.parametrize("begins_looking", [True, False])
def test_the_faster_way_is_found_and_kept(machine: Machine, looks: bool, begins_looking: bool) -> None:
    run = Run(waiting(looks=begins_looking))
    assert run.until(machine, looks) < FIRST_US + AGAIN_US + 2 * LOOK_US + 2 * EXTRA_US
    run.for_us(machine, 2 * LONGEST_US)
    changes = run.end.changes
    share, _ = run.for_us(machine, 4 * LONGEST_US)
    assert (share if looks else 1.0 - share) > 0.98
    assert run.end.changes == changes
    assert run.end.between_us == LONGEST_US


@pytest.mark.full
@pytest.mark.parametrize(("machine", "looks"), MACHINES)
def test_trials_cost_little(machine: Machine, looks: bool) -> None:
    """Also in a short run: a demo takes a second."""
    for time_us, lost in [(800_000, 0.07), (10_000_000, 0.02)]:
        run = Run(waiting(looks=looks))
        _, turns = run.for_us(machine, time_us)
        ideal = Run(waiting(looks=looks))
        ideal.end.may_change = False
        _, most = ideal.for_us(machine, time_us)
        assert turns > (1.0 - lost) * most


@pytest.mark.full
@pytest.mark.parametrize("quiet", [QUIET, PARTED_LATE])
def test_a_load_that_comes_and_goes_is_followed(quiet: Machine) -> None:
    run = Run()
    for _ in range(3):
        run.for_us(quiet, 3 * LONGEST_US)
        assert run.end.prefers_looking
        assert run.until(BUSY, looks=False) < LONGEST_US + AGAIN_US + LONGEST_US / 2
        run.for_us(BUSY, 3 * LONGEST_US)
        assert run.until(quiet, looks=True) < LONGEST_US + AGAIN_US + LONGEST_US / 2
    assert run.end.changes == 6


@pytest.mark.parametrize(("looking_us", "looks"), [(60.0, True), (84.0, True), (84.8, False), (90.0, False)])
@pytest.mark.parametrize("begins_looking", [True, False])
def test_looking_must_save_a_sixteenth(looking_us: float, looks: bool, begins_looking: bool) -> None:
    run = Run(waiting(looks=begins_looking))
    run.for_us(Machine(looking_us, 90.0), 3 * LONGEST_US)
    assert bool(run.end.prefers_looking) == looks


@pytest.mark.full
@pytest.mark.parametrize("looks", [True, False])
def test_one_trial_that_was_faster_changes_nothing(looks: bool) -> None:
    """Another program may just have slept meanwhile."""
    run, seen = Run(waiting(looks=looks)), 0
    usual, other = (40.0, 200.0) if looks else (200.0, 40.0)
    plain, lucky = Machine(usual, other), Machine(usual, usual / 4)
    if not looks:
        plain, lucky = Machine(other * 4, usual / 4), Machine(usual / 16, usual / 4)
    while run.now_us < START_US + 4 * LONGEST_US:
        first = run.end.tries and not run.end.was_faster
        run.turn(lucky if first else plain)
        seen += run.end.was_faster
        assert bool(run.end.prefers_looking) == looks
    assert seen > 0


@pytest.mark.parametrize(("looking_us", "asleep_us"), [(6000.0, 100.0), (2000.0, 20_000.0), (30_000.0, 20_000.0)])
@pytest.mark.parametrize("begins_looking", [True, False])
def test_slow_turns_are_compared_too(looking_us: float, asleep_us: float, begins_looking: bool) -> None:
    run = Run(waiting(looks=begins_looking))
    run.for_us(Machine(looking_us, asleep_us), 3 * LONGEST_US)
    assert bool(run.end.prefers_looking) == (looking_us < asleep_us and asleep_us < 30_000.0)


def test_a_link_slower_than_can_be_compared_stays_as_it_is_and_is_seldom_tried() -> None:
    run = Run()
    run.for_us(Machine(70_000.0, 60_000.0), 8 * LONGEST_US)
    assert run.end.prefers_looking
    assert run.end.between_us == LONGEST_US


@pytest.mark.parametrize("slice_us", [4000.0, 60_000.0])
def test_a_program_that_takes_the_processor_for_long_is_noticed(slice_us: float) -> None:
    run = Run()
    run.for_us(Machine(40.0, 80.0, (50.0, 3000.0), slice_us=slice_us), 3 * LONGEST_US)
    assert not run.end.prefers_looking


def test_two_trials_before_and_after_a_long_pause_are_not_two_in_a_row() -> None:
    run = Run()
    lucky = Machine(40.0, 20.0)
    while not run.end.was_faster:
        run.turn(lucky)
    run.now_us += 600e6
    while not run.end.tries:
        run.turn(QUIET)
        assert not run.end.was_faster
    while run.end.tries:
        run.turn(lucky)
    assert run.end.was_faster
    assert run.end.prefers_looking


def test_asleep_means_asleep() -> None:
    end = ffi.new("hil_waiting_t *")
    lib.hil_waiting_init(end, False)
    for turn in range(20_000):
        lib.hil_waiting_turn(end, turn * 100)
        assert not lib.hil_waiting_looks(end)
    assert (end.trials, bool(end.poll_backoff.enabled)) == (0, False)


@pytest.mark.parametrize("looks", [True, False])
def test_each_change_of_the_way_forgets_looks_in_vain(looks: bool) -> None:
    """Else the first looks after it would be slept through."""
    run = Run(waiting(looks=looks))
    tried = False
    while run.now_us < START_US + LONGEST_US:
        run.end.poll_backoff.failures, run.end.poll_backoff.sleeps_left = 8, 254
        run.turn(QUIET)
        if bool(run.end.tries) != tried:
            tried = bool(run.end.tries)
            assert (run.end.poll_backoff.failures, run.end.poll_backoff.sleeps_left) == (0, 0)
    assert run.end.trials > 0


def _looks(link: Any) -> None:
    link.waiting.may_change = False
    link.waiting.prefers_looking = link.waiting.poll_backoff.enabled = True


def _sleeps(link: Any) -> None:
    lib.hil_waiting_init(ffi.addressof(link, "waiting"), False)


def _paced(link: Any) -> None:
    _looks(link)
    link.realtime_factor = 20.0


@pytest.mark.parametrize(("prepare", "sleeps"), [(_looks, 0), (_sleeps, 1), (_paced, 1)])
def test_the_robots_end_is_told(
    dialect: ModuleType, make_world: Any, prepare: Callable[[Any], None], sleeps: int
) -> None:
    bench = Bench(dialect)
    robot = bench.robot()
    prepare(bench.link)
    try:
        assert bench.run(make_world(), 50) == lib.HIL_OK
    finally:
        bench.close()
    assert {message.host_sleeps for message in robot.of_type("OMNI_HIL_SENSORS")} == {sleeps}


@pytest.mark.full
def test_the_pages_table_is_what_its_command_prints() -> None:
    """Its figures are of one machine. Its rows and columns are checked, and that the command works."""
    page = (ROOT / "docs/checks/performance.md").read_text(encoding="utf-8")
    lines = list(table(rounds=1, seconds=0.2))
    for line in lines[:2]:
        assert f"{line}\n" in page
    for line in lines[2:-2]:
        name = line.split("|")[1]
        assert page.count(f"\n|{name}|") == 1
        assert all(float(figure) > 0.0 for figure in line.split("|")[2:-1])
    assert "60 s simulated, median of 5 runs in turn" in page
