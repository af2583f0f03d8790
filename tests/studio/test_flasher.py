# SPDX-License-Identifier: MIT
"""Firmware from the page: checked by the real `omni flash`; uploads go to a program that stands for it."""

from __future__ import annotations

import hashlib
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from omni.studio.actions import BadRequestError
from omni.studio.flasher import Firmware, Flasher, firmware_of
from tests.host.hex_files import teensy_program, write_hex
from tests.waiting import wait_until

STAND_IN = """
import hashlib, json, pathlib, sys, time
words = sys.argv[1:]
(pathlib.Path({folder!r}) / "called").open("a").write(repr(words) + "\\n")
print("first words", file=sys.stderr, flush=True)
if {slow!r}:
    time.sleep(60)
if "--dry-run" in words:
    path = {file!r}
    sha = hashlib.sha256(pathlib.Path(path).read_bytes()).hexdigest()
    board = {{"board": "/dev/a", "problem": None}}
    print(json.dumps({{"file": path, "size": 9, "sha256": sha, "built": {built!r}, **board}}))
else:
    print(json.dumps({{"port": "/dev/a", "version": {{"firmware": "1.2.3", "git_hash": {runs!r}}}}}))
"""


def stand_in(folder: Path, *, built: str = "aa", runs: str = "aa", slow: bool = False) -> tuple[Flasher, Path]:
    file = folder / "firmware.hex"
    file.write_bytes(b"an image")
    script = folder / "flash.py"
    script.write_text(STAND_IN.format(folder=str(folder), file=str(file), built=built, runs=runs, slow=slow))
    return Flasher([sys.executable, str(script)]), file


def finished(flasher: Flasher) -> dict[str, Any]:
    wait_until(lambda: not flasher.running, "it goes on")
    return flasher.state()


BUILT = Firmware("three_wheel", "", "/dev/a", False)


@pytest.mark.full
def test_a_file_is_checked_and_nothing_is_uploaded(tmp_path: Path) -> None:
    file = write_hex(tmp_path / "good.hex", teensy_program())
    flasher = Flasher()
    flasher.check(Firmware("", str(file), "/dev/nothing", False))
    state = finished(flasher)
    assert state["trouble"] == ""
    assert "no such port /dev/nothing" in state["done"]
    assert any("nothing was uploaded" in line for line in state["lines"])
    assert state["checked"] is False


@pytest.mark.full
def test_a_damaged_file_says_what_is_wrong(tmp_path: Path) -> None:
    file = tmp_path / "bad.hex"
    file.write_text("what is this?")
    flasher = Flasher()
    flasher.check(Firmware("", str(file), "", False))
    state = finished(flasher)
    assert "is not in Intel's hex format. upload the .hex file" in state["trouble"]
    with pytest.raises(BadRequestError, match="not checked"):
        flasher.upload(Firmware("", str(file), "", False))


def test_only_what_was_checked_is_uploaded_the_very_file(tmp_path: Path) -> None:
    flasher, file = stand_in(tmp_path)
    with pytest.raises(BadRequestError, match="not checked"):
        flasher.upload(BUILT)
    flasher.check(BUILT)
    assert finished(flasher)["checked"]
    with pytest.raises(BadRequestError, match="not checked"):
        flasher.upload(Firmware("four_wheel", "", "/dev/a", False))
    flasher.upload(BUILT)
    assert "/dev/a runs firmware 1.2.3" in finished(flasher)["done"]
    called = (tmp_path / "called").read_text().splitlines()
    assert called == [
        "['--robot', 'three_wheel', '--port', '/dev/a', '--dry-run', '--json']",
        f"['{file}', '--sha256', '{hashlib.sha256(file.read_bytes()).hexdigest()}', '--port', '/dev/a', '--json']",
    ]


def test_another_wiring_is_another_request_and_goes_with_the_check_and_the_upload(tmp_path: Path) -> None:
    flasher, _ = stand_in(tmp_path)
    flasher.check(BUILT)
    finished(flasher)
    rewired = replace(BUILT, new_wiring=True)
    with pytest.raises(BadRequestError, match="not checked"):
        flasher.upload(rewired)
    flasher.check(rewired)
    finished(flasher)
    flasher.upload(rewired)
    finished(flasher)
    assert all("--new-wiring" in line for line in (tmp_path / "called").read_text().splitlines()[1:])


def test_a_board_that_still_runs_other_firmware_is_said(tmp_path: Path) -> None:
    flasher, _ = stand_in(tmp_path, built="aa", runs="bb")
    flasher.check(BUILT)
    finished(flasher)
    flasher.upload(BUILT)
    assert "runs bb, not aa" in finished(flasher)["trouble"]


def test_one_at_a_time_and_it_can_be_ended(tmp_path: Path) -> None:
    flasher, _ = stand_in(tmp_path, slow=True)
    flasher.check(BUILT)
    wait_until(lambda: flasher.state()["lines"] == ["first words"], "it says nothing")
    with pytest.raises(BadRequestError, match="another firmware"):
        flasher.check(BUILT)
    flasher.end()
    assert "ended" in finished(flasher)["trouble"]


@pytest.mark.parametrize(
    "request_",
    [
        {},
        {"robot": "three_wheel", "file": "x.hex", "port": "", "blank": False},
        {"robot": "", "file": "", "port": "", "blank": False},
        {"robot": "no such", "file": "", "port": "", "blank": False},
        {"robot": "", "file": "--skip-check", "port": "", "blank": False},
        {"robot": "three_wheel", "file": "", "port": "-x", "blank": False},
        {"robot": "three_wheel", "file": "", "port": 1, "blank": False},
        {"robot": "three_wheel", "file": "", "port": "", "blank": "yes"},
    ],
)
def test_bad_requests_start_nothing(request_: dict[str, Any]) -> None:
    with pytest.raises(BadRequestError):
        firmware_of(request_)
