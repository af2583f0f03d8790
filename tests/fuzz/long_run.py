# SPDX-License-Identifier: MIT
"""Long seeded runs of the fuzzers, in batches that do not depend on each other: interrupted, they go on.

usage: python -m tests.fuzz.long_run [--jobs N] [--write] [TARGET=INPUTS...]

Most batches run without sanitizers, because that is eight times faster; one in twenty of the app's runs with them. What
has been done stands in build/nightly/fuzz, one file per program: programs that were built from other sources begin
anew. --write puts the figures into docs/checks/fuzzing.md. Exit code 1 if something was found.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.fuzz import fuzz

STATE = fuzz.ROOT / "build" / "nightly" / "fuzz"
PAGE = fuzz.ROOT / "docs" / "checks" / "fuzzing.md"
BEGIN, END = "<!-- long runs: python -m tests.fuzz.long_run --write -->", "<!-- end of long runs -->"


@dataclass(frozen=True)
class Plan:
    """How a target is run: inputs in all, of at most so many bytes, in batches; every so many one with sanitizers."""

    inputs: int
    longest: int
    batch: int
    sanitized_every: int

    def batches(self) -> int:
        """Return how many batches there are."""
        return -(-self.inputs // self.batch)

    def build_of(self, batch: int) -> str:
        """Return what the program of this batch is built with."""
        return "sanitizers" if batch % self.sanitized_every == 0 else "nothing"


PLANS = {
    "parser": Plan(1_000_000_000, 256, 5_000_000, 100),
    "app": Plan(10_000_000, 1000, 20_000, 20),
    "sequence": Plan(10_000_000, 512, 20_000, 20),
    "store": Plan(10_000_000, 1000, 100_000, 20),
}


@dataclass
class Campaign:
    """What one target has done; its file is written after every batch."""

    target: str
    plan: Plan
    seed: int
    programs: dict[str, Path]
    path: Path
    commit: str
    done: dict[str, dict[str, Any]]

    def save(self) -> None:
        """Write the file whole or not at all."""
        state = {"target": self.target, "seed": self.seed, "commit": self.commit, **vars(self.plan), "done": self.done}
        part = self.path.with_suffix(".part")
        part.write_text(json.dumps(state), encoding="utf-8")
        part.replace(self.path)

    def command(self, batch: int) -> list[str]:
        """Return the command of one batch."""
        count = min(self.plan.batch, self.plan.inputs - batch * self.plan.batch)
        numbers = (self.seed, batch, count, self.plan.longest)
        return [str(self.programs[self.plan.build_of(batch)]), *(str(number) for number in numbers)]

    def total(self, name: str, build: str | None = None) -> float:
        """Return the sum of a figure over all batches, or those of one build."""
        chosen = (figures for batch, figures in self.done.items() if build in (None, self.plan.build_of(int(batch))))
        return float(sum(figures[name] for figures in chosen))


def commit() -> str:
    """Return the commit, and whether the work tree differs from it."""
    command = ["git", "describe", "--always", "--dirty", "--exclude", "*"]
    return subprocess.run(command, cwd=fuzz.ROOT, check=True, capture_output=True, text=True).stdout.strip()


def campaign(target: str, inputs: int, seed: int) -> Campaign:
    """Return what there is to do, with what has been done already by these very programs."""
    plan = Plan(**{**vars(PLANS[target]), "inputs": inputs})
    built = {name: fuzz.program(target, name) for name in ("nothing", "sanitizers")}
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in built.values()))
    digest.update(f"{seed} {plan.longest} {plan.batch} {plan.sanitized_every}".encode())
    folder = STATE / f"{target}-{digest.hexdigest()[:12]}"
    folder.mkdir(parents=True, exist_ok=True)
    programs = {}
    for name, path in built.items():  # copies: a build in between does not change what runs
        programs[name] = folder / name
        if not programs[name].exists():
            shutil.copy2(path, programs[name])
    path = folder / "state.json"
    state: dict[str, Any] = {"commit": commit(), "done": {}}
    if path.exists():
        state = json.loads(path.read_text(encoding="utf-8"))
    return Campaign(target, plan, seed, programs, path, state["commit"], state["done"])


def run_batch(run: Campaign, batch: int) -> dict[str, Any] | str:
    """Run one batch. Returns its figures, or what was found."""
    last = run.path.parent / f"finding-{batch}"
    environment = {**os.environ, "FUZZ_LAST": str(last)}
    begin = time.monotonic()
    done = subprocess.run(
        run.command(batch), capture_output=True, text=True, errors="replace", env=environment, check=False
    )
    if done.returncode != 0:
        return f"exit code {done.returncode}, input in {last}\n{done.stdout[-2000:]}{done.stderr[-4000:]}"
    figures: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return {**figures, "seconds": time.monotonic() - begin}


def go_on(run: Campaign, jobs: int) -> bool:
    """Do what is left of a campaign. Returns False at the first finding."""
    left = [batch for batch in range(run.plan.batches()) if str(batch) not in run.done]
    with ThreadPoolExecutor(jobs) as pool:
        waiting = {pool.submit(run_batch, run, batch): batch for batch in left}
        for future in as_completed(waiting):
            result = future.result()
            if isinstance(result, str):
                for other in waiting:
                    other.cancel()
                sys.stdout.write(f"{run.target}: FOUND SOMETHING in batch {waiting[future]}: {result}\n")
                return False
            run.done[str(waiting[future])] = result
            run.save()
    sys.stdout.write(f"{run.target}: nothing found in {run.total('executions'):.0f} inputs\n")
    return True


def rate(run: Campaign, name: str, build: str) -> str:
    """Return a figure per second of one process of one build."""
    seconds = run.total("seconds", build)
    return f"{run.total(name, build) / seconds:.0f}" if seconds > 0 else "-"


def table(runs: list[Campaign]) -> str:
    """Return the figures in Markdown."""
    lines = [
        "| Target | Inputs | Wanted | Bytes each, at most | Frames | Ticks | … driving | Stops, … in motion | "
        "Inputs/s of a process: plain, sanitized | Ticks/s | Commit |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for run in runs:
        total = {name: f"{run.total(name):.0f}" for name in ("executions", "frames", "ticks", "driving_ticks")}
        stops = f"{run.total('stops'):.0f}, {run.total('stops_in_motion'):.0f}"
        speed = [rate(run, "executions", build) for build in ("nothing", "sanitizers")]
        ticks = [rate(run, "ticks", build) for build in ("nothing", "sanitizers")]
        lines.append(
            f"| `{run.target}` | {total['executions']} | {run.plan.inputs} | {run.plan.longest} | {total['frames']} | "
            f"{total['ticks']} | {total['driving_ticks']} | {stops} | {', '.join(speed)} | {', '.join(ticks)} | "
            f"{run.commit} |"
        )
    return "\n".join(lines)


def latest() -> list[Campaign]:
    """Return the latest run of each target, whatever its programs were built from: the table names the commit."""
    runs: dict[str, Campaign] = {}
    for path in sorted(STATE.glob("*/state.json"), key=lambda path: path.stat().st_mtime):
        state = json.loads(path.read_text(encoding="utf-8"))
        plan = Plan(*(state[name] for name in ("inputs", "longest", "batch", "sanitized_every")))
        runs[state["target"]] = Campaign(state["target"], plan, state["seed"], {}, path, state["commit"], state["done"])
    return [runs[target] for target in PLANS if target in runs]


def write_page(runs: list[Campaign]) -> None:
    """Put the table between its marks."""
    text = PAGE.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    PAGE.write_text(f"{before}{BEGIN}\n{table(runs)}\n{END}{rest.split(END)[1]}", encoding="utf-8")


def wanted(argument: str) -> tuple[str, int]:
    """Read TARGET or TARGET=INPUTS. Raises ArgumentTypeError."""
    target, _, number = argument.partition("=")
    if target not in PLANS:
        raise argparse.ArgumentTypeError(f"there is no long run of {target}; there are {', '.join(PLANS)}")
    if number and not (number.isdigit() and int(number) > 0):
        raise argparse.ArgumentTypeError(f"{argument}: a number of inputs is wanted, as in {target}=1000000")
    return target, int(number) if number else PLANS[target].inputs


def main() -> int:
    """Run what was asked for; exit code 1 if something was found."""
    parser = argparse.ArgumentParser(description="Long seeded runs of the fuzzers; interrupted, they go on later.")
    parser.add_argument("targets", nargs="*", type=wanted, metavar="TARGET=INPUTS", help="all by default")
    parser.add_argument("--seed", type=int, default=1, help="[%(default)s]")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes [%(default)s]")
    parser.add_argument("--write", action="store_true", help="put what is done so far into docs/checks/fuzzing.md")
    options = parser.parse_args()
    if options.write:
        write_page(latest())
        return 0
    for name in ("nothing", "sanitizers"):
        fuzz.build([f"seeded_{target}" for target in PLANS], name)
    targets = options.targets or [(target, plan.inputs) for target, plan in PLANS.items()]
    runs = [campaign(target, inputs, options.seed) for target, inputs in targets]
    good = True
    for run in runs:
        good = go_on(run, options.jobs) and good
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
