# SPDX-License-Identifier: MIT
"""Programs that run beside the image, in memory it does not use, and call the functions inside it.

A guest is compiled for the image's processor from the same headers, so that every struct has the image's layout. It is
linked against the addresses of the image's functions. Only what the linker dropped from the image, because the firmware
never calls it, comes from the guest's own build.
"""

from __future__ import annotations

import os
import shutil
import struct
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from elftools.elf.elffile import ELFFile
from unicorn import UC_HOOK_BLOCK, Uc, arm_const

from tests.image.elf_call import ElfCall
from tests.parity.builds import call

HERE = Path(__file__).resolve().parent
RUNTIME = HERE / "guest" / "guest.c"
CPU = ("-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-d16", "-mfloat-abi=hard")
FLAGS = (*CPU, "-O2", "-ffp-contract=off", "-fno-math-errno", "-ffunction-sections", "-fdata-sections", "-mlong-calls")
C = ("-std=c99", "-D_POSIX_C_SOURCE=200809L")
CPP = ("-std=gnu++17", "-fno-exceptions", "-fno-rtti", "-fno-threadsafe-statics", "-fno-use-cxa-atexit")
IMAGE_FLAGS = (*CPU, "-O3", "-ffp-contract=off", "-fno-math-errno", "-ffunction-sections", "-fdata-sections")
"""What platformio.ini and platform-teensy compile the core with, as far as it changes the code."""
COMPILER = "arm-none-eabi-gcc"
FUNCTIONS = ("omni_", "_ZN4omni", "_ZNK4omni")
TABLES = ("_ZTVN4omni",)
_GLOBAL = ("STB_GLOBAL", "STB_WEAK")
_ARGUMENTS = 0x2027F800
"""Where the words of a guest's command line lie; behind its memory (guest.ld)."""


@dataclass
class GuestSources:
    """What a guest is made of. ``parts``: what the image may have; only functions that it lacks are taken from here."""

    sources: Sequence[Path]
    parts: Sequence[Path]
    includes: Sequence[Path] = field(default_factory=list)


def our_symbols(image: Path) -> dict[str, int]:
    """Return the addresses of the image's functions and virtual tables, a function's with the bit of Thumb code.

    Its data are left out: the image holds the presets of one robot only.
    """
    with image.open("rb") as file:
        table = ELFFile(file).get_section_by_name(".symtab")
        return {
            symbol.name: symbol["st_value"]
            for symbol in table.iter_symbols()
            if symbol["st_info"]["bind"] in _GLOBAL
            and symbol["st_shndx"] != "SHN_UNDEF"
            and symbol.name.startswith(FUNCTIONS if symbol["st_info"]["type"] == "STT_FUNC" else TABLES)
        }


def build_guest(out: Path, name: str, files: GuestSources, image: Path) -> Path:
    """Build a guest for an image and return its ELF file. Raises BuildError."""
    folder = out / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    addresses = folder / "image.ld"
    addresses.write_text("".join(f"{name} = {value:#x};\n" for name, value in sorted(our_symbols(image).items())))
    own = _compile(folder, (*files.sources, RUNTIME), files.includes)
    parts = _compile(folder, files.parts, files.includes)
    for part in parts:  # the image's functions take the place of these
        call(["arm-none-eabi-objcopy", "--weaken", str(part)])
    return _link(folder / f"{name}.elf", [*own, *parts], [str(addresses)])


def build_alone(out: Path, name: str, files: GuestSources, compiler: str) -> Path:
    """Build a program of its own: its parts compiled by ``compiler`` as the image's are, the rest by the usual one."""
    folder = out / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    own = _compile(folder, (*files.sources, RUNTIME), files.includes)
    parts = _compile(folder, files.parts, files.includes, compiler, IMAGE_FLAGS)
    return _link(folder / f"{name}.elf", [*own, *parts], [])


def _compile(
    folder: Path,
    sources: Sequence[Path],
    includes: Sequence[Path],
    compiler: str = COMPILER,
    flags: Sequence[str] = FLAGS,
) -> list[Path]:
    """Compile .c and .cpp files and return the object files."""

    def compiled(source: Path) -> Path:
        target = folder / f"{source.parent.name}-{source.stem}.o"
        standard = CPP if source.suffix == ".cpp" else C
        folders = [f"-I{include}" for include in includes]
        call([compiler, *standard, *flags, *folders, "-c", str(source), "-o", str(target)])
        return target

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(compiled, sources))


def _link(program: Path, objects: Sequence[Path], scripts: Sequence[str]) -> Path:
    words = ["-nostartfiles", "--specs=nano.specs", "-T", str(HERE / "guest" / "guest.ld"), *scripts]
    call([COMPILER, *CPU, *words, "-Wl,--gc-sections", "-Wl,--fatal-warnings", *map(str, objects), "-o", str(program)])
    return program


def run_guest(machine: ElfCall, name: str, arguments: Sequence[str] = ()) -> tuple[int, str]:
    """Run the guest that was loaded last to its end and return its exit code and what it printed."""
    said: list[bytes] = []

    def listen(uc: Uc, _address: int, _size: int, _data: object) -> None:
        count = uc.reg_read(arm_const.UC_ARM_REG_R1)
        said.append(bytes(uc.mem_read(uc.reg_read(arm_const.UC_ARM_REG_R0), count)))

    console = machine.symbols["guest_said"] & ~1
    hook = machine.on(UC_HOOK_BLOCK, listen, console, console)
    try:
        code = machine.call("guest_run", len(arguments) + 1, _lay_out(machine, (name, *arguments)))
    finally:
        machine.off(hook)
    return code, b"".join(said).decode()


def _lay_out(machine: ElfCall, words: Sequence[str]) -> int:
    """Write a command line into memory and return its address: pointers, then the words."""
    at = _ARGUMENTS + 4 * (len(words) + 1)
    pointers = []
    for word in words:
        pointers.append(at)
        machine.write(at, word.encode() + b"\0")
        at += len(word) + 1
    machine.write(_ARGUMENTS, struct.pack(f"<{len(pointers) + 1}I", *pointers, 0))
    return _ARGUMENTS
