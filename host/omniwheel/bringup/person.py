# SPDX-License-Identifier: MIT
"""Eyes and hands beside the robot, as the checks see them."""

from __future__ import annotations

from enum import Enum
from typing import Protocol

from omniwheel.errors import OmniError


class HandMotion(Enum):
    """What only a hand can move on a real robot. The value: what moves it in a simulated world."""

    WHEEL = (
        "in simulation: start the robot with `omni sitl hands`, which turns the wheels, or with `omni sitl --commands` "
        'and type there {"fault": "wheel_turned", "wheel": 1, "on": true, "duration_s": 2}'
    )
    PUSH = "in simulation: start the robot with `omni sitl push` (on the page: scenario push), which pushes it"
    TURN = "in simulation no hand turns the robot: cancel this check"
    PRESS_BUTTON = (
        "in simulation: start the robot with `omni sitl stand --commands` and type there "
        '{"fault": "stop_button", "on": true}'
    )
    RELEASE_BUTTON = 'in simulation: type {"fault": "stop_button", "on": false} where `omni sitl --commands` runs'


class NotReadyError(OmniError):
    """The person did not agree to what a check needs."""


class Person(Protocol):
    """The operator beside the robot. The robot is disarmed during every question."""

    def show(self, text: str) -> None:
        """Show a line."""

    def move_by_hand(self, motion: HandMotion, text: str) -> None:
        """Ask the operator to move something by hand, as ``text`` says."""

    def confirm(self, question: str) -> bool:
        """Return whether the robot may be moved, or whatever ``question`` asks leave for."""

    def saw(self, question: str) -> bool | None:
        """Return the operator's observation; None: unknown."""


class Assumed:
    """No operator (``--yes``): confirms everything and observes nothing."""

    def show(self, text: str) -> None:
        """Drop the line."""

    def move_by_hand(self, motion: HandMotion, text: str) -> None:
        """Drop the request."""

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
