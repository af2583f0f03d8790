# SPDX-License-Identifier: MIT
"""Runs the checks of an image one by one, the cheapest first, until one fails."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from image_check.run import NOT_RUN, Outcome, all_checks, run_checks, run_one
from image_check.worker_processes import ProcessFailure, call_in_processes
from tests.image.planted.bugs import ROBOT, Bug

LEAST_LIMIT_S, LIMIT_FACTOR = 30, 10
"""A check of a broken image may never end. It gets so much processor time, or so many times its usual one."""
QUICK_S = 3.0
"""A quick search leaves out what takes longer, unless it found the bug the last time."""
SEED = 1
BY_THE_CLOCK = "faults-in-the-loop"
"""Has time-outs of this computer's clock. It comes last, and counts if the image without a bug passes it then."""


@dataclass(frozen=True)
class Result:
    """What became of a bug. ``found_by`` is the check, "" if none found it; ``sentence`` is what it said."""

    digest: str
    found_by: str
    sentence: str

    def line(self) -> str:
        """Return it for a terminal."""
        return f"{self.found_by}: {self.sentence}" if self.found_by else "NOT FOUND"


@dataclass(frozen=True)
class Search:
    """The checks of a depth, and the processor time [s] of each with the image without a bug."""

    depth: str
    costs_s: dict[str, float]
    quick: bool = False
    clean: Path | None = None
    """The image without a bug."""

    @classmethod
    def by_all(cls, depth: str, clean: Path, image: Path, *, quick: bool, workers: int) -> Search:
        """Return a search by all checks. Each must pass with the image without a bug: one that fails finds nothing.

        ``clean`` keeps their costs for this image. Raises SystemExit if one fails.
        """
        kept = json.loads(clean.read_text(encoding="utf-8")) if clean.is_file() else {}
        names = {check.name for check in all_checks() if depth in check.depths}
        if kept.get("image") != image.name or kept["costs_s"].keys() != names:
            outcomes = run_checks(image, ROBOT, depth=depth, seed=SEED, workers=workers)
            failed = [f"{outcome.name}: {outcome.failure}" for outcome in outcomes if not outcome.passed]
            if failed:
                raise SystemExit(f"a check fails without any bug: {failed[0]}")
            kept = {"image": image.name, "costs_s": {outcome.name: outcome.cpu_s for outcome in outcomes}}
            clean.parent.mkdir(parents=True, exist_ok=True)
            clean.write_text(json.dumps(kept), encoding="utf-8")
        return cls(depth, kept["costs_s"], quick, image)

    def of(self, image: Path, bug: Bug, first: str) -> Result | None:
        """Return which check finds the bug in this image; None: a quick search has not found it.

        ``first``: the check that found it the last time, or "".
        """
        names = [name for name in self.costs_s if name == first or not self.quick or self.costs_s[name] <= QUICK_S]
        for name in sorted(names, key=lambda name: (name != first, name == BY_THE_CLOCK, self.costs_s[name])):
            outcome = self._run(image, name)
            if outcome is not None and not outcome.passed and self._counts(name):
                return Result(bug.digest, name, outcome.failure)
        return None if self.quick else Result(bug.digest, "", "")

    def _counts(self, name: str) -> bool:
        """Whether a check that has failed would have passed without the bug."""
        if name != BY_THE_CLOCK or self.clean is None:
            return True
        outcome = self._run(self.clean, name)
        return outcome is not None and outcome.passed

    def _run(self, image: Path, name: str) -> Outcome | None:
        """Return what a check shows; None if it was cut off or could not run: it has found nothing."""
        limit_s = max(LEAST_LIMIT_S, round(LIMIT_FACTOR * self.costs_s[name]))
        ((_, outcome),) = call_in_processes(run_one, [(image, ROBOT, self.depth, SEED, name)], 1, limit_s)
        return None if isinstance(outcome, ProcessFailure) or outcome.failure.startswith(NOT_RUN) else outcome
