# SPDX-License-Identifier: MIT
"""The flashed image's tick keeps its budget of instructions, and the estimates of its cycles are in their order."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.needs import need

need("arm", "llvm", module=True)

from tests.image.cortex_m7_model import Instruction, ModelError, costs, disassemble, in_order  # noqa: E402
from tests.image.edge_cycles import measure_edges  # noqa: E402
from tests.image.tick_cycles import EDGE_WHEELS, counted, wrong_order  # noqa: E402
from tests.image.tick_figures import measure_cases  # noqa: E402
from tests.parity.budgets import PAGE, read_recorded, too_large  # noqa: E402

EDGE_LIMITS = {1: 66, 3: 90, 4: 98}
"""Instructions that an edge may take, by the number of wheels that interrupts count."""


def code(*lines: str) -> list[Instruction]:
    return [Instruction(line) for line in lines]


@pytest.mark.full
def test_the_images_tick_keeps_the_budget(image: Path) -> None:
    cases = measure_cases(image, only_first=True)
    measured, recorded = counted(cases), read_recorded()
    assert too_large(measured, {name: recorded[name] for name in measured}) == []
    assert wrong_order(cases, []) == []


@pytest.mark.parametrize("wheels", EDGE_WHEELS)
def test_an_edge_keeps_its_budget(image: Path, wheels: int) -> None:
    edge = measure_edges(image, wheels)
    assert edge.instructions <= EDGE_LIMITS[wheels]
    assert wrong_order([], [edge]) == []


def test_the_page_has_all_cases() -> None:
    rows = PAGE.read_text().split("<!-- tick-cycles -->")[1].split("<!-- /tick-cycles -->")[0].splitlines()
    recorded = [name for name in read_recorded() if name.endswith(".tick_mean")]
    assert len([row for row in rows if row.startswith("| ")]) == 1 + len(recorded)


def test_independent_instructions_overlap_and_dependent_ones_do_not() -> None:
    apart, chain = costs([code("add r0, r1, r2", "add r3, r4, r5"), code("add r0, r1, r2", "add r3, r0, r5")])
    assert (apart.units, apart.serial) == (chain.units, chain.serial) == (1.0, 2)
    assert in_order(code("add r0, r1, r2", "add r3, r4, r5")) < in_order(code("add r0, r1, r2", "add r3, r0, r5"))


def test_a_division_holds_up_what_follows() -> None:
    following = code("vadd.f32 s3, s4, s4")
    waits = in_order(code("vdiv.f32 s0, s1, s2") + following) - in_order(following)
    assert waits > 10
    bounds = costs([code("vdiv.f32 s0, s1, s2") + following])[0]
    assert bounds.units < waits < bounds.serial


def test_every_register_of_a_load_or_store_counts() -> None:
    few, many, floats = costs([code("push {r4, lr}"), code("push {r4, r5, r6, r7, r8, lr}"), code("vpush {d8, d9}")])
    assert (few.units, many.units, floats.units) == (1.0, 3.0, 2.0)
    assert many.serial == 3 * few.serial
    pop, single = costs([code("pop {r4, r5, pc}"), code("ldr r4, [sp]")])
    assert pop.serial > 3 * single.serial  # it is a branch, too


def test_the_base_of_a_load_is_loaded_last() -> None:
    assert in_order(code("ldm r0, {r0, r1, r2, r3}")) <= in_order(code("ldm r4, {r0, r1, r2, r3}"))


def test_conditions_are_known_to_the_disassembler(image: Path) -> None:
    instructions = [instruction for instruction, _ in disassemble(image).values()]
    after = [instructions[i + 1] for i, one in enumerate(instructions) if one.text.startswith("ite ")]
    assert after
    assert all(instruction.condition for instruction in after)
    costs([after])  # each can be said without its condition


def test_what_the_model_does_not_know_is_an_error() -> None:
    with pytest.raises(ModelError):
        costs([code("frobnicate r0")])
