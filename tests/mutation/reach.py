# SPDX-License-Identifier: MIT
"""Measures which test reaches which function of an area, and how long it takes: the map that chooses a mutant's tests.

usage: python -m tests.mutation.reach OUT FILE... ; runs in the environment that :func:`measure` makes for it.
"""

from __future__ import annotations

import ctypes
import fnmatch
import hashlib
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from tests import native
from tests.mutation.builds import OUT, Area, Builder, BuildError, python, run
from tests.mutation.operators import FILE_SCOPE, Mutant
from tests.native import ROOT

LONGEST_S = 15.0
"""Processor time that the tests of a mutant usually may take together, building libraries left out."""
INSTRUMENTED = (
    *("-O1", "-fno-ipa-sra", "-fno-ipa-cp", "-finstrument-functions"),
    "-finstrument-functions-exclude-file-list=/usr/,/mavlink/",
)


class Reach:
    """The measured map of an area, kept in ``build/mutation``."""

    def __init__(self, area: Area) -> None:
        self._area = area
        self._path = OUT / f"{area.name}-reach.json"
        parts = [ROOT / part for part in area.tests]
        found = [path for part in parts for path in ([part] if part.is_file() else sorted(part.rglob("test_*.py")))]
        left_out = area.left_out or ("-",)
        self.test_files = [path for path in found if not path.relative_to(ROOT).as_posix().startswith(left_out)]
        """The files of tests that may find a mutant of the area."""
        self._map: dict[str, Any] = {"sources": "", "files": {}}
        if self._path.exists():
            self._map = json.loads(self._path.read_text(encoding="utf-8"))

    def update(self) -> None:
        """Measure what has changed since the last time. Raises BuildError."""
        sources = digest(sorted(path for path in self._area.folder.rglob("*") if path.is_file()))
        if self._map["sources"] != sources:
            self._map = {"sources": sources, "files": {}}
        files = {path.relative_to(ROOT).as_posix(): digest([path, *helpers(path)]) for path in self.test_files}
        stale = [name for name, value in files.items() if self._map["files"].get(name, {}).get("digest") != value]
        if stale:
            for name, tests in measure(self._area, stale).items():
                self._map["files"][name] = {"digest": files[name], "tests": tests}
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._path.write_text(json.dumps(self._map), encoding="utf-8")

    def tests(self) -> Iterator[tuple[str, float, frozenset[str]]]:
        """Yield each test with its seconds and the functions that it reaches."""
        for file in self.test_files:
            entry = self._map["files"].get(file.relative_to(ROOT).as_posix(), {"tests": {}})
            for test, (seconds, functions) in entry["tests"].items():
                yield test, seconds, frozenset(functions)

    def names(self) -> frozenset[str]:
        """Return the names of all tests that passed when they were last measured, and whose files still exist."""
        files = {path.relative_to(ROOT).as_posix() for path in self.test_files}
        return frozenset(test for file in files for test in self._map["files"].get(file, {}).get("tests", ()))

    def digest_of(self, file: str) -> str:
        """Return what tells whether a file of tests has changed; empty if there is none of this name."""
        path = ROOT / file
        return digest([path, *helpers(path)]) if path in self.test_files else ""

    def chosen(self, mutant: Mutant, neighbours: frozenset[str], longest_s: float = LONGEST_S) -> dict[str, float]:
        """Return the tests for a mutant with their seconds, those first that are cheap and about little else.

        ``neighbours`` are the functions of its file: they count if nothing reaches the function itself, as with
        constants and with what is computed by the compiler. A file without functions is everybody's.
        """
        reaching = [entry for entry in self.tests() if reached(mutant.symbol, entry[2])]
        if not reaching or mutant.function == FILE_SCOPE:
            reaching = [entry for entry in self.tests() if any(reached(symbol, entry[2]) for symbol in neighbours)]
        reaching = reaching or list(self.tests())
        reaching.sort(key=lambda entry: (entry[1] + 0.02) * (20 + len(entry[2])))
        result: dict[str, float] = {}
        for test, seconds, _ in reaching:
            if sum(result.values()) + seconds <= longest_s:
                result[test] = seconds
        return result


def reached(symbol: str, functions: frozenset[str]) -> bool:
    """Return whether a function, or of a template any that its pattern stands for, is among those that a test calls."""
    if "*" in symbol:
        return bool(fnmatch.filter(functions, symbol))
    return symbol in functions


