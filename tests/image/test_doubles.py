# SPDX-License-Identifier: MIT
"""The emulated processor's double-precision instructions, by small programs."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from tests.image.assembly import assemble
from tests.image.bare import running

INF = float("inf")

DOUBLES = {
    "vadd.f64": lambda a, b, d: a + b,
    "vsub.f64": lambda a, b, d: a - b,
    "vmul.f64": lambda a, b, d: a * b,
    "vnmul.f64": lambda a, b, d: -(a * b),
    "vdiv.f64": lambda a, b, d: a / b,
    "vmla.f64": lambda a, b, d: d + a * b,
    "vmls.f64": lambda a, b, d: d - a * b,
}
ONE = {
    "vmov.f64 d2, d0": lambda a: a,
    "vabs.f64 d2, d0": abs,
    "vneg.f64 d2, d0": lambda a: -a,
    "vsqrt.f64 d2, d1": None,
    "vmov.f64 d2, #-2.5": lambda a: -2.5,
}


def _double_program(instruction: str, a: float, b: float, d: float, result: str = "vstr d2, [r7]") -> str:
    values = "\n".join(f".quad 0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016x}" for value in (a, b, d))
    return f"""
main:
    ldr r0, =numbers
    vldm r0, {{d0-d2}}
    {instruction}
    {result}
    b done
.balign 8
numbers:
{values}
"""


def _as_double(words: list[int]) -> float:
    return float(struct.unpack("<d", struct.pack("<2I", *words))[0])


@pytest.mark.parametrize("name", sorted(DOUBLES))
def test_double_precision_arithmetic(tmp_path: Path, name: str) -> None:
    generator = np.random.default_rng(5)
    for _ in range(3):
        a, b, d = (float(value) for value in generator.normal(size=3) * 10.0 ** generator.integers(-8, 8, size=3))
        with running(assemble(_double_program(f"{name} d2, d0, d1", a, b, d), tmp_path)) as bare:
            bare.finish()
            assert _as_double(bare.words(2)) == DOUBLES[name](a, b, d)


@pytest.mark.parametrize(
    ("instruction", "expected"),
    [
        ("vmov.f64 d2, d0", -3.75),
        ("vabs.f64 d2, d0", 3.75),
        ("vneg.f64 d2, d0", 3.75),
        ("vsqrt.f64 d2, d1", float(np.sqrt(2.25e9))),
        ("vmov.f64 d2, #-2.5", -2.5),
        ("vmov.f64 d2, #0.125", 0.125),
        ("vfma.f64 d2, d0, d1", 1.0 - 3.75 * 2.25e9),
        ("vfms.f64 d2, d0, d1", 1.0 + 3.75 * 2.25e9),
    ],
)
def test_double_precision_moves(tmp_path: Path, instruction: str, expected: float) -> None:
    with running(assemble(_double_program(instruction, -3.75, 2.25e9, 1.0), tmp_path)) as bare:
        bare.finish()
        assert _as_double(bare.words(2)) == expected


@pytest.mark.parametrize(
    ("value", "signed", "unsigned", "nearest"),
    [
        (1.5, 1, 1, 2),
        (-1.5, -1, 0, -2),
        (2.5, 2, 2, 2),
        (3e9, 2**31 - 1, 3_000_000_000, 2**31 - 1),
        (-1e30, -(2**31), 0, -(2**31)),
        (1e30, 2**31 - 1, 2**32 - 1, 2**31 - 1),
        (float("nan"), 0, 0, 0),
    ],
)
def test_double_to_integer(tmp_path: Path, value: float, signed: int, unsigned: int, nearest: int) -> None:
    convert = "vcvt.s32.f64 s4, d0\n vcvt.u32.f64 s5, d0\n vcvtr.s32.f64 s6, d0"
    store = "vstr s4, [r7]\n vstr s5, [r7, #4]\n vstr s6, [r7, #8]"
    with running(assemble(_double_program(convert, value, 0.0, 0.0, store), tmp_path)) as bare:
        bare.finish()
        assert bare.words(3) == [signed & 0xFFFFFFFF, unsigned, nearest & 0xFFFFFFFF]


def test_integers_and_floats_to_double(tmp_path: Path) -> None:
    convert = """
    ldr r0, =0xFFFFFFFE
    vmov s6, r0
    vcvt.f64.s32 d4, s6
    vcvt.f64.u32 d5, s6
    vcvt.f32.f64 s7, d0
    vcvt.f64.f32 d6, s7
