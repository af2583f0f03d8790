# SPDX-License-Identifier: MIT
"""The checks of faults at the image's pins: they pass, they name what they leave out, and they can fail."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from hil_sim.fault_cases import CASES, FaultCase
from hil_sim.image_check import unplug
from hil_sim.image_check.bench import Bench, CheckError, Context
from hil_sim.image_check.check import Check
from hil_sim.image_check.faults import (
    BATTERY,
    EXTRA,
    NOT_AT_THE_PINS,
    SHORT,
    Starts,
    faults_at_the_pins,
    on_the_floor,
    run_case,
)
from hil_sim.image_file import read_image
from hil_sim.rt1062 import Channel
from hil_sim.scenario import load_scenario

KNOWN = {case.name: case for case in (*CASES, *EXTRA)}
AT_THE_PINS = [name for name in KNOWN if name not in NOT_AT_THE_PINS and name not in BATTERY]
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
    assert set(NOT_AT_THE_PINS) | set(BATTERY) | set(SHORT) <= set(KNOWN)


def test_the_short_check_says_what_it_leaves_out(image: Path) -> None:
    figures = faults_at_the_pins(context(image, "short"))
    left_out = " ".join(figure for figure in figures if figure.startswith("not tried"))
    assert [name for name in (*NOT_AT_THE_PINS, *BATTERY) if KNOWN[name].what not in left_out] == []
    assert [name for name in SHORT if not any(KNOWN[name].what in figure for figure in figures)] == []


@pytest.mark.slow
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
        ("i2c_nack", {"says": "the moon is made of cheese"}, "is not said"),
        ("i2c_nack", {"stops": "stall"}, "stall is not said"),
    ],
)
def test_what_is_not_as_promised_is_found(
    starts: tuple[Bench, Starts], name: str, changes: dict[str, object], complaint: str
) -> None:
    with pytest.raises(CheckError, match=complaint):
        run(starts, replace(KNOWN[name], **changes))  # type: ignore[arg-type]


@pytest.mark.slow
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
