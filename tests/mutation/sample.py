# SPDX-License-Identifier: MIT
"""The small sample of every nightly run: mutants that a named test kills, tried again with that test alone.

usage: python -m tests.mutation.sample [--write]

tests/mutation/sample.jsonl names them: file, function, key and the test. They are the first of a seed's order that the
last run in build/mutation killed and whose test is quick, so the choice depends on no commit. A mutant is found by its
function and by its line before and after, wherever they are now. One whose line has changed is left out and said so;
--write chooses anew. Exit code 1 if fewer are killed than FLOOR_PERCENT, fewer by make test alone than
FAST_FLOOR_PERCENT, or if too many are left out.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from tests.mutation.builds import OUT, Area, Builder, BuildError, areas, prepare_site
from tests.mutation.operators import Mutant, chosen
from tests.mutation.process import Runner
from tests.mutation.reach import Reach
from tests.mutation.records import Results
from tests.native import ROOT

KEPT = Path(__file__).with_name("sample.jsonl")
FLOOR_PERCENT = 95.0
"""The one place that says how many of the sample must be killed."""
FAST_FLOOR_PERCENT = 90.0
"""How many of the sample tests of the fast tier must kill: what make test alone finds."""
LEFT_OUT_PERCENT = 40.0
"""More than that, and the sample says little any more: choose anew."""
SEED = 1
COUNTS = {"core": 40, "app": 20}
QUICK_S = 1.0


@dataclass(frozen=True)
class Kept:
    """A mutant of the sample; ``seconds`` is the processor time of its test on the unchanged program."""

    area: str
    file: str
    function: str
    key: str
    by: str
    seconds: float


def read(path: Path = KEPT) -> list[Kept]:
    """Return the sample."""
    return [Kept(**json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines()]


def choose(name: str, area: Area, mutants: Sequence[Mutant], results: Results) -> list[Kept]:
    """Return the first of the seed's order that were killed by quick tests; no header, which many sources include."""
    costs_s = {test: seconds for test, seconds, _ in Reach(area).tests()}
    kept = []
    for mutant in chosen(mutants, len(mutants), SEED):
        result = results.carried(mutant, costs_s)
        if result is None or mutant.file.endswith(".h") or costs_s[result.by] > QUICK_S or result.how != "failed":
            continue
        kept.append(Kept(name, Path(mutant.file).name, mutant.function, mutant.key, result.by, costs_s[result.by]))
        if len(kept) == COUNTS[name]:
            break
    return kept


def survivors(area: Area, mutants: Mapping[str, Mutant], kept: Sequence[Kept]) -> list[Kept]:
    """Try those of an area with their tests. Raises BuildError if one of these fails on the unchanged program."""
    files = sorted({entry.by.split("::")[0] for entry in kept})
    builder = Builder(area)
    runner = Runner(replace(area, tests=tuple(files)), builder.folder)

    def killed(mutant: Mutant | None, product: Path, tests: dict[str, float]) -> str:
        library = str(product) if area.name == "core" else ""
        return runner.verdict(tests, builder.test_environment(mutant, product), library)["test"]

    if test := killed(None, builder.link({}), {entry.by: entry.seconds for entry in kept}):
        raise BuildError(f"{test} fails on the unchanged program; run make setup, make test")
    alive = []
    for entry in kept:
        mutant = mutants[entry.key]
        compiled = builder.try_mutant(mutant)
        if compiled.product is None or not killed(mutant, compiled.product, {entry.by: entry.seconds}):
            alive.append(entry)
    runner.close()
    return alive


def fast_tests(files: Iterable[str]) -> frozenset[str]:
    """Return the names of the tests in ``files`` that make test runs."""
    there = sorted(file for file in files if (ROOT / file).exists())
    words = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider", "--tier", "fast", *there]
    listing = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False).stdout
    return frozenset(line for line in listing.splitlines() if "::" in line)


def check(kept: Sequence[Kept]) -> int:
    """Try the sample and say how it went; exit code."""
    prepare_site()
    by_area: dict[str, list[Kept]] = defaultdict(list)
    for entry in kept:
        by_area[entry.area].append(entry)
    fast = fast_tests({entry.by.split("::")[0] for entry in kept})
    by_fast, tried, alive = 0, 0, []
    for name, entries in by_area.items():
        area = areas()[name]
        mutants = {mutant.key: mutant for mutant in area.mutants()}
        here = [entry for entry in entries if entry.key in mutants and (ROOT / entry.by.split("::")[0]).exists()]
        tried += len(here)
        alive += (lost := survivors(area, mutants, here))
        by_fast += sum(entry.by in fast for entry in here if entry not in lost)
    for entry in alive:
        sys.stdout.write(f"not killed by {entry.by}: {entry.function} in {entry.file}, {entry.key}\n")
    percent, fast_percent = (100.0 * count / max(tried, 1) for count in (tried - len(alive), by_fast))
    left_out = len(kept) - tried
    sys.stdout.write(
        f"{tried - len(alive)} of {tried} mutants are killed, {percent:.1f} %, {FLOOR_PERCENT:g} % must be; "
        f"{left_out} of the sample's {len(kept)} lines or tests are gone\n"
        f"by make test alone: {by_fast}, {fast_percent:.1f} %, {FAST_FLOOR_PERCENT:g} % must be\n"
    )
    if 100.0 * left_out > LEFT_OUT_PERCENT * len(kept):
        sys.stderr.write("the sample is too old: make mutants, then python -m tests.mutation.sample --write\n")
        return 1
    return 0 if percent >= FLOOR_PERCENT and fast_percent >= FAST_FLOOR_PERCENT else 1


def main() -> int:
    """Try the sample, or choose it."""
    parser = argparse.ArgumentParser(description="A few mutants that must be killed, each by the test that did so.")
    parser.add_argument("--write", action="store_true", help="choose anew from the last run in build/mutation")
    options = parser.parse_args()
    if not options.write:
        return check(read())
    results = Results(OUT / "results.jsonl")
    kept = [entry for name, area in areas().items() for entry in choose(name, area, area.mutants(), results)]
    KEPT.write_text("".join(json.dumps(asdict(entry)) + "\n" for entry in kept), encoding="utf-8")
    sys.stdout.write(f"{len(kept)} mutants are kept in {KEPT.name}\n")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except BuildError as problem:
        sys.exit(f"mutation: {problem}")
