# SPDX-License-Identifier: MIT
"""Builds failing_calls.c, and says how to run a program over it."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

SOURCE = Path(__file__).with_name("failing_calls.c")
USABLE = sys.platform.startswith("linux") and "OMNI_SANITIZED" not in os.environ
"""A sanitizer has to be loaded first, and dyld has other ways."""


@dataclass(frozen=True)
class Failure:
    """How a call fails: ``stays`` is a disk that remains full, ``short`` one that takes half of the bytes first."""

    name: str
    error: int
    stays: bool = False
    short: bool = False


FULL = Failure("full", errno.ENOSPC, stays=True)
FULL_ONCE = Failure("full once", errno.ENOSPC)
SHORT = Failure("short", errno.ENOSPC, stays=True, short=True)
QUOTA = Failure("quota", errno.EDQUOT, stays=True)
TOO_BIG = Failure("too big", errno.EFBIG)
BROKEN_ONCE = Failure("input/output error once", errno.EIO)
BROKEN = Failure("input/output error", errno.EIO, stays=True)
FAILURES = (FULL, BROKEN_ONCE, SHORT, QUOTA, TOO_BIG, FULL_ONCE, BROKEN)


def need_shim() -> None:
    """Skip where a library cannot be put before libc; in CI that is an error on Linux."""
    if not USABLE or shutil.which("cc") is None:
        assert not (os.environ.get("CI") and USABLE), "CI needs a C compiler for the failing file system"
        pytest.skip("no failing file system here: Linux and a C compiler are needed")


@cache
def library() -> Path:
    """Return the compiled library."""
    folder = Path(tempfile.mkdtemp(prefix="omni-faults-"))
    path = folder / "failing_calls.so"
    command = ["cc", "-O1", "-shared", "-fPIC", "-Wall", "-Wextra", "-o", str(path), str(SOURCE), "-ldl"]
    subprocess.run(command, check=True, timeout=60)
    return path


def environment(folder: Path, number: int, failure: Failure) -> dict[str, str]:
    """Return what to add to a program's environment so that call ``number`` below ``folder`` fails."""
    values = {
        "LD_PRELOAD": str(library()),
        "FAIL_UNDER": str(folder.resolve()),
        "FAIL_AT": str(number),
        "FAIL_WITH": str(failure.error),
    }
    values.update({"FAIL_STAYS": "1"} if failure.stays else {})
    values.update({"FAIL_SHORT": "1"} if failure.short else {})
    return values


def chosen(numbers: Sequence[int], most: int) -> Sequence[int]:
    """Return all numbers, or ``most`` (two or more) of them, evenly spaced, with the first and the last."""
    if len(numbers) <= most:
        return numbers
    return [numbers[round(i * (len(numbers) - 1) / (most - 1))] for i in range(most)]
