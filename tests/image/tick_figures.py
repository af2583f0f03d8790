# SPDX-License-Identifier: MIT
"""Runs the budgets' program as a guest of the image and counts what its control tick executes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from unicorn import UC_HOOK_BLOCK

from tests.image.cortex_m7_model import Cost, in_order
from tests.image.elf_call import ElfCall
from tests.image.executed import Blocks, Code, Recorder
from tests.image.guest import HERE, GuestSources, build_guest, run_guest
from tests.image.parity_cores import FOLDER, core_includes, core_sources
from tests.parity.budget_figures import CORE_TICK, whole_tick
from tests.parity.builds import OUT, ROOT, BuildError, generate

WARM_UP_TICKS = 400
"""Of tests/parity/budgets/main.cpp, which runs each case twice: once watching the core, once the whole tick."""
SAMPLE = 7
"""Every so many ticks are looked at in order: a number that meets all ticks between two fixes, which come every 20."""
_RESTART = "_ZN4omni11ControlLoop7restartEv"
_CASES = "case_count"
APP_SOURCES = (
    "tick/burst_recorder.cpp",
    "tick/control_loop.cpp",
    "tick/i2c_scan.cpp",
    "tick/pin_tester.cpp",
    "drivers/pca9685.cpp",
    "drivers/pwm_pins.cpp",
    "tick/robot_setup.cpp",
)


@dataclass(frozen=True)
class CaseFigures:
    """A case: instructions of the core and of the whole tick, cycles of the whole tick.

    ``in_order_mean`` is that of every SAMPLE-th tick. ``max``: of the tick with the most instructions.
    """

    name: str
    core_mean: int
    core_max: int
    tick_mean: int
    tick_max: int
    bounds_mean: Cost
    bounds_max: Cost
    in_order_mean: int
    in_order_max: int


def measure_cases(image: Path, only_first: bool = False) -> list[CaseFigures]:
    """Run all cases, or the first, and return their figures. Raises BuildError or ModelError."""
    code, cases = record_cases(image, only_first)
    return [_figures(name, code, ticks) for name, ticks in cases.items()]


def record_cases(image: Path, only_first: bool = False) -> tuple[Code, dict[str, list[tuple[Blocks, Blocks]]]]:
    """Run all cases, or the first; return the code and for each case its ticks' blocks, and those of the core alone."""
    machine = ElfCall(image)
    code = Code(image, machine)
    guest = _build(image)
    machine.load(guest)
    if only_first:
        machine.set_word(machine.symbols[_CASES], 1)
    cases = machine.word(machine.symbols[_CASES])
    rounds = _Rounds(machine)
    recorder = Recorder(machine, code, machine.symbols[whole_tick(machine.symbols)], machine.symbols[CORE_TICK])
    recorder.wanted = rounds.measuring
    exit_code, output = run_guest(machine, guest.stem)
    names = [line.split()[1] for line in output.splitlines() if line.startswith("tick ")]
    if exit_code != 0 or len(names) != cases or len(recorder.recorded) % cases != 0:
        raise BuildError(f"{guest.stem}: exit code {exit_code}, {len(recorder.recorded)} ticks\n{output}")
    ticks = len(recorder.recorded) // cases
    return code, {name: recorder.recorded[i * ticks : (i + 1) * ticks] for i, name in enumerate(names)}


class _Rounds:
    """Follows the guest's program: which of its ticks are to be recorded."""

    def __init__(self, machine: ElfCall) -> None:
        restart = machine.symbols[_RESTART] & ~1
        self._runs = 0
        self._ticks = 0
        machine.on(UC_HOOK_BLOCK, self._on_restart, restart, restart)

    def _on_restart(self, *_: object) -> None:
        self._runs += 1
        self._ticks = 0

    def measuring(self) -> bool:
        """Count a tick; only those after the warm-up of the second run of a case are measured."""
        self._ticks += 1
        return self._runs % 2 == 0 and self._ticks > WARM_UP_TICKS


def _build(image: Path) -> Path:
    generate()
    budgets = ROOT / "tests" / "parity" / "budgets"
    program = ROOT / "tests" / "parity" / "program"
    here = HERE / "guest" / "budgets"
    own = [budgets / "main.cpp", budgets / "cases.cpp", here / "meter.cpp", program / "world.c", program / "random.c"]
    app = [ROOT / "firmware" / "app" / name for name in APP_SOURCES]
    includes = [here, budgets, ROOT / "firmware", OUT / "generated" / "include", *core_includes()]
    return build_guest(FOLDER, "budgets", GuestSources(own, [*core_sources(), *app], includes), image)


def _figures(name: str, code: Code, ticks: Sequence[tuple[Blocks, Blocks]]) -> CaseFigures:
    whole = [blocks for blocks, _ in ticks]
    core = [code.count(part) for _, part in ticks]
    counts = [code.count(blocks) for blocks in whole]
    largest = whole[counts.index(max(counts))]
    bounds = [code.cost(blocks) for blocks in whole]
    return CaseFigures(
        name=name,
        core_mean=round(sum(core) / len(core)),
        core_max=max(core),
        tick_mean=round(sum(counts) / len(counts)),
        tick_max=max(counts),
        bounds_mean=Cost(
            sum(bound.units for bound in bounds) / len(bounds),
            round(sum(bound.serial for bound in bounds) / len(bounds)),
        ),
        bounds_max=code.cost(largest),
        in_order_mean=_mean_in_order(code, whole[::SAMPLE]),
        in_order_max=in_order(code.written_out(largest)),
    )


def _mean_in_order(code: Code, ticks: Sequence[Blocks]) -> int:
    """Ticks often take the same way: each way is looked at once."""
    cycles = {blocks: in_order(code.written_out(blocks)) for blocks in set(ticks)}
    return round(sum(cycles[blocks] for blocks in ticks) / len(ticks))
