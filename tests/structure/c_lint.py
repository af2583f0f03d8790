# SPDX-License-Identifier: MIT
"""Runs clang-tidy or cppcheck over what a compile database lists, but for what has passed (tests/kept.py).

usage: python -m tests.structure.c_lint clang-tidy|cppcheck BUILD [option of the tool ...]

clang-tidy looks at each file by itself, cppcheck at all of them together. Exit code 1: one of them complains.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests import kept

ROOT = kept.ROOT
PROCESSES = 2
AT_ONCE = 4
"""Files that one process of clang-tidy gets."""
LEFT_OUT = re.compile(r"/generated/|/hil_sim/lanes/(.*[.]cpp|pack[.]c)$")
"""Lanes consist of the core's sources, which are checked as C. pack.c has intrinsics, and gcc's header is for gcc."""
CPPCHECK = (
    *("--quiet", "--inline-suppr", "-j", str(PROCESSES), "--enable=warning,performance,portability"),
    *("--error-exitcode=1", "--suppress=missingInclude", "--suppress=missingIncludeSystem"),
    "--suppress=unmatchedSuppression",
)
SETTINGS = {"clang-tidy": (".clang-tidy",), "cppcheck": ()}


def digests(tool: str, database: Path, options: Sequence[str]) -> dict[Path, str]:
    """Return, by each source of the database, a digest of all that the tool sees of it."""
    settings = [(ROOT / name).read_text(encoding="utf-8") for name in SETTINGS[tool]]
    more = (kept.version_of(tool), *settings, *options)
    sources = kept.compiled_sources(database)
    return {
        source: kept.source_digest(source, command, folder, *more)
        for source, (command, folder) in sorted(sources.items())
        if not LEFT_OUT.search(str(source))
    }


def clang_tidy(build: Path, options: Sequence[str]) -> bool:
    """Run clang-tidy over what is not kept; return whether it has no complaint."""
    inputs = digests("clang-tidy", build / "compile_commands.json", options)
    names = {source: f"clang-tidy: {source.relative_to(ROOT)}" for source in inputs}
    wanted = [source for source in inputs if not kept.has_passed(names[source], inputs[source])]
    groups = [wanted[i : i + AT_ONCE] for i in range(0, len(wanted), AT_ONCE)]

    def run(group: Sequence[Path]) -> bool:
        command = ["clang-tidy", "--quiet", "-p", str(build), *options, *map(str, group)]
        return subprocess.run(command, cwd=ROOT, stderr=subprocess.DEVNULL, check=False).returncode == 0

    with ThreadPoolExecutor(PROCESSES) as pool:
        good = list(pool.map(run, groups))
    sys.stdout.write(f"clang-tidy: {len(wanted)} of {len(inputs)} files, the rest is kept\n")
    passed = [source for group, is_good in zip(groups, good, strict=True) if is_good for source in group]
    kept.note_passed((names[source], inputs[source]) for source in passed)
    kept.drop("clang-tidy: ", names.values())
    return all(good)


def cppcheck(build: Path, options: Sequence[str]) -> bool:
    """Run cppcheck unless it has passed; return whether it has no complaint."""
    inputs = kept.digest(*digests("cppcheck", build / "compile_commands.json", (*CPPCHECK, *options)).values())
    if kept.has_passed("cppcheck", inputs):
        sys.stdout.write("cppcheck: kept\n")
        return True
    places = [f"--project={build}/compile_commands.json", f"-i{build}", f"-i{ROOT}/hil_sim/lanes"]
    command = ["cppcheck", *places, f"--suppress=*:{ROOT / build}/*", *CPPCHECK, *options]
    good = subprocess.run(command, cwd=ROOT, check=False).returncode == 0
    if good:
        kept.note_passed([("cppcheck", inputs)])
    return good


def main() -> int:
    """Run the command line and return its exit code."""
    tool, build, *options = sys.argv[1:]
    return 0 if {"clang-tidy": clang_tidy, "cppcheck": cppcheck}[tool](Path(build), options) else 1


if __name__ == "__main__":
    sys.exit(main())
