# SPDX-License-Identifier: MIT
"""Builds the parity and budget programs with every compiler, and runs them, on QEMU where they are the Cortex-M7's."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "build" / "parity"
CORTEX_M7 = "cortex-m7"
QEMU = ("qemu-system-arm", "-M", "mps2-an500", "-nographic", "-monitor", "none", "-serial", "none")
BUILD_TIMEOUT_S = 900
RUN_TIMEOUT_S = 1800


class BuildError(Exception):
    """A program could not be built or run; the message holds the tool's words."""


@dataclass(frozen=True)
class Build:
    """One way to compile the core. ``level`` replaces the products' own optimisation."""

    name: str
    compiler: str
    level: str | None = None

    @property
    def is_cortex_m7(self) -> bool:
        return self.compiler == "arm-none-eabi-gcc"

    def missing_tools(self) -> list[str]:
        tools = [self.compiler, *(["arm-none-eabi-g++", QEMU[0]] if self.is_cortex_m7 else [])]
        return [tool for tool in tools if shutil.which(tool) is None]

    @property
    def folder(self) -> Path:
        return OUT / self.name

    def prepare(self) -> None:
        """Build its programs. Raises BuildError."""
        make(self)

    def parity(self, arguments: list[str]) -> tuple[int, str]:
        """Run the parity program and return its exit code and output."""
        return run(self, "parity", arguments)


GATE = (Build("gcc", "gcc"), Build("clang", "clang"), Build(CORTEX_M7, "arm-none-eabi-gcc"))
EXTRA = tuple(Build(f"{build.name}{level}", build.compiler, level) for build in GATE for level in ("-O0", "-O2"))


def usable(builds: Sequence[Build]) -> tuple[list[Build], list[str]]:
    """Return the builds whose tools are installed and, for each of the others, a sentence that says what is missing.

    Raises BuildError instead if CI=true: there nothing may be left out.
    """
    missing = {build: build.missing_tools() for build in builds}
    sentences = [f"{build.name}: {', '.join(tools)} not installed" for build, tools in missing.items() if tools]
    if sentences and os.environ.get("CI") == "true":
        raise BuildError("; ".join(sentences))
    return [build for build in builds if not missing[build]], sentences


def make(build: Build) -> None:
    """Configure and build; incremental."""
    generated = OUT / "generated"
    if not (build.folder / "build.ninja").exists():
        options = [f"-DOMNI_GENERATED={generated}", f"-DCMAKE_MAKE_PROGRAM={tool('ninja')}"]
        if build.is_cortex_m7:
            options.append(f"-DCMAKE_TOOLCHAIN_FILE={ROOT / 'cmake' / 'arm-none-eabi.cmake'}")
        else:
            options.append(f"-DCMAKE_C_COMPILER={build.compiler}")
        if build.level is not None:
            options.append(f"-DOMNI_LEVEL={build.level}")
        source = str(ROOT / "tests" / "parity")
        call([tool("cmake"), "-G", "Ninja", "-S", source, "-B", str(build.folder), *options])
    # A build by an earlier version of this file may have been made through ccache, without call graphs.
    graphs = not build.is_cortex_m7 or any(build.folder.rglob("*.ci"))
    call([tool("cmake"), "--build", str(build.folder), *([] if graphs else ["--clean-first"])])


def generate() -> None:
    """Write the generated tables that all builds share."""
    script = ROOT / "shared" / "generate" / "generate.py"
    call([sys.executable, str(script), "--out", str(OUT / "generated"), "--part", "tables"])


def run(build: Build, program: str, arguments: Sequence[str] = (), counting: bool = False) -> tuple[int, str]:
    """Return exit code and output of a program. ``counting``: QEMU's time is instructions (Cortex-M7 only)."""
    path = build.folder / program
    if not build.is_cortex_m7:
        command = [str(path), *arguments]
    else:
        words = ",".join(f"arg={word}" for word in (program, *arguments))
        clock = ("-icount", "shift=10,sleep=off,align=off") if counting else ()
        command = [*QEMU, *clock, "-semihosting-config", f"enable=on,target=native,{words}", "-kernel", str(path)]
    done = subprocess.run(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        timeout=RUN_TIMEOUT_S,
    )
    return done.returncode, done.stdout


def call(command: Sequence[str]) -> str:
    """Run a tool and return its output. Raises BuildError with its words.

    Without ccache: it keeps objects, but not the call graphs that the compiler writes beside them.
    """
    environment = {**os.environ, "CCACHE_DISABLE": "1"}
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=BUILD_TIMEOUT_S, env=environment
    )
    if done.returncode != 0:
        raise BuildError(f"{' '.join(command)}\n{done.stdout}{done.stderr}")
    return done.stdout


def tool(name: str) -> str:
    """Return the path of a tool of this Python environment, or of the system."""
    beside = Path(sys.executable).parent / name
    found = str(beside) if beside.exists() else shutil.which(name)
    if found is None:
        raise BuildError(f"{name} is not installed")
    return found
