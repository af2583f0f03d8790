# SPDX-License-Identifier: MIT
"""Where the image that `make firmware` linked is, and what it takes to run parts of it here."""

from __future__ import annotations

import os
from pathlib import Path

from tests.image_build.front_ends import GCC, OUT

ROOT = Path(__file__).resolve().parents[2]
DEFAULT = ROOT / ".pio" / "build" / "three_wheel" / "firmware.elf"
NEWER_GCC = OUT / "gcc" / GCC[1]


def image_path() -> Path:
    """Return the image's path: $OMNI_IMAGE, or that of `make firmware`; it need not exist."""
    return Path(os.environ.get("OMNI_IMAGE") or DEFAULT)


def newer_gcc() -> Path:
    """Return the newer compiler's path: $OMNI_NEWER_GCC, or that of `make firmware-build-check`; it need not exist."""
    return Path(os.environ.get("OMNI_NEWER_GCC") or NEWER_GCC)
