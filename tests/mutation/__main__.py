# SPDX-License-Identifier: MIT
"""Changes the core and the firmware in one small way after another and asks whether a test notices.

usage: python -m tests.mutation [--count N] [--seed N] [--area core|app] [--file NAME] [--function NAME] [--jobs N]
                                [--longest SECONDS] [--quick] [--floor PERCENT] [--so-far] [--recheck] [--old-map]
                                [--write] [--list] [--verbose]

The sample is the same for the same seed; what has been found is kept in build/mutation/results.jsonl, so that an
interrupted run goes on. A kill is carried over from older sources if the mutant's function reads as it did and the
test that killed still exists; --recheck tries those again, too, with that test first. --old-map spares the measurement
of which test reaches what after a change: a function that is new gets the tests of its file, or all. Survivors are
printed as entries for tests/mutation/survivors.toml, where each is judged. --longest 400 tries them with more of the
tests that reach them first: what every test reaches gets only the cheapest ones otherwise.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import textwrap
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
from tests.mutation.builds import OUT, Area, Builder, BuildError, areas, prepare_site, run
from tests.mutation.golden import Golden
from tests.mutation.operators import Mutant, chosen
from tests.mutation.process import Runner
from tests.mutation.reach import LONGEST_S, Reach, digest
from tests.mutation.records import GOLDEN, KILLED, REFUSED, SAME, SURVIVED, Result, Results
from tests.native import ROOT

RESULTS = OUT / "results.jsonl"
PAGE = ROOT / "tests" / "mutation" / "results.md"
AREAS = ("core", "app")
SLOW_S = 1800.0
"""Longest silence of the unchanged program, when tests compile the firmware for the first time."""
FIRST = 12
"""Tests that are run before the files of all others are even loaded."""
MARKS = ("<!-- mutation: begin -->", "<!-- mutation: end -->")


Verdict = tuple[Mutant, Result, bool]
"""The last part tells whether the result is carried over from other sources."""


class Bench:
    """Tries mutants of one area, one at a time."""

    def __init__(
        self, area: Area, reach: Reach, functions: Mapping[str, frozenset[str]], longest_s: float = LONGEST_S
    ) -> None:
        self._builder = Builder(area)
        self._longest_s = longest_s
        self._area, self._reach, self._functions = area, reach, functions
        self._runner = Runner(area, self._builder.folder)
        self._golden = Golden(self._builder.folder / "golden") if area.name == "core" else None
        self._killers: dict[str, list[str]] = defaultdict(list)
        self._costs_s = {test: seconds for test, seconds, _ in reach.tests()}
        self._try_original()

    def close(self) -> None:
        """End the tests' process."""
        self._runner.close()

    def result(self, mutant: Mutant, digests: tuple[str, str], killer: str) -> Result:
        """Try one; ``killer``: the test that killed it the last time comes first."""
        source, tests = digests
        compiled = self._builder.try_mutant(mutant)
        if compiled.refused:
            return Result(mutant.key, REFUSED, source, "", how=compiled.refused)
        if compiled.same or compiled.product is None:
            return Result(mutant.key, SAME, source, "")
        costs_s = self._order(mutant, self._reach.chosen(mutant, self._functions[mutant.file], self._longest_s))
        environment = self._builder.test_environment(mutant, compiled.product)
        library = str(compiled.product) if self._area.name == "core" else ""
        known = {killer: self._costs_s[killer]} if killer in self._costs_s else {}
        answer = self._first_failure(known, costs_s, environment, library)
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

    def _first_failure(
        self, known: dict[str, float], costs_s: dict[str, float], environment: dict[str, str], library: str
    ) -> dict[str, str]:
        """Run the known killer and then the tests, the first ones alone: loading all files takes longer than those."""
        tests = [(test, seconds) for test, seconds in costs_s.items() if test not in known]
        for part in (list(known.items()), tests[:FIRST], tests[FIRST:]):
            if part and (answer := self._runner.verdict(dict(part), environment, library))["test"]:
                return answer
        return {"test": "", "how": ""}

    def _order(self, mutant: Mutant, costs_s: dict[str, float]) -> dict[str, float]:
        """What killed the function's other mutants comes first."""
        first = list(dict.fromkeys(test for test in self._killers[mutant.function] if test in costs_s))[:5]
        return {test: costs_s[test] for test in [*first, *(test for test in costs_s if test not in first)]}


