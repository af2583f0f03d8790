# SPDX-License-Identifier: MIT
"""Runs the tests that a change can break: make test-changed.

usage: python -m tests.changed [--since REVISION] [--list] [-- options of pytest]

What changed is the difference from the merge base with the main branch, with what is not committed yet. Tests are found
by what they import, directly or not; for C code by the functions that each test reaches, where `make mutants` has
measured that (tests/mutation/reach.py), else by folder; for other files by who mentions their name.
"""

from __future__ import annotations

import argparse
import ast
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path, PurePosixPath

from tests.mutation.builds import areas
from tests.mutation.reach import Reach

ROOT = Path(__file__).resolve().parent.parent
ALWAYS = ("tests/structure",)
PACKAGES = {"omniwheel": "host", "omni_schema": "shared/generate"}
"""Where packages are that are not in the top folder."""
FOLDERS = (
    ("shared/core/", ("tests/core", "tests/hil_sim", "tests/e2e", "tests/firmware")),
    ("shared/", ("tests/generate", "tests/core", "tests/firmware", "tests/host", "tests/radio", "tests/hil_sim")),
    ("firmware/app/", ("tests/firmware", "tests/radio", "tests/e2e")),
    ("firmware/boards/", ("tests/boards", "tests/image", "tests/firmware")),
    ("hil_sim/", ("tests/hil_sim", "tests/e2e", "tests/studies")),
    ("host/native/", ("tests/core", "tests/hil_sim")),
    ("host/omni/studio/page/", ("tests/studio",)),
    ("docs/", ("tests/docs",)),
    ("cmake/", ("tests/core", "tests/e2e")),
)
"""Tests of files that are not Python, by the first prefix that fits."""
_FUNCTION = re.compile(r"^\w[^;{}=]*?\b(\w+)\(", re.MULTILINE)
_HUNK = re.compile(r"^@@ -\S+ \+(\d+)(?:,(\d+))? @@", re.MULTILINE)


def git(*words: str) -> str:
    """Return what git prints; nothing if it fails."""
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False).stdout.strip()


def base() -> str:
    """Return the revision that the change began from."""
    for branch in ("origin/HEAD", "origin/main", "main"):
        if found := git("merge-base", "HEAD", branch):
            return found
    return git("rev-parse", "HEAD")


def changed_files(since: str) -> list[str]:
    """Return the paths that differ from a revision, new and deleted files included."""
    new = git("ls-files", "--others", "--exclude-standard")
    return sorted({*git("diff", "--name-only", since).splitlines(), *new.splitlines()})


def module_file(name: str) -> str:
    """Return the path of a module of this repository; empty if it is another's."""
    place = PurePosixPath(PACKAGES.get(name.split(".")[0], "."), *name.split("."))
    for path in (place.with_suffix(".py"), place / "__init__.py"):
        if (ROOT / path).is_file():
            return str(path)
    return ""


@cache
def imported(path: Path) -> frozenset[str]:
    """Return the files of this repository that a Python file imports, with the packages around them."""
    package = path.relative_to(ROOT).parts[:-1]
    if package[:1] == ("host",) or package[:2] == ("shared", "generate"):
        package = package[1 if package[0] == "host" else 2 :]
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            start = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            whole = ".".join(part for part in (start, node.module or "") if part)
            names |= {whole, *(f"{whole}.{alias.name}" for alias in node.names)}
    return frozenset(module_file(name) for name in names) - {""}


def python_files() -> list[Path]:
    """Return the Python files that git knows or could know."""
    words = ("ls-files", "--cached", "--others", "--exclude-standard", "*.py")
    return [ROOT / path for path in git(*words).splitlines() if (ROOT / path).is_file()]


def importers(files: Iterable[Path]) -> Mapping[str, set[str]]:
    """Return for each file those that import it."""
    result: dict[str, set[str]] = defaultdict(set)
    for path in files:
        for target in imported(path):
            result[target].add(str(path.relative_to(ROOT)))
    return result


def all_behind(path: str, users: Mapping[str, set[str]]) -> set[str]:
    """Return a file and all that import it, directly or not."""
    found, waiting = {path}, [path]
    while waiting:
        for user in users.get(waiting.pop(), set()) - found:
            found.add(user)
            waiting.append(user)
    return found


def changed_functions(path: str, since: str) -> set[str]:
    """Return the functions of a C file that a change touches; empty if it touches something outside of functions."""
    file = ROOT / path
    if not file.is_file():
        return set()
    text = file.read_text(encoding="utf-8")
    starts = [(text.count("\n", 0, match.start()) + 1, match[1]) for match in _FUNCTION.finditer(text)]
    ends = [number for number, line in enumerate(text.splitlines(), 1) if line.startswith("}")]
    names = set()
    for first, count in _HUNK.findall(git("diff", "-U0", since, "--", path)):
        for line in range(int(first), int(first) + max(int(count or 1), 1)):
            before = [(start, name) for start, name in starts if start <= line]
            if not before or any(before[-1][0] < end < line for end in ends):
                return set()
            names.add(before[-1][1])
    return names


def reaching(path: str, since: str) -> set[str]:
    """Return the tests that reach what changed in a C file of core or app, by measurement; empty if not measured."""
    functions = changed_functions(path, since)
    found = set()
    for area in areas().values():
        if functions and (ROOT / path).is_relative_to(area.folder):
            for test, _, reached in Reach(area).tests():
                if any(function in symbol for function in functions for symbol in reached):
                    found.add(test)
    return found


def tests_for(paths: Iterable[str], since: str) -> list[str]:
    """Return files, folders and names of tests that a change of ``paths`` can break."""
    python = python_files()
    users = importers(python)
    test_files = {str(path.relative_to(ROOT)): path for path in python if path.name.startswith("test_")}
    chosen: set[str] = set(ALWAYS)
    for path in paths:
        if path.endswith("conftest.py"):
            chosen.add(str(PurePosixPath(path).parent))
        elif path.endswith(".py"):
            chosen |= all_behind(path, users) & test_files.keys()
        elif tests := reaching(path, since):
            chosen |= tests
        else:
            chosen |= next((set(tests) for prefix, tests in FOLDERS if path.startswith(prefix)), set())
            name = PurePosixPath(path).name
            chosen |= {test for test, file in test_files.items() if name in file.read_text(encoding="utf-8")}
    return without_inner(chosen)


def without_inner(chosen: Iterable[str]) -> list[str]:
    """Return paths and test names without those that another one contains."""
    names = set(chosen)
    outer = {name: {name.split("::")[0], *map(str, PurePosixPath(name.split("::")[0]).parents)} for name in names}
    return sorted(name for name in names if not (outer[name] - {name}) & names)


def main() -> int:
    """Run the command line; the exit code is pytest's."""
    parser = argparse.ArgumentParser(description="run the tests that a change can break")
    parser.add_argument("--since", help="revision to compare with (default: merge base with the main branch)")
    parser.add_argument("--list", action="store_true", help="only print the tests")
    parser.add_argument("options", nargs="*", help="options of pytest, after --")
    options = parser.parse_args()
    since = options.since or base()
    tests = tests_for(changed_files(since), since)
    sys.stdout.write("\n".join(tests) + "\n")
    sys.stdout.flush()
    if options.list:
        return 0
    return subprocess.run([sys.executable, "-m", "pytest", *options.options, *tests], cwd=ROOT, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
