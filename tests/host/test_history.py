# SPDX-License-Identifier: MIT
"""The history of a robot's parameters: what was changed is known, and any earlier state comes back."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from omni.cli import app
from omniwheel import FirmwareProcess
from omniwheel.errors import HistoryError, OutputFileError, ParameterRefusedError
from omniwheel.history import ChangeRecorder, RobotHistory, history_file
from omniwheel.robot import Robot, connect


@pytest.fixture
def history(tmp_path: Path) -> RobotHistory:
    return RobotHistory(tmp_path / "deep" / "robot.jsonl")


def path_of(history: RobotHistory) -> Path:
    assert history.path is not None
    return history.path


def keep(robot: Robot, history: RobotHistory, command: str = "test", why: str = "") -> ChangeRecorder:
    def fail(error: OutputFileError) -> None:
        raise error

    return ChangeRecorder(robot, history, command, why, fail)


def change(robot: Robot, history: RobotHistory, values: Mapping[str, float], why: str = "") -> None:
    keep(robot, history, why=why)
    robot.parameters.set_many(values)


def test_a_change_is_kept_with_who_when_and_why(robot: Robot, history: RobotHistory) -> None:
    old = robot.parameters["ISMC_LAM_XY"]
    keep(robot, history, "omni params set", "it hums")
    robot.parameters["ISMC_LAM_XY"] = 15.0
    robot.parameters["ISMC_LAM_XY"] = 16.0
    (entry,) = history.entries()
    assert (entry.number, entry.command, entry.why) == (1, "omni params set", "it hums")
    assert entry.time.endswith("+00:00")
    assert entry.who
    assert entry.changes == {"ISMC_LAM_XY": (old, 16.0)}
    assert not entry.stored


def test_what_was_set_back_in_the_end_is_no_entry(robot: Robot, history: RobotHistory) -> None:
    old = robot.parameters["WS_P"]
    keep(robot, history)
    robot.parameters["WS_P"] = 0.5
    assert len(history.entries()) == 1
    robot.parameters["WS_P"] = old
    assert history.entries() == []


def test_a_refused_change_is_no_entry(fake: Any, robot: Robot, history: RobotHistory) -> None:
    keep(robot, history)
    fake.refusals["WHEELS"] = "denied: armed"
    with pytest.raises(ParameterRefusedError):
        robot.parameters.set_many({"WS_P": 0.5, "WHEELS": 4.0})
    assert history.entries() == []


def test_every_earlier_state_comes_back(robot: Robot, history: RobotHistory) -> None:
    names = ("WS_P", "WS_I", "ISMC_LAM_XY")
    states = [{name: robot.parameters[name] for name in names}]
    for values in ({"WS_P": 0.5}, {"WS_P": 0.75, "WS_I": 2.0}, {"ISMC_LAM_XY": 5.0}, {"WS_P": 0.5, "ISMC_LAM_XY": 6.0}):
        change(robot, history, values)
        states.append({name: robot.parameters[name] for name in names})
    for number in (4, 2, 1, 3):
        wanted = states[number - 1]
        change(robot, history, history.before(number))
        assert {name: robot.parameters[name] for name in names} == wanted, number
        change(robot, history, history.before(len(history.entries())))  # undoing the undoing
        assert {name: robot.parameters[name] for name in names} == states[-1], number


def test_lines_of_two_programs_may_alternate(robot: Robot, history: RobotHistory) -> None:
    one, other = keep(robot, history, "one"), keep(robot, history, "other")
    one.changed({"WS_P": (1.0, 2.0)})
    other.changed({"WS_I": (3.0, 4.0)})
    one.changed({"WS_P": (2.0, 3.0)})
    other.stored()
    other.measured({"rise_s": (0.2, 0.1), "overshoot": (float("nan"), 0.1)})
    first, second = history.entries()
    assert (first.command, first.changes, first.stored) == ("one", {"WS_P": (1.0, 3.0)}, False)
    assert (second.command, second.changes, second.stored) == ("other", {"WS_I": (3.0, 4.0)}, True)
    assert second.figures == {"rise_s": (0.2, 0.1)}


@pytest.mark.parametrize("number", [0, -1, 3])
def test_an_entry_that_is_not_there_is_refused(robot: Robot, history: RobotHistory, number: int) -> None:
    change(robot, history, {"WS_P": 0.5})
    change(robot, history, {"WS_P": 0.6})
    with pytest.raises(HistoryError, match="1 to 2"):
        history.before(number)


def test_a_line_cut_short_loses_only_itself(robot: Robot, history: RobotHistory) -> None:
    change(robot, history, {"WS_P": 0.5})
    change(robot, history, {"WS_I": 2.0})
    whole = path_of(history).read_bytes()
    path_of(history).write_bytes(whole[:-10])
    assert [list(entry.changes) for entry in history.entries()] == [["WS_P"]]
    change(robot, history, {"WS_D": 0.001})
    assert [list(entry.changes) for entry in history.entries()] == [["WS_P"], ["WS_D"]]


@pytest.mark.parametrize(
    "line",
    [
        *("7", "[1]", "{}", '{"session": 1, "set": 5}', '{"session": SAME, "set": {"X": [1]}}', "{"),
        '{"session": SAME, "set": {"X": [1, ' + "9" * 400 + "]}}",
    ],
)
def test_strange_lines_are_passed_over(robot: Robot, history: RobotHistory, line: str) -> None:
    change(robot, history, {"WS_P": 0.5})
    session = json.dumps(json.loads(path_of(history).read_text().splitlines()[0])["session"])
    with path_of(history).open("a") as file:
        file.write(line.replace("SAME", session) + "\n")
    assert [list(entry.changes) for entry in history.entries()] == [["WS_P"]]


@pytest.mark.parametrize("why", ["two\u2028lines", "a\u0085b", "a\x1cb\x0bc\rd\ne", "of no code \udcff", "\0"])
def test_whatever_the_user_gives_as_a_reason_the_change_is_kept(robot: Robot, history: RobotHistory, why: str) -> None:
    change(robot, history, {"WS_P": 0.5}, why)
    change(robot, history, {"WS_I": 2.0})
    first, second = history.entries()
    assert first.why == why.replace("\udcff", "?")
    assert list(second.changes) == ["WS_I"]


def test_a_full_disk_ends_no_line_that_another_program_appends_meanwhile(
    history: RobotHistory, monkeypatch: pytest.MonkeyPatch
) -> None:
    history.append([{"session": "a", "time": "", "who": "", "command": "", "why": ""}])
    other = (
        "import sys; from pathlib import Path; from omniwheel.history import RobotHistory; print('ready', flush=True)\n"
        "RobotHistory(Path(sys.argv[1])).append([{'session': 'a', 'set': {'WS_P': [1.0, 2.0]}}])"
    )
    started: list[subprocess.Popen[bytes]] = []

    def full(file: int, data: bytes) -> int:
        monkeypatch.undo()
        child = subprocess.Popen([sys.executable, "-c", other, str(history.path)], stdout=subprocess.PIPE)
        started.append(child)
        assert child.stdout is not None
        child.stdout.readline()
        with suppress(subprocess.TimeoutExpired):  # it waits for us; if it did not, its line would be there by now
            child.wait(0.3)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(OutputFileError):
        history.append([{"session": "b"}])
    with started[0] as child:
        assert child.wait(60.0) == 0
    assert [entry.changes for entry in history.entries()] == [{"WS_P": (1.0, 2.0)}]


def test_a_full_disk_keeps_no_change_from_the_robot(
    robot: Robot, history: RobotHistory, monkeypatch: pytest.MonkeyPatch
) -> None:
    change(robot, history, {"WS_P": 0.5})
    whole = path_of(history).read_bytes()
    warned: list[OutputFileError] = []
    ChangeRecorder(robot, history, "test", "", warned.append)
    real = os.write

    def full(file: int, data: bytes) -> int:
        """Take the first 20 bytes of a line, and no more."""
        if b"session" in data:
            return real(file, data[:20])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "write", full)
    robot.parameters.set_many({"WS_P": 0.75, "WS_I": 2.0})
    monkeypatch.undo()
    assert robot.parameters["WS_P"] == 0.75
    assert len(warned) == 1
    assert path_of(history).read_bytes() == whole


def test_a_robot_is_known_by_its_serial_number_or_its_link(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("OMNI_STATE_DIR", str(tmp_path))
    assert history_file(15049900, "/dev/ttyACM0") == history_file(15049900, "tcp:other:1")
    assert str(history_file(0, "tcp:127.0.0.1:5760")).rpartition("/")[2] == "link-tcp-127.0.0.1-5760.jsonl"
    assert history_file(0, "/dev/ttyACM0") != history_file(0, "/dev/ttyACM1")
    monkeypatch.delenv("OMNI_STATE_DIR")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    assert history_file(1, "") == tmp_path / "state" / "omniwheel" / "history" / "robot-1.jsonl"


def omni(*words: str) -> str:
    done = CliRunner().invoke(app, list(words))
    assert done.exit_code == 0, done.output
    return done.stdout


def test_undone_over_a_restart_of_the_robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMNI_STATE_DIR", str(tmp_path / "state"))
    storage = tmp_path / "robot.bin"
    with FirmwareProcess("three_wheel", storage=storage) as firmware:
        url = firmware.urls[0]
        with connect(url) as robot:
            old = {name: robot.parameters[name] for name in ("WS_P", "ISMC_LAM_XY")}
        omni("params", "set", "WS_P=0.5", "--why", "first try", "--store", "--link", url)
        omni("params", "set", "ISMC_LAM_XY=5", "WS_P=0.25", "--store", "--link", url)
        port = url.rpartition(":")[2]
    with FirmwareProcess("three_wheel", storage=storage, links=[f"tcp:127.0.0.1:{port}"]) as firmware:
        url = firmware.urls[0]
        entries = json.loads(omni("params", "undo", "--history", "--json", "--link", url))["entries"]
        assert [entry["why"] for entry in entries] == ["first try", ""]
        assert [entry["stored"] for entry in entries] == [True, True]
        assert "first try" in omni("params", "undo", "--history", "--link", url)
        told = json.loads(omni("params", "undo", "1", "--json", "--link", url))
        assert set(told) == set(old)
        with connect(url) as robot:
            assert {name: robot.parameters.read(name) for name in old} == old
        omni("params", "undo", "--link", url)
        with connect(url) as robot:
            assert robot.parameters.read("WS_P") == 0.25
        omni("params", "reset", "--link", url)
        omni("params", "undo", "--link", url)
        with connect(url) as robot:
            assert robot.parameters.read("ISMC_LAM_XY") == 5.0


def test_a_try_that_was_kept_has_its_figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sitl: str) -> None:
    monkeypatch.setenv("OMNI_STATE_DIR", str(tmp_path / "state"))
    words = ["--set", "ISMC_LAM_XY=5", "-e", "step", "--size", "0.02", "--duration", "3", "--out", str(tmp_path)]
    omni("tune", "--link", sitl, *words, "--revert", "--json")
    assert json.loads(omni("params", "undo", "--history", "--json", "--link", sitl))["entries"] == []
    omni("tune", "--link", sitl, *words, "--keep", "--why", "softer", "--json")
    (entry,) = json.loads(omni("params", "undo", "--history", "--json", "--link", sitl))["entries"]
    assert entry["why"] == "softer"
    assert list(entry["changes"]) == ["ISMC_LAM_XY"]
    assert len(entry["figures"]["position_m"]) == 2
