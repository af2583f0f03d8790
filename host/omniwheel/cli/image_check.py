# SPDX-License-Identifier: MIT
"""The check that an image passes before it is uploaded or released."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

from omniwheel.errors import FlashError

CHECK_MODULE = "hil_sim.image_check"
"""Runs an image: ``python -m hil_sim.image_check FIRMWARE.ELF``. It prints its report; exit code 0: it passed."""
NOT_THERE = "no image check is part of this installation: this image has not been run"


def image_check_command(image: Path) -> list[str] | None:
    """Return what checks a firmware.elf, or None if this installation has no such check."""
    return [sys.executable, "-m", CHECK_MODULE, str(image)] if find_spec(CHECK_MODULE) else None


def check_image(image: Path) -> str:
    """Run the check on a firmware.elf and return its report. Raises FlashError if the image does not pass."""
    command = image_check_command(image)
    if command is None:
        return NOT_THERE
    done = subprocess.run(command, check=False, stdout=subprocess.PIPE, text=True)
    report = done.stdout.strip()
    if done.returncode != 0:
        hint = "--skip-check uploads it nevertheless" + (f"; the report:\n{report}" if report else "")
        raise FlashError(f"the image does not pass its check (exit code {done.returncode})", hint=hint)
    return report or "the image passed its check"
