# SPDX-License-Identifier: MIT
"""A failing file system under every command that writes: an error that is said, whole files, nothing left behind."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from omni import checks
from omni.cli import app
from tests.faults.commands import CASES, SAME_AS, STORED_BY_FIRMWARE, WRITE_NOTHING
from tests.faults.shim import chosen, library, need_shim

ROOT = Path(__file__).resolve().parents[2]
SAMPLE = 2
"""So many calls of a command fail in turn; all of them in `make nightly`."""


def commands(command: Any, name: str = "") -> Iterator[str]:
    """Yield the name of every command of the program."""
    if not hasattr(command, "list_commands"):
        yield name
        return
    context = command.make_context("omni", [], resilient_parsing=True)
    for word in command.list_commands(context):
        yield from commands(command.get_command(context, word), f"{name} {word}".strip())


def test_every_command_of_the_program_is_known_here() -> None:
    """A new one that writes gets a case; one that writes nothing is entered as such."""
    known = [*CASES, *STORED_BY_FIRMWARE, *WRITE_NOTHING, *SAME_AS]
    assert len(known) == len(set(known))
    programs = (typer.main.get_command(app), ""), (typer.main.get_command(checks.app), "checks")
    assert {name for program, prefix in programs for name in commands(program, prefix)} == set(known)


@pytest.fixture(scope="module")
def driver() -> Iterator[subprocess.Popen[str]]:
    """An interpreter over the failing file system that has imported everything, and forks for each case."""
    need_shim()
    environment = {**os.environ, "LD_PRELOAD": str(library()), "COLUMNS": "200", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "tests.faults.drive"]
    with subprocess.Popen(
        command, cwd=ROOT, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        yield process
        process.kill()


def try_failing_calls(driver: subprocess.Popen[str], name: str, folder: Path, most: int | None = None) -> None:
    assert driver.stdin is not None
    assert driver.stdout is not None
    driver.stdin.write(json.dumps([name, str(folder), most]) + "\n")
    driver.stdin.flush()
    told = json.loads(driver.stdout.readline())
    assert told["problems"] == []
    assert told["calls"] >= 3, "a command that writes opens, writes and renames"


@pytest.mark.full
@pytest.mark.parametrize("name", CASES)
def test_some_call_fails_and_a_command_says_so_and_leaves_whole_files(
    driver: subprocess.Popen[str], name: str, tmp_path: Path
) -> None:
    try_failing_calls(driver, name, tmp_path, SAMPLE)


@pytest.mark.nightly
@pytest.mark.parametrize("name", CASES)
def test_whatever_call_fails_a_command_says_so_and_leaves_whole_files(
    driver: subprocess.Popen[str], name: str, tmp_path: Path
) -> None:
    try_failing_calls(driver, name, tmp_path)


def test_the_sample_has_the_first_and_the_last_call() -> None:
    assert chosen(range(1, 6), 6) == range(1, 6)
    assert chosen(range(1, 52), 6) == [1, 11, 21, 31, 41, 51]
    assert chosen(range(1, 62, 6), 6) == [1, 13, 25, 37, 49, 61]
