# SPDX-License-Identifier: MIT
"""Changes the core and the firmware in one small way after another and asks whether a test notices.

usage: python -m tests.mutation [--count N] [--seed N] [--area core|app] [--file NAME] [--function NAME] [--jobs N]
                                [--quick] [--floor PERCENT] [--so-far] [--write] [--list] [--verbose]

The sample is the same for the same seed; what has been found is kept in build/mutation/results.jsonl, so that an
interrupted run goes on. Survivors are printed as entries for tests/mutation/survivors.toml, where each is judged.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import chain
from pathlib import Path
from queue import Queue
from typing import Any

from tests.mutation import records
from tests.mutation.builds import OUT, Area, Builder, BuildError, areas, prepare_site, python, run
from tests.mutation.golden import Golden
from tests.mutation.operators import Mutant, chosen
from tests.mutation.reach import Reach, digest
from tests.mutation.records import GOLDEN, KILLED, REFUSED, SAME, SURVIVED, Result, Results
from tests.native import ROOT

RESULTS = OUT / "results.jsonl"
PAGE = ROOT / "docs" / "checks" / "testing.md"
AREAS = ("core", "app")
SILENT_S = 150.0
"""A test that says nothing for so long hangs. Only for what waits: what computes is stopped by its processor time."""
SLOW_S = 1800.0
"""The same for the unchanged program, when tests compile the firmware for the first time."""
FIRST = 12
"""Tests that are run before the files of all others are even loaded."""
MARKS = ("<!-- mutation: begin -->", "<!-- mutation: end -->")


class Runner:
    """The process that runs tests in forks of itself."""

    def __init__(self, area: Area, folder: Path) -> None:
        program, environment = python()
        self._folder = folder
        self._process = subprocess.Popen(
            [program, "-m", "tests.mutation.runner", "own" if area.name == "core" else "all", *area.tests],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            env={**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", **environment},
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._in, self._out = self._process.stdin, self._process.stdout
        if self._out.readline() != "ready\n":
            raise BuildError("the process that runs the tests does not start")

    def verdict(
        self, costs_s: dict[str, float], environment: dict[str, str], library: str, silent_s: float = SILENT_S
    ) -> dict[str, str]:
        """Return the test that failed and how."""
        folder = self._folder / "tmp"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        environment = {**environment, "TMPDIR": str(folder)}
        job = {"costs_s": costs_s, "environment": environment, "library": library, "folder": str(folder / "pytest")}
        job["silent_s"] = silent_s
        self._in.write(json.dumps(job) + "\n")
        self._in.flush()
        if not (line := self._out.readline()):
            raise BuildError("the process that runs the tests has ended: see its words above")
        answer: dict[str, str] = json.loads(line)
        return answer

    def close(self) -> None:
        """End it."""
        self._in.close()
        self._process.wait()


class Bench:
    """Tries mutants of one area, one at a time."""

    def __init__(self, area: Area, reach: Reach, functions: Mapping[str, frozenset[str]]) -> None:
        self._builder = Builder(area)
        self._area, self._reach, self._functions = area, reach, functions
        self._runner = Runner(area, self._builder.folder)
        self._golden = Golden(self._builder.folder / "golden") if area.name == "core" else None
        self._killers: dict[str, list[str]] = defaultdict(list)
        self._try_original()

    def close(self) -> None:
        """End the tests' process."""
        self._runner.close()

    def result(self, mutant: Mutant, digests: tuple[str, str]) -> Result:
        """Try one."""
        source, tests = digests
        compiled = self._builder.try_mutant(mutant)
        if compiled.refused:
            return Result(mutant.key, REFUSED, source, "", how=compiled.refused)
        if compiled.same or compiled.product is None:
            return Result(mutant.key, SAME, source, "")
        costs_s = self._order(mutant, self._reach.chosen(mutant, self._functions[mutant.file]))
        environment = self._builder.test_environment(mutant, compiled.product)
        library = str(compiled.product) if self._area.name == "core" else ""
        answer = self._first_failure(costs_s, environment, library)
        if answer["test"]:
            self._killers[mutant.function].insert(0, answer["test"])
            file = answer["test"].split("::")[0]
            return Result(mutant.key, KILLED, source, self._reach.digest_of(file), answer["test"], answer["how"])
        if self._golden is not None and self._golden.differs(compiled.product):
            return Result(mutant.key, GOLDEN, source, tests)
        return Result(mutant.key, SURVIVED, source, tests, how="" if costs_s else "no test reaches it")

    def _try_original(self) -> None:
        """Run a test of each file on the unchanged program: they must pass. Raises BuildError."""
        cheapest: dict[str, tuple[float, str]] = {}
        for test, seconds, _ in self._reach.tests():
            file = test.split("::")[0]
            cheapest[file] = min(cheapest.get(file, (seconds, test)), (seconds, test))
        product = self._builder.link({})
        environment = self._builder.test_environment(None, product)
        library = str(product) if self._area.name == "core" else ""
        answer = self._runner.verdict({test: s for s, test in cheapest.values()}, environment, library, SLOW_S)
        if answer["test"]:
            raise BuildError(f"{answer['test']}: {answer['how']} on the unchanged program; run make setup, make test")

    def _first_failure(self, costs_s: dict[str, float], environment: dict[str, str], library: str) -> dict[str, str]:
        """Run the tests; the first ones alone, because loading the files of all takes longer than those few."""
        tests = list(costs_s.items())
        for part in (tests[:FIRST], tests[FIRST:]):
            if part and (answer := self._runner.verdict(dict(part), environment, library))["test"]:
                return answer
        return {"test": "", "how": ""}

    def _order(self, mutant: Mutant, costs_s: dict[str, float]) -> dict[str, float]:
        """What killed the function's other mutants comes first."""
        first = list(dict.fromkeys(test for test in self._killers[mutant.function] if test in costs_s))[:5]
        return {test: costs_s[test] for test in [*first, *(test for test in costs_s if test not in first)]}


