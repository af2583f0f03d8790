# SPDX-License-Identifier: MIT
"""What can run a simulated robot's firmware: this computer, an emulated Cortex-M7, an emulated Teensy 4.0."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from omni.studio.error_text import in_words
from omniwheel.errors import OmniError
from omniwheel.flashing.source import source_dir

PC, EMULATED, IMAGE = "pc", "emulated", "image"
WORDS = {
    PC: "as a process on this computer",
    EMULATED: "on an emulated Cortex-M7 (QEMU)",
    IMAGE: "as a firmware image, on an emulated Teensy 4.0",
}
SHORT = {PC: "", EMULATED: "emulated Cortex-M7", IMAGE: "flashed image, emulated"}
_IMAGE_PACKAGES = {"unicorn": "unicorn", "elftools": "pyelftools", "intelhex": "intelhex"}


def processors() -> list[dict[str, Any]]:
    """Return what there is to choose: ``name``, ``words``, ``problem`` with what is missing for it ("": nothing).

    ``files``: images that `make firmware` or `omni flash` left in a source checkout, newest first, and their robots.
    """
    return [
        {"name": PC, "words": WORDS[PC], "problem": "", "files": None},
        {"name": EMULATED, "words": WORDS[EMULATED], "problem": _without_emulator(), "files": None},
        {"name": IMAGE, "words": WORDS[IMAGE], "problem": _without_packages(), "files": built_images()},
    ]


def built_images() -> list[dict[str, str]]:
    """Return ``path`` and ``robot`` of images that were built here, newest first."""
    try:
        root = source_dir()
    except OmniError:
        return []
    found = sorted(root.glob(".pio/build/*/firmware.elf"), key=lambda path: path.stat().st_mtime, reverse=True)
    return [{"path": str(path), "robot": path.parent.name} for path in found]


def _without_emulator() -> str:
    from omniwheel.emulated_firmware import require_emulator

    try:
        require_emulator()
    except OmniError as error:
        return in_words(error)
    return ""


def _without_packages() -> str:
    missing = [package for module, package in _IMAGE_PACKAGES.items() if find_spec(module) is None]
    return f"{', '.join(missing)} is not installed. Run: pip install 'omniwheel[flash]'" if missing else ""
