# SPDX-License-Identifier: MIT
"""Where the installed package keeps what the build made: the same in a wheel and in an editable install."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

_REINSTALL = "the installation is incomplete; install again with: pip install . (or make setup)"


class MissingFileError(FileNotFoundError):
    """A file that belongs to the package is not there."""


def _existing(path: Path, what: str) -> Path:
    if not path.exists():
        raise MissingFileError(f"{what} not found at {path}: {_REINSTALL}")
    return path


def data_dir() -> Path:
    """Return the folder that holds everything below."""
    extension = find_spec("omniwheel._core")
    if extension is None or extension.origin is None:
        raise MissingFileError(f"omniwheel._core is missing: {_REINSTALL}")
    return Path(extension.origin).resolve().parent


def firmware_path() -> Path:
    """Return the firmware program for this PC."""
    return _existing(data_dir() / "bin" / "omni-firmware", "the PC firmware")


def emulated_firmware_path() -> Path:
    """Return the firmware program for the emulated Cortex-M7."""
    return _existing(data_dir() / "bin" / "omni-firmware-mps2.elf", "the emulated firmware")


def robots_dir() -> Path:
    """Return the folder of the robot files that come with the package."""
    return _existing(data_dir() / "robots", "the folder of robot files")


def presets_dir() -> Path:
    """Return the folder of the parameter presets that come with the package."""
    return _existing(data_dir() / "presets", "the folder of presets")


def params_path() -> Path:
    """Return params.toml, the description of every parameter."""
    return _existing(data_dir() / "params.toml", "the parameter description")


def world_path() -> Path:
    """Return world.toml, the description of the simulated world."""
    return _existing(data_dir() / "world.toml", "the description of the simulated world")


def dialect_dir() -> Path:
    """Return the folder that holds the generated MAVLink dialect, module ``omni``."""
    return _existing(data_dir() / "dialects", "the MAVLink dialect")
