# SPDX-License-Identifier: MIT
"""Every program in examples runs as it stands, in simulated time, and says what it found."""

from __future__ import annotations

import os
import re
import runpy
import struct
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "examples"
PROGRAMS = sorted(path.stem for path in FOLDER.glob("*.py"))
MOST_LINES = 40


def numbers(text: str, pattern: str) -> list[float]:
    """Return the numbers in a program's output that match a pattern with one group."""
    return [float(found) for found in re.findall(pattern, text)]


def joystick(folder: Path) -> list[str]:
    """Push the stick ahead for a while, then press a button; the kernel's file is a file here."""
    event = struct.Struct("IhBB")
    events = [event.pack(0, -32767, 2, 1)] * 60 + [event.pack(0, 1, 1, 0)]
    (folder / "js0").write_bytes(b"".join(events))
    return [str(folder / "js0")]


ARGUMENTS: dict[str, Callable[[Path], list[str]]] = {"joystick": joystick}
CHECKS: dict[str, Callable[[str], bool]] = {
    "follow_path": lambda said: max(numbers(said, r"error ([\d.]+) mm")) < 10.0,
    "identify": lambda said: len(numbers(said, r"wheel \d: .* ([\d.]+) rad/s RMS")) == 3,
    "joystick": lambda said: numbers(said, r"x=([-\d.e]+)")[0] > 0.2,
    "log_and_plot": lambda said: "mode velocity" in said,
    "monte_carlo": lambda said: numbers(said, r"worst ([\d.]+) mm")[0] < 20.0,
    "motion_capture": lambda said: 5.0 > numbers(said, r"off by ([\d.]+) mm")[1] < numbers(said, r"([\d.]+) mm")[0],
    "own_controller": lambda said: abs(numbers(said, r"x=([-\d.e]+)")[0] - 0.4) < 0.01,
    "square": lambda said: len(numbers(said, r"error ([\d.]+) mm")) == 4 and said.rstrip().endswith("armed"),
    "tune_gain": lambda said: "stored FL_KP_XY" in said,
    "two_robots": lambda said: len(re.findall(r"robot \d: ", said)) == 2,
}


@pytest.mark.full
@pytest.mark.parametrize("name", PROGRAMS)
def test_an_example_runs_and_says_what_it_should(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(os.environ, "MPLBACKEND", "agg")
    monkeypatch.setattr(sys, "argv", [f"{name}.py", *(ARGUMENTS[name](tmp_path) if name in ARGUMENTS else [])])
    runpy.run_path(str(FOLDER / f"{name}.py"), run_name="__main__")
    assert CHECKS[name](capsys.readouterr().out)


@pytest.mark.parametrize("name", PROGRAMS)
def test_an_example_is_short(name: str) -> None:
    assert len((FOLDER / f"{name}.py").read_text(encoding="utf-8").splitlines()) <= MOST_LINES


def test_each_example_has_a_check() -> None:
    assert sorted(CHECKS) == PROGRAMS
