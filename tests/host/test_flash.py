# SPDX-License-Identifier: MIT
"""Building and uploading with stand-ins for PlatformIO and the loader; the board that comes back is the PC firmware."""

from __future__ import annotations

import configparser
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from image_check.run import Outcome
from omniwheel import FirmwareProcess
from omniwheel.errors import FlashError, LinkOpenError
from omniwheel.flashing import boards, loader, running, source
from omniwheel.flashing.boards import Board
from omniwheel.ports import Port
from omniwheel.robot import connect
from omniwheel.robots import find_robot_file, robot_names
from tests.host.flash_bench import Bench, flash, teensy

PASSED = Outcome("boots", "it boots", ("0.3 s",), "", 0.1)
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def board() -> Iterator[str]:
    """Return the link URL of a running firmware."""
    with FirmwareProcess(links=["tcp:127.0.0.1:0"]) as firmware:
        yield firmware.urls[0]


class Clock:
    """Time that passes only while somebody waits."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(tmp_path, monkeypatch)


# ---- building


def test_every_robot_that_comes_with_the_source_has_an_environment() -> None:
    ini = configparser.ConfigParser(interpolation=None)
    ini.read(ROOT / "platformio.ini")
    for path in (ROOT / "shared" / "robots").glob("*.toml"):
        assert ini[f"env:{path.stem}"]["custom_robot"] == f"shared/robots/{path.name}"
    assert f"env:{source.OWN_ROBOT_ENVIRONMENT}" in ini
    assert ini["env"]["upload_protocol"] == "teensy-cli"


def test_a_packaged_robot_is_built_in_its_own_environment_and_a_file_in_the_general_one(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMNI_ROBOT", "left_over.toml")
    for name in robot_names():
        source.build(name)
        assert bench.called("pio") == (["run", "-d", str(ROOT), "-e", name], None)
    mine = tmp_path / "mine.toml"
    mine.write_text(find_robot_file("three_wheel").read_text().replace('"three_wheel"', '"mine"'))
    made = source.build(mine)
    assert bench.called("pio") == (["run", "-d", str(ROOT), "-e", "robot"], str(mine))
    assert made.hex == ROOT / ".pio" / "build" / "robot" / "firmware.hex"


def test_a_build_that_fails_is_an_error_of_its_own(bench: Bench) -> None:
    bench.program("pio", 3)
    result = flash("--build-only")
    assert result.exit_code == 1
    assert "exit code 3" in result.stderr


def test_a_first_build_that_fails_tells_that_it_needs_the_network(bench: Bench) -> None:
    bench.program("pio", 1)
    said = " ".join(flash("--build-only").stderr.split())
    assert "no platforms/teensy yet" in said
    assert "HTTPClientError" in said
    for part in ("platforms/teensy", "packages/framework-arduinoteensy", "packages/toolchain-gccarmnoneeabi-teensy"):
        (bench.folder / "core" / part).mkdir(parents=True)
    assert "HTTPClientError" not in flash("--build-only").stderr


def test_a_wrong_robot_file_is_refused_before_anything_is_built(bench: Bench, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(find_robot_file("three_wheel").read_text().replace("wheels = 3", "wheels = 7"))
    result = flash("--build-only", "--robot", str(wrong))
    assert result.exit_code == 2
    assert "wheels" in result.stderr
    assert not bench.was_called("pio")


def test_missing_programs_and_missing_source_say_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("shutil.which", lambda *_, **__: None)
    with pytest.raises(FlashError) as caught:
        source.find_pio()
    assert caught.value.hint == f"{sys.executable} -m pip install 'platformio>=6.1'"
    with pytest.raises(FlashError) as caught:
        loader.require_loader()
    assert "apt install teensy-loader-cli" in caught.value.hint
    monkeypatch.setattr(source, "__file__", str(tmp_path / "a" / "b" / "c" / "d" / "source.py"))
    with pytest.raises(FlashError, match="source"):
        source.source_dir()


def test_platformios_own_loader_comes_first(bench: Bench, tmp_path: Path) -> None:
    assert loader.find_loader() == str(tmp_path / "teensy_loader_cli")
    own = tmp_path / "core" / "packages" / "tool-teensy"
    own.mkdir(parents=True)
    (tmp_path / "teensy_loader_cli").rename(own / "teensy_loader_cli")
    assert loader.find_loader() == str(own / "teensy_loader_cli")


# ---- which board


@pytest.mark.parametrize(
    ("ports", "waiting", "arguments", "words"),
    [
        ([], 0, [], "no Teensy is connected"),
        ([teensy("/dev/a"), teensy("/dev/b")], 0, [], "--port, one of /dev/a, /dev/b"),
        ([teensy("/dev/a"), teensy("/dev/b")], None, ["--port", "/dev/a"], "cannot tell them apart"),
        ([teensy("/dev/a")], 1, ["--port", "/dev/a"], "would be flashed instead"),
        ([teensy("/dev/a")], 2, ["--port", "/dev/a"], "2 Teensys wait in their bootloaders"),
        ([], 2, ["--blank"], "2 Teensys wait in their bootloaders"),
        ([teensy("/dev/a")], 0, ["--port", "/dev/c"], "no such port /dev/c"),
        ([Port("/dev/x", "adapter", "xbee")], 0, ["--port", "/dev/x"], "/dev/x is not a Teensy"),
    ],
)
def test_without_one_board_nothing_is_built_or_uploaded(
    bench: Bench, ports: list[Port], waiting: int | None, arguments: list[str], words: str
) -> None:
    bench.ports, bench.waiting = ports, waiting
    for what in ([], [str(bench.hex)]):
        result = flash(*what, *arguments)
        assert result.exit_code == 1
        assert words in " ".join(result.stderr.split())
    assert not bench.was_called("pio")
    assert not bench.was_called("teensy_loader_cli")
    assert not bench.rebooted


def test_a_file_that_is_none_is_said_before_a_board_is_asked_for(bench: Bench) -> None:
    result = flash("nowhere.hex")
    assert result.exit_code == 2
    assert "nowhere.hex cannot be read" in result.stderr


def test_of_two_boards_the_named_one_is_sent_to_its_bootloader_where_no_other_waits(bench: Bench) -> None:
    bench.ports = [teensy("/dev/a"), teensy("/dev/b")]
    assert boards.choose_board("/dev/b", blank=False) == Board(teensy("/dev/b"))
    bench.ports, bench.waiting = [], 1
    assert boards.choose_board(None, blank=False) == Board(None)


def test_a_board_without_a_port_is_the_one_that_appears(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.ports = [teensy("/dev/a")]
    blank = boards.choose_board(None, blank=True)
    assert blank == Board(None, ("/dev/a",))
    assert not loader.enter_bootloader(blank)  # it may be that one, whose button was pressed
    assert running._port_of(blank) == teensy("/dev/a")
    bench.ports = [teensy("/dev/a"), teensy("/dev/new")]
    assert running._port_of(blank) == teensy("/dev/new")
    assert not bench.rebooted


def test_another_board_that_gets_into_its_bootloader_meanwhile_ends_it(bench: Bench) -> None:
    bench.waiting = 2
    with pytest.raises(FlashError, match="another Teensy"):
        loader.enter_bootloader(Board(teensy("/dev/a")))


def test_a_board_is_sent_to_its_bootloader_by_its_port_and_watched_until_it_is_gone(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(loader, "LEAVE_S", 5.0)
    clock = Clock()

    def sleep(seconds: float) -> None:
        clock.sleep(seconds)
        bench.ports = [] if clock.now > 1.0 else bench.ports

    bench.ports = [teensy("/dev/a")]
    assert loader.enter_bootloader(Board(bench.ports[0]), clock=clock, sleep=sleep)
    assert bench.rebooted == [("/dev/a", 134)]
    bench.ports = [teensy("/dev/a")]
    assert not loader.enter_bootloader(Board(bench.ports[0]), clock=clock, sleep=clock.sleep)
    assert clock.now > 5.0


def test_a_port_that_cannot_be_opened_is_named(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("omniwheel.flashing.loader.serial.Serial", refuse)
    with pytest.raises(FlashError, match="/dev/a cannot be opened") as caught:
        loader.enter_bootloader(Board(teensy("/dev/a")))
    assert "omni doctor" in caught.value.hint


# ---- uploading


def test_an_upload_ends_with_the_version_that_the_board_says(
    bench: Bench, board: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(loader, "enter_bootloader", lambda _: True)
    bench.ports = [teensy(board)]
    with connect(board) as robot:
        bench.git_hash = robot.version.git_hash
    result = flash("--json")
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert said["port"] == board
    assert said["version"]["git_hash"] == bench.git_hash
    arguments, _ = bench.called("teensy_loader_cli")
    assert arguments[:-1] == ["--mcu=TEENSY40", "-w", "-v"]
    assert Path(arguments[-1]).name == bench.hex.name


def test_a_released_file_is_uploaded_without_building(
    bench: Bench, board: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(loader, "enter_bootloader", lambda _: True)
    bench.ports = [teensy(board)]
    result = flash(str(bench.hex))
    assert result.exit_code == 0, result.output
    assert "runs firmware" in result.stdout
    assert not bench.was_called("pio")
    assert bench.was_called("teensy_loader_cli")


def test_what_was_checked_is_uploaded_whatever_becomes_of_the_file(
    bench: Bench, board: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    good, uploaded = bench.hex.read_bytes(), []
    monkeypatch.setattr(loader, "enter_bootloader", lambda _: bool(bench.hex.write_text("another program")))
    monkeypatch.setattr(loader, "run_loader", lambda _, image: uploaded.append(image.read_bytes()))
    bench.ports = [teensy(board)]
    assert flash(str(bench.hex)).exit_code == 0
    assert uploaded == [good]


def test_a_loader_that_fails_says_how_to_go_on(bench: Bench) -> None:
    bench.ports = [teensy("/dev/a")]
    bench.program("teensy_loader_cli", 1)
    result = flash(str(bench.hex))
    assert result.exit_code == 1
    said = " ".join(result.stderr.split())
    assert "exit code 1" in said
    assert "button" in said
    assert "--blank" in said
    assert bench.rebooted == [("/dev/a", 134)]


def test_a_loader_that_finds_no_bootloader_has_an_end(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def expire(*_: object, **options: Any) -> None:
        raise subprocess.TimeoutExpired("teensy_loader_cli", options["timeout"])

    monkeypatch.setattr("omniwheel.flashing.loader.subprocess.run", expire)
    with pytest.raises(FlashError, match="no upload within 120 s") as caught:
        loader.run_loader("teensy_loader_cli", bench.hex)
    assert "button" in caught.value.hint


def test_an_upload_that_is_interrupted_says_how_to_go_on(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    bench.ports = [teensy("/dev/a")]
    monkeypatch.setattr("omniwheel.flashing.loader.subprocess.run", interrupt)
    result = flash(str(bench.hex))
    assert result.exit_code == 130
    assert "--blank" in result.stderr


def test_a_damaged_file_is_refused_before_the_board_is_touched(bench: Bench) -> None:
    bench.ports = [teensy("/dev/a")]
    bench.hex.write_text(bench.hex.read_text()[:2000])
    result = flash(str(bench.hex))
    assert result.exit_code == 2
    assert not bench.rebooted
    assert not bench.was_called("teensy_loader_cli")


def test_a_file_and_a_robot_do_not_go_together(bench: Bench) -> None:
    result = flash(str(bench.hex), "--robot", "four_wheel")
    assert result.exit_code == 2
    assert "--robot" in result.stderr


# ---- what runs afterwards


def test_a_board_that_still_runs_other_firmware_is_an_error(bench: Bench, board: str) -> None:
    bench.ports = [teensy(board)]
    with pytest.raises(FlashError, match="not the 12345678 just built") as caught:
        running.wait_for_firmware(Board(bench.ports[0]), "123456789abcdef0", began_s=0.0, left=True)
    assert "button" in caught.value.hint


def test_the_port_is_waited_for_while_the_board_starts(bench: Bench, board: str) -> None:
    clock = Clock()

    def sleep(seconds: float) -> None:
        clock.sleep(seconds)
        if clock.now > 5.0:
            bench.ports = [teensy(board, "1234")]
        elif clock.now > 2.0:
            bench.ports = [teensy("tcp:127.0.0.1:1", "1234")]  # there, and does not answer yet

    other = teensy("/dev/other", "99")
    bench.ports = [other]
    before = Board(teensy("/dev/a", "1234"))  # comes back under another name
    flashed = running.wait_for_firmware(before, "", began_s=0.0, left=True, clock=clock, sleep=sleep)
    assert flashed.port == board
    assert clock.now > 5.0


def test_the_old_firmware_is_not_taken_for_the_new_one(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """It answers at once, and with the version that was built, when the same source is uploaded again."""
    clock, started = Clock(), [-1000.0]
    answer = running.Answer(object(), 0.0)  # type: ignore[arg-type]
    monkeypatch.setattr(running, "_checked", lambda port, version, _: version)
    monkeypatch.setattr(running, "_ask", lambda _: running.Answer(answer.version, clock.now - started[0]))
    bench.ports = [teensy("/dev/a")]
    with pytest.raises(FlashError, match="did not respond") as caught:
        running.wait_for_firmware(Board(bench.ports[0]), "", began_s=0.0, left=False, clock=clock, sleep=clock.sleep)
    assert "--blank" in caught.value.hint

    def restart(seconds: float) -> None:
        clock.sleep(seconds)
        if clock.now > begin + 3.0 and started[0] < begin:
            started[0] = clock.now

    begin = clock.now
    flashed = running.wait_for_firmware(
        Board(bench.ports[0]), "", began_s=begin, left=False, clock=clock, sleep=restart
    )
    assert flashed.version is answer.version
    assert clock.now > begin + 3.0


def test_a_board_that_does_not_come_back_is_an_error_with_a_way_on(bench: Bench) -> None:
    clock = Clock()
    with pytest.raises(FlashError, match="did not respond within 30 s") as caught:
        running.wait_for_firmware(Board(teensy("/dev/a")), "", began_s=0.0, left=True, clock=clock, sleep=clock.sleep)
    assert "unplug" in caught.value.hint


def test_the_board_is_asked_without_counting_as_a_ground_station(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def refuse(_: str, **options: object) -> None:
        asked.append(options["heartbeat"])
        raise LinkOpenError("busy")

    monkeypatch.setattr(running, "connect", refuse)
    bench.ports = [teensy("/dev/a")]
    clock = Clock()
    with pytest.raises(FlashError, match="did not respond") as caught:
        running.wait_for_firmware(Board(bench.ports[0]), "", began_s=0.0, left=True, clock=clock, sleep=clock.sleep)
    assert "busy" in caught.value.hint
    assert asked
    assert not any(asked)


# ---- without an upload


def test_a_dry_run_says_what_it_would_do_and_touches_nothing(bench: Bench) -> None:
    bench.ports, bench.git_hash = [teensy("/dev/a", "42")], "0123456789abcdef"
    result = flash("--dry-run", "--json")
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert said["board"] == "/dev/a (serial number 42)"
    assert said["command"][1:] == ["--mcu=TEENSY40", "-w", "-v", str(bench.hex)]
    assert said["built"] == bench.git_hash
    assert said["uploaded"] is False
    assert bench.was_called("pio")
    assert not bench.was_called("teensy_loader_cli")
    assert not bench.rebooted


def test_a_dry_run_needs_neither_board_nor_loader(bench: Bench) -> None:
    (bench.folder / "teensy_loader_cli").unlink()
    result = flash("--dry-run", "--robot", "four_wheel")
    assert result.exit_code == 0, result.output
    said = " ".join(result.stderr.split())
    assert "no Teensy is connected" in said
    assert "teensy_loader_cli is not installed here; Debian, Ubuntu: sudo apt install teensy-loader-cli" in said
    assert "nothing was uploaded" in said


def test_an_image_that_fails_its_check_is_not_uploaded(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.ports = [teensy("/dev/a")]
    asked = []

    def run_checks(image: Path, robot: str, *, depth: str, done: Callable[[Outcome], None]) -> list[Outcome]:
        asked.append((image.name, robot, depth))
        outcomes = [
            Outcome("boots", "it boots", ("0.3 s",), "", 0.1),
            Outcome("stops", "it stops", (), "it drives on", 0.1),
        ]
        for outcome in outcomes:
            done(outcome)
        return outcomes

    monkeypatch.setattr("image_check.run.run_checks", run_checks)
    result = flash()
    assert result.exit_code == 1
    assert "1 of its checks: stops" in result.stderr
    assert "it drives on" in result.stderr
    assert "--skip-check" in result.stderr
    assert not bench.rebooted
    assert asked == [("firmware.elf", "three_wheel", "short")]
    assert flash("--dry-run", "--skip-check").exit_code == 0
    assert len(asked) == 1
