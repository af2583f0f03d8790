# SPDX-License-Identifier: MIT
"""Benchmark: one step of the robot's Kalman filters, ours beside generic matrices in C and Eigen."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from bench import build
from bench.options import Options
from bench.tables import Cell, Row, Table, with_ratios
from hil_sim.speed import Spread

CANDIDATES = {
    "core": "ours",
    "tiny": "small generic matrices in C, as TinyEKF",
    "eigen": "C++ with Eigen",
    "eigen_late": "C++ with Eigen, doing what ours does",
}
FILTERS = {"pose": "pose EKF, predict and correct", "motor": "motor filter"}
NS, MEDIAN, RATIO = "ns", "median", "× ours"
X86, M7, M7_RATIO = "x86 instructions", "Cortex-M7 instructions", "× ours, Cortex-M7"
STEPS, COUNTED_STEPS, M7_STEPS = 20000, 2000, 500


def program() -> Path:
    """Build the program for this computer."""
    sources = [build.PROGRAMS / "estimators.cpp", build.PROGRAMS / "core_estimators.c", build.PEERS / "tiny_ekf.c"]
    if not build.has_eigen():
        return build.build("estimators", sources)
    sources += [build.PEERS / "eigen_ekf.cpp", build.PEERS / "eigen_late_ekf.cpp"]
    return build.build("estimators", sources, ["-DBENCH_EIGEN"])


def program_m7() -> Path:
    """Build the program for the emulated Cortex-M7; Eigen stays on the PC."""
    sources = [build.PROGRAMS / "estimators.cpp", build.PROGRAMS / "core_estimators.c", build.PEERS / "tiny_ekf.c"]
    return build.build_cortex_m7("estimators", sources)


def measure(options: Options) -> list[Table]:
    """Return a table per filter."""
    built = program()
    names = [f"{candidate}_{kind}" for kind in FILTERS for candidate in _candidates(kind)]
    spreads = options.measure({name: _timed(built, name) for name in names})
    counts = {name: instructions(built, name) for name in names} if build.has_valgrind() else {}
    m7 = _counts_m7([name for name in names if not name.startswith("eigen")]) if build.has_cortex_m7() else {}
    return [_table(kind, spreads, counts, m7, options) for kind in FILTERS]


def instructions(built: Path, name: str) -> float:
    """Return x86 instructions of a step."""
    return build.count(built, [name, str(COUNTED_STEPS)], name).total / COUNTED_STEPS


def _candidates(kind: str) -> list[str]:
    return [name for name in _all_of(kind) if not name.startswith("eigen") or build.has_eigen()]


def _all_of(kind: str) -> list[str]:
    """Only the pose filter does more than the textbook's."""
    return [name for name in CANDIDATES if name != "eigen_late" or kind == "pose"]


def _timed(built: Path, name: str) -> Callable[[], float]:
    return lambda: build.numbers(build.call([str(built), name, str(STEPS), "5"]))["cost"][0]


def _counts_m7(names: list[str]) -> dict[str, float]:
    built = program_m7()
    return {name: build.numbers(build.run_cortex_m7(built, [name, str(M7_STEPS)]))["cost"][0] for name in names}


def _table(
    kind: str, spreads: dict[str, Spread], counts: dict[str, float], m7: dict[str, float], options: Options
) -> Table:
    rows = []
    for candidate in _all_of(kind):
        name, words = f"{candidate}_{kind}", CANDIDATES[candidate]
        cells: dict[str, Cell] = {NS: "not installed"}
        if name in spreads:
            cells = {NS: spreads[name].least, MEDIAN: spreads[name].median}
            cells |= {X86: counts.get(name), M7: m7.get(name)}
        rows.append(Row(words, cells))
    ratios = with_ratios(rows, NS, CANDIDATES["core"], RATIO)
    if m7:
        ratios = with_ratios(ratios, M7, CANDIDATES["core"], M7_RATIO)
    note = f"One step; {STEPS} steps of the same input, float; {options.how}. Instructions by callgrind and QEMU."
    return Table(kind, FILTERS[kind], (NS, MEDIAN, RATIO, X86, M7, M7_RATIO), ratios, note)