def try_all(
    area: Area, everything: Sequence[Mutant], mutants: Sequence[Mutant], results: Results, jobs: int
) -> Iterator[tuple[Mutant, Result]]:
    """Yield each of ``mutants``, some of ``everything`` in the area, with its result, known or found now."""
    reach = Reach(area)
    reach.update()
    tests = digest(reach.test_files)
    sources = {mutant.file: digest([ROOT / mutant.file]) for mutant in mutants}
    todo = []
    for mutant in mutants:
        known = results.get(mutant.key, sources[mutant.file], tests, reach.digest_of(results.killer(mutant.key)))
        if known is None:
            todo.append(mutant)
        else:
            yield mutant, known
    if not todo:
        return
    todo.sort(key=lambda mutant: mutant.file.endswith(".h"))  # headers are compiled many times: those last
    functions: dict[str, frozenset[str]] = defaultdict(frozenset)
    for mutant in everything:
        functions[mutant.file] |= {mutant.symbol} - {""}
    benches: Queue[Bench] = Queue()
    for _ in range(jobs):
        benches.put(Bench(area, reach, functions))

    def attempt(mutant: Mutant) -> tuple[Mutant, Result]:
        bench = benches.get()
        try:
            return mutant, bench.result(mutant, (sources[mutant.file], tests))
        finally:
            benches.put(bench)

    with ThreadPoolExecutor(jobs) as pool:
        for mutant, result in pool.map(attempt, todo):
            results.add(result)
            yield mutant, result
    for _ in range(jobs):
        benches.get().close()


