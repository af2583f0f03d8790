# SPDX-License-Identifier: MIT
"""The emulated processor's exceptions and faults, by small programs."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from tests.image.assembly import RAM, assemble
from tests.image.bare import running

FINDING_FAULT = 0

SYSTICK = """
    ldr r0, =0xE000E010
    movs r1, #1
    str r1, [r0, #4]            @ every 20 us
    str r1, [r0, #8]
    movs r1, #3
    str r1, [r0]
"""

# A checksum that needs every register, the flags within IT blocks, multiple loads and stores, floating point.
CHECKSUM = """
main:
    handler 15, on_tick
    {systick}
    movs r0, #0
    movs r1, #1
    movw r2, #1103
    movw r3, #12345
    movs r4, #0
    movs r5, #0
    mov r12, #7
    vmov.f32 s0, #1.0
    vmov.f32 s1, #0.5
    movw r6, #{rounds}
loop:
    mul r1, r1, r2
    add r1, r1, r3
    tst r1, #64
    itete ne
    addne r4, r4, r1
    eoreq r4, r4, r1, ror #3
    addne r5, r5, #1
    subeq r5, r5, r4
    push {{r1-r5, r12}}
    vmul.f32 s2, s0, s1
    vadd.f32 s0, s2, s1
    adds r0, r0, r5
    pop {{r1-r5, r12}}
    adc r12, r12, r4
    vcmp.f32 s0, s1
    vmrs APSR_nzcv, FPSCR
    it gt
    addgt r12, #1
    strd r4, r5, [r7, #8]
    ldrd r8, r9, [r7, #8]
    eor r12, r12, r8
    subs r6, #1
    bne loop
    vmov r3, s0
    stm r7, {{r0, r1, r2, r3, r4, r5}}
    str r12, [r7, #24]
    str sp, [r7, #28]
    b done
.thumb_func
on_tick:
    ldr r0, =0x{ticks:08X}
    ldr r1, [r0]
    add r1, #1
    str r1, [r0]
    mov r2, #-1
    mov r3, r2
    mov r12, r2
    vmov s0, r2
    vmov s1, r2
    vmov s15, r2
    vadd.f32 s2, s3, s4
    msr APSR_nzcvq, r2
    bx lr
"""
TICKS = RAM + 0xE00


def _checksum(folder: Path, *, ticks: bool, exact: bool, instruction_ns: int) -> tuple[list[int], int]:
    source = CHECKSUM.format(systick=SYSTICK if ticks else "", rounds=3000, ticks=TICKS)
    with running(assemble(source, folder), instruction_ns=instruction_ns, exact=exact) as bare:
        counter = bare.words(1, TICKS)[0]
        bare.finish()
        assert bare.findings() == []
        return bare.words(8), (bare.words(1, TICKS)[0] - counter) & 0xFFFFFFFF


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("instruction_ns", [7, 251])
def test_interrupts_at_any_instruction_leave_the_program_as_it_was(
    tmp_path: Path, exact: bool, instruction_ns: int
) -> None:
    calm, none = _checksum(tmp_path, ticks=False, exact=False, instruction_ns=10)
    disturbed, ticks = _checksum(tmp_path, ticks=True, exact=exact, instruction_ns=instruction_ns)
    assert none == 0
    assert ticks > (20 if instruction_ns == 7 else 500)
    assert disturbed == calm


def test_priorities_and_nesting(tmp_path: Path) -> None:
    # 20 asks for 21 (more urgent: at once) and 22 (less: afterwards); 23 is as urgent as 20: afterwards too, before 22.
    source = """
main:
    handler 36, first
    handler 37, urgent
    handler 38, late
    handler 39, equal
    ldr r0, =0xE000E414         @ priorities of interrupts 20..23
    ldr r1, =0x80C04080
    str r1, [r0]
    ldr r0, =0xE000E100
    mov r1, #0xF00000
    str r1, [r0]
    ldr r6, =0xE000E200
    mov r5, #0x100000
    cpsid i
    str r5, [r6]
    movs r0, #1
    str r0, [r7], #4            @ masked: nothing has run yet
    cpsie i
    movs r0, #9
    str r0, [r7], #4
    b done
.macro trace value
    movs r0, #\\value
    str r0, [r7], #4
.endm
.thumb_func
first:
    trace 2
    mov r1, #0xE00000
    str r1, [r6]
    isb                         @ ends the basic block
    trace 4
    bx lr
.thumb_func
urgent:
    trace 3
    bx lr
.thumb_func
equal:
    trace 5
    bx lr
.thumb_func
late:
    trace 6
    bx lr
"""
    # Handlers move r7, which no frame holds: the trace grows in the order of execution.
    with running(assemble(source, tmp_path)) as bare:
        bare.finish()
        assert bare.words(7) == [1, 2, 3, 4, 5, 6, 9]


def test_basepri_masks_what_is_not_more_urgent(tmp_path: Path) -> None:
    source = """
main:
    handler 36, on_20
    handler 37, on_21
    ldr r0, =0xE000E414
    ldr r1, =0x00004080
    str r1, [r0]
    ldr r0, =0xE000E100
    mov r1, #0x300000
    str r1, [r0]
    movs r0, #0x60
    msr BASEPRI, r0
    ldr r6, =0xE000E200
    str r1, [r6]
    dsb
    isb
    movs r0, #1
    str r0, [r7], #4
    movs r0, #0
    msr BASEPRI, r0
    isb
    nop
    movs r0, #2
    str r0, [r7], #4
    b done
.thumb_func
on_20:
    movs r0, #20
    str r0, [r7], #4
    bx lr
.thumb_func
on_21:
    movs r0, #21
    str r0, [r7], #4
    bx lr
"""
    with running(assemble(source, tmp_path)) as bare:
        bare.finish()
        assert bare.words(4) == [21, 1, 20, 2]


FAULT = """
main:
    handler 3, on_fault
    handler 4, on_fault
    handler 5, on_fault
    handler 6, on_fault
    ldr r0, =0xE000ED24
    ldr r1, ={enable}
    str r1, [r0]
    {before}
guilty:
    {instruction}
after:
    b .
.thumb_func
on_fault:
    mrs r0, IPSR
    ldr r1, [sp, #24]           @ where it happened
    ldr r2, =0xE000ED28
    ldr r3, [r2]                @ CFSR
    ldr r4, [r2, #4]            @ HFSR
    stm r7, {{r0, r1, r3, r4}}
    b done
"""
ALL_FAULTS = "0x70000"
PERIPHERAL = "ldr r2, =0xE000ED08\n"
MEMORY_PROTECTION = """
    ldr r2, =0xE000ED94
    ldr r3, =0x{base:08X}
    str r3, [r2, #8]
    ldr r3, =0x{attributes:08X}
    str r3, [r2, #12]
    movs r3, #5                 @ on, the rest as without
    str r3, [r2]
    dsb
    isb
    b 1f
1:
"""
READ_ONLY_4K = 0x07000017
NO_ACCESS_32 = 0x10000009


def fault(
    folder: Path, instruction: str, *, before: str = "", enable: str = ALL_FAULTS
) -> tuple[list[int], int, list[str]]:
    """Return exception, place, CFSR and HFSR as the handler finds them; the guilty address; the findings."""
    program = assemble(FAULT.format(instruction=instruction, before=before, enable=enable), folder)
    with running(program) as bare:
        bare.finish()
        return bare.words(4), program.symbols["guilty"] & ~1, bare.findings()


@pytest.mark.parametrize(
    ("instruction", "before", "exception", "status"),
    [
        ("str r1, [r2, #1]", PERIPHERAL, 6, 1 << 24),
        ("strh r1, [r2, #1]", PERIPHERAL, 6, 1 << 24),
        ("ldr r1, [r2, #2]", PERIPHERAL, 6, 1 << 24),
        ("udf #1", "", 6, 1 << 16),
        ("ldr r1, [r2]", "ldr r2, =0x30000000", 5, 1 << 9 | 1 << 15),
        ("str r1, [r2]", "ldr r2, =0x60002000", 4, 1 << 1 | 1 << 7),
        (
            "str r1, [r2]",
            MEMORY_PROTECTION.format(base=0x20008010, attributes=READ_ONLY_4K) + "ldr r2, =0x20008ABC",
            4,
            0x82,
        ),
        (
            "ldr r1, [r2]",
            MEMORY_PROTECTION.format(base=0x20008010, attributes=NO_ACCESS_32) + "ldr r2, =0x2000801C",
            4,
            0x82,
        ),
    ],
)
def test_a_fault_is_taken_where_it_happens(
    tmp_path: Path, instruction: str, before: str, exception: int, status: int
) -> None:
    (number, address, cfsr, hfsr), guilty, findings = fault(tmp_path, instruction, before=before)
    assert (number, hex(address), cfsr, hfsr) == (exception, hex(guilty), status, 0)
    assert len(findings) == 1


def test_a_fault_that_is_off_becomes_a_hard_fault(tmp_path: Path) -> None:
    (number, _, _, hfsr), _, _ = fault(tmp_path, "udf #1", enable="0")
    assert (number, hfsr) == (3, 1 << 30)


def test_reading_beside_a_guarded_region_is_allowed(tmp_path: Path) -> None:
    guard = MEMORY_PROTECTION.format(base=0x20008010, attributes=NO_ACCESS_32)
    source = f"main:\n{guard}\n ldr r2, =0x20008020\n ldr r1, [r2]\n ldr r2, =0x20007FFC\n str r1, [r2]\n b done\n"
    with running(assemble(source, tmp_path)) as bare:
        bare.finish()
        assert bare.findings() == []


def test_a_fault_within_the_hard_fault_handler_locks_the_processor_up(tmp_path: Path) -> None:
    source = """
main:
    handler 3, broken
    udf #1
.thumb_func
broken: udf #2
"""
    with running(assemble(source, tmp_path)) as bare:
        assert bare.run(1000.0) == 0
        executed = bare.register(15)
        assert bare.run(2000.0) == 0
        assert bare.register(15) == executed


def test_a_stack_that_overflows_locks_up_instead_of_overwriting(tmp_path: Path) -> None:
    guard = MEMORY_PROTECTION.format(base=0x20008010, attributes=NO_ACCESS_32)
    source = f"""
main:
    handler 15, on_tick
    {guard}
    ldr sp, =0x20008030
    {SYSTICK}
    b .
.thumb_func
on_tick: b done
"""
    with running(assemble(source, tmp_path)) as bare:
        bare.run(1000.0)
        assert any("stack" in finding for finding in bare.findings())


def test_an_unknown_register_ends_the_run_with_its_name(tmp_path: Path) -> None:
    with running(assemble("main:\n ldr r0, =0x40000000\n ldr r1, [r0]\n b done\n", tmp_path)) as bare:
        assert bare.run(1000.0) == 6
        assert "0x40000000" in bare.why


def test_time_goes_on_with_instructions(tmp_path: Path) -> None:
    source = """
main:
    ldr r0, =0xE000EDFC
    mov r1, #0x01000000
    str r1, [r0]
    ldr r0, =0xE0001000
    movs r1, #1
    str r1, [r0]
    ldr r2, [r0, #4]
    movw r3, #10000
1:  subs r3, #1
    bne 1b
    ldr r4, [r0, #4]
    subs r4, r2
    str r4, [r7]
    b done
"""
    with running(assemble(source, tmp_path), instruction_ns=10) as bare:
        bare.finish()
        # Two instructions of 10 ns a round, 600 cycles in a microsecond.
        assert abs(bare.words(1)[0] - 20_000 * 6) < 60
