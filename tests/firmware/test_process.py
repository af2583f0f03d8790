# SPDX-License-Identifier: MIT
"""The firmware as a program: options, mistakes, pseudo-terminal, ending."""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from omniwheel.paths import firmware_path
from tests.firmware.client import WAIT_S, connect, firmware, mav
from tests.waiting import Deadline, wait_until


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [str(firmware_path()), *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=WAIT_S, check=False)


def test_help_and_version() -> None:
    assert "--lockstep" in run("--help").stdout
    assert run("--version").stdout.startswith("omni-firmware ")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--robot", "hexapod"], "three_wheel"),
        (["--link", "serial:1"], "tcp:HOST:PORT"),
        (["--link", "tcp:127.0.0.1:70000"], "0..65535"),
        (["--link", "tcp:127.0.0.1"], "HOST:PORT"),
        (["--frobnicate", "1"], "--frobnicate"),
        (["--link"], "--link"),
        (["--params", "/no/such/file"], "/no/such/file"),
        (["--params", "/tmp"], "/tmp: Is a directory"),
        (["--storage", "/no/such/folder/file"], "/no/such/folder/file"),
    ],
)
def test_mistakes_are_explained_and_end_with_2(arguments: list[str], message: str) -> None:
    result = run(*arguments)
    assert result.returncode == 2
    assert message in result.stderr
    assert result.stdout == ""


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("ISMC_LAM_XY=abc", ":1: ISMC_LAM_XY = 'abc': a number from 0 to 200 is needed, in 1/s"),
        ("\n# comment\nISMC_LAM_XY = 500", ":3: ISMC_LAM_XY = '500'"),
        ("ISMC_LAM_XY=nan", "a number from 0 to 200"),
        ("WHEELS=3.5", "a whole number from 3 to 4"),
        ("NO_SUCH=1", ":1: NO_SUCH: there is no such parameter"),
        ("ISMC_LAM_XY", "NAME=VALUE"),
        ("W1_IN1_CH=8", "does not fit"),
        ("ISMC_LAM_XY=9\n#" + "x" * 255, ":2: line too long"),
        ("ISMC_LAM_XY=9\0 and much more that would go unnoticed\n", ":1: a zero byte"),
    ],
)
def test_mistakes_in_a_parameter_file_name_line_key_and_range(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "robot.params"
    path.write_text(text)
    result = run("--params", str(path))
    assert result.returncode == 2
    assert message in result.stderr


def test_a_parameter_file_changes_the_robot(tmp_path: Path) -> None:
    path = tmp_path / "robot.params"
    path.write_text("# mine\nWHEEL_RADIUS = 0.0625  # bigger\nISMC_LAM_XY=9\n")
    with firmware("--params", str(path), "--lockstep") as running:
        robot = connect(running)
        assert (robot.get("WHEEL_RADIUS"), robot.get("ISMC_LAM_XY")) == (0.0625, 9.0)
        robot.socket.close()


def test_a_port_in_use_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        result = run("--link", f"tcp:127.0.0.1:{port}")
    assert result.returncode == 2
    assert str(port) in result.stderr


@contextmanager
def hangup(action: signal.Handlers) -> Iterator[None]:
    """Start processes with this action for SIGHUP, which they inherit: nohup lets the tests run with it ignored."""
    before = signal.signal(signal.SIGHUP, action)
    try:
        yield
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
@pytest.mark.parametrize("mode", [["--lockstep"], []])
def test_signals_end_it_cleanly(number: signal.Signals, mode: list[str]) -> None:
    with hangup(signal.SIG_DFL), firmware(*mode) as running:
        running.process.send_signal(number)
        assert running.process.wait(WAIT_S) == 0


def test_under_nohup_it_outlives_its_terminal() -> None:
    with hangup(signal.SIG_IGN), firmware() as running:
        running.process.send_signal(signal.SIGHUP)
        robot = connect(running)
        robot.wait("HEARTBEAT")
        robot.socket.close()
        running.process.send_signal(signal.SIGTERM)
        assert running.process.wait(WAIT_S) == 0


def test_several_processes_run_side_by_side() -> None:
    with firmware() as one, firmware() as two:
        assert one.links != two.links
        for running in (one, two):
            client = connect(running)
            client.wait("HEARTBEAT")
            client.socket.close()


def test_without_a_host_it_ticks_by_the_clock() -> None:
    with firmware() as running:
        robot = connect(running)
        first = robot.wait("OMNI_STATUS")
        second = robot.wait("OMNI_STATUS")
        assert second.ticks - first.ticks == second.time_boot_ms - first.time_boot_ms > 0
        assert robot.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == mav.MAV_RESULT_ACCEPTED
        robot.wait_for(
            lambda message: (
                message.get_type() == "HEARTBEAT"
                and message.system_status in (mav.MAV_STATE_ACTIVE, mav.MAV_STATE_CRITICAL)
            ),
            "it does not drive",
        )
        robot.socket.close()


def test_who_arms_a_robot_without_the_output_enable_pin_is_told_once() -> None:
    with firmware() as running:
        robot = connect(running)

        def accepted(wanted: int) -> bool:
            return bool(robot.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, wanted) == mav.MAV_RESULT_ACCEPTED)

        for wanted in (1, 0, 1):
            wait_until(partial(accepted, wanted), "it refuses")
        assert sum("no output-enable pin" in text for text in robot.texts()) == 1
        robot.socket.close()


def test_a_pseudo_terminal_carries_mavlink(tmp_path: Path) -> None:
    path = tmp_path / "tty"
    with firmware("--lockstep", links=(f"pty:{path}",)) as running:
        assert running.links == [str(path)]
        terminal = os.open(path, os.O_RDWR | os.O_NOCTTY)
        parser = mav.MAVLink(None)
        beat = None
        deadline = Deadline("no heartbeat on the pseudo-terminal")
        while beat is None:
            select.select([terminal], [], [], deadline.left_s())
            messages = parser.parse_buffer(os.read(terminal, 4096)) or []
            beat = next((m for m in messages if m.get_type() == "HEARTBEAT"), None)
        os.close(terminal)
        assert beat.get_srcSystem() == 1
    assert not path.exists()
