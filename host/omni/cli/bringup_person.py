# SPDX-License-Identifier: MIT
"""The person at the terminal, for ``omni bringup``: the links are served while an answer is awaited."""

from __future__ import annotations

import select
import sys
from typing import TYPE_CHECKING

from rich.markup import escape

from omni.cli.common import error_console
from omniwheel.errors import OmniError

if TYPE_CHECKING:
    from omniwheel.bringup import HandMotion
    from omniwheel.robot import Robot

_PERIOD_S = 0.05
_YES, _NO = ("y", "yes"), ("n", "no")


class NoAnswerError(OmniError):
    """No operator at the terminal."""


class TerminalPerson:
    """Asks on standard error, reads standard input, keeps the robots' links served meanwhile.

    ``may_be_assumed``: whether the command has an option --yes.
    """

    def __init__(self, *robots: Robot, may_be_assumed: bool = True) -> None:
        self._robots = robots
        self._hint = "run it in a terminal, or add --yes" if may_be_assumed else "run it in a terminal"

    def show(self, text: str) -> None:
        """Print a line."""
        error_console.print(f"[bold cyan]→[/] {escape(text)}", soft_wrap=True)

    def move_by_hand(self, motion: HandMotion, text: str) -> None:
        """Print the request, and what fulfils it if the robot is simulated."""
        self.show(text)
        if any(robot.status.simulated for robot in self._robots):
            error_console.print(f"  [dim]{escape(motion.value)}[/]", soft_wrap=True)

    def confirm(self, question: str) -> bool:
        """Ask yes or no; anything but yes is no."""
        return self._prompt(question, "y/N").lower() in _YES

    def saw(self, question: str) -> bool | None:
        """Ask yes, no or don't know."""
        answer = self._prompt(question, "y/n, Enter: unknown").lower()
        return True if answer in _YES else False if answer in _NO else None

    def _prompt(self, question: str, choices: str) -> str:
        error_console.print(f"[bold yellow]?[/] {escape(question)} [dim]({choices})[/] ", end="", soft_wrap=True)
        while not _line_waits():
            for robot in self._robots:
                robot.pump(_PERIOD_S)
        line = sys.stdin.readline()
        if not line:
            error_console.print()
            raise NoAnswerError("standard input was closed before the question was answered", hint=self._hint)
        return line.strip()


def _line_waits() -> bool:
    """Return whether reading a line would not wait, or True where that cannot be known (Windows)."""
    try:
        return bool(select.select([sys.stdin], [], [], 0.0)[0])
    except (OSError, ValueError):
        return True