"""
    store = "vstr d4, [r7]\n vstr d5, [r7, #8]\n vstr d6, [r7, #16]"
    with running(assemble(_double_program(convert, 0.1, 0.0, 0.0, store), tmp_path)) as bare:
        bare.finish()
        words = bare.words(6)
    assert [_as_double(words[at : at + 2]) for at in (0, 2, 4)] == [-2.0, 4294967294.0, float(np.float32(0.1))]


@pytest.mark.parametrize(
    ("a", "b", "flags"), [(1.0, 2.0, 8), (2.0, 2.0, 6), (3.0, 2.0, 2), (float("nan"), 2.0, 3), (-0.0, 0.0, 6)]
)
def test_double_comparison(tmp_path: Path, a: float, b: float, flags: int) -> None:
    with running(
        assemble(_double_program("vcmp.f64 d0, d1", a, b, 0.0, "vmrs r0, FPSCR\n str r0, [r7]"), tmp_path)
    ) as bare:
        bare.finish()
        assert bare.words(1)[0] >> 28 == flags


@pytest.mark.parametrize(
    ("instruction", "expected"),
    [
        ("vnmla.f64 d2, d0, d1", -3.0 - 1.5 * 2.5),
        ("vnmls.f64 d2, d0, d1", 1.5 * 2.5 - 3.0),
        ("vfnma.f64 d2, d0, d1", -3.0 - 1.5 * 2.5),
        ("vfnms.f64 d2, d0, d1", 1.5 * 2.5 - 3.0),
        ("vmaxnm.f64 d2, d0, d1", 2.5),
        ("vminnm.f64 d2, d0, d1", 1.5),
        ("vrintz.f64 d2, d1", 2.0),
        ("vrintr.f64 d2, d1", 2.0),
        ("vrintx.f64 d2, d0", 2.0),
        ("vrinta.f64 d2, d1", 3.0),
        ("vrintn.f64 d2, d1", 2.0),
        ("vrintp.f64 d2, d1", 3.0),
        ("vrintm.f64 d2, d1", 2.0),
        ("movs r1, #1\n cmp r1, #1\n vseleq.f64 d2, d0, d1", 1.5),
        ("movs r1, #1\n cmp r1, #2\n vselge.f64 d2, d0, d1", 2.5),
        ("movs r1, #1\n cmp r1, #1\n vselgt.f64 d2, d0, d1", 2.5),
        ("ldr r1, =0xFFFE8000\n vmov s4, r1\n vcvt.f64.s32 d2, d2, #16", -1.5),
    ],
)
def test_what_a_compiler_may_use_besides(tmp_path: Path, instruction: str, expected: float) -> None:
    with running(assemble(_double_program(instruction, 1.5, 2.5, 3.0), tmp_path)) as bare:
        bare.finish()
        assert _as_double(bare.words(2)) == expected


@pytest.mark.parametrize(
    ("instruction", "expected"),
    [
        ("vcvta.s32.f64 s4, d1", -3),
        ("vcvtm.s32.f64 s4, d0", -2),
        ("vcvtp.u32.f64 s4, d0", 0),
        ("vcvt.s32.f64 d0, d0, #4\n vmov s4, s0", -24),
    ],
)
def test_other_ways_to_an_integer(tmp_path: Path, instruction: str, expected: int) -> None:
    program = _double_program(instruction, -1.5, -2.5, 0.0, "vstr s4, [r7]")
    with running(assemble(program, tmp_path)) as bare:
        bare.finish()
        assert bare.words(1)[0] == expected & 0xFFFFFFFF


@pytest.mark.parametrize(
    ("instruction", "a", "b"),
    [
        ("vsub.f64 d2, d0, d1", INF, INF),
        ("vmul.f64 d2, d0, d1", INF, 0.0),
        ("vdiv.f64 d2, d0, d1", 0.0, 0.0),
        ("vsqrt.f64 d2, d0", -1.0, 0.0),
        ("vfma.f64 d2, d0, d1", INF, 0.0),
    ],
)
def test_an_operation_without_a_result_gives_the_processors_own_nan(
    tmp_path: Path, instruction: str, a: float, b: float
) -> None:
    with running(assemble(_double_program(instruction, a, b, 1.0), tmp_path)) as bare:
        bare.finish()
        assert bare.words(2) == [0, 0x7FF80000]


def test_a_conditional_operation_is_the_last_of_its_block(tmp_path: Path) -> None:
    source = """
main:
    vmov.f64 d0, #1.0
    movs r1, #2
    cmp r1, #1
    itt gt
    vmovgt.f64 d2, d0
    vaddgt.f64 d2, d2, d0
    movs r2, #0                 @ outside of the block: sets the flags
    ite eq
    moveq r0, #1
    movne r0, #2
    vstr d2, [r7]
    str r0, [r7, #8]
    b done
"""
    with running(assemble(source, tmp_path)) as bare:
        bare.finish()
        words = bare.words(3)
    assert (_as_double(words[:2]), words[2]) == (2.0, 1)


def test_an_interrupt_keeps_what_a_handler_computes(tmp_path: Path) -> None:
    """Its first operation is one that only we know: it makes the floating-point registers its own all the same."""
    source = """
main:
    handler 36, outer
    handler 37, inner
    ldr r0, =0xE000E414
    ldr r1, =0x00004080
    str r1, [r0]
    ldr r0, =0xE000E100
    mov r1, #0x300000
    str r1, [r0]
    ldr r6, =0xE000E200
    mov r5, #0x100000
    str r5, [r6]
    isb
    nop
    vstr d1, [r7]
    b done
.thumb_func
outer:
    vmov.f64 d1, #1.0
    mov r5, #0x200000
    str r5, [r6]
    isb
    nop
    vstr d1, [r7, #8]
    bx lr
.thumb_func
inner:
    vmov.f64 d1, #2.0
    bx lr
"""
    with running(assemble(source, tmp_path)) as bare:
        bare.finish()
        assert _as_double(bare.words(4)[2:]) == 1.0


def test_a_rounding_mode_that_is_not_modelled_is_not_blamed_on_the_program(tmp_path: Path) -> None:
    mode = "vmrs r0, FPSCR\n orr r0, #0x1000000\n vmsr FPSCR, r0\n vadd.f64 d2, d0, d1"
    with running(assemble(_double_program(mode, 1.0, 2.0, 3.0), tmp_path)) as bare:
        assert bare.run(1000.0) == 6
        assert "FPSCR" in bare.why
        assert bare.findings() == []
