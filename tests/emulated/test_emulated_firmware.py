# SPDX-License-Identifier: MIT
"""The emulator as a process: links, mistakes, ends, resets, crashes. The firmware itself: see tests/firmware."""

from __future__ import annotations

import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from omniwheel.bringup.bench import health_of
from omniwheel.emulated_firmware import DIRECT, EmulatedFirmware
from omniwheel.errors import FirmwareEndedError, FirmwareNotFoundError, FirmwareStartError, LinkError
from omniwheel.paths import MissingFileError, emulated_firmware_path
from omniwheel.robot import Robot, connect
from omniwheel.telemetry import Heartbeat, Status
from tests.arm import need_emulated_firmware, run_program
from tests.waiting import wait_until


@pytest.fixture(scope="module", autouse=True)
def _emulator() -> None:
    need_emulated_firmware()


@pytest.fixture(scope="module")
def firmware() -> Iterator[EmulatedFirmware]:
    with EmulatedFirmware(links=["tcp:127.0.0.1:0", "pty"]) as running:
        yield running


def silence(robot: Robot) -> None:
    """Ask for no telemetry: a frame cut by what happens next would swallow the beginning of the one after it."""
    robot.parameters.set_many({"SR1_STATE": 0, "SR1_WHEELS": 0, "SR1_STATUS": 0})
    robot.pump(0.2)


def wait_for_text(robot: Robot, pattern: str) -> None:
    wait_until(
        lambda: any(re.search(pattern, text.text) for text in robot.texts.all),
        lambda: [text.text for text in robot.texts.all],
        pause=lambda: robot.pump(0.05),
    )


def test_a_serial_port_serves_one_client_after_the_other(firmware: EmulatedFirmware) -> None:
    for gain in (7.0, 8.0):
        with connect(firmware.urls[0]) as robot:
            robot.require_same_parameters()
            robot.parameters["ISMC_LAM_XY"] = gain
    with connect(firmware.urls[1]) as robot:
        assert robot.parameters.read("ISMC_LAM_XY") == 8.0


def test_a_client_that_leaves_half_a_frame_costs_the_next_one_nothing(firmware: EmulatedFirmware) -> None:
    _, host, port = firmware.links[0].split(":")
    with socket.create_connection((host, int(port))) as rude:
        rude.sendall(b"\xfd\x50" + bytes(20))
    with connect(firmware.urls[0]) as robot:
        assert robot.parameters.read("WHEELS") == 3.0


def test_it_ticks_by_its_timer_and_arms(firmware: EmulatedFirmware) -> None:
    with connect(firmware.urls[0]) as robot:
        first = robot.wait_for(Status)
        second = robot.wait_for(Status)
        assert second.ticks - first.ticks == round((second.time_s - first.time_s) * 1000) > 0
        robot.arm()
        assert next(beat for beat in robot.telemetry(Heartbeat) if beat.armed).armed
        robot.disarm()


def test_stored_parameters_outlive_a_reboot_by_command(tmp_path: Path) -> None:
    with EmulatedFirmware(storage=tmp_path / "with a blank, and a comma") as firmware:
        with connect(firmware.urls[0]) as robot:
            robot.parameters["ISMC_LAM_XY"] = 21.0
            robot.store()
            robot.parameters["ISMC_LAM_XY"] = 33.0
            robot.reboot()
            assert robot.parameters.read("ISMC_LAM_XY") == 21.0
        assert firmware.running


def test_a_hang_is_ended_by_the_watchdog_and_said() -> None:
    with EmulatedFirmware(injectable=True, watchdog_ms=500) as firmware, connect(firmware.urls[0]) as robot:
        silence(robot)
        firmware.hang()
        wait_for_text(robot, "restarted by the watchdog")


def test_a_crash_is_kept_over_the_reset_and_said() -> None:
    with (
        EmulatedFirmware(injectable=True, crash_resets=True) as firmware,
        connect(firmware.urls[0]) as robot,
    ):
        silence(robot)
        firmware.crash()
        wait_for_text(robot, "restarted after a crash")
        wait_for_text(robot, r"HardFault at pc [0-9a-f]{8}")


