# SPDX-License-Identifier: MIT
"""Reads NumPy's archives. Whatever is wrong with one is an error with a message, and nothing in it is executed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


class NotAnArchiveError(ValueError):
    """A file that is not a NumPy archive, or is damaged."""


def read_npz(path: Path) -> dict[str, NDArray[Any]]:
    """Return all arrays of an archive by name. Raises OSError if it cannot be read, NotAnArchiveError if it is none."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            return {name: np.asarray(stored[name]) for name in stored.files}
    except OSError:
        raise
    except Exception as error:  # whatever zipfile, zlib, NumPy and the tokenizer of its headers come up with
        raise NotAnArchiveError(f"{path} is not a NumPy archive, or is damaged ({error})") from error
