# SPDX-License-Identifier: MIT
"""The control tick inside the image that is flashed gives the bits that a PC gives; so does a newer compiler's."""

from __future__ import annotations

from pathlib import Path

import pytest
from rich.console import Console

from tests.image import flashed
from tests.needs import need

need("arm", module=True)

from elftools.elf.elffile import ELFFile  # noqa: E402
from unicorn import UC_HOOK_BLOCK  # noqa: E402

from tests.image.elf_call import ElfCall  # noqa: E402
from tests.image.guest import our_symbols, run_guest  # noqa: E402
from tests.image.parity_cores import FlashedCore, NewerCore  # noqa: E402
from tests.parity.builds import GATE, generate  # noqa: E402
from tests.parity.compare import Core, compare  # noqa: E402

TICKS = 100_000
BX_LR = bytes([0x70, 0x47])


def agree(core: Core, ticks: int) -> tuple[bool, str]:
    """Compare a core with the PC's and return whether their bits agree, and what was said."""
    console = Console(record=True, width=1000)
    good = compare([GATE[0], core], ticks, 1, 0, console)
    return good, console.export_text()


@pytest.mark.nightly
def test_the_tick_inside_the_image_gives_the_same_bits(image: Path) -> None:
    good, words = agree(FlashedCore(image), TICKS)
    assert good, f"{words}\nIs {image} of these sources? make firmware"


@pytest.mark.nightly
def test_the_tick_of_a_newer_compiler_gives_the_same_bits() -> None:
    need("newer-gcc")
    good, words = agree(NewerCore(flashed.newer_gcc()), TICKS)
    assert good, words


def test_it_is_the_images_tick_that_runs(image: Path) -> None:
    core = FlashedCore(image)
    generate()
    core.prepare()
    machine = ElfCall(image)
    calls: list[int] = []
    tick = our_symbols(image)["omni_robot_tick"] & ~1
    machine.on(UC_HOOK_BLOCK, lambda _uc, address, _size, _data: calls.append(address), tick, tick)
    machine.load(core.guest)
    code, _ = run_guest(machine, "parity", ["--ticks", "500", "--least", "0"])
    assert code == 0
    assert len(calls) == 500


def test_an_image_that_computes_otherwise_is_found_and_the_place_named(image: Path, tmp_path: Path) -> None:
    other = tmp_path / "tampered" / "firmware.elf"
    other.parent.mkdir()
    other.write_bytes(without_wheel_loops(image))
    good, words = agree(FlashedCore(other), 600)
    assert not good
    assert "tick and output: " in words


def without_wheel_loops(image: Path) -> bytes:
    """Return an image whose wheel-speed loops do nothing."""
    program = bytearray(image.read_bytes())
    with image.open("rb") as file:
        elf = ELFFile(file)
        symbols = elf.get_section_by_name(".symtab")
        address = symbols.get_symbol_by_name("omni_wheel_speed_step")[0]["st_value"] & ~1
        offset = next(elf.address_offsets(address, size=2))
    program[offset : offset + 2] = BX_LR
    return bytes(program)
