# SPDX-License-Identifier: MIT
"""Which tests passed for a commit, so that CI does not repeat on one machine what has passed on the other.

Every run writes build/tests-passed.txt: the commit, then a line per test. ``--passed FILE`` leaves these tests out, if
the file is of this commit and nothing has been changed since.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
RECORD = ROOT / "build" / "tests-passed.txt"


def add_option(parser: pytest.Parser) -> None:
    """Add --passed."""
    parser.addoption("--passed", metavar="FILE", help="leave out the tests that FILE says have passed for this commit")


def commit(folder: Path) -> str:
    """Return the commit that a working tree holds unchanged; "" if it was changed or is none of git's."""
    try:
        state = subprocess.run(
            ["git", "-C", str(folder), "status", "--porcelain=v2", "--branch", "--untracked-files=no"],
            capture_output=True, text=True, check=True, timeout=60.0,
        ).stdout.splitlines()  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return ""
    found = [line.split()[2] for line in state if line.startswith("# branch.oid ")]
    changed = any(not line.startswith("#") for line in state)
    return found[0] if found and not changed else ""


def write(path: Path, revision: str, names: Iterable[str]) -> None:
    """Write which tests passed; a name may have any characters."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(f"{line}\n" for line in (revision, *map(json.dumps, sorted(set(names))))), encoding="utf-8")


def read(path: Path, revision: str) -> frozenset[str]:
    """Return the tests that passed; none if the file is not there or is of another commit, or if there is no commit."""
    try:
        first, *lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return frozenset()
    return frozenset(map(json.loads, lines)) if revision and first == revision else frozenset()


def leave_out(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect what has passed, if --passed is given."""
    given = config.getoption("passed")
    if given is None:
        return
    done = read(Path(given), commit(ROOT))
    config.hook.pytest_deselected(items=[item for item in items if item.nodeid in done])
    items[:] = [item for item in items if item.nodeid not in done]


def record(reports: Iterable[pytest.TestReport]) -> None:
    """Write the tests of a run that passed."""
    write(RECORD, commit(ROOT), (report.nodeid for report in reports if report.when == "call"))
