# SPDX-License-Identifier: MIT
"""How the page says that something was refused or has failed."""

from __future__ import annotations


def hint_of(error: BaseException) -> str:
    """Return what to do about an error as a sentence, or ""; options of the command are fields on the page."""
    hint = str(getattr(error, "hint", "")).replace("--", "")
    return hint[:1].upper() + hint[1:]


def in_words(error: BaseException) -> str:
    """Return an error and what to do about it."""
    hint = hint_of(error)
    return f"{error}. {hint}" if hint else str(error)
