# SPDX-License-Identifier: MIT
"""Runs the steps of CI side by side and ends with a table of what each one took. Needs nothing but Python.

usage: python3 -m tests.ci.run_steps [--limit SECONDS] [STEP ...]

A step begins as soon as there is a free slot and the steps it comes after have passed. After a failure the other steps
still run, but for those that come after it. At the limit everything is ended. Exit code 1 if a step did not pass.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LOGS = ROOT / "build" / "ci"
LIMIT_S = 4800.0
SLOTS = 3
"""Steps at once. One more than two processors: a step that waits for a disk, a process or a browser leaves one idle."""
POLL_S = 0.2
TAIL = 25
"""Lines that are shown of a step that passed; its log has all."""
TEST_ARGS = "--passed=build/ci/bare-passed.txt --durations 20"


@dataclass(frozen=True)
class Step:
    """A command; ``slots`` is how many others it displaces."""

    name: str
    command: str
    after: tuple[str, ...] = ()
    slots: int = 1


def make(target: str, *after: str, slots: int = 1) -> Step:
    """Return the step of a make target, which comes after the set-up."""
    return Step(target, f"make {target}", after or ("setup",), slots)


STEPS = (
    Step("setup", "make setup .venv/stamp-docs .venv/stamp-lint .venv/stamp-platformio studio-page", slots=SLOTS),
    make("firmware-build-check"),
    Step("bare", ".ci/bare", ("setup",)),
    make("firmware-check", "firmware-build-check"),  # both build in .pio
    make("lint"),
    make("sanitize"),
    make("fuzz"),
    make("prove"),
    make("docs"),
    make("parity"),
    make("budgets"),
    make("core-checks"),
    make("demo"),
    make("bench-gates", slots=SLOTS),  # nothing else runs while it measures
    # Last, since it displaces all others; what has passed on the bare machine is not repeated.
    Step("test-all", f"make test-all ARGS='{TEST_ARGS}'", ("setup",), SLOTS),
)


@dataclass
class Outcome:
    """How a step went: ``passed`` is None while it runs or if it was not begun."""

    step: Step
    passed: bool | None = None
    wall_s: float = 0.0
    cpu_s: float = 0.0
    note: str = ""


@dataclass
class Run:
    """The steps of one run; time is that of ``time.monotonic``."""

    steps: Sequence[Step]
    limit_s: float = LIMIT_S
    logs: Path = LOGS
    outcomes: dict[str, Outcome] = field(default_factory=dict)
    _running: dict[int, tuple[Step, float]] = field(default_factory=dict)

    def all_passed(self) -> bool:
        """Run them. Returns whether every step passed within the limit."""
        self.logs.mkdir(parents=True, exist_ok=True)
        self.outcomes = {step.name: Outcome(step) for step in self.steps}
        begin = time.monotonic()
        waiting = list(self.steps)
        note = "interrupted"
        try:
            while waiting or self._running:
                waiting = self._begin(waiting)
                if not self._running:
                    break  # what is left comes after a step that failed
                if time.monotonic() - begin > self.limit_s:
                    note = f"ended at the limit of {self.limit_s:.0f} s"
                    break
                self._collect()
                time.sleep(POLL_S)
        finally:
            self._end_all(note)
        return all(outcome.passed for outcome in self.outcomes.values())

    def _begin(self, waiting: list[Step]) -> list[Step]:
        """Begin what fits; return what still waits."""
        left = []
        for place, step in enumerate(waiting):
            before = [self.outcomes[name] for name in step.after if name in self.outcomes]
            failed = [outcome.step.name for outcome in before if outcome.passed is False or outcome.note]
            if failed:
                self.outcomes[step.name].note = f"not run: {', '.join(failed)} did not pass"
            elif not all(outcome.passed for outcome in before):
                left.append(step)
            elif sum(running.slots for running, _ in self._running.values()) + step.slots <= SLOTS:
                self._start(step)
            else:
                # A large step is not overtaken for ever: what comes behind it in the table waits, too.
                return left + waiting[place:]
        return left

    def _start(self, step: Step) -> None:
        log = (self.logs / f"{step.name}.log").open("wb")
        child = os.fork()
        if child == 0:
            os.setsid()  # so that all that it starts can be ended
            os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
            os.dup2(log.fileno(), 1)
            os.dup2(log.fileno(), 2)
            os.execvp("bash", ["bash", "-c", step.command])
        log.close()
        self._running[child] = (step, time.monotonic())

    def _collect(self) -> None:
        """Note the steps that ended, and show their logs."""
        for child, (step, began) in list(self._running.items()):
            ended, status, usage = os.wait4(child, os.WNOHANG)
            if ended:
                del self._running[child]
                outcome = self.outcomes[step.name]
                outcome.passed = status == 0
                outcome.wall_s = time.monotonic() - began
                outcome.cpu_s = usage.ru_utime + usage.ru_stime
                self._show(outcome)

    def _show(self, outcome: Outcome) -> None:
        log = self.logs / f"{outcome.step.name}.log"
        lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
        shown = lines[-TAIL:] if outcome.passed else lines
        word = "passed" if outcome.passed else "FAILED"
        print(f"== {outcome.step.name}: {word} after {outcome.wall_s:.0f} s ({outcome.step.command})", *shown, sep="\n")
        sys.stdout.flush()

    def _end_all(self, note: str) -> None:
        for child, (step, began) in self._running.items():
            os.killpg(child, signal.SIGKILL)
            _, _, usage = os.wait4(child, 0)
            outcome = self.outcomes[step.name]
            outcome.note, outcome.wall_s = note, time.monotonic() - began
            outcome.cpu_s = usage.ru_utime + usage.ru_stime
            self._show(outcome)
        self._running.clear()

    def ends_of_failed(self, lines: int = 12) -> list[str]:
        """Return the last lines of each step that failed: its whole log is far above by then."""
        shown = []
        for outcome in self.outcomes.values():
            if outcome.passed is False:
                log = (self.logs / f"{outcome.step.name}.log").read_text(encoding="utf-8", errors="replace")
                shown += [f"== {outcome.step.name} ended so", *log.splitlines()[-lines:]]
        return shown

    def table(self) -> list[str]:
        """Return a line per step, the longest first."""
        lines = [f"{'seconds':>8} {'CPU':>7}  step"]
        for outcome in sorted(self.outcomes.values(), key=lambda outcome: -outcome.wall_s):
            note = "" if outcome.passed else outcome.note or ("FAILED" if outcome.passed is False else "not run")
            lines.append(f"{outcome.wall_s:8.0f} {outcome.cpu_s:7.0f}  {outcome.step.name:<22} {note}".rstrip())
        return lines


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="run the steps of CI")
    parser.add_argument("--limit", type=float, default=LIMIT_S, help="seconds for the whole run (default %(default)s)")
    parser.add_argument("names", nargs="*", metavar="STEP", help="only these; what they come after is not run")
    options = parser.parse_args(words)
    known = [step.name for step in STEPS]
    if unknown := [name for name in options.names if name not in known]:
        parser.error(f"there is no step {', '.join(unknown)}; there are {', '.join(known)}")
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends what runs, as Ctrl-C does
    run = Run([step for step in STEPS if not options.names or step.name in options.names], options.limit)
    begin = time.monotonic()
    passed = run.all_passed()
    word = "passed" if passed else "FAILED"
    print(*run.ends_of_failed(), f"== CI {word} in {time.monotonic() - begin:.0f} s", *run.table(), sep="\n")
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
