# SPDX-License-Identifier: MIT
"""Status texts in which the hub says who commands. The program whose drive they end recognises them by these rules.

A text has 50 characters. A program's name has 25 (``core.NAME_CHARACTERS``), so each of these fits.
"""

from __future__ import annotations

NOBODY_COMMANDS = "hub: nobody commands"
_COMMANDS = " commands"
_STOPPED = "hub: stopped by "
_HELD = "hub: held by "
_REFUSED = "hub: refused, "
DRIVE_ENDED = _REFUSED + "its drive has ended"
PAUSE_FIRST = _REFUSED + "pause before you take over"


def commands(name: str) -> str:
    """Return what the others are told when a program takes the command."""
    return f"hub: {name}{_COMMANDS}"


def stopped(name: str, *, held: bool) -> str:
    """Return what is said of the program that stopped the robot, or ``held`` it: the robot stays armed."""
    return f"{_HELD if held else _STOPPED}{name}"


def refused(commander: str) -> str:
    """Return why what moves the robot is refused while ``commander`` commands."""
    return f"{_REFUSED}{commander}{_COMMANDS}"


def is_stop(text: str) -> bool:
    """Return whether a text says that a program has stopped or held the robot."""
    return text.startswith((_STOPPED, _HELD))


def disarms(text: str) -> bool:
    """Return whether a text says that a program has disarmed the robot or pressed its emergency stop."""
    return text.startswith(_STOPPED)


def ends_drive(text: str) -> bool:
    """Return whether a text, sent to the program that drove until now, means that its drive is over."""
    return names_program(text) or text.startswith(_REFUSED)


def names_program(text: str) -> bool:
    """Return whether a text names the program that stopped the robot or has taken the command."""
    commands_now = text.startswith("hub: ") and text.endswith(_COMMANDS) and text != NOBODY_COMMANDS
    return is_stop(text) or commands_now
