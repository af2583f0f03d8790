# SPDX-License-Identifier: MIT
"""What the budgets are made of: instructions and stack from the emulated processor, bounds and sizes from the build."""

from __future__ import annotations

from collections.abc import Iterable

from tests.parity.builds import Build, BuildError, call, run
from tests.parity.stack_bound import read_call_graph

Figures = dict[str, int]

CORE_TICK = "omni_robot_tick"
_WHOLE_TICK = "_ZN4omni11ControlLoop4tickE"
"""How the symbol of ControlLoop::tick begins, whatever its arguments are."""


def whole_tick(symbols: Iterable[str]) -> str:
    """Return the symbol of ControlLoop::tick. Raises BuildError."""
    found = sorted(symbol for symbol in symbols if symbol.startswith(_WHOLE_TICK))
    if len(found) != 1:
        raise BuildError(f"{len(found)} symbols begin with {_WHOLE_TICK}: has ControlLoop::tick another name now?")
    return found[0]


def measure(build: Build) -> Figures:
    """Return all figures of a Cortex-M7 build, by "section.name", in the order of the page."""
    return {**instructions(build), **stack_bounds(build), **sizes(build)}


def instructions(build: Build) -> Figures:
    """Run the budgets' program. Raises BuildError if it fails."""
    code, output = run(build, "budgets", counting=True)
    if code != 0:
        raise BuildError(f"budgets: exit code {code}\n{output}")
    figures: Figures = {}
    deepest = 0
    for line in output.splitlines():
        kind, case, mean, largest, stack = line.split()
        figures[f"{case}.{kind}_mean"] = int(mean)
        figures[f"{case}.{kind}_max"] = int(largest)
        if kind == "tick":
            deepest = max(deepest, int(stack))
    figures["stack.tick_painted"] = deepest
    return figures


def stack_bounds(build: Build) -> Figures:
    """Bounds from the call graphs, without what the board's own methods use."""
    files = [*build.folder.rglob("core.dir/**/*.ci"), *build.folder.rglob("budgets.dir/**/app/**/*.ci")]
    graph = read_call_graph(files)
    return {"stack.core_bound": graph.bound(CORE_TICK), "stack.tick_bound": graph.bound(whole_tick(graph.frames))}


def sizes(build: Build) -> Figures:
    """Flash and RAM of the core: its objects' code and constants, and its structs."""
    objects = [str(path) for path in sorted(build.folder.rglob("core.dir/**/*.obj"))]
    total = call(["arm-none-eabi-size", "--totals", *objects]).splitlines()[-1].split()
    code, output = run(build, "budgets", ["--sizes"])
    if code != 0:
        raise BuildError(f"budgets --sizes: exit code {code}\n{output}")
    structs = {f"size.{name}": int(size) for name, size in (line.split() for line in output.splitlines())}
    return {"size.core_code": int(total[0]), "size.core_data": int(total[1]) + int(total[2]), **structs}
