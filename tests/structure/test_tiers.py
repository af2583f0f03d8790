# SPDX-License-Identifier: MIT
"""Tiers, time limits and the table of what is missing, in a pytest run of its own with this project's hooks."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.needs import NEEDS, ROOT

CONFTEST = """
from tests.conftest import *
needs.NEEDS["kit"] = needs.Need("kits", "get kit", ("no-such-program",))
"""
TESTS = """
import time
import pytest
def test_fast(): pass
@pytest.mark.full
def test_full(): pass
@pytest.mark.nightly
def test_nightly(): pass
@pytest.mark.needs("kit")
@pytest.mark.parametrize("k", range(3))
def test_kit(k): pass
@pytest.mark.full
@pytest.mark.timeout(0.2)
def test_endless():
    while True: time.sleep(0.01)
"""
INI = "[pytest]\ntestpaths = .\ntimeout = 60\nmarkers =\n  full: x\n  nightly: x\n  needs: x\n"


Run = Callable[..., tuple[str, int]]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Run pytest on TESTS with options and environment variables: its output and exit code."""
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "test_some.py").write_text(TESTS)
    (tmp_path / "pytest.ini").write_text(INI)

    def call(*words: str, **environment: str) -> tuple[str, int]:
        kept = {name: value for name, value in os.environ.items() if name != "CI" and not name.startswith("PYTEST")}
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-v", *words],
            cwd=tmp_path,
            env={**kept, "PYTHONPATH": f"{ROOT}", **environment},
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        return done.stdout, done.returncode

    return call


def passed(output: str) -> set[str]:
    return {line.split("::")[1].split()[0] for line in output.splitlines() if " PASSED" in line}


@pytest.mark.full
def test_a_run_without_files_takes_the_fast_tier_and_counts_what_is_missing(run: Run) -> None:
    output, code = run()
    assert (passed(output), code) == ({"test_fast"}, 0)
    row = next(line for line in output.splitlines() if line.endswith("get kit"))
    assert row.split() == ["3", "tests", "kits", "get", "kit"]


@pytest.mark.full
def test_a_named_file_and_test_all_run_the_full_tier_and_a_test_without_end_fails(run: Run) -> None:
    for words in (["test_some.py"], ["--tier", "all"]):
        output, code = run(*words)
        assert (passed(output), code) == ({"test_fast", "test_full"}, 1)
        assert "FAILED test_some.py::test_endless" in output


@pytest.mark.full
def test_the_nightly_tier_is_the_rest(run: Run) -> None:
    output, code = run("--tier", "nightly")
    assert (passed(output), code) == ({"test_nightly"}, 0)


@pytest.mark.full
def test_in_ci_a_missing_tool_is_a_failure(run: Run) -> None:
    output, code = run(CI="true")
    assert (output.count("ERROR test_some.py::test_kit"), code) == (3, 1)


def test_each_remedy_is_one_command() -> None:
    assert all(need.remedy.startswith(("sudo apt install ", "make ")) for need in NEEDS.values())
