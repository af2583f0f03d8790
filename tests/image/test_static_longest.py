# SPDX-License-Identifier: MIT
"""The longest way through machine code, against programs that are run and counted; loop bounds against ticks."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

pytest.importorskip("capstone")
pytest.importorskip("networkx")

from unicorn import UC_ARCH_ARM, UC_HOOK_CODE, UC_MODE_MCLASS, UC_MODE_THUMB, Uc, arm_const

from emulated_teensy.image_file import read_image
from tests.image.static.calls import Calls
from tests.image.static.code import CodeError, Function, Program
from tests.image.static.longest import Longest, Loop, blocks_of, loops_of, most_turns
from tests.image.static.loop_bounds import LoopBounds
from tests.image.test_static_stack import linked
from tests.image.tick_figures import record_cases

MAX_WHEELS = 4
RETURN_TO = 0x60F00000
LINES = """
__attribute__((noinline)) int inner(int n) { int s = 0; for (int i = 0; i < n; ++i) { s += i ^ n; } return s; }
__attribute__((noinline)) int outer(int n) { int s = 0; for (int i = 0; i < n; ++i) { s ^= inner(n); } return s; }
__attribute__((noinline)) int odd(int n) { return n & 1 ? inner(n) : outer(n); }
__attribute__((noinline)) int chosen(int n) {
    switch (n) {
    case 0: return 7;
    case 1: return inner(3);
    case 2: return outer(2);
    case 3: return n * 3;
    case 4: return inner(n);
    }
    return outer(n & 3);
}
int _start(int n) { return inner(n) + outer(n) + odd(n) + chosen(n); }
"""


def counted(program: Path, function: int, argument: int) -> int:
    """Run a function on Unicorn and return how many instructions it executed."""
    machine = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
    machine.mem_map(0x60000000, 0x01000000)
    machine.mem_map(0x20000000, 0x10000)
    for address, data in Program(program).segments:
        machine.mem_write(address, bytes(data))
    count = 0

    def one(*_: object) -> None:
        nonlocal count
        count += 1

    machine.hook_add(UC_HOOK_CODE, one)
    machine.reg_write(arm_const.UC_ARM_REG_SP, 0x2000F000)
    machine.reg_write(arm_const.UC_ARM_REG_LR, RETURN_TO | 1)
    machine.reg_write(arm_const.UC_ARM_REG_R0, argument)
    machine.emu_start(function | 1, RETURN_TO)
    return count


@pytest.mark.parametrize("level", ["-O1", "-O2"])
def test_no_run_is_longer_and_the_longest_is_nearly_reached(tmp_path: Path, level: str) -> None:
    most = 5
    source = tmp_path / "small.c"
    source.write_text(LINES)
    program = linked(tmp_path, source, flags=level)
    calls = Calls(Program(program), read_image(program))
    longest = Longest(calls, lambda _function, _loop: most)
    for name in ("inner", "outer", "odd", "chosen"):
        start = calls.program.addresses[name]
        runs = [counted(program, start, argument) for argument in range(most + 1)]
        bound = longest.below(start)
        assert max(runs) <= bound, name
        assert bound <= 3 * max(runs) + 60, name


def test_a_loop_without_a_rule_is_refused(tmp_path: Path) -> None:
    source = tmp_path / "small.c"
    source.write_text(LINES)
    program = linked(tmp_path, source, flags="-O1")
    image = read_image(program)
    with pytest.raises(CodeError, match=r"no rule in loops\.toml"):
        Longest(Calls(Program(program), image), LoopBounds(image, 3)).below(Program(program).addresses["inner"])


@pytest.mark.nightly
def test_no_measured_tick_exceeds_a_loop_bound_or_the_whole_bound(image: Path) -> None:
    """A wrong rule in loops.toml would make the bound of the tick worthless."""
    flashed = read_image(image)
    calls = Calls(Program(image), flashed)
    bound_of = LoopBounds(flashed, MAX_WHEELS)
    tick = calls.matching("_ZN4omni11ControlLoop4tick.*")
    whole = Longest(calls, bound_of).below(tick)
    functions = {name: calls.program.function(calls.program.addresses[name]) for name, _ in bound_of.used}
    turns = {(name, head): turns_of(functions[name], head, bound_of) for name, head in bound_of.used}
    code, cases = record_cases(image)
    looked_at = 0
    for ticks in cases.values():
        for blocks in {blocks for blocks, _ in ticks}:
            assert code.count(blocks) <= whole
            begun = Counter(blocks)
            for (name, head), most in turns.items():
                calls_of_it = begun[functions[name].start]
                assert begun[head] <= calls_of_it * most, (name, hex(head))
                looked_at += begun[head]
    assert looked_at > 10_000


def turns_of(function: Function, head: int, bound_of: LoopBounds) -> int:
    """Return how often a loop's first block can begin in one call: as often as it is entered and begun again."""
    loops = loops_of(function, blocks_of(function).graph)

    def bound(loop: Loop) -> int:
        return bound_of(function, loop) + 1

    return most_turns(next(loop for loop in loops if loop.head == head), loops, bound)
