# SPDX-License-Identifier: MIT
"""What a check is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from image_check.bench import Context

SHORT, CI, NIGHTLY = "short", "ci", "nightly"
DEPTHS = (SHORT, CI, NIGHTLY)
"""Before an upload; in every CI run; with all that takes longer."""


@dataclass(frozen=True)
class Check:
    """One check: ``run`` returns sentences with what it measured, and raises OmniError if the image fails it."""

    name: str
    what: str
    run: Callable[[Context], list[str]]
    depths: tuple[str, ...] = DEPTHS
    chip: bool = False
    """It is about the PWM chip and its bus: a robot whose motors hang on the processor's pins has none."""
