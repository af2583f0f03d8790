# SPDX-License-Identifier: MIT
"""Makes a change ready for CI: mends what a program can mend, and checks what CI will check of it (make ready).

usage: python -m tests.ci.ready [--since REVISION]

It goes on after a failure. At the end it says what failed, what it wrote, and what this machine could not check.
"""

from __future__ import annotations

import argparse
import hashlib
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests import changed
from tests.ci.run_steps import SLOTS, Run, Step
from tests.needs import NEEDS, missing

LOGS = Path("build") / "ready"


@dataclass(frozen=True)
class Task:
    """A command that is run if a changed path begins with one of ``paths`` and all of ``needs`` are here."""

    name: str
    command: str
    paths: tuple[str, ...] = ("",)
    needs: tuple[str, ...] = ()
    slots: int = SLOTS

    def concerns(self, files: Sequence[str]) -> bool:
        """Return whether it is for one of the changed files."""
        return any(file.startswith(self.paths) for file in files)


CORE = ("shared/core/", "shared/params.toml", "shared/generate/")
IMAGE = (*CORE, "shared/link/", "firmware/")
SIMULATED = (*CORE, "hil_sim/", "shared/world.toml", "shared/robots/")
PYTHON = shlex.quote(sys.executable)
WRITERS = (
    Task("tools", "make .venv/stamp-lint .venv/stamp-docs studio-page"),
    Task("format", "make format"),
    Task("link vectors", f"{PYTHON} -m tests.docs.link_vectors --write", ("shared/link/", "tests/docs/")),
    Task("pictures", f"{PYTHON} -m tests.docs.pictures --write", SIMULATED),
    Task("budgets", "make budgets ARGS=--write", (*IMAGE, "tests/parity/"), ("arm", "qemu")),
    Task("proofs", "make prove ARGS=--write", (*CORE, "tests/proof/"), ("frama-c",)),
    Task("memory of the image", "make firmware-memory ARGS=--write", IMAGE),
)
"""What writes files, one after another: some write into the same page."""
CHECKS = (
    Task("lint", "make lint", slots=1),
    Task("docs", "make docs", slots=1),
    Task("core-checks", "make core-checks", CORE, ("arm", "clang"), slots=1),
    Task("parity", "make parity", (*IMAGE, "tests/parity/"), ("arm", "qemu", "clang"), slots=1),
    Task("tests", "make test-changed"),
)


@dataclass
class Report:
    """What came of the tasks: names of those that failed, files that were written, and why the others were not run."""

    failed: list[str] = field(default_factory=list)
    written: list[str] = field(default_factory=list)
    unchecked: dict[str, str] = field(default_factory=dict)

    def lines(self) -> list[str]:
        """Return it for a person."""
        lines = ["== NOT READY" if self.failed else "== ready, as far as this machine can tell"]
        lines += [f"failed:      {name} ({LOGS / name}.log)" for name in self.failed]
        lines += [f"written:     {name} (look at the difference, and commit it)" for name in self.written]
        return lines + [f"not checked: {name}: {remedy}" for name, remedy in self.unchecked.items()]


def contents(since: str) -> dict[str, str]:
    """Return a digest of each file that differs from a revision, "" for one that is gone."""
    paths = [(name, changed.ROOT / name) for name in changed.changed_files(since)]
    return {name: hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "" for name, path in paths}


def ready(since: str, writers: Sequence[Task] = WRITERS, checks: Sequence[Task] = CHECKS) -> Report:
    """Run the tasks for what has changed since a revision."""
    report = Report()
    before = contents(since)

    def possible(tasks: Sequence[Task]) -> list[Step]:
        files = list(contents(since))
        for task in tasks:
            if task.concerns(files) and (lacking := missing(*task.needs)):
                report.unchecked[task.name] = "; ".join(NEEDS[name].remedy for name in lacking)
        chosen = [task for task in tasks if task.concerns(files) and task.name not in report.unchecked]
        return [Step(task.name, task.command, slots=task.slots) for task in chosen]

    for tasks in (writers, checks):
        run = Run(possible(tasks), logs=LOGS)
        run.all_passed()
        report.failed += [name for name, outcome in run.outcomes.items() if not outcome.passed]
    after = contents(since)
    report.written = sorted(name for name in before.keys() | after.keys() if before.get(name) != after.get(name))
    return report


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="make a change ready for CI")
    parser.add_argument("--since", help="revision to compare with (default: merge base with the main branch)")
    options = parser.parse_args()
    report = ready(options.since or changed.base())
    print(*report.lines(), sep="\n")
    return 1 if report.failed else 0


if __name__ == "__main__":
    sys.exit(main())
