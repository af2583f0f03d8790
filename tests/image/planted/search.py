# SPDX-License-Identifier: MIT
"""Runs the checks of an image one by one, the quick ones first, until one fails."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil_sim.image_check.run import all_checks
from tests.image.planted.bugs import ROOT, Bug

LIMIT_S = 900.0
"""A check of a broken image may never end. One that was cut off has found nothing."""
QUICK_S = 3.0
"""A quick search leaves out what takes longer, unless it found the bug the last time."""


@dataclass(frozen=True)
class Result:
    """What became of a bug. ``found_by`` is the check, "" if none found it; ``sentence`` is what it said."""

    digest: str
    found_by: str
    sentence: str

    def line(self) -> str:
        """Return it for a terminal."""
        return f"{self.found_by}: {self.sentence}" if self.found_by else "NOT FOUND"


def _run(image: Path, depth: str, name: str) -> list[dict[str, Any]]:
    omni = str(Path(sys.executable).parent / "omni")
    command = [omni, "check-image", str(image), "--depth", depth, "--workers", "1", "--json", "--only", name]
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=LIMIT_S)
        checks: list[dict[str, Any]] = json.loads(done.stdout)["checks"]
    except subprocess.TimeoutExpired:
        return []
    except ValueError as error:
        raise SystemExit(f"omni check-image said: {done.stderr[-500:]}") from error
    return checks


class Search:
    """The checks in the order of the time [s] that they take with the image without a bug."""

    def __init__(self, depth: str, known: dict[str, float], *, quick: bool = False) -> None:
        self.depth, self.quick, self.known = depth, quick, known
        self.names = sorted(known, key=lambda name: known[name])

    @classmethod
    def only(cls, depth: str, name: str) -> Search:
        """Return a search by a single check."""
        return cls(depth, {name: 0.0})

    @classmethod
    def by_all(cls, depth: str, clean: Path, image: Path, *, quick: bool) -> Search:
        """Return a search by all checks; first, each must pass with the image without a bug."""
        search = cls(depth, json.loads(clean.read_text(encoding="utf-8")) if clean.is_file() else {}, quick=quick)
        known = search.known
        names = list(dict.fromkeys(check.name for check in all_checks() if depth in check.depths))
        for name in names:
            if name not in known:
                known[name] = search._passes(image, name)
                clean.parent.mkdir(parents=True, exist_ok=True)
                clean.write_text(json.dumps(known), encoding="utf-8")
        return cls(depth, {name: known[name] for name in names}, quick=quick)

    def _passes(self, image: Path, name: str) -> float:
        """Return how long a check took that must pass here [s]: one that fails without any bug cannot find one."""
        (check,) = _run(image, self.depth, name) or [{"passed": False, "failure": f"no end within {LIMIT_S:g} s"}]
        if not check["passed"]:
            raise SystemExit(f"check {name} fails without any bug: {check['failure']}")
        return float(check["wall_s"])

    def of(self, image: Path, bug: Bug, first: str) -> Result | None:
        """Return which check finds the bug in this image; None: a quick search has not found it.

        ``first``: the check that found it the last time, or "".
        """
        names = [name for name in self.names if name == first or not self.quick or self.known[name] <= QUICK_S]
        for name in sorted(names, key=lambda name: name != first):
            for check in _run(image, self.depth, name):
                if not check["passed"]:
                    return Result(bug.digest, name, check["failure"])
        return None if self.quick else Result(bug.digest, "", "")