def digest(paths: Sequence[Path]) -> str:
    """Return a short name of the contents of files."""
    total = hashlib.sha256()
    for path in paths:
        total.update(path.name.encode() + b"\0" + path.read_bytes())
    return total.hexdigest()[:16]


def helpers(test: Path) -> list[Path]:
    """Return what the tests of a folder share."""
    return sorted(path for path in test.parent.iterdir() if path.is_file() and not path.name.startswith("test_"))


def processor_s() -> float:
    """Return the processor time of this process and of its ended children: a busy machine changes it little."""
    return sum(os.times()[:4])


def measure(area: Area, files: Sequence[str]) -> dict[str, dict[str, tuple[float, list[str]]]]:
    """Run files of tests on an instrumented build; per file and passing test its seconds and functions."""
    builder = Builder(area, extra=INSTRUMENTED)
    product = builder.link(builder.compile_all())
    hook = OUT / "reach.so"
    run(["cc", "-O2", "-shared", "-fPIC", str(Path(__file__).with_suffix(".c")), "-o", str(hook), "-ldl"])
    folder = OUT / f"{area.name}-calls"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "test").write_bytes(bytes(4))
    (folder / "calls").touch()
    program, environment = python()
    environment |= builder.test_environment(None, product)
    environment |= {"LD_PRELOAD": str(hook), "OMNI_REACH": str(folder), "OMNI_OPTIONS": shlex.join(INSTRUMENTED)}
    environment["OMNI_LIBRARY"] = str(product) if area.name == "core" else ""
    out = folder / "reach.json"
    command = [program, "-m", "tests.mutation.reach", str(out), *files]
    done = subprocess.run(command, cwd=ROOT, env={**os.environ, **environment}, capture_output=True, text=True)
    if not out.exists():
        raise BuildError(f"tests on the instrumented build: {done.stdout[-2000:]}{done.stderr[-2000:]}")
    result: dict[str, dict[str, tuple[float, list[str]]]] = {file: {} for file in files}
    for test, entry in json.loads(out.read_text(encoding="utf-8")).items():
        result[test.split("::")[0]][test] = entry
    return result


class Recorder:
    """Notes each passing test's seconds and what it called.

    The time in which a test builds a library is left out. The first test that needs one would seem too long for any
    mutant, and the others free.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._number = 0
        self._begin_s = 0.0
        self._failed: set[str] = set()
        self._symbols: dict[str, dict[int, str]] = {}
        self._building_s = 0.0
        self.found: dict[str, tuple[float, list[str]]] = {}

    def watched(self, build: Callable[..., Path]) -> Callable[..., Path]:
        """Return ``build`` with its time left out."""

        def built(*arguments: Any, **options: Any) -> Path:
            begin_s = processor_s()
            try:
                return build(*arguments, **options)
            finally:
                self._building_s += processor_s() - begin_s

        return built

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self._number += 1
        with (self._folder / "test").open("r+b") as file:
            file.write(self._number.to_bytes(4, "little"))
        os.truncate(self._folder / "calls", 0)
        self._building_s = 0.0
        self._begin_s = processor_s()

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.outcome != "passed":
            self._failed.add(report.nodeid)

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        seconds = processor_s() - self._begin_s - self._building_s
        calls = set((self._folder / "calls").read_text(encoding="utf-8").splitlines())
        if nodeid not in self._failed:
            self.found[nodeid] = (round(seconds, 4), sorted({self._symbol(call) for call in calls} - {""}))

    def _symbol(self, call: str) -> str:
        place, path = call.split(" ", 1)
        if path not in self._symbols:
            listing = subprocess.run(["nm", "--defined-only", path], capture_output=True, text=True, check=False)
            rows = (line.split() for line in listing.stdout.splitlines())
            self._symbols[path] = {
                int(row[0], 16): re.sub(r"\.\w+(\.\d+)?$", "", row[2])
                for row in rows
                if len(row) == 3 and row[1] in "tTwW"
            }
        return self._symbols[path].get(int(place, 16), "")


def main(out: str, files: Sequence[str]) -> None:
    """Run the tests and write what was measured."""
    if os.environ["OMNI_LIBRARY"]:
        ctypes.CDLL(os.environ["OMNI_LIBRARY"], ctypes.RTLD_GLOBAL)
    recorder = Recorder(Path(os.environ["OMNI_REACH"]))
    native.build_library = recorder.watched(native.build_library)
    options = ["-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--tb=line", "-k", "not emulated"]
    pytest.main([*options, *files], plugins=[recorder])
    Path(out).write_text(json.dumps(recorder.found), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
