# SPDX-License-Identifier: MIT
"""Eyes and hands beside the robot, as the checks see them."""

from __future__ import annotations

from typing import Protocol

from omniwheel.errors import OmniError


class NotReadyError(OmniError):
    """The person did not agree to what a check needs."""


class Person(Protocol):
    """The operator beside the robot. The robot is disarmed during every question."""

    def show(self, text: str) -> None:
        """Show a line."""

    def confirm(self, question: str) -> bool:
        """Return whether the robot may be moved, or whatever ``question`` asks leave for."""

    def saw(self, question: str) -> bool | None:
        """Return the operator's observation; None: unknown."""


class Assumed:
    """No operator (``--yes``): confirms everything and observes nothing."""

    def show(self, text: str) -> None:
        """Drop the line."""

    def confirm(self, question: str) -> bool:
        """Agree."""
        return True

    def saw(self, question: str) -> bool | None:
        """Return None: no observation."""
        return None


def require(person: Person, question: str) -> None:
    """Raise NotReadyError unless the person agrees."""
    if not person.confirm(question):
        raise NotReadyError("no wheel was moved", hint="run the command again when the robot is ready")


STAND = "The wheels will turn. Is the robot on a stand, all wheels off the floor, and the motor supply on?"
