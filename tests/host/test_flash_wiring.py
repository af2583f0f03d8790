# SPDX-License-Identifier: MIT
"""Only the firmware that was meant, and only onto a robot of its wiring, is uploaded."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from omni_schema import wiring_id
from omniwheel import FirmwareProcess
from omniwheel.flashing import loader, wiring
from omniwheel.flashing.boards import Board
from omniwheel.flashing.hex_file import read_hex
from omniwheel.robots import read_robot
from tests.host.flash_bench import Bench, flash, teensy
from tests.host.hex_files import teensy_program, write_hex


@pytest.fixture(scope="module")
def board() -> Iterator[str]:
    """Return the link URL of a running firmware."""
    with FirmwareProcess(links=["tcp:127.0.0.1:0"]) as firmware:
        yield firmware.urls[0]


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(tmp_path, monkeypatch)


@pytest.mark.parametrize("what", ["file", "robot"])
def test_firmware_of_another_wiring_than_the_boards_is_not_uploaded(
    bench: Bench, board: str, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    """Its motors and encoders could be on other pins. A robot that was wired anew is said to be so."""
    of = {name: wiring_id(read_robot(name)) for name in ("three_wheel", "four_wheel")}
    entered: list[Board] = []

    def enter(board: Board) -> bool:
        entered.append(board)
        return True

    monkeypatch.setattr(loader, "enter_bootloader", enter)
    monkeypatch.setattr(wiring, "_running_id", lambda _: of["four_wheel"])
    bench.ports = [teensy(board)]
    write_hex(bench.hex, teensy_program(wiring_id=of["three_wheel"]))
    arguments = [str(bench.hex)] if what == "file" else []
    for more in ([], ["--dry-run", "--json"]):
        result = flash(*arguments, *more)
        assert {"three_wheel", "four_wheel", "--new-wiring"} <= set(re.findall(r"[\w-]+", result.output))
    assert json.loads(result.stdout)["problem"]
    assert flash(*arguments).exit_code == 1
    assert not bench.was_called("teensy_loader_cli")
    assert not entered
    assert flash(*arguments, "--new-wiring").exit_code == 0
    assert bench.was_called("teensy_loader_cli")


def test_what_says_nothing_of_its_wiring_is_no_reason_to_refuse(bench: Bench, board: str) -> None:
    """A PC's firmware, a board that does not answer, one without a port, and a program without a label."""
    ours = read_hex(write_hex(bench.hex, teensy_program(wiring_id=7)))
    assert ours.wiring_id == 7
    for silent in (Board(teensy(board)), Board(teensy("tcp:127.0.0.1:1")), Board(None)):
        wiring.require_same_wiring(ours, silent)
    foreign = read_hex(write_hex(bench.hex, teensy_program()))
    assert foreign.wiring_id == 0
    wiring.require_same_wiring(foreign, Board(teensy(board)))


def test_a_file_with_another_digest_than_the_wanted_one_is_refused(bench: Bench, board: str) -> None:
    bench.ports = [teensy(board)]
    result = flash(str(bench.hex), "--sha256", "0" * 64)
    assert result.exit_code == 2
    assert not bench.was_called("teensy_loader_cli")
    good = hashlib.sha256(bench.hex.read_bytes()).hexdigest()
    assert flash(str(bench.hex), "--sha256", good.upper(), "--dry-run").exit_code == 0
    assert flash("--sha256", good, "--dry-run").exit_code == 2
