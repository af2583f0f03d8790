# SPDX-License-Identifier: MIT
"""The package's one exception, and the help that its messages give."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_LEAST_PART = 3
_MOST_GUESSES = 3


class SchemaError(ValueError):
    """A parameter or robot file is missing, malformed or out of range.

    The message names the file, the key, the value and what is allowed; ``hint`` says what to do.
    """

    def __init__(self, source: str, key: str, problem: str, hint: str = "correct the file and try again") -> None:
        self.source = source
        self.hint = hint
        self.key = key
        self.problem = problem
        where = f"{source}: {key}" if key else source
        super().__init__(f"{where}: {problem}")


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return " (did you mean X?)" for the closest known name, or "" if none is close.

    Without a close one it is the first few that contain ``name``: "LAM" gives ISMC_LAM_XY or ISMC_LAM_TH.
    """
    folded = {candidate.lower(): candidate for candidate in known}
    part = name.lower()
    close = difflib.get_close_matches(part, list(folded), n=1)
    if not close and len(part) >= _LEAST_PART:
        close = [candidate for candidate in folded if part in candidate][:_MOST_GUESSES]
    guesses = [folded[one] for one in close]
    *first, last = guesses or [""]
    return f" (did you mean {', '.join(first)}{' or ' if first else ''}{last}?)" if guesses else ""
