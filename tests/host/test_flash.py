# SPDX-License-Identifier: MIT
"""Building and uploading with a program in PlatformIO's place; the board that comes back is the PC firmware."""

from __future__ import annotations

import configparser
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from omniwheel import FirmwareProcess, flashing
from omniwheel.cli import app
from omniwheel.errors import FlashError, LinkOpenError, OmniError
from omniwheel.ports import Port
from omniwheel.robot import connect
from omniwheel.robots import find_robot_file, robot_names

ROOT = Path(__file__).resolve().parents[2]
PIO = """\
#!{python}
import os, pathlib, sys
folder = pathlib.Path(__file__).parent
(folder / "arguments").write_text(repr((sys.argv[1:], os.environ.get("OMNI_ROBOT"))))
sys.exit({exit_code})
"""


@pytest.fixture(scope="module")
def board() -> Iterator[str]:
    """Return the link URL of a running firmware."""
    with FirmwareProcess(links=["tcp:127.0.0.1:0"]) as firmware:
        yield firmware.urls[0]


class Bench:
    """What the code under test sees of PlatformIO and of USB."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder = folder
        self.ports: list[Port] = []
        self.built = ""
        self.pio(0)
        monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
        monkeypatch.setattr(flashing, "serial_ports", lambda: self.ports)
        monkeypatch.setattr(flashing, "_built_hash", lambda _: self.built)

    def pio(self, exit_code: int) -> None:
        path = self.folder / "pio"
        path.write_text(PIO.format(python=sys.executable, exit_code=exit_code))
        path.chmod(0o755)

    def called(self) -> tuple[list[str], str | None]:
        arguments, robot = eval((self.folder / "arguments").read_text())
        return arguments, robot


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(tmp_path, monkeypatch)


def teensy(device: str) -> Port:
    return Port(device, "USB Serial", "teensy")


def test_every_robot_that_comes_with_the_source_has_an_environment() -> None:
    ini = configparser.ConfigParser(interpolation=None)
    ini.read(ROOT / "platformio.ini")
    for path in (ROOT / "shared" / "robots").glob("*.toml"):
        assert ini[f"env:{path.stem}"]["custom_robot"] == f"shared/robots/{path.name}"
    assert f"env:{flashing.OWN_ROBOT_ENVIRONMENT}" in ini


def test_a_packaged_robot_is_built_in_its_own_environment_and_a_file_in_the_general_one(
    bench: Bench, tmp_path: Path
) -> None:
    for name in robot_names():
        flashing.run_pio(name, upload=False)
        assert bench.called() == (["run", "-d", str(ROOT), "-e", name], None)
    mine = tmp_path / "mine.toml"
    mine.write_text(find_robot_file("three_wheel").read_text().replace('"three_wheel"', '"mine"'))
    flashing.run_pio(mine, upload=True, port="/dev/ttyACM7")
    arguments, robot = bench.called()
    assert arguments[-5:] == ["robot", "-t", "upload", "--upload-port", "/dev/ttyACM7"]
    assert robot == str(mine)


def test_an_upload_ends_with_the_version_that_the_board_says(bench: Bench, board: str) -> None:
    bench.ports = [teensy(board)]
    with connect(board) as robot:
        bench.built = robot.version.git_hash
    result = CliRunner().invoke(app, ["flash", "--json"])
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert said["port"] == board
    assert said["version"]["git_hash"] == bench.built


def test_a_board_that_still_runs_other_firmware_is_an_error(bench: Bench, board: str) -> None:
    bench.ports = [teensy(board)]
    bench.built = "123456789abcdef0"
    result = CliRunner().invoke(app, ["flash"])
    assert result.exit_code == 1
    assert "not the 12345678 just built" in result.stderr
    assert "button" in result.stderr


@pytest.mark.parametrize(
    ("ports", "arguments", "words"),
    [
        ([], [], "no Teensy is connected"),
        ([teensy("/dev/a"), teensy("/dev/b")], [], "/dev/a, /dev/b"),
        ([teensy("/dev/a")], ["--port", "/dev/c"], "there is no port /dev/c"),
    ],
)
def test_without_one_board_nothing_is_built(bench: Bench, ports: list[Port], arguments: list[str], words: str) -> None:
    bench.ports = ports
    result = CliRunner().invoke(app, ["flash", *arguments])
    assert result.exit_code == 1
    assert words in result.stderr
    assert not (bench.folder / "arguments").exists()


def test_a_build_that_fails_is_an_error_of_its_own(bench: Bench) -> None:
    bench.pio(3)
    result = CliRunner().invoke(app, ["flash", "--build-only"])
    assert result.exit_code == 1
    assert "exit code 3" in result.stderr


def test_a_wrong_robot_file_is_refused_before_anything_is_built(bench: Bench, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(find_robot_file("three_wheel").read_text().replace("wheels = 3", "wheels = 7"))
    result = CliRunner().invoke(app, ["flash", "--build-only", "--robot", str(wrong)])
    assert result.exit_code == 2
    assert "wheels" in result.stderr
    assert not (bench.folder / "arguments").exists()


def test_the_port_is_waited_for_while_the_board_starts(bench: Bench, board: str) -> None:
    now = 0.0

    def sleep(seconds: float) -> None:
        nonlocal now
        now += seconds
        if now > 5.0:
            bench.ports = [teensy(board)]
        elif now > 2.0:
            bench.ports = [teensy("tcp:127.0.0.1:1")]  # there, and does not answer yet

    flashed = flashing.wait_for_firmware(None, "", clock=lambda: now, sleep=sleep)
    assert flashed.port == board
    assert now > 5.0


def test_a_board_that_does_not_come_back_is_an_error_with_a_way_on(bench: Bench) -> None:
    now = 0.0

    def sleep(seconds: float) -> None:
        nonlocal now
        now += seconds

    with pytest.raises(FlashError, match="did not answer within 30 s") as caught:
        flashing.wait_for_firmware(None, "", clock=lambda: now, sleep=sleep)
    assert "unplug" in caught.value.hint


def test_missing_pio_and_missing_source_say_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("shutil.which", lambda *_, **__: None)
    with pytest.raises(FlashError) as caught:
        flashing.find_pio()
    assert "pip install platformio" in caught.value.hint
    monkeypatch.setattr(flashing, "__file__", str(tmp_path / "a" / "b" / "c" / "flashing.py"))
    with pytest.raises(FlashError, match="source"):
        flashing.source_dir()


def test_the_board_is_asked_without_counting_as_a_ground_station(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def refuse(_: str, **options: object) -> None:
        asked.append(options["heartbeat"])
        raise LinkOpenError("busy")

    monkeypatch.setattr(flashing, "connect", refuse)
    bench.ports = [teensy("/dev/a")]
    clock = iter(range(100))
    with pytest.raises(OmniError, match="did not answer"):
        flashing.wait_for_firmware(None, "", timeout_s=10, clock=lambda: next(clock), sleep=lambda _: None)
    assert asked
    assert not any(asked)
