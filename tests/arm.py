# SPDX-License-Identifier: MIT
"""Builds bare programs for the emulated Cortex-M7 and runs them: startup, console and exit code are the board's base's.

A program has ``main(int argc, char **argv)``, prints with printf (to the console), and returns its exit code; see
``base/stack.h`` for the painted stack and ``clock_ticks()`` in ``base/machine.h`` for counting instructions.
"""

from __future__ import annotations

import os
import shlex
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from omniwheel.emulated_firmware import EMULATOR, MACHINE
from omniwheel.paths import MissingFileError, emulated_firmware_path
from tests.native import ROOT, WARNINGS, generated_dir
from tests.needs import need, refuse

BOARD = ROOT / "firmware" / "boards" / "mps2_an500"
COMPILERS = {".c": "arm-none-eabi-gcc", ".cpp": "arm-none-eabi-g++"}
CPU = ("-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-d16", "-mfloat-abi=hard")
COMMON = (*CPU, "-O2", "-ffp-contract=off", "-fno-math-errno", "-ffunction-sections", "-fdata-sections", *WARNINGS)
CPP = ("-std=gnu++17", "-fno-exceptions", "-fno-rtti", "-fno-threadsafe-statics", "-fno-use-cxa-atexit")
LINK = ("-nostartfiles", "-T", str(BOARD / "base" / "an500.ld"), "-Wl,--gc-sections", "-Wl,--fatal-warnings")


def need_emulator() -> None:
    """Skip the test where compiler or emulator are missing; on CI they must be there."""
    need("arm", "qemu")


def need_emulated_firmware() -> None:
    """Skip the test where the emulator or the firmware for it is missing; on CI they must be there.

    Under the sanitizers it is skipped, too: they see nothing of what QEMU runs, and their build has no such firmware.
    """
    if os.environ.get("OMNI_SANITIZED"):
        pytest.skip("the sanitizers see nothing of an emulated firmware")
    need("arm", "qemu")
    try:
        emulated_firmware_path()
    except MissingFileError:
        refuse("make setup")


def build_program(
    out_dir: Path, name: str, sources: Sequence[Path], includes: Sequence[Path] = (), flags: Sequence[str] = ()
) -> Path:
    """Compile ``sources`` (.c as C99, .cpp as C++17) with the board's base and return the path of the ELF file.

    Include folders are ``includes``, the firmware's, the core's, the generated ones and the board's (``base/...``).
    Raises AssertionError with the compiler's words.
    """
    folders = [*includes, ROOT / "firmware", ROOT / "shared" / "core" / "include", generated_dir() / "include", BOARD]
    common = [*COMMON, *flags, *(f"-I{folder}" for folder in folders), "-isystem", str(generated_dir() / "mavlink")]
    objects = []
    for number, source in enumerate([*sources, *sorted((BOARD / "base").glob("*.cpp"))]):
        target = out_dir / f"{number}-{source.stem}.o"
        standard = CPP if source.suffix == ".cpp" else ("-std=c99",)
        _run([COMPILERS[source.suffix], *standard, *common, "-c", str(source), "-o", str(target)])
        objects.append(str(target))
    program = out_dir / f"{name}.elf"
    _run([COMPILERS[".cpp"], *CPU, *LINK, *objects, "-o", str(program)])
    return program


def run_program(
    program: Path, *words: str, icount_shift: int | None = None, timeout_s: float = 60.0, folder: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a program; ``stderr`` is its console. ``words`` are its arguments, without blanks or commas.

    With ``icount_shift`` an instruction takes exactly 2**shift ns of the board's time, whose clock_ticks() are 40 ns
    each. The program's files are looked for in ``folder``.
    """
    semihosting = ",".join(["enable=on", "target=native", f"arg={program.stem}", *(f"arg={word}" for word in words)])
    icount = [] if icount_shift is None else ["-icount", f"shift={icount_shift},align=off,sleep=off"]
    command = [EMULATOR, "-M", MACHINE, "-kernel", str(program), "-display", "none", "-monitor", "none"]
    command += ["-serial", "null", "-semihosting-config", semihosting, *icount]
    return subprocess.run(command, capture_output=True, text=True, timeout=timeout_s, check=False, cwd=folder)


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{shlex.join(command)}\n{done.stderr}"
