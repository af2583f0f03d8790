# SPDX-License-Identifier: MIT
"""The emulated chip with a small program."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import unicorn

from emulated_teensy.machine import NOTHING_WIRED, Options, Wiring, chip_config
from hil_sim.teensy import RobotCircuit
from hil_sim.world import World
from omniwheel._core import ffi, lib
from tests.image.assembly import RAM, Program


def unicorn_library() -> Path:
    """Return Unicorn's shared library."""
    return next(iter(sorted((Path(unicorn.__file__).parent / "lib").glob("libunicorn.*so*"))))


@dataclass
class Bare:
    """A running chip."""

    c: object
    program: Program
    begin_ns: int
    """When the boot ROM jumped to the program."""

    def run(self, until_us: float) -> int:
        """Run until this time after the program's begin; return why it stopped."""
        return int(lib.rt1062_run(self.c, self.begin_ns + int(until_us * 1000)))

    def finish(self, limit_us: float = 1e6) -> None:
        """Run until the program's ``done``; fail if it does not get there."""
        lib.rt1062_break(self.c, 0)
        lib.rt1062_break(self.c, self.program.symbols["done"])
        stop = self.run(limit_us)
        assert stop == lib.RT1062_STOP_BREAK, f"stop {stop} at 0x{self.register(15):08x}: {self.why} {self.findings()}"

    def register(self, number: int) -> int:
        """Return r0..r15, 16: xPSR."""
        return int(lib.rt1062_register(self.c, number))

    @property
    def why(self) -> str:
        """Return why the last run ended."""
        return str(ffi.string(lib.rt1062_why(self.c)).decode())

    def words(self, count: int, address: int = RAM) -> list[int]:
        """Return words of memory."""
        data = ffi.new("uint8_t[]", 4 * count)
        assert lib.rt1062_read(self.c, address, data, 4 * count)
        return list(struct.unpack(f"<{count}I", bytes(data)))

    def findings(self) -> list[str]:
        """Return what the chip objected to."""
        found = [lib.rt1062_finding(self.c, number) for number in range(lib.rt1062_findings(self.c))]
        return [str(ffi.string(finding.text).decode()) for finding in found]


@contextmanager
def running(
    program: Program,
    *,
    instruction_ns: int = 10,
    exact: bool = False,
    seed: int = 1,
    wiring: Wiring = NOTHING_WIRED,
    world: World | None = None,
) -> Iterator[Bare]:
    """Power the chip on with this program in its flash memory and a world at its pins."""
    config = chip_config(wiring, Options(instruction_ns=instruction_ns, exact=exact, words=True, seed=seed))
    why = ffi.new("char[]", lib.RT1062_TEXT)
    machine = lib.rt1062_new(str(unicorn_library()).encode(), config, why, lib.RT1062_TEXT)
    assert machine != ffi.NULL, ffi.string(why)
    try:
        circuit = RobotCircuit(world, wiring) if world is not None else None
        if circuit is not None:
            circuit.attach(machine)
        ffi.memmove(lib.rt1062_flash(machine), program.flash, len(program.flash))
        assert lib.rt1062_power_on(machine), ffi.string(lib.rt1062_why(machine))
        yield Bare(machine, program, int(lib.rt1062_time_ns(machine)))
    finally:
        lib.rt1062_free(machine)
