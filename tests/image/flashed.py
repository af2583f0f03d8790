# SPDX-License-Identifier: MIT
"""Where the image that `make firmware` linked is, and what it takes to run parts of it here."""

from __future__ import annotations

import importlib.util
import os
import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.image_build.front_ends import GCC, OUT

ROOT = Path(__file__).resolve().parents[2]
DEFAULT = ROOT / ".pio" / "build" / "three_wheel" / "firmware.elf"
NEWER_GCC = OUT / "gcc" / GCC[1]
PACKAGES = {"unicorn": "unicorn", "elftools": "pyelftools"}
MODEL_TOOLS = ("llvm-mca", "llvm-objdump")
COMPILERS = ("arm-none-eabi-gcc", "arm-none-eabi-g++", "arm-none-eabi-objcopy")


def image_path() -> Path:
    """Return the image's path: $OMNI_IMAGE, or that of `make firmware`; it need not exist."""
    return Path(os.environ.get("OMNI_IMAGE") or DEFAULT)


def newer_gcc() -> Path:
    """Return the newer compiler's path: $OMNI_NEWER_GCC, or that of `make firmware-build-check`; it need not exist."""
    return Path(os.environ.get("OMNI_NEWER_GCC") or NEWER_GCC)


def missing_for_guests() -> list[str]:
    """Return what is missing to run programs beside an image, in words that say what to do."""
    packages = [name for module, name in PACKAGES.items() if importlib.util.find_spec(module) is None]
    tools = [tool for tool in COMPILERS if shutil.which(tool) is None]
    return [f"{name} (pip install {name})" for name in packages] + [f"{tool} (gcc-arm-none-eabi)" for tool in tools]


def missing_for_model() -> list[str]:
    """Return what is missing to estimate cycles."""
    return [f"{tool} (llvm)" for tool in MODEL_TOOLS if shutil.which(tool) is None]


def missing_image(image: Path) -> list[str]:
    """Return a sentence if there is no image."""
    return [] if image.is_file() else [f"{image} (make firmware, or OMNI_IMAGE=firmware.elf)"]


def missing_newer_gcc() -> list[str]:
    """Return a sentence if there is no newer compiler."""
    path = newer_gcc()
    hint = "make firmware-build-check, or OMNI_NEWER_GCC=arm-none-eabi-gcc"
    return [] if path.is_file() else [f"{path} ({hint})"]


def need(missing: Sequence[str], module: bool = False) -> None:
    """Skip the test, or with ``module`` the whole file, if something is missing; on CI it must be there."""
    if missing and os.environ.get("CI") == "true":
        pytest.fail(f"not there: {', '.join(missing)}")
    if missing:
        pytest.skip(f"not there: {', '.join(missing)}", allow_module_level=module)
