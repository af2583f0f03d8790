# SPDX-License-Identifier: MIT
"""The emulated processor where others are lenient: alignment of single instructions, faults amid a block, waiting."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from tests.image.assembly import assemble
from tests.image.bare import running
from tests.image.test_processor import ALL_FAULTS, FAULT, fault

UNALIGNED = 1 << 24
INVSTATE = 1 << 17


@pytest.mark.parametrize(
    "instruction",
    [
        "ldrd r3, r4, [r2]",
        "strd r3, r4, [r2]",
        "ldm r2, {r3, r4}",
        "stm r2, {r3, r4}",
        "ldm.w r2, {r3, r8}",
        "vldr s0, [r2]",
        "vldr d0, [r2]",
        "vstr d0, [r2]",
        "vldm r2, {s0-s1}",
        "ldrex r3, [r2]",
    ],
)
def test_words_that_must_be_aligned_in_any_memory(tmp_path: Path, instruction: str) -> None:
    (number, address, cfsr, _), guilty, findings = fault(tmp_path, instruction, before="ldr r2, =0x20004002")
    assert (number, hex(address), cfsr) == (6, hex(guilty), UNALIGNED)
    assert len(findings) == 1
    assert "unaligned" in findings[0]


@pytest.mark.parametrize("instruction", ["ldr r3, [r2]", "str r3, [r2]", "ldrh r3, [r2, #1]"])
def test_others_need_not_be(tmp_path: Path, instruction: str) -> None:
    with running(assemble(f"main:\n ldr r2, =0x20004002\n {instruction}\n b done\n", tmp_path)) as bare:
        bare.finish()
        assert bare.findings() == []


def test_a_call_of_a_null_pointer(tmp_path: Path) -> None:
    (number, address, cfsr, _), _, findings = fault(tmp_path, "movs r3, #0\n blx r3")
    assert (number, address, cfsr) == (6, 0, INVSTATE)
    assert "even" in findings[0]


IN_A_HANDLER = """
    ldr r0, =vectors_in_ram + 4 * 15
    ldr r1, =on_tick + 1
    str r1, [r0]
    ldr r0, =0xE000ED04
    mov r1, #0x4000000          @ SysTick, pending
    str r1, [r0]
    isb
    nop
"""


def test_a_fault_in_the_last_block_of_a_handler_belongs_to_the_handler(tmp_path: Path) -> None:
    source = FAULT.format(instruction=IN_A_HANDLER, before="", enable=ALL_FAULTS)
    source = source.replace("stm r7", "ldr r4, [sp, #28]\n stm r7")
    source += """
.thumb_func
on_tick:
    ldr r2, =0xE000ED08
wrong:
    str r1, [r2, #1]
    bx lr
"""
    program = assemble(source, tmp_path)
    with running(program) as bare:
        bare.finish()
        number, address, _, xpsr = bare.words(4)
    # UsageFault is no more urgent than SysTick: a HardFault.
    assert (number, address, xpsr & 0x1FF) == (3, program.symbols["wrong"] & ~1, 15)


def test_an_interrupt_that_primask_holds_back_ends_the_waiting(tmp_path: Path) -> None:
    source = """
main:
    handler 15, on_tick
    cpsid i
    ldr r0, =0xE000ED04
    mov r1, #0x4000000
    str r1, [r0]
    isb
    nop
    wfi
    movs r0, #5
    str r0, [r7]
    b done
.thumb_func
on_tick:
    b .
"""
    with running(assemble(source, tmp_path)) as bare:
        bare.finish()
        assert bare.words(1) == [5]


@pytest.mark.parametrize("address", ["0xE000ED08", "0x20004000", "0x20004001"])
def test_a_conditional_access_ends_with_its_instruction(tmp_path: Path, address: str) -> None:
    source = f"""
main:
    ldr r0, ={address}
    ldr r3, =target + 1
    movs r5, #3
    movs r1, #0
    it eq
    ldreq r2, [r0]
    cmp r1, #5
    bx r3
.balign 4
.thumb_func
target:
    movs r5, #7                 @ outside of the block, whatever the flags
    str r5, [r7]
    b done
"""
    with running(assemble(source, tmp_path)) as bare:
        bare.finish()
        assert bare.words(1) == [7]