def try_all(
    area: Area, everything: Sequence[Mutant], mutants: Sequence[Mutant], results: Results, options: Any
) -> Iterator[Verdict]:
    """Yield each of ``mutants``, some of ``everything`` in the area, with its result, known or found now."""
    reach = Reach(area)
    if not options.old_map:
        reach.update()
    tests, names = digest(reach.test_files), reach.names()
    sources = {mutant.file: digest([ROOT / mutant.file]) for mutant in mutants}
    todo = []
    for mutant in mutants:
        test_file = reach.digest_of(results.killer(mutant.key).split("::")[0])
        if known := results.get(mutant.key, sources[mutant.file], tests, test_file, options.longest):
            yield mutant, known, False
        elif not options.recheck and (known := results.carried(mutant, names)):
            yield mutant, known, True
        else:
            todo.append(mutant)
    if not todo:
        return
    todo.sort(key=lambda mutant: mutant.file.endswith(".h"))  # headers are compiled many times: those last
    functions: dict[str, frozenset[str]] = defaultdict(frozenset)
    for mutant in everything:
        functions[mutant.file] |= {mutant.symbol} - {""}
    benches: Queue[Bench] = Queue()
    for _ in range(options.jobs):
        benches.put(Bench(area, reach, functions, options.longest))
    state = commit()

    def attempt(mutant: Mutant) -> tuple[Mutant, Result]:
        bench = benches.get()
        try:
            result = bench.result(mutant, (sources[mutant.file], tests), results.killer(mutant.key))
            return mutant, replace(result, text=mutant.text, commit=state, longest_s=options.longest)
        finally:
            benches.put(bench)

    with ThreadPoolExecutor(options.jobs) as pool:
        for mutant, result in pool.map(attempt, todo):
            results.add(result)
            yield mutant, result, False
    for _ in range(options.jobs):
        benches.get().close()


def commit() -> str:
    """Return the commit, and whether the work tree differs from it."""
    command = ["git", "describe", "--always", "--dirty", "--exclude", "*"]
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def known_so_far(everything: Mapping[str, Area], sample: Sequence[Mutant], results: Results) -> list[Verdict]:
    """Return what is known of a sample without running anything."""
    names = frozenset(chain(*(Reach(area).names() for area in everything.values())))
    found: list[Verdict] = []
    for mutant in sample:
        result = results.found(mutant.key, digest([ROOT / mutant.file]))
        if result and (result.outcome != KILLED or result.by in names):
            found.append((mutant, result, False))
        elif result := results.carried(mutant, names):
            found.append((mutant, result, True))
    return found


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
        return _tell(known_so_far(everything, sample, results), len(sample), judged, options, 0.0)
    prepare_site()
    verdicts: list[Verdict] = []
    begin = time.monotonic()
    for name, area in everything.items():
        part = [mutant for mutant in sample if ROOT / mutant.file in set(area.folder.rglob("*"))]
        for verdict in try_all(area, mutants[name], part, results, options) if part else ():
            verdicts.append(verdict)
            if options.verbose:
                mutant, result, _ = verdict
                sys.stdout.write(f"{result.outcome}: {_words(mutant)} {result.by} {result.how}\n")
                sys.stdout.flush()
    return _tell(verdicts, len(sample), judged, options, time.monotonic() - begin)


def _asked_for(mutant: Mutant, options: Any) -> bool:
    return (not options.file or Path(mutant.file).name in options.file) and (
        not options.function or mutant.function in options.function
    )


def _words(mutant: Mutant) -> str:
    place = f"{Path(mutant.file).name}:{records.line_of(mutant)}"
    return f"{place} {mutant.function}, {mutant.operator}: {mutant.was} => {mutant.becomes}"


def _tell(verdicts: Sequence[Verdict], wanted: int, judged: dict[str, Any], options: Any, seconds: float) -> int:
    pairs = [(mutant, result) for mutant, result, _ in verdicts]
    open_survivors = [m for m, r in pairs if r.outcome in (SURVIVED, GOLDEN) and m.key not in judged]
    for mutant in open_survivors:
        sys.stdout.write(f"\n# {_words(mutant)}\n{records.survivor_text(mutant)}\n")
    origins = records.origins(pairs, {mutant.key for mutant, _, carried in verdicts if carried})
    tables = f"{textwrap.fill(origins, 118)}\n\n{records.report(pairs, judged)}"
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
    parser.add_argument(
        "--longest", type=float, default=LONGEST_S, help="processor time of a mutant's tests together [%(default)s]"
    )
    parser.add_argument("--quick", action="store_true", help="only with the tests of the area's own folder")
    parser.add_argument("--so-far", action="store_true", help="run nothing, tell of those that have been run")
    parser.add_argument("--old-map", action="store_true", help="choose tests by the last measurement, however old")
    parser.add_argument("--recheck", action="store_true", help="carry no kill over from other sources")
    parser.add_argument("--write", action="store_true", help="put the tables into results.md")
    parser.add_argument("--list", action="store_true", help="only say which mutants are in the sample")
    parser.add_argument("--verbose", action="store_true", help="say what became of each")
    return parser.parse_args()


if __name__ == "__main__":
    try:
        sys.exit(main())
    except BuildError as problem:
        sys.exit(f"mutation: {problem}")
