# SPDX-License-Identifier: MIT
"""The bench of the checks loses nothing that the chip objected to."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from emulated_teensy.image_file import Image
from emulated_teensy.machine import STACK_END, Channel, FindingKind, Stop
from hil_sim.scenario import load_scenario
from image_check.bench import Bench, CheckError, Context, MachineLink
from omniwheel.errors import LinkLostError
from tests.image.assembly import assemble

GUILTY = """
main:
    cpsid i
    movw r2, #10000
1:  subs r2, #1
    bne 1b
    udf #1
"""


@pytest.fixture
def context(tmp_path: Path) -> Context:
    """Return a context of a program that faults 200 us after its start."""
    return Context(Image(tmp_path / "guilty", assemble(GUILTY, tmp_path).flash), load_scenario("stand", "three_wheel"))


def fault(bench: Bench) -> None:
    """Let it fault, then go back to the time before."""
    bench.machine.power_on()
    before = bench.machine.snapshot()
    assert bench.machine.run(0.001) == Stop.TIME
    assert bench.findings()
    bench.machine.restore(before)
    assert not bench.findings()


def test_objections_before_going_back_count(context: Context) -> None:
    with pytest.raises(CheckError, match="undefined instruction"), context.bench() as bench:
        fault(bench)


def test_a_check_that_fails_tells_what_the_chip_objected_to(context: Context) -> None:
    def check() -> None:
        with context.bench() as bench:
            fault(bench)
            raise CheckError("never there")

    with pytest.raises(CheckError, match=r"never there.*undefined instruction"):
        check()


def test_forgotten_objections_are(context: Context) -> None:
    with context.bench() as bench:
        fault(bench)
        bench.machine.forget_findings()


def test_a_robot_that_takes_no_bytes_ends_the_check(context: Context) -> None:
    with context.bench() as bench:
        bench.machine.power_on()
        link = MachineLink(bench, Channel.USB)
        with pytest.raises(LinkLostError, match="no byte from image:usb"):
            link.write(b"anybody there?")
        bench.machine.forget_findings()


STACK = 0x2000F000
FRAME = 32


def test_a_stack_over_the_variables_is_objected_to(context: Context) -> None:
    deep = with_stack_end(context, STACK - FRAME + 4)
    with (
        pytest.raises(CheckError, match="the stack reaches 4 bytes below its end at 0x2000EFE4"),
        deep.bench(expected=frozenset({FindingKind.FAULT})) as bench,
    ):
        fault(bench)


def test_what_is_left_of_the_stack_is_told(context: Context) -> None:
    with with_stack_end(context, STACK - FRAME - 8).bench(expected=frozenset({FindingKind.FAULT})) as bench:
        fault(bench)
        assert bench.machine.stack_left == 8


def with_stack_end(context: Context, address: int) -> Context:
    """Return the same with the end of the variables at an address."""
    return replace(context, image=replace(context.image, symbols={STACK_END: address}))
