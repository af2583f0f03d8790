# SPDX-License-Identifier: MIT
"""What an edge of an encoder costs that interrupts count: the image's own code, from the vector to the return."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tests.image.cortex_m7_model import in_order
from tests.image.elf_call import ElfCall
from tests.image.executed import Blocks, Code, Recorder
from tests.image.guest import HERE, GuestSources, build_guest, run_guest
from tests.image.parity_cores import FOLDER, core_includes
from tests.parity.builds import ROOT, BuildError

EDGES_PER_S = 40_000
"""Of a wheel at 25 rad/s with 10000 counts per turn."""
PROCESSOR_Hz = 600e6
ENTRY_AND_EXIT = 12 + 10
"""Cycles from the request to the first instruction, and from the last one back: Arm's figures without wait states."""
PINS = ((2, 3), (4, 5), (6, 9), (7, 8))
"""Of guest/edges/main.cpp."""
_PORTS = {2: (9, 4), 3: (9, 5), 4: (9, 6), 5: (9, 8), 6: (7, 10), 7: (7, 17), 8: (7, 16), 9: (7, 11)}
"""GPIO port and bit of a Teensy 4.0's pins (schematic)."""
_GPIO6, _PORT_BYTES = 0x42000000, 0x4000
_LEVELS, _STATUS = 8, 24  # PSR and ISR
_IRQ_GPIO6789 = 157
_QUADRATURE = ((1, 0), (1, 1), (0, 1), (0, 0))
"""Levels of A and B, A leading."""
TURNS = 8
"""Times that all four edges of every wheel come; fewer in all than a tick may bring of one wheel."""


@dataclass(frozen=True)
class EdgeFigures:
    """Means of one edge; the cycles without entry and exit."""

    wheels: int
    instructions: float
    units: float
    in_order: float
    serial: float

    def share(self, cycles: float) -> float:
        """Return the share of the processor when every wheel brings EDGES_PER_S."""
        return self.wheels * EDGES_PER_S * (cycles + ENTRY_AND_EXIT) / PROCESSOR_Hz


def measure_edges(image: Path, wheels: int) -> EdgeFigures:
    """Turn all wheels and return what an edge costs. Raises BuildError if an edge was not counted."""
    machine = ElfCall(image)
    machine.map_registers()
    code = Code(image, machine)
    guest = _build(image)
    machine.load(guest)
    exit_code, _ = run_guest(machine, guest.stem, [str(wheels)])
    vector = machine.word(machine.symbols["_VectorsRam"] + 4 * (16 + _IRQ_GPIO6789))
    recorder = Recorder(machine, code, vector)
    for _ in range(TURNS):
        for levels in _QUADRATURE:
            for pins in PINS[:wheels]:
                _move(machine, pins, levels)
                machine.call(vector)
                recorder.finish()
    recorder.stop()
    valid = machine.call("edges_read")
    counted = machine.word(machine.symbols["edges_sum"])
    edges = [blocks for blocks, _ in recorder.recorded]
    if exit_code != 0 or valid != 2**wheels - 1 or counted != len(edges):
        raise BuildError(f"{counted} of {len(edges)} edges were counted (begin: {exit_code}, valid: {valid:#x})")
    return _figures(code, edges, wheels)


def _build(image: Path) -> Path:
    here = HERE / "guest" / "edges"
    files = GuestSources([here / "main.cpp"], [], [here, ROOT / "firmware", *core_includes()])
    return build_guest(FOLDER, "edges", files, image)


def _move(machine: ElfCall, pins: tuple[int, int], levels: tuple[int, int]) -> None:
    """Put the levels onto a wheel's pins and raise the flag of what changed, and no other."""
    for port in {port for port, _ in _PORTS.values()}:
        machine.set_word(_register(port, _STATUS), 0)
    for pin, level in zip(pins, levels, strict=True):
        port, bit = _PORTS[pin]
        before = machine.word(_register(port, _LEVELS))
        after = before & ~(1 << bit) | level << bit
        machine.set_word(_register(port, _LEVELS), after)
        if after != before:
            machine.set_word(_register(port, _STATUS), 1 << bit)


def _register(port: int, offset: int) -> int:
    return _GPIO6 + (port - 6) * _PORT_BYTES + offset


def _figures(code: Code, edges: list[Blocks], wheels: int) -> EdgeFigures:
    bounds = [code.cost(edge) for edge in edges]
    cycles = {edge: in_order(code.written_out(edge)) for edge in set(edges)}
    return EdgeFigures(
        wheels=wheels,
        instructions=sum(map(code.count, edges)) / len(edges),
        units=sum(bound.units for bound in bounds) / len(edges),
        in_order=sum(cycles[edge] for edge in edges) / len(edges),
        serial=sum(bound.serial for bound in bounds) / len(edges),
    )