def main() -> int:
    """Exit code 1 if fewer mutants are killed than the floor asks for."""
    options = _options()
    run([sys.executable, "-c", "import clang.cindex"])
    everything = {name: area for name, area in areas().items() if name in (options.area or AREAS)}
    if options.quick:
        everything = {name: replace(area, tests=area.tests[:1]) for name, area in everything.items()}
    mutants = {name: area.mutants() for name, area in everything.items()}
    wanted = [mutant for mutant in chain(*mutants.values()) if _asked_for(mutant, options)]
    sample = list(chosen(wanted, options.count or len(wanted), options.seed))
    sys.stdout.write(f"{len(sample)} of {len(wanted)} mutants, seed {options.seed}\n")
    if options.list:
        for mutant in sample:
            sys.stdout.write(f"{_words(mutant)}\n")
        return 0
    results, judged = Results(RESULTS), records.read_judgements()
    if options.so_far:
        found = ((m, results.found(m.key, digest([ROOT / m.file]))) for m in sample)
        known = [(mutant, result) for mutant, result in found if result is not None]
        return _tell(known, len(sample), judged, options, 0.0)
    prepare_site()
    pairs: list[tuple[Mutant, Result]] = []
    begin = time.monotonic()
    for name, area in everything.items():
        part = [mutant for mutant in sample if ROOT / mutant.file in set(area.folder.rglob("*"))]
        for mutant, result in try_all(area, mutants[name], part, results, options.jobs) if part else ():
            pairs.append((mutant, result))
            if options.verbose:
                sys.stdout.write(f"{result.outcome}: {_words(mutant)} {result.by} {result.how}\n")
                sys.stdout.flush()
    return _tell(pairs, len(sample), judged, options, time.monotonic() - begin)


def _asked_for(mutant: Mutant, options: Any) -> bool:
    return (not options.file or Path(mutant.file).name in options.file) and (
        not options.function or mutant.function in options.function
    )


def _words(mutant: Mutant) -> str:
    place = f"{Path(mutant.file).name}:{records.line_of(mutant)}"
    return f"{place} {mutant.function}, {mutant.operator}: {mutant.was} => {mutant.becomes}"


def _tell(
    pairs: Sequence[tuple[Mutant, Result]], wanted: int, judged: dict[str, Any], options: Any, seconds: float
) -> int:
    open_survivors = [m for m, r in pairs if r.outcome in (SURVIVED, GOLDEN) and m.key not in judged]
    for mutant in open_survivors:
        sys.stdout.write(f"\n# {_words(mutant)}\n{records.survivor_text(mutant)}\n")
    tables = records.report(pairs, judged)
    sys.stdout.write(f"\n{tables}\n\n{len(open_survivors)} survivors are not judged yet; {seconds:.0f} s\n")
    if options.write:
        words = " ".join(word for word in sys.argv[1:] if word not in ("--write", "--verbose"))
        _write(f"`python -m tests.mutation {words}`: {len(pairs)} of {wanted} mutants have been run.\n\n{tables}")
    percent = records.score(pairs, judged).killed_percent_of_different
    if percent < options.floor:
        sys.stderr.write(f"{percent:.1f} % of the mutants are killed, {options.floor:g} % must be\n")
        return 1
    return 0


def _write(text: str) -> None:
    before, rest = PAGE.read_text(encoding="utf-8").split(MARKS[0])
    behind = rest.split(MARKS[1])[1]
    PAGE.write_text(f"{before}{MARKS[0]}\n{text}\n{MARKS[1]}{behind}", encoding="utf-8")


def _options() -> Any:
    parser = argparse.ArgumentParser(description="Does a test notice when the core or the firmware is changed?")
    parser.add_argument("--count", type=int, default=0, help="size of the sample; 0: all [%(default)s]")
    parser.add_argument("--seed", type=int, default=1, help="[%(default)s]")
    parser.add_argument("--area", action="append", choices=AREAS, help="both by default")
    parser.add_argument("--file", action="append", help="only mutants of files of this name")
    parser.add_argument("--function", action="append", help="only mutants of this function")
    parser.add_argument("--jobs", type=int, default=1, help="mutants at a time [%(default)s]")
    parser.add_argument("--floor", type=float, default=0.0, help="percent that must be killed [%(default)s]")
    parser.add_argument("--quick", action="store_true", help="only with the tests of the area's own folder")
    parser.add_argument("--so-far", action="store_true", help="run nothing, tell of those that have been run")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/checks/testing.md")
    parser.add_argument("--list", action="store_true", help="only say which mutants are in the sample")
    parser.add_argument("--verbose", action="store_true", help="say what became of each")
    return parser.parse_args()


if __name__ == "__main__":
    try:
        sys.exit(main())
    except BuildError as problem:
        sys.exit(f"mutation: {problem}")
