# SPDX-License-Identifier: MIT
"""The check that an image passes before it is uploaded or released."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rich.markup import escape

from omni.cli.common import note
from omniwheel.errors import FlashError, MissingPackageError

if TYPE_CHECKING:
    from image_check.run import Outcome


def check_image(image: Path, robot: str, *, depth: str, without: str = "") -> str:
    """Run the image on the emulated chip and return the report. Raises FlashError if it does not pass or cannot run.

    ``without`` says how to do without the check, if that is possible.
    """
    from image_check.run import outcome_page, run_checks

    try:
        outcomes = run_checks(image, robot, depth=depth, done=print_outcome)
    except MissingPackageError as error:
        hint = "; ".join(filter(None, (error.hint, without)))
        raise FlashError(f"the image cannot be checked: {error}", hint=hint) from error
    failed = [outcome.name for outcome in outcomes if not outcome.passed]
    if failed:
        hint = "what they say is above" + (f"; {without}, which is for people who know why" if without else "")
        raise FlashError(f"the image fails {len(failed)} of its checks: {', '.join(failed)}", hint=hint)
    return outcome_page(image, robot, depth, 1, outcomes)


def print_outcome(outcome: Outcome) -> None:
    """Print a line about a check that is over."""
    mark = "[green]✓[/]" if outcome.passed else "[red]✗[/]"
    text = "; ".join(outcome.figures) if outcome.passed else outcome.failure
    note(f"{mark} {escape(outcome.name)}: {escape(text)} [dim]({outcome.wall_s:.1f} s)[/]")
