# SPDX-License-Identifier: MIT
"""``omni host-control`` as a process on a serial line, with a stand-in for the Vicon: what the robot is left with."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from typer.testing import CliRunner

from omni.cli import app
from omniwheel.host_control.pwm_line import STOP, STOP_LINES, parse_line

FAKE = Path(__file__).parents[1] / "mocap" / "fake_vicon"
WAIT_S = 30.0


@contextmanager
def serial_line() -> Iterator[tuple[int, str]]:
    """A pseudo-terminal: the robot's end and the name of the computer's port."""
    robot, port = os.openpty()
    tty.setraw(port)
    try:
        yield robot, os.ttyname(port)
    finally:
        os.close(robot)
        os.close(port)


def read_until(robot: int, enough: int, silent_s: float = WAIT_S) -> bytes:
    """Read the robot's end until this many bytes have come or the line has been silent for a while."""
    data = b""
    while len(data) < enough and select.select([robot], [], [], silent_s)[0]:
        data += os.read(robot, 4096)
    return data


def test_one_motor_turns_for_its_time() -> None:
    with serial_line() as (robot, port):
        result = CliRunner().invoke(app, ["host-control", "motor", "--link", port, "--for", "0.3", "--", "3", "-80"])
        data = read_until(robot, 10_000, silent_s=0.2)
    assert result.exit_code == 0, result.output
    lines = [parse_line(line + b"*") for line in data.split(b"*")[:-1]]
    assert lines[0] == (0, 0, -80, 0)
    assert len(lines) >= 2 + STOP_LINES
    assert lines[-STOP_LINES:] == [STOP] * STOP_LINES


@pytest.mark.full
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_the_robot_stopped(number: signal.Signals) -> None:
    words = ["host-control", "pose", "0", "0", "0", "--source", "vicon:vicon.local/robot", "--link"]
    environment = {**os.environ, "PYTHONPATH": str(FAKE), "FAKE_VICON": "still"}
    with serial_line() as (robot, port):
        command = [sys.executable, "-c", "from omni.cli import main; main()", *words, port]
        with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as process:
            driving = read_until(robot, 60)
            process.send_signal(number)
            _, errors = process.communicate(timeout=WAIT_S)
        rest = read_until(robot, 10_000, silent_s=0.2)
    lines = [parse_line(line + b"*") for line in (driving + rest).split(b"*")[:-1]]
    assert process.returncode == 130
    assert "interrupted" in errors
    assert "Traceback" not in errors
    assert any(any(line) for line in lines[:-STOP_LINES])
    assert lines[-STOP_LINES:] == [STOP] * STOP_LINES
