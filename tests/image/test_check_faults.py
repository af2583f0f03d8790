# SPDX-License-Identifier: MIT
"""The checks of faults at the image's pins: they pass, they name what they leave out, and they can fail."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from emulated_teensy.image_file import read_image
from emulated_teensy.machine import Channel
from hil_sim.fault_bench import run_case as run_on_the_bench
from hil_sim.fault_cases import CASES, FaultCase
from hil_sim.scenario import load_scenario
from image_check import edges, fault_loop, unplug
from image_check.bench import Bench, CheckError, Context
from image_check.check import Check
from image_check.faults import (
    BATTERY,
    BUTTON,
    EXTRA,
    NOT_AT_THE_PINS,
    SHORT,
    Starts,
    faults_at_the_pins,
    on_the_floor,
    run_case,
)
from image_check.run import all_checks

KNOWN = {case.name: case for case in (*CASES, *EXTRA)}
AT_THE_PINS = [name for name in KNOWN if name not in (*NOT_AT_THE_PINS, *BATTERY, BUTTON)]
ROBOT = "three_wheel"


def context(image: Path, depth: str) -> Context:
    return Context(read_image(image), load_scenario("stand", ROBOT), depth=depth)


@pytest.fixture(scope="module")
def starts(image: Path) -> Iterator[tuple[Bench, Starts]]:
    """Return a machine with the robot on the floor."""
    c = context(image, "ci")
    with c.booted(scenario=on_the_floor(c.scenario)) as bench:
        yield bench, Starts(bench)


def run(starts: tuple[Bench, Starts], case: FaultCase) -> str:
    bench, where = starts
    return run_case(bench, where, case, bench.scenario.parameter_values())


def test_the_names_are_those_of_cases() -> None:
    assert set(NOT_AT_THE_PINS) | {BUTTON, *BATTERY, *SHORT} <= set(KNOWN)


def test_the_short_check_says_what_it_leaves_out(image: Path) -> None:
    figures = faults_at_the_pins(context(image, "short"))
    left_out = " ".join(figure for figure in figures if figure.startswith("not tried"))
    assert [name for name in (*NOT_AT_THE_PINS, *BATTERY) if KNOWN[name].what not in left_out] == []
    assert [name for name in SHORT if not any(KNOWN[name].what in figure for figure in figures)] == []


@pytest.mark.nightly
@pytest.mark.parametrize("name", AT_THE_PINS)
def test_a_fault_at_the_pins_is_met_as_promised(starts: tuple[Bench, Starts], name: str) -> None:
    assert KNOWN[name].what in run(starts, KNOWN[name])


@pytest.mark.parametrize(
    ("name", "changes", "complaint"),
    [
        ("i2c_stuck", {"bound": "0.005"}, "bridges off after"),
        ("i2c_stuck", {"parameters": {"SAFE_I2C_N": 30.0}}, "bridges off after"),
        ("i2c_glitch", {"stops": "driver", "bound": "0.012"}, "a bridge input stays high"),
        ("i2c_nack", {"stops": None}, "must drive on"),
        ("i2c_nack", {"says": "the moon is made of cheese"}, "cheese"),
        ("i2c_nack", {"stops": "stall"}, "stall"),
    ],
)
def test_what_is_not_as_promised_is_found(
    starts: tuple[Bench, Starts], name: str, changes: dict[str, object], complaint: str
) -> None:
    with pytest.raises(CheckError, match=complaint):
        run(starts, replace(KNOWN[name], **changes))  # type: ignore[arg-type]


@pytest.mark.nightly  # `make firmware-check` runs the same checks
@pytest.mark.parametrize("check", unplug.CHECKS, ids=lambda check: check.name)
def test_cable_host_and_upload(image: Path, check: Check) -> None:
    assert check.run(context(image, "ci"))


def test_a_deaf_host_takes_nothing(image: Path) -> None:
    with context(image, "short").booted() as bench:
        robot = bench.connect()
        robot.pump(0.2)
        bench.machine.usb_deaf(True)
        bench.drain()
        bench.advance(0.3)
        assert bench.take(Channel.USB) == b""
        bench.machine.usb_deaf(False)
        bench.advance(0.1)
        assert bench.take(Channel.USB) != b""


@pytest.mark.nightly  # `make firmware-check` runs the same checks
@pytest.mark.parametrize("check", edges.CHECKS, ids=lambda check: check.name)
def test_encoders_at_their_limits(image: Path, check: Check) -> None:
    assert check.run(context(image, "ci"))


def test_noise_takes_the_place_of_a_wire(image: Path) -> None:
    """Edges come at the rate that was asked for, and the disc's levels come back afterwards."""
    pin = 3
    with context(image, "short").booted() as bench:
        rest = bench.machine.pin(pin)
        bench.machine.noise(pin, 10_000)
        levels = []
        for _ in range(5000):
            bench.advance(1e-6)
            levels.append(bench.machine.pin(pin))
        edges_seen = sum(a != b for a, b in pairwise(levels))
        assert 40 <= edges_seen <= 60
        bench.machine.noise(pin, 0)
        assert bench.machine.pin(pin) == rest


def test_noise_needs_a_wire(image: Path) -> None:
    with context(image, "short").booted() as bench, pytest.raises(ValueError, match="pin 99"):
        bench.machine.noise(99, 1000)


def test_a_case_in_the_loop_is_as_on_the_pc(image: Path) -> None:
    case = KNOWN["clock_back"]
    ours, theirs = run_on_the_bench(case, fault_loop.flashed(image)), run_on_the_bench(case)
    fault_loop.compare(ours, theirs)
    with pytest.raises(CheckError, match=r"latency_s is 0\.5"):
        fault_loop.compare(replace(ours, latency_s=0.5), theirs)


@pytest.mark.nightly
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_every_case_in_the_loop_is_as_on_the_pc(image: Path, case: FaultCase) -> None:
    fault_loop.compare(run_on_the_bench(case, fault_loop.flashed(image)), run_on_the_bench(case))


def test_no_check_is_listed_twice() -> None:
    names = [check.name for check in all_checks()]
    assert len(names) == len(set(names))
