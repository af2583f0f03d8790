# SPDX-License-Identifier: MIT
"""Status texts of the hub that name the client in command, and how the program whose drive they end recognises them.

A text has 50 characters. A program's name has 25 (``core.NAME_CHARACTERS``), so each of these fits.
"""

from __future__ import annotations

NO_CLIENT_IN_COMMAND = "hub: no client in command"
_COMMANDS = " in command"
_STOPPED = "hub: stopped by "
_HELD = "hub: held by "
_REFUSED = "hub: refused, "
DRIVE_ENDED = _REFUSED + "its drive has ended"
PAUSE_FIRST = _REFUSED + "pause before you take over"


def commands(name: str) -> str:
    """Return the text to the other clients when a program takes the command."""
    return f"hub: {name}{_COMMANDS}"


def stopped(name: str, *, held: bool) -> str:
    """Return the text about the program that stopped the robot, or ``held`` it: the robot stays armed."""
    return f"{_HELD if held else _STOPPED}{name}"


def refused(commander: str) -> str:
    """Return the refusal of a client's motion commands while ``commander`` is in command."""
    return f"{_REFUSED}{commander}{_COMMANDS}"


def is_stop(text: str) -> bool:
    """Return whether a text reports that a program has stopped or held the robot."""
    return text.startswith((_STOPPED, _HELD))


def disarms(text: str) -> bool:
    """Return whether a text reports that a program has disarmed the robot or pressed its emergency stop."""
    return text.startswith(_STOPPED)


def ends_drive(text: str) -> bool:
    """Return whether a text, sent to the program that drove until now, means that its drive is over."""
    return names_program(text) or text.startswith(_REFUSED)


def names_program(text: str) -> bool:
    """Return whether a text names the program that stopped the robot or has taken the command."""
    commands_now = text.startswith("hub: ") and text.endswith(_COMMANDS) and text != NO_CLIENT_IN_COMMAND
    return is_stop(text) or commands_now
