# SPDX-License-Identifier: MIT
"""`.ci/bare` notices runs that only seem to have passed, and installs what the pages name."""

from __future__ import annotations

import json
import re
from importlib.metadata import packages_distributions
from pathlib import Path
from typing import Any

import pytest

from tests.bare.results import FEWEST_PASSED, faults_of_demo, faults_of_tests

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
LINE = "=========== {counts} in 130.25s (0:02:10) ============"
TABLE = """
================= not tested here ==================
332 tests  programs for the Teensy's processor  sudo apt install gcc-arm-none-eabi
  8 tests  a reason of its own
"""
PASSED = f"{FEWEST_PASSED} passed, 340 skipped, 12 deselected, 3 warnings"


def test_a_run_with_its_table_is_accepted() -> None:
    assert faults_of_tests(TABLE + LINE.format(counts=PASSED)) == []


@pytest.mark.parametrize(
    "log",
    [
        "",
        TABLE,
        LINE.format(counts=PASSED),
        TABLE + LINE.format(counts=f"1 failed, {PASSED}"),
        TABLE + LINE.format(counts=f"{PASSED}, 2 errors"),
        TABLE + LINE.format(counts=f"{FEWEST_PASSED - 1} passed, 340 skipped"),
        TABLE + LINE.format(counts=f"{FEWEST_PASSED} passed, 341 skipped"),
        TABLE + LINE.format(counts="340 skipped"),
        TABLE.replace("sudo apt install gcc-arm-none-eabi", "") + LINE.format(counts=PASSED),
    ],
    ids=["empty", "cut-off", "no-table", "failed", "errors", "few", "skipped-unlisted", "none-ran", "no-remedy"],
)
def test_a_run_with_a_fault_is_not(log: str) -> None:
    assert len(faults_of_tests(log)) >= 1


def run_folder(folder: Path, position_m: float, *, completed: bool = True, picture: bytes = b"\x89PNG\r\n") -> Path:
    (folder / "run.png").write_bytes(picture)
    summary: dict[str, Any] = {"completed": completed, "rmse": {"position_m": position_m, "theta_rad": 0.002}}
    (folder / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    return folder


PROMISE = "the robot is off its path by 2.3 mm and 2.0 mrad"


def test_a_demo_as_promised_is_accepted(tmp_path: Path) -> None:
    assert faults_of_demo(PROMISE, run_folder(tmp_path, 0.00228)) == []


def test_a_demo_with_a_fault_is_not(tmp_path: Path) -> None:
    assert len(faults_of_demo(PROMISE, run_folder(tmp_path, 0.0024))) == 1
    assert len(faults_of_demo(PROMISE, run_folder(tmp_path, 0.00228, completed=False))) == 1
    assert len(faults_of_demo(PROMISE, run_folder(tmp_path, 0.00228, picture=b""))) == 1
    assert len(faults_of_demo("", run_folder(tmp_path, 0.00228))) == 1


@pytest.mark.full
def test_opencv_is_the_one_that_needs_no_screen() -> None:
    """opencv-python has the same folder as the headless one, and needs libraries of X11."""
    assert packages_distributions()["cv2"] == ["opencv-python-headless"], "remove .venv; make setup"


def test_the_pages_name_one_list_of_packages() -> None:
    """`.ci/bare` installs the list of docs/start/screen.md."""
    pages = [ROOT / "README.md", ROOT / "docs" / "start" / "screen.md"]
    named = [re.findall(r"`sudo apt-get install ([^`]+)`", page.read_text(encoding="utf-8")) for page in pages]
    assert named[0] == named[1]
    assert len(named[0]) == 1
    assert {"python3-venv", "g++", "make", "git"} <= set(named[0][0].split())