def test_a_crash_ends_it_with_the_registers() -> None:
    with pytest.raises(FirmwareEndedError, match=r"exit code 70: .*HardFault at pc [0-9a-f]{8}") as caught:
        lose_it()
    assert "cfsr" in caught.value.hint


def lose_it() -> None:
    with EmulatedFirmware(injectable=True) as firmware, connect(firmware.urls[0]) as robot:
        firmware.crash()
        wait_until(lambda: robot.pump(0.1), "the link is not lost")


@pytest.mark.parametrize(
    ("cause", "told"), [("watchdog", "watchdog"), ("crash", "crash"), ("over_temperature", "over-temperature")]
)
def test_a_reset_cause_can_be_given(cause: str, told: str) -> None:
    # The watchdog goes by the wall clock here: on a busy computer it would reset the board, with a cause of its own.
    with EmulatedFirmware(reset_cause=cause, watchdog_ms=0) as firmware, connect(firmware.urls[0]) as robot:
        assert health_of(robot).reset_cause == told
        assert firmware.running


@pytest.mark.parametrize(
    ("links", "message"),
    [
        (["serial:1"], "tcp:HOST:PORT"),
        (["tcp:127.0.0.1"], "HOST:PORT"),
        (["tcp:127.0.0.1:70000"], "65535"),
        ([DIRECT], "lockstep"),
        (["pty"] * 5, "1 to 4"),
    ],
)
def test_wrong_links_are_explained(links: list[str], message: str) -> None:
    with pytest.raises(FirmwareStartError, match=message):
        EmulatedFirmware(links=links).__enter__()


def test_a_port_in_use_and_a_storage_that_cannot_be_are_named(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(FirmwareStartError, match=str(port)):
            EmulatedFirmware(links=[f"tcp:127.0.0.1:{port}"]).__enter__()
    with pytest.raises(FirmwareStartError, match="no such folder"):
        EmulatedFirmware(storage=tmp_path / "no such folder" / "file").__enter__()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--frobnicate", "1"], "--frobnicate"),
        (["--links", "9"], "1 to 4"),
        (["--watchdog", "soon"], "whole number"),
        (["--reset-cause", "boredom"], "power_on"),
        (["--params", "missing"], "missing"),
        (["--console-link"], "--lockstep"),
        (["--storage"], "--storage"),
    ],
)
def test_mistakes_on_the_guests_command_line_end_with_2(words: list[str], message: str, tmp_path: Path) -> None:
    done = run_program(emulated_firmware_path(), *words, folder=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr


def test_a_parameter_file_with_a_mistake_is_a_start_error(monkeypatch: pytest.MonkeyPatch) -> None:
    firmware = EmulatedFirmware()
    monkeypatch.setitem(firmware.values, "NO_SUCH", 1.0)
    with pytest.raises(FirmwareStartError, match="NO_SUCH: there is no such parameter"):
        firmware.__enter__()


def test_missing_programs_say_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(FirmwareNotFoundError, match="qemu-system-arm is not installed") as caught:
        EmulatedFirmware()
    assert "apt-get install qemu-system-arm" in caught.value.hint


def test_a_missing_build_says_how_to_make_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def missing() -> Path:
        raise MissingFileError(tmp_path)

    monkeypatch.setattr("omniwheel.emulated_firmware.emulated_firmware_path", missing)
    with pytest.raises(FirmwareNotFoundError, match="has not been built") as caught:
        EmulatedFirmware()
    assert "make setup" in caught.value.hint


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not tell a child of its parent's end")
@pytest.mark.parametrize("options", ["", "lockstep=True, links=['direct']"])
def test_it_ends_when_its_parent_is_killed(options: str) -> None:
    program = (
        "from omniwheel.emulated_firmware import EmulatedFirmware\n"
        f"firmware = EmulatedFirmware({options}); firmware.start(); print(firmware.pid, flush=True); input()"
    )
    parent = subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert parent.stdout is not None
    emulator = int(parent.stdout.readline())
    parent.kill()
    parent.communicate()
    wait_until(lambda: not _lives(emulator), "the emulator goes on")


def _lives(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_direct_link_is_opened_once() -> None:
    with EmulatedFirmware(lockstep=True, links=[DIRECT]) as firmware:
        link = firmware.open_link()
        with pytest.raises(LinkError, match="only once"):
            firmware.open_link()
        link.close()
