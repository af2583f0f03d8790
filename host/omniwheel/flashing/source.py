# SPDX-License-Identifier: MIT
"""Builds a Teensy's firmware from a source checkout with PlatformIO."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from omniwheel.errors import FlashError
from omniwheel.files import home
from omniwheel.robots import read_robot

OWN_ROBOT_ENVIRONMENT = "robot"
"""The environment of platformio.ini that builds for the file that OMNI_ROBOT names."""
STANDARD_ERROR = 2
"""Where other programs' words go: standard output is for what this program has to say (--json)."""
_CHANGED = "#define OMNI_GIT_DIRTY 1"
_HASH = re.compile(r'#define OMNI_GIT_HASH_STRING "([0-9a-f]{16})"')


@dataclass(frozen=True)
class Build:
    """A finished build: the program with symbols, what is uploaded, the git hash built in ("" if none).

    ``changed``: the source differed from that commit.
    """

    elf: Path
    hex: Path
    git_hash: str
    changed: bool = False


def source_dir() -> Path:
    """Return the source checkout that this package runs from. Raises FlashError if it runs from somewhere else."""
    root = Path(__file__).resolve().parents[3]
    if not (root / "platformio.ini").is_file():
        hint = "get the source and run `make flash` there, or upload a released file: omni flash FILE.hex"
        raise FlashError("the firmware's source is not part of this installation", hint=hint)
    return root


def core_dir() -> Path:
    """Return the folder where PlatformIO keeps its tools."""
    return Path(os.environ.get("PLATFORMIO_CORE_DIR") or (home() or Path("/")) / ".platformio")


def find_pio() -> str:
    """Return PlatformIO's program. Raises FlashError."""
    beside_python = str(Path(sys.executable).parent)
    for folder in (None, beside_python, str(core_dir() / "penv" / "bin")):
        path = shutil.which("pio", path=folder)
        if path:
            return path
    raise FlashError("PlatformIO (pio) is not installed", hint=f"{sys.executable} -m pip install 'platformio>=6.1'")


def environment_of(robot: str | Path, root: Path) -> tuple[str, dict[str, str]]:
    """Return the PlatformIO environment that builds for this robot, and what to put into the process's environment.

    The robot file is checked. Raises RobotFileError.
    """
    path = Path(read_robot(robot).source).resolve()
    own = root / "shared" / "robots" / path.name
    if own.is_file() and own.read_bytes() == path.read_bytes():
        return path.stem, {}
    return OWN_ROBOT_ENVIRONMENT, {"OMNI_ROBOT": str(path)}


def build(robot: str | Path) -> Build:
    """Build the firmware for a robot. PlatformIO's words go to standard error. Raises FlashError, RobotFileError."""
    root = source_dir()
    environment, variables = environment_of(robot, root)
    inherited = {name: value for name, value in os.environ.items() if name != "OMNI_ROBOT"}
    command = [find_pio(), "run", "-d", str(root), "-e", environment]
    done = subprocess.run(command, check=False, env={**inherited, **variables}, stdout=STANDARD_ERROR)
    if done.returncode != 0:
        raise FlashError(f"PlatformIO's build failed (exit code {done.returncode})", hint=_why_it_failed())
    folder = root / ".pio" / "build" / environment
    header = folder / "generated" / "include" / "omni" / "version_gen.h"
    git_hash, changed = _version(header.read_text(encoding="utf-8") if header.is_file() else "")
    return Build(folder / "firmware.elf", folder / "firmware.hex", git_hash, changed)


def _why_it_failed() -> str:
    """Return what to do about a build that failed. Without a network the first one ends in an HTTPClientError."""
    parts = ("platforms/teensy", "packages/framework-arduinoteensy", "packages/toolchain-gccarmnoneeabi-teensy")
    missing = [part for part in parts if not (core_dir() / part).is_dir()]
    if not missing:
        return "its output is above"
    return (
        f"its output is above; {core_dir()} has no {missing[0]} yet: PlatformIO fetches it in the first build, "
        "which needs the network (HTTPClientError: there is none)"
    )


def _version(header: str) -> tuple[str, bool]:
    found = _HASH.search(header)
    return found.group(1) if found else "", _CHANGED in header
