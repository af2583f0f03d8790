# SPDX-License-Identifier: MIT
"""The gates can fail: they find a broken parity and name the place, and a figure that has grown."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from rich.console import Console

from tests.needs import need
from tests.parity.budget_figures import whole_tick
from tests.parity.budget_page import UPDATES, bus_us, is_current
from tests.parity.budgets import LIMITS, PAGE, read_recorded, too_large, updated
from tests.parity.builds import GATE, Build, BuildError, call, usable
from tests.parity.compare import compare
from tests.parity.stack_bound import LIBRARY_BYTES, StackBoundError, read_call_graph


@pytest.mark.nightly
def test_fused_multiply_add_is_found_and_located() -> None:
    fused = Build("cortex-m7-fused", "arm-none-eabi-gcc", "-ffp-contract=fast")
    need("arm", "qemu")
    builds, _ = usable([GATE[0], fused])
    console = Console(record=True, width=1000)
    assert not compare(builds, 2000, 1, 0, console)
    assert "tick and output: " in console.export_text()


def test_a_figure_that_grew_is_named() -> None:
    recorded = read_recorded()
    assert too_large(recorded, recorded) == []
    name = next(iter(LIMITS))
    grown = {**recorded, name: LIMITS[name] * 2}
    assert [sentence.split(":")[0] for sentence in too_large(grown, recorded)] == [name, name]


def test_what_has_hardly_moved_is_not_recorded_again() -> None:
    recorded = {"a.core_mean": 5000, "b.core_mean": 5000}
    measured = {"a.core_mean": 5040, "new.core_mean": 7, "b.core_mean": 5200}
    assert updated(measured, recorded) == {"a.core_mean": 5000, "new.core_mean": 7, "b.core_mean": 5200}
    assert list(updated(measured, recorded)) == list(measured)


def test_a_page_is_current_until_a_figure_or_a_word_moves() -> None:
    page = "x\n<!-- t -->\n| `omni_f2` | 1000 | 0.91 % |\n<!-- /t -->\n"
    assert is_current(page, "t", ["| `omni_f2` | 1015 | 0.92 % |"])
    assert not is_current(page, "t", ["| `omni_f2` | 1030 | 0.94 % |"])
    assert not is_current(page, "t", ["| `omni_g2` | 1000 | 0.91 % |"])
    assert not is_current(page, "t", ["| `omni_f2` | 1000 | 0.91 % |", "| more | 1 | 0 % |"])


def test_the_page_shows_what_was_recorded() -> None:
    page = PAGE.read_text()
    for name, value in read_recorded().items():
        assert f" {value} " in page, name


def test_the_bound_is_the_deepest_path(tmp_path: Path) -> None:
    graph = tmp_path / "graph.ci"
    node = 'node: {{ title: "{0}" label: "{0}\\nfile.c:1:1\\n{1} bytes (static)\\n0 dynamic objects" }}\n'
    edge = 'edge: {{ sourcename: "{}" targetname: "{}" }}\n'
    calls = [("top", "left"), ("top", "right"), ("left", "memcpy"), ("right", "low")]
    sizes = {"top": 40, "left": 8, "right": 16, "low": 100}
    graph.write_text("".join(node.format(*n) for n in sizes.items()) + "".join(edge.format(*e) for e in calls))
    assert read_call_graph([graph]).bound("top") == 40 + 16 + 100
    assert read_call_graph([graph]).bound("left") == 8 + LIBRARY_BYTES
    graph.write_text(graph.read_text() + edge.format("low", "top"))
    with pytest.raises(StackBoundError, match="recursion"):
        read_call_graph([graph]).bound("top")


def test_calls_through_pointers_count(tmp_path: Path) -> None:
    graph = tmp_path / "graph.ci"
    node = 'node: {{ title: "{0}" label: "{0}\\nfile.c:1:1\\n{1} bytes (static)\\n0 dynamic objects" }}\n'
    sizes = {
        "a.c:step_controller.isra.0": 8,
        "b.c:controller_step_one": 16,
        "b.c:controller_step_two": 100,
        "nobody": 4,
    }
    text = "".join(node.format(*n) for n in sizes.items())
    graph.write_text(
        text + 'edge: { sourcename: "a.c:step_controller.isra.0" targetname: "__indirect_call" label: "" }\n'
    )
    assert read_call_graph([graph]).bound("a.c:step_controller.isra.0") == 8 + 100
    graph.write_text(text + 'edge: { sourcename: "nobody" targetname: "__indirect_call" label: "" }\n')
    with pytest.raises(StackBoundError, match="nobody calls through a pointer"):
        read_call_graph([graph]).bound("nobody")


def test_three_pair_bursts_stay_within_the_bus_budget() -> None:
    assert bus_us(UPDATES["three pair bursts (ours)"], 1000) <= 300
    assert bus_us(UPDATES["six single-channel writes"], 100) == 3360


def test_a_build_goes_around_ccache_which_loses_call_graphs() -> None:
    program = "import os; print(os.environ['CCACHE_DISABLE'])"
    assert call([sys.executable, "-c", program]).strip() == "1"


def test_the_tick_is_found_whatever_its_arguments_are() -> None:
    other = "_ZN4omni11ControlLoop6tickedEv"
    assert whole_tick([other, "_ZN4omni11ControlLoop4tickEv"]) == "_ZN4omni11ControlLoop4tickEv"
    with pytest.raises(BuildError, match="0 symbols"):
        whole_tick([other])
