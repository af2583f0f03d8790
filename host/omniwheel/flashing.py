# SPDX-License-Identifier: MIT
"""Builds a Teensy's firmware from a source checkout, uploads it with PlatformIO and asks the board what runs now."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from omniwheel.errors import FlashError, OmniError
from omniwheel.firmware_version import RobotVersion
from omniwheel.ports import Port, serial_ports
from omniwheel.robot import Robot, connect
from omniwheel.robots import read_robot

OWN_ROBOT_ENVIRONMENT = "robot"
"""The environment of platformio.ini that builds for the file that OMNI_ROBOT names."""
BOOT_S = 30.0
_POLL_S = 0.2
_STANDARD_ERROR = 2
_HASH = re.compile(r'#define OMNI_GIT_HASH_STRING "([0-9a-f]{16})"')


@dataclass(frozen=True)
class Flashed:
    """What runs after an upload: on which port, and which version."""

    port: str
    version: RobotVersion


def source_dir() -> Path:
    """Return the source checkout that this package runs from. Raises FlashError if it runs from somewhere else."""
    root = Path(__file__).resolve().parents[2]
    if not (root / "platformio.ini").is_file():
        hint = "get the source, and run `make flash` there, or `make setup` and then `.venv/bin/omni flash`"
        raise FlashError("the firmware's source is not part of this installation", hint=hint)
    return root


def find_pio() -> str:
    """Return PlatformIO's program. Raises FlashError."""
    beside_python = str(Path(sys.executable).parent)
    in_its_own_folder = str(Path.home() / ".platformio" / "penv" / "bin")
    for folder in (None, beside_python, in_its_own_folder):
        path = shutil.which("pio", path=folder)
        if path:
            return path
    raise FlashError("PlatformIO (pio) is not installed", hint="pip install platformio, or `make flash` in the source")


def environment_of(robot: str | Path, root: Path) -> tuple[str, dict[str, str]]:
    """Return the PlatformIO environment that builds for this robot, and what to put into the process's environment.

    The robot file is checked. Raises RobotFileError.
    """
    path = Path(read_robot(robot).source).resolve()
    own = root / "shared" / "robots" / path.name
    if own.is_file() and own.read_bytes() == path.read_bytes():
        return path.stem, {}
    return OWN_ROBOT_ENVIRONMENT, {"OMNI_ROBOT": str(path)}


def run_pio(robot: str | Path, *, upload: bool, port: str | None = None) -> str:
    """Build, and upload if asked to. Return the git hash that was built in. PlatformIO's words go to the terminal."""
    root = source_dir()
    environment, variables = environment_of(robot, root)
    command = [find_pio(), "run", "-d", str(root), "-e", environment]
    if upload:
        command += ["-t", "upload", *(["--upload-port", port] if port else [])]
    inherited = {name: value for name, value in os.environ.items() if name != "OMNI_ROBOT"}
    # Standard output is for what this program has to say (--json).
    done = subprocess.run(command, check=False, env={**inherited, **variables}, stdout=_STANDARD_ERROR)
    if done.returncode != 0:
        what = "build or upload" if upload else "build"
        raise FlashError(f"PlatformIO's {what} failed (exit code {done.returncode})", hint="its own words are above")
    return _built_hash(root / ".pio" / "build" / environment)


def _built_hash(folder: Path) -> str:
    header = folder / "generated" / "include" / "omni" / "version_gen.h"
    found = _HASH.search(header.read_text(encoding="utf-8")) if header.is_file() else None
    return found.group(1) if found else ""


def teensy_ports() -> list[Port]:
    """Return the serial ports that look like a Teensy."""
    return [port for port in serial_ports() if port.guess == "teensy"]


def require_board(port: str | None) -> None:
    """Raise FlashError unless there is one board to upload to."""
    found = [teensy.device for teensy in teensy_ports()]
    if port is not None:
        if port not in [known.device for known in serial_ports()]:
            raise FlashError(f"there is no port {port}", hint=f"Teensys: {', '.join(found) or 'none'}")
        return
    if not found:
        hint = "plug it in by a USB cable that carries data; a board that never had a serial port needs --blank"
        raise FlashError("no Teensy is connected", hint=hint)
    if len(found) > 1:
        raise FlashError(f"{len(found)} Teensys are connected", hint=f"--port, one of {', '.join(found)}")


def wait_for_firmware(
    port: str | None,
    built_hash: str,
    *,
    timeout_s: float = BOOT_S,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> Flashed:
    """Wait until the board is back on USB and say what it runs. Raises FlashError if it is not what was built."""
    deadline = clock() + timeout_s
    problem: OmniError | None = None
    while clock() < deadline:
        devices = [teensy.device for teensy in teensy_ports()]
        device = port if port in devices else (devices[0] if devices and port is None else None)
        if device is not None:
            try:
                return _ask(device, built_hash)
            except FlashError:
                raise
            except OmniError as error:  # not there yet, or gone again: it is starting
                problem = error
        sleep(_POLL_S)
    hint = (
        f"last problem: {problem}"
        if problem
        else "its port did not come back; unplug it, plug it in and look at the lamp"
    )
    raise FlashError(f"the board did not answer within {timeout_s:.0f} s of the upload", hint=hint)


def _ask(device: str, built_hash: str) -> Flashed:
    robot: Robot = connect(device, timeout_s=3.0, heartbeat=False)
    try:
        version = robot.version
    finally:
        robot.close()
    if built_hash.strip("0") and version.git_hash and version.git_hash != built_hash:
        raise FlashError(
            f"{device} runs {version}, not the {built_hash[:8]} just built",
            hint="the upload did not reach it: press the button on the board and try again",
        )
    return Flashed(device, version)
