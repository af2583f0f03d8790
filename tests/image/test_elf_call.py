# SPDX-License-Identifier: MIT
"""Functions inside the image answer as their headers say, and what the processor's model cannot do is never skipped."""

from __future__ import annotations

import math
import struct
from pathlib import Path

import pytest

from tests.needs import need

need("arm", module=True)

from tests.image.elf_call import DOUBLE_HELPER, CallError, ElfCall  # noqa: E402

FREE = 0x20240000
BX_LR = 0x4770


@pytest.fixture(scope="module")
def machine(image: Path) -> ElfCall:
    return ElfCall(image)


def test_a_function_of_the_core_is_called(machine: ElfCall) -> None:
    machine.call("omni_wrap_pi", floats=[7.0])
    assert machine.float_result == pytest.approx(7.0 - 2.0 * math.pi, abs=1e-6)


@pytest.mark.parametrize(
    ("value", "whole"),
    [(0.0, 0), (1.9, 1), (2.0**31 + 256.0, 2**31 + 256), (3.0e18, int(3.0000000e18)), (1e30, 2**64 - 1), (-5.0, 0)],
)
def test_the_helper_in_double_precision_is_stood_in_for(machine: ElfCall, value: float, whole: int) -> None:
    bits = struct.pack("<f", value)
    low = machine.call(DOUBLE_HELPER, int.from_bytes(bits, "little"))
    high = machine.uc.reg_read(machine.HIGH_RESULT)
    exact = struct.unpack("<f", bits)[0]
    assert high << 32 | low == (int(exact) if 0.0 <= exact < 2.0**64 else whole)


def test_double_precision_elsewhere_is_an_error(machine: ElfCall) -> None:
    vadd_f64_d0_d0_d0 = struct.pack("<3H", 0xEE30, 0x0B00, BX_LR)
    machine.write(FREE, vadd_f64_d0_d0_d0)
    with pytest.raises(CallError, match="Invalid instruction"):
        machine.call(FREE)


def test_a_register_is_no_memory(machine: ElfCall) -> None:
    ldr_r0_r0 = struct.pack("<2H", 0x6800, BX_LR)
    machine.write(FREE + 16, ldr_r0_r0)
    with pytest.raises(CallError, match="UNMAPPED"):
        machine.call(FREE + 16, 0x400E4000)


def test_a_call_that_does_not_come_back_is_an_error(machine: ElfCall) -> None:
    branch_to_itself = struct.pack("<H", 0xE7FE)
    machine.write(FREE + 32, branch_to_itself)
    with pytest.raises(CallError, match="not back after 1000 instructions"):
        machine.call(FREE + 32, instructions=1000)


def test_places_are_named(machine: ElfCall) -> None:
    assert machine.where((machine.symbols["omni_robot_tick"] & ~1) + 4) == "omni_robot_tick+0x4"
