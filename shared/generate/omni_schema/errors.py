# SPDX-License-Identifier: MIT
"""The package's one exception, and the help that its messages give."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


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
    """Return " (did you mean X?)" for the closest known name, or "" if none is close."""
    candidates = list(known)
    folded = {candidate.lower(): candidate for candidate in candidates}
    close = difflib.get_close_matches(name.lower(), list(folded), n=1)
    return f" (did you mean {folded[close[0]]}?)" if close else ""
