# SPDX-License-Identifier: MIT
"""Builds the benchmarks' C and C++ programs with the products' flags, and counts their instructions."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from omniwheel import files
from omniwheel.emulated_firmware import EMULATOR
from tests.arm import COMPILERS, build_program, run_program
from tests.native import ROOT, core_archive, generated_dir

OUT = ROOT / "build" / "bench"
PROGRAMS = ROOT / "bench" / "programs"
PEERS = ROOT / "bench" / "peers"
FLAGS = ("-O3", "-ffp-contract=off", "-fno-math-errno", "-Wall", "-Wextra", "-Wconversion", "-Werror")
EIGEN = Path("/usr/include/eigen3")
CORE_PARTS = (
    *("control/original_law", "actuate/saturation", "model/kinematics", "math/math"),
    *(
        f"estimate/{part}"
        for part in ("motor_kf", "pose_ekf", "pose_ekf_correct", "pose_ekf_flow", "pose_ekf_history", "pose_ekf_gyro")
    ),
)
METER = ROOT / "tests" / "parity" / "budgets"
TIMEOUT_S = 300
ICOUNT_SHIFT = 10
"""As the meter expects it."""


class BenchError(Exception):
    """A benchmark cannot be built or run; the message holds the tool's words."""


@dataclass(frozen=True)
class Counted:
    """Instructions of a run: all that were collected, and inclusive ones of some functions."""

    total: int
    of: Mapping[str, int]


def includes() -> list[str]:
    """Return the compiler's words for the folders that programs may include from."""
    own = ("shared/core/include", "shared/link/include", "hil_sim/include")
    folders = [PROGRAMS, *(ROOT / folder for folder in own), generated_dir() / "include"]
    return [f"-I{folder}" for folder in folders]


def build(name: str, sources: Sequence[Path], flags: Sequence[str] = (), archives: Sequence[Path] = ()) -> Path:
    """Compile what is older than its source or was compiled with other words, link with the core, return the program.

    .c is C11, .cpp is C++17.
    """
    folder = OUT / name
    folder.mkdir(parents=True, exist_ok=True)
    libraries = [*archives, core_archive()]
    headers = [*PROGRAMS.glob("*.h"), *PEERS.glob("*.h"), Path(__file__), *libraries]
    newest = max(path.stat().st_mtime for path in headers)

    def compiled(source: Path) -> Path:
        target, words = folder / f"{source.stem}.o", folder / f"{source.stem}.words"
        compiler = ["g++", "-std=c++17"] if source.suffix == ".cpp" else ["gcc", "-std=gnu11"]
        given = [*compiler, *FLAGS, *flags, *includes(), "-isystem", str(EIGEN)]
        command = [*given, "-c", str(source), "-o", str(target)]
        old = not target.exists() or target.stat().st_mtime < max(newest, source.stat().st_mtime)
        if old or not words.exists() or words.read_text() != shlex.join(command):
            words.unlink(missing_ok=True)
            call(command)
            files.write_text(words, shlex.join(command))
        return target

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        objects = list(pool.map(compiled, sources))
    program = folder / name
    call(["g++", *map(str, [*objects, *libraries]), "-lm", "-lpthread", "-o", str(program)])
    return program


def has_eigen() -> bool:
    """Return whether Eigen's headers are there."""
    return (EIGEN / "Eigen" / "Dense").exists()


def has_valgrind() -> bool:
    """Return whether instructions can be counted."""
    return shutil.which("valgrind") is not None


def count(program: Path, words: Sequence[str], function: str, inside: Sequence[str] = ()) -> Counted:
    """Count the instructions of ``function`` with all that it calls, and of functions ``inside`` it, by callgrind."""
    report = program.with_suffix(".callgrind")
    tool = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={report}", f"--toggle-collect={function}"]
    call([*tool, str(program), *words])
    total = next(int(line.split()[1]) for line in report.read_text().splitlines() if line.startswith("totals:"))
    if not inside:
        return Counted(total, {})
    table = call(["callgrind_annotate", "--inclusive=yes", "--threshold=100", str(report)])
    return Counted(total, {name: _inclusive(table, name) for name in inside})


def _inclusive(table: str, function: str) -> int:
    """Return a function's instructions from callgrind_annotate's table, with the copies that the compiler made."""
    found = 0
    for line in table.splitlines():
        words = line.split()
        if words and words[0][0].isdigit() and f":{function}" in line:
            name = line.split(f":{function}", 1)[1]
            if name[:1] in (" ", ".", ""):
                found += int(words[0].replace(",", ""))
    return found


def call(command: Sequence[str], folder: Path | None = None) -> str:
    """Run a tool and return its output. Raises BenchError with its words."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=TIMEOUT_S, cwd=folder)
    if done.returncode != 0:
        raise BenchError(f"{shlex.join(command)}\n{done.stdout}{done.stderr}")
    return done.stdout


def numbers(output: str) -> dict[str, list[float]]:
    """Return what a program printed: a name and numbers on each line."""
    return {line.split()[0]: [float(word) for word in line.split()[1:]] for line in output.splitlines() if line}


def build_cortex_m7(name: str, sources: Sequence[Path]) -> Path:
    """Compile for the emulated Cortex-M7, with the core's modules that the programs use and the budgets' meter."""
    folder = OUT / f"{name}-m7"
    folder.mkdir(parents=True, exist_ok=True)
    core = [ROOT / "shared" / "core" / "src" / f"{part}.c" for part in CORE_PARTS]
    flags = ("-O3", "-isystem", str(generated_dir() / "include"))
    return build_program(folder, name, [*sources, *core, METER / "meter.cpp"], [PROGRAMS, METER], flags)


def has_cortex_m7() -> bool:
    """Return whether programs for the emulated Cortex-M7 can be built and run."""
    return all(shutil.which(tool) for tool in (*COMPILERS.values(), EMULATOR))


def run_cortex_m7(program: Path, words: Sequence[str]) -> str:
    """Run a program with exact counts and return what it printed."""
    done = run_program(program, *words, icount_shift=ICOUNT_SHIFT, timeout_s=TIMEOUT_S)
    if done.returncode != 0:
        raise BenchError(f"{program.name} {shlex.join(words)}: exit code {done.returncode}\n{done.stderr}")
    return done.stderr
