# SPDX-License-Identifier: MIT
"""The check that an image passes before it is uploaded or released."""

from __future__ import annotations

from pathlib import Path

from hil_sim.image_check.run import report, run_checks
from omniwheel.cli.check_image import say_outcome
from omniwheel.errors import FlashError, MissingPackageError

SKIP_HINT = "--skip-check uploads it unchecked"


def check_image(image: Path, robot: str, *, depth: str) -> str:
    """Run the image on the emulated chip and return the report. Raises FlashError if it does not pass or cannot run."""
    try:
        outcomes = run_checks(image, robot, depth=depth, done=say_outcome)
    except MissingPackageError as error:
        raise FlashError(f"the image cannot be checked: {error}", hint=f"{error.hint}; {SKIP_HINT}") from error
    failed = [outcome.name for outcome in outcomes if not outcome.passed]
    if failed:
        hint = f"what they say is above; {SKIP_HINT}, which is for people who know why"
        raise FlashError(f"the image fails {len(failed)} of its checks: {', '.join(failed)}", hint=hint)
    return report(image, robot, depth, 1, outcomes)
