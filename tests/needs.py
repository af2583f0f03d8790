# SPDX-License-Identifier: MIT
"""What some tests need and a bare machine lacks: each kind with the command that installs it.

A test declares it with ``@pytest.mark.needs("arm")``, or calls :func:`need` where only a fixture knows. Without it the
test is skipped, and the table at the end of the run counts it. With ``CI=true`` a missing tool is a failure.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PREFIX = "not installed: "
APT = "sudo apt install "


@dataclass(frozen=True)
class Need:
    """A kind of missing thing.

    ``subject``: what is not tested without it. ``remedy``: the command that brings it. ``programs``: all must be on the
    PATH; ``files``: one must exist; ``pkg_config``: a library that pkg-config must know. ``optional``: CI
    may go without it.
    """

    subject: str
    remedy: str
    programs: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    pkg_config: str = ""
    optional: bool = False

    def missing(self) -> bool:
        """Return whether it is not here."""
        if any(shutil.which(program) is None for program in self.programs):
            return True
        if self.files and not any(Path(ROOT, path).exists() for path in self.files):
            return True
        return bool(self.pkg_config) and subprocess.run(["pkg-config", "--exists", self.pkg_config]).returncode != 0


NEWER_GCC = "build/front-ends/gcc/gcc_arm_none_eabi/toolchain/bin/arm-none-eabi-gcc"
ARM_PACKAGES = "gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib"
NEEDS = {
    "arm": Need(
        "programs for the Teensy's processor",
        APT + ARM_PACKAGES,
        ("arm-none-eabi-gcc", "arm-none-eabi-g++", "arm-none-eabi-objcopy"),
    ),
    "qemu": Need("the firmware on QEMU's Cortex-M7", APT + "qemu-system-arm", ("qemu-system-arm",)),
    "clang": Need("fuzzers, mutants, the core under Clang", APT + "clang libclang-rt-dev", ("clang", "clang++")),
    "llvm": Need("the processor's cycles by LLVM's model", APT + "llvm", ("llvm-mca", "llvm-objdump")),
    "frama-c": Need("proofs", APT + "frama-c-base ocaml-findlib", ("frama-c", "ocamlfind")),
    "valgrind": Need("instruction counts of benchmarks", APT + "valgrind", ("valgrind",)),
    "objdump": Need("fused instructions in the simulator's code", APT + "binutils", ("objdump",)),
    "sdformat": Need(
        "exported robots in Gazebo's parser",
        APT + "libsdformat-dev pkg-config",
        ("pkg-config",),
        pkg_config="sdformat12",
    ),
    "octave": Need("the filter study's Octave script", APT + "octave", ("octave-cli",), optional=True),
    "eigen": Need(
        "the filter study's Eigen program",
        APT + "libeigen3-dev",
        files=("/usr/include/eigen3/Eigen/Dense",),
        optional=True,
    ),
    "opengl": Need("films of MuJoCo worlds", APT + "libosmesa6"),
    "browser": Need(
        "the studio in a browser",
        APT + "chromium-headless-shell",
        files=("/usr/bin/chromium-headless-shell", "/usr/bin/chromium", "/usr/bin/google-chrome"),
    ),
    "image": Need(
        "the image that is flashed, on an emulated Teensy",
        "make firmware",
        files=(os.environ.get("OMNI_IMAGE") or ".pio/build/three_wheel/firmware.elf",),
    ),
    "newer-gcc": Need(
        "the tick by the compiler of a user's PlatformIO",
        "make firmware-build-check",
        files=(os.environ.get("OMNI_NEWER_GCC") or NEWER_GCC,),
    ),
    "eslint": Need(
        "the linter of the studio's page", "make lint-page", files=("build/eslint/node_modules/.bin/eslint",)
    ),
}


def missing(*names: str) -> list[str]:
    """Return those of the named kinds that are not here."""
    return [name for name in names if NEEDS[name].missing()]


def remedies(*names: str) -> str:
    """Return the commands that bring what is missing of the named kinds; empty if nothing is."""
    return "; ".join(NEEDS[name].remedy for name in missing(*names))


def refuse(name: str, *, optional: bool = False, module: bool = False) -> None:
    """Skip because ``name``, a kind of NEEDS or a remedy of its own, is not here; with ``CI=true`` fail.

    ``module``: for a call while a file is imported, whose tests are all skipped.
    """
    if os.environ.get("CI") and not optional:
        pytest.fail(PREFIX + name)
    pytest.skip(PREFIX + name, allow_module_level=module)


def need(*names: str, module: bool = False) -> None:
    """Skip the test if one of the named kinds is not here; with ``CI=true`` fail unless the kind is optional."""
    for name in missing(*names):
        refuse(name, optional=NEEDS[name].optional, module=module)


@dataclass
class Skips:
    """Counts skipped tests by reason."""

    kinds: Counter[str] = field(default_factory=Counter)
    others: Counter[str] = field(default_factory=Counter)

    @classmethod
    def of(cls, reports: Iterable[pytest.TestReport]) -> Skips:
        """Count reports of skipped tests."""
        skips = cls()
        for report in reports:
            reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
            reason = reason.removeprefix("Skipped: ")
            if reason.startswith(PREFIX):
                skips.kinds[reason.removeprefix(PREFIX)] += 1
            else:
                skips.others[reason] += 1
        return skips

    def table(self) -> list[str]:
        """Return lines: how many tests, of what, and what to type."""
        rows = []
        for name, count in self.kinds.most_common():
            known = NEEDS.get(name)
            rows.append((f"{count} tests", known.subject if known else name, known.remedy if known else ""))
        rows += [(f"{count} tests", reason, "") for reason, count in self.others.most_common()]
        widths = [max((len(row[column]) for row in rows), default=0) for column in range(2)]
        return [f"{a:>{widths[0]}}  {b:<{widths[1]}}  {c}".rstrip() for a, b, c in rows]
