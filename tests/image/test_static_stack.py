# SPDX-License-Identifier: MIT
"""The stack's bound from machine code, held against the compiler, programs with a known depth, and runs."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("capstone")

from emulated_teensy.image_file import read_image
from tests.image import flashed
from tests.image.static.calls import Calls
from tests.image.static.code import CodeError, Program
from tests.image.static.running import calls_seen, interrupts, running, used_stack, work
from tests.image.static.stack import Stack, depths_of
from tests.image.static.whole import heap_functions, whole_stack
from tests.needs import need

FLAGS = (
    "-mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-d16 -ffunction-sections -O3 -ffp-contract=off -fno-math-errno"
)
LINK = "-nostartfiles -Wl,-Ttext=0x60001000,-Tdata=0x60100000,-Tbss=0x60180000,--unresolved-symbols=ignore-all"
WATCHED_S, CALLS_WATCHED = 0.02, 60


def linked(folder: Path, *sources: Path, flags: str = "") -> Path:
    """Compile and link for the Cortex-M7; the compiler leaves its own stack figures (.su) in the folder."""
    need("arm")
    core = flashed.ROOT / "shared/core"
    folders = [f"-I{path}" for path in (core / "include", folder / "generated" / "include")]
    words = [*FLAGS.split(), *flags.split(), "-g", "-fstack-usage", *folders]
    for source in sources:
        subprocess.run(["arm-none-eabi-gcc", *words, "-c", str(source)], check=True, cwd=folder)
    objects = [f"{source.stem}.o" for source in sources]
    program = folder / "program.elf"
    subprocess.run(["arm-none-eabi-gcc", *words, *LINK.split(), *objects, "-o", str(program)], check=True, cwd=folder)
    return program


def written(folder: Path, text: str, flags: str = "") -> Calls:
    """Return the calls of a small C program."""
    source = folder / "small.c"
    source.write_text(text)
    program = linked(folder, source, flags=flags)
    return Calls(Program(program), read_image(program))


@pytest.fixture(scope="module")
def calls(image: Path) -> Calls:
    """The calls of the image that is flashed."""
    return Calls(Program(image), read_image(image))


def test_frames_are_those_that_the_compiler_says(tmp_path: Path) -> None:
    script = flashed.ROOT / "shared" / "generate" / "generate.py"
    subprocess.run([sys.executable, script, "--out", tmp_path / "generated", "--part", "tables"], check=True)
    sources = [*(flashed.ROOT / "shared/core/src").rglob("*.c"), *(tmp_path / "generated").rglob("*_gen.c")]
    program = Program(linked(tmp_path, *sources))
    said: dict[str, list[int]] = {}
    for file in tmp_path.glob("*.su"):
        for name, count, kind in re.findall(r":(\w+)\t(\d+)\t(.+)", file.read_text()):
            assert kind == "static"
            said.setdefault(name, []).append(int(count))
    compared = 0
    for name, counts in said.items():
        if name in program.addresses and len(counts) == 1:  # other files may have functions of the same name
            deepest = max(depths_of(program.function(program.addresses[name])).values())
            assert deepest == counts[0], name
            compared += 1
    assert compared >= 80


def test_the_deepest_way_is_found_through_calls_and_tail_calls(tmp_path: Path) -> None:
    calls = written(
        tmp_path,
        """
        extern void take(void *);
        __attribute__((noinline)) void take(void *p) { *(volatile char *)p = 1; }
        __attribute__((noinline)) void deep(void) { char a[400]; take(a); take(a + 1); }
        __attribute__((noinline)) void flat(void) { char a[16]; take(a); take(a + 1); }
        void _start(int n) { if (n) { flat(); deep(); } else { deep(); flat(); } }
        """,
    )
    found = Stack(calls).below(calls.program.addresses["_start"])
    own = {name: max(depths_of(calls.program.function(at)).values()) for name, at in calls.program.addresses.items()}
    assert found.way[:2] == ("_start", "deep")
    assert own["deep"] >= 400
    assert found.bytes in (own["_start"] + own["deep"], own["deep"])  # a tail call leaves nothing of the caller


NO_BOUND = {
    "recursion": """
        int f(int n);
        __attribute__((noinline)) int g(int n) { return f(n - 1) + n; }
        __attribute__((noinline)) int f(int n) { return n > 0 ? g(n - 1) * n : 1; }
        int _start(int n) { return f(n); }""",
    "moves the stack pointer|bytes on the stack": """
        __attribute__((noinline)) void take(void *p) { *(volatile char *)p = 1; }
        void _start(int n) { char a[n]; take(a); take(a + 1); }""",
    "leads to no known function": "void (*hook)(void); void _start(void) { hook(); hook(); }",
}


@pytest.mark.parametrize(("why", "text"), NO_BOUND.items(), ids=["recursion", "array of unknown size", "hook"])
def test_what_has_no_bound_is_refused(tmp_path: Path, why: str, text: str) -> None:
    calls = written(tmp_path, text, flags="-O2")
    with pytest.raises(CodeError, match=why):
        Stack(calls).below(calls.program.addresses["_start"])


def test_the_image_keeps_its_bound_and_takes_no_memory_from_a_heap(calls: Calls, image: Path) -> None:
    with running(image, "three_wheel") as bench:
        work(bench)
        enabled = interrupts(bench.machine)
        used = used_stack(bench.machine)
    whole = whole_stack(calls, enabled)
    assert used <= whole.bytes
    assert used > whole.main.bytes / 4  # the run did reach deep
    assert {level.priority for level in whole.levels} >= {16, 48, 64, 128}
    assert heap_functions(calls) == []


def test_every_call_of_a_run_is_one_that_was_foreseen(calls: Calls, image: Path) -> None:
    """A pointer that led elsewhere than the bound took into account would make the bound worthless."""
    program = calls.program
    with running(image, "three_wheel") as bench:
        enabled = interrupts(bench.machine)
        stack = Stack(calls)
        whole_stack(calls, enabled)
        for interrupt in enabled:
            stack.below(interrupt.function)
        stack.below(program.addresses["ResetHandler2"])
        functions = sorted({target for _, target in stack.pairs})
        robot = bench.connect()
        robot.arm()
        seen = calls_seen(bench, functions, WATCHED_S, CALLS_WATCHED)
    unforeseen = [(hex(back), program.names(start)) for back, start in seen if not foreseen(calls, back, start)]
    assert not unforeseen
    assert len({start for _, start in seen}) > 40


def foreseen(calls: Calls, back: int, start: int) -> bool:
    """Whether the call that ends at ``back`` may lead to a function, directly or by jumps out of what it calls."""
    program = calls.program
    holder = next(at for at in reversed(program.starts) if at < back)
    function = program.function(holder)
    step = next(step for step in function.steps.values() if step.address + step.size == back)
    open_ends, done = set(calls.targets(function, step)), set()
    while open_ends:
        at = open_ends.pop()
        done.add(at)
        inner = program.function(at)
        for jump in inner.steps.values():
            if jump.leaves:
                open_ends |= set(calls.targets(inner, jump)) - done
    return start in done
